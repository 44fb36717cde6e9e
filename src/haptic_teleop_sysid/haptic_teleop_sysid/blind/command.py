"""`haptic-teleop blind`: draw concealed cases, seal their labels, diagnose, open, score."""

from __future__ import annotations

import argparse
import importlib.util
import json
import os
import shlex
import statistics
from pathlib import Path
from typing import Any

from rich.console import Console

from haptic_teleop_control.command_line import ArgumentParser, run_command
from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_sysid.blind.archive import PLAN, pack, unpack
from haptic_teleop_sysid.blind.cases import KINDS, LEVELS
from haptic_teleop_sysid.blind.runner import (
    FRONT_DOOR,
    RAN,
    diagnose,
    generate,
    generate_again,
    parse_cases,
    plan,
)
from haptic_teleop_sysid.blind.sealing import open_labels, refuse_other_draws, seal, sealed_digest
from haptic_teleop_sysid.spread import ONE_THREAD, spread


def parser() -> argparse.ArgumentParser:
    """Return the command's arguments."""
    found = ArgumentParser(prog="haptic-teleop blind", description=__doc__)
    found.add_argument("--seed", type=int, required=True, help="what all draws come from")
    found.add_argument(
        "--cases",
        default="single=300,clean=300,pair=40,outside=40,tied=30",
        help="how many of each kind: single, clean, pair, triple (effects together), outside (the table), "
        "tied (cannot be told apart); default: %(default)s",
    )
    found.add_argument("--output", type=Path, required=True, help="directory of cases, results and report")
    found.add_argument(
        "--levels",
        default=",".join(f"{v:g}" for v in LEVELS),
        help="sizes of singles, as d' (default: %(default)s)",
    )
    found.add_argument(
        "--jobs", type=int, default=-1, metavar="N", help="processes at once (default: all cores)"
    )
    found.add_argument("--dask", metavar="ADDRESS", help="scheduler of a Dask cluster, or `local`")
    found.add_argument(
        "--timeout",
        type=float,
        default=300.0,
        help="seconds after which a diagnosis has failed (default: %(default)g)",
    )
    found.add_argument("--only", choices=("generate", "score"), help="one part: the cases, or the score")
    found.add_argument(
        "--partial", action="store_true", help="with --only score: open the labels of what has run so far"
    )
    found.add_argument("--resume", action="store_true", help="keep what an earlier run finished")
    found.add_argument(
        "--archive",
        type=Path,
        metavar="FILE.tar.xz",
        help="what has been said so far, in one file: read first where it exists, written in the end. With "
        "it a run goes on elsewhere (recordings are drawn again), or is scored anew (--only score)",
    )
    found.add_argument(
        "--baselines", type=int, default=0, metavar="N", help="also run other methods on N cases"
    )
    found.add_argument("--command", help="what to run instead of this installation's diagnose")
    return found


def main(argv: list[str] | None = None) -> int:
    """Run the command; 0 when all was scored, 2 for bad arguments."""
    return run_command(_body, argv)


def _levels(text: str) -> tuple[float, ...]:
    try:
        levels = tuple(float(piece) for piece in text.split(","))
    except ValueError:
        levels = ()
    if not levels or min(levels) < 0.5 or max(levels) > 1e4:
        raise ConfigurationError(f'--levels {text!r} is not a list of d\' from 0.5 to 10000: write "2,8,32".')
    return levels


def _body(argv: list[str]) -> int:
    arguments = parser().parse_args(argv)
    os.environ.update(ONE_THREAD)  # inherited by every worker
    cases = parse_cases(arguments.cases, KINDS)
    levels = _levels(arguments.levels)
    output: Path = arguments.output.resolve()  # workers of a cluster stand elsewhere
    if arguments.partial and arguments.only != "score":
        raise ConfigurationError("--partial goes with --only score: what has run is scored, nothing is run.")
    if arguments.timeout <= 0 or arguments.baselines < 0 or arguments.seed < 0:
        raise ConfigurationError("--timeout must be positive, --seed and --baselines at least 0.")
    if arguments.baselines and importlib.util.find_spec("pysindy") is None:
        raise ConfigurationError("--baselines needs PySINDy: pip install pysindy.")  # now, not after hours
    say = Console(stderr=True)
    wanted = {"seed": arguments.seed, "cases": cases, "levels": list(levels)}
    listed = plan(arguments.seed, cases)
    if arguments.archive is not None and arguments.archive.exists():
        _take_over(arguments.archive, output, wanted)
        arguments.resume = True
    if arguments.only != "score":
        _generate(arguments, output, wanted, listed, levels, say)
    elif not (output / PLAN).exists() or json.loads((output / PLAN).read_text()) != wanted:
        raise ConfigurationError(
            f"{output} was not generated with this --seed, --cases and --levels: give the same."
        )
    digest = sealed_digest(output)
    made = "the labels' seal" if arguments.only == "score" else "labels sealed"
    say.print(f"{made}, SHA-256 {digest}", soft_wrap=True)
    if arguments.only == "generate":
        return 0
    if arguments.only is None:
        command = (
            (*FRONT_DOOR, "--no-report")
            if arguments.command is None
            else tuple(shlex.split(arguments.command))
        )
        waiting = [
            (output / "cases" / name, command, arguments.timeout)
            for name, _, _ in listed
            if not (arguments.resume and (output / "cases" / name / RAN).exists())
        ]
        try:
            spread(diagnose, waiting, arguments.jobs, arguments.dask, "diagnosing", threads=True)
        finally:
            if arguments.archive is not None:
                say.print(f"{arguments.archive} holds {pack(output, arguments.archive)} cases now")
    missing = [name for name, _, _ in listed if not (output / "cases" / name / RAN).exists()]
    partial = arguments.partial and len(missing) < len(listed)
    labels = open_labels(output, str(arguments.seed), [] if partial else missing, digest)
    refuse_other_draws(output, str(arguments.seed), labels)
    # The order of the cases says nothing of their kind, so that the first ones are a fair draw.
    labels = {name: label for name, label in labels.items() if name not in missing}
    say.print(f"labels opened, digest as before; {len(labels)} of {len(listed)} cases have run")
    return _score(arguments, output, labels, wanted, digest, say)


def _take_over(archive: Path, output: Path, wanted: dict[str, Any]) -> None:
    """Put what an archive holds into ``output``, unless either belongs to other cases."""
    planned = output / PLAN
    if planned.exists() and json.loads(planned.read_text()) != wanted:
        raise ConfigurationError(f"{output} holds other cases: choose another --output, or the same cases.")
    unpack(archive, output)
    if json.loads(planned.read_text()) != wanted:
        raise ConfigurationError(
            f"{archive} was made with other --seed, --cases or --levels: give the same ({planned} has them)."
        )


def _generate(
    arguments: argparse.Namespace,
    output: Path,
    wanted: dict[str, Any],
    listed: list[tuple[str, str, int]],
    levels: tuple[float, ...],
    say: Console,
) -> None:
    planned = output / PLAN
    if planned.exists():
        if json.loads(planned.read_text()) != wanted:
            raise ConfigurationError(
                f"{output} holds other cases: choose another --output, or the same cases."
            )
        if not arguments.resume:
            raise ConfigurationError(
                f"{output} holds an earlier run: say --resume or choose another --output."
            )
        if sealed_digest(output) is not None:
            _draw_again(arguments, output, listed, levels)
            return
    try:
        (output / "cases").mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigurationError(
            f"--output {output} cannot be used ({error.strerror}): choose another."
        ) from None
    planned.write_text(json.dumps(wanted))
    jobs = [((arguments.seed, name, kind, index, output / "cases", levels),) for name, kind, index in listed]
    made = spread(generate, jobs, arguments.jobs, arguments.dask, "generating")
    labels = {name: label for name, label, _ in sorted(made)}
    seal(labels, output, str(arguments.seed))
    say.print(
        f"{len(made)} cases, {statistics.median(seconds for _, _, seconds in made):.2f} s each (median)"
    )


def _draw_again(
    arguments: argparse.Namespace,
    output: Path,
    listed: list[tuple[str, str, int]],
    levels: tuple[float, ...],
) -> None:
    """Draw the recordings of the cases that are left to run and that this machine does not have."""
    cases = output / "cases"
    jobs = [
        ((arguments.seed, name, kind, index, cases, levels),)
        for name, kind, index in listed
        # The model is written last.
        if not ((cases / name / RAN).exists() or (cases / name / "model.yaml").exists())
    ]
    spread(generate_again, jobs, arguments.jobs, arguments.dask, "drawing again")


def _score(
    arguments: argparse.Namespace,
    output: Path,
    labels: dict[str, Any],
    wanted: dict[str, Any],
    digest: str | None,
    say: Console,
) -> int:
    from haptic_teleop_sysid.blind.page import write_page
    from haptic_teleop_sysid.blind.scoring import score_case
    from haptic_teleop_sysid.blind.summary import summarise
    from haptic_teleop_sysid.blind.tables import markdown
    from haptic_teleop_sysid.results import tool_version, write_json

    scores = [score_case(name, label, output / "cases" / name) for name, label in labels.items()]
    summary = summarise(scores)
    baselines: dict[str, Any] = {}
    if arguments.baselines:
        from haptic_teleop_sysid.blind.baselines import run_baselines

        baselines = run_baselines(
            output / "cases", labels, arguments.baselines, arguments.jobs, arguments.dask
        )
    result = {
        "schema": 1,
        "seed": wanted["seed"],
        "cases_asked": wanted["cases"],
        "cases_run": len(scores),
        "levels": wanted["levels"],
        "digest": digest,
        "version": tool_version(),
        "summary": summary,
        "baselines": baselines,
        "cases": scores,
    }
    write_json(output / "blind.json", result)
    (output / "table.md").write_text(markdown(result))
    write_page(result, output / "report.html")
    say.print(f"wrote {output}/blind.json, report.html, table.md")
    return 0
