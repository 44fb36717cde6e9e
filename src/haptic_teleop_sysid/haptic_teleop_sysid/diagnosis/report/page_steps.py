"""The next three steps after a diagnosis, as commands to paste."""

from __future__ import annotations

import shlex
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from haptic_teleop_sysid.report import Page

from .next_experiment import FILE, SIGNAL_FILE

#: What the next recording is called, in the folder of the results.
RECORDING = "next_recording"


@dataclass(frozen=True)
class Origin:
    """What a diagnosis was made from, as it was named on the command line: the ``model`` file, the recordings
    for ``estimation``, for ``validation``, and that ``judge``, the ``mapping`` of logs; the folder
    ``output``; ``unused``: whether those that judge were neither fitted to nor chosen by; ``scenario``: a
    file that simulates the robot with the model that is handed on, where there is one; ``windows``: length of
    those over which each that judges was simulated, s, None for the whole."""

    model: str
    estimation: tuple[str, ...]
    validation: tuple[str, ...]
    judge: tuple[str, ...]
    output: Path
    mapping: str | None = None
    unused: bool = False
    scenario: Path | None = None
    windows: tuple[float | None, ...] = ()


def steps(page: Page, content: dict[str, Any], origin: Origin) -> None:
    """Simulate, compare, record: the section with the commands, each of which works as it stands."""
    experiment = content["next_experiment"]
    augmented = str(origin.output / "augmented_model.yaml")
    page.section("The next three steps").commands(
        [
            (f"Simulate with what augmented_model.yaml holds: {content['augmented_model']['what']} "
             f"({_means(content, origin)}).",
             _simulate(content, augmented, origin)),
            (f"Compare it with your model, on {_compared_on(origin)}.",
             _compare(augmented, origin)),
            (f"{_experiment(content)}. {_recorded_by(content, origin)}",
             _record(content, origin)),
        ]
    )  # fmt: skip
    if experiment["signal_generator"]:
        page.sections[-1].table(
            ("parameter of the signal", "setting"),
            sorted(experiment["signal_generator"].items()),
            "The signal of the next experiment; chance that the better of two models is told by it: "
            f"{100 * experiment['expected_discrimination']:.0f} %",
        )


def _experiment(content: dict[str, Any]) -> str:
    """What is to be recorded, and why."""
    why = content["next_experiment"]["why"]
    if content["next_experiment"]["signal_generator"]:
        return f"Run the next experiment: {why}"
    return f"What to record next: {why}"


def _compared_on(origin: Origin) -> str:
    """What the recordings of the second command were used for."""
    if origin.unused:
        return "recordings that were used for nothing else"
    return (
        "the validation recordings: it was not fitted to them, but they helped to choose it, and others are "
        "a harder test"
    )


def _simulate(content: dict[str, Any], model: str, origin: Origin) -> str:
    """The scenario with the model in the simulated robot; the robot alone where there is no such file; else
    the model as a Python function."""
    if origin.scenario is not None:
        recording = str(origin.output / "simulated")
        run = ["haptic-teleop", "lockstep", str(origin.scenario), "--record", recording]
        verified = str(origin.output / "simulated_verified")
        look = ["haptic-teleop", "verify", recording, "--output", verified]
        return f"{shlex.join(run)}\n{shlex.join(look)}"
    if content["robot"] in ("sfj", "omni"):
        value = f"{content['joint']}.model:={Path(model).resolve()}"
        return shlex.join(["haptic-teleop", f"{content['robot']}_sim", "--ros-args", "-p", value])
    script = str(origin.output / "augmented_model.py")
    return shlex.join(["haptic-teleop", "export", "--model", model, "--to", "python", "--output", script])


def _means(content: dict[str, Any], origin: Origin) -> str:
    """What the first command gives."""
    if origin.scenario is not None:
        return "scenario 1 and a page on it; with scenario in place of lockstep it runs as ROS 2 nodes"
    if content["robot"] in ("sfj", "omni"):
        return "a robot in simulation that speaks its topics; Ctrl-C ends it"
    return "one Python function; a simulated robot there is for the 2DSFJ and the Omni alone"


def _compare(model: str, origin: Origin) -> str:
    """Over windows as long as those of the page where these are alike, so that it says the same."""
    words = ["haptic-teleop", "compare", "--model", origin.model, model, "--bag", *origin.judge]
    if len({*origin.windows}) == 1:
        words += ["--window", "whole" if origin.windows[0] is None else f"{origin.windows[0]:.6g}"]
    words += ["--mapping", origin.mapping] if origin.mapping else []
    return shlex.join([*words, "--allow-gaps", "--output", str(origin.output / "compare")])


def _recorded_by(content: dict[str, Any], origin: Origin) -> str:
    """How the recording comes about, and what becomes of it."""
    if _driven(content):
        return (
            "The first command MOVES THE ROBOT and records it: commission the robot first "
            "(docs/first_contact.md); with --lockstep it simulates the robot instead. The second diagnoses "
            "the recording with the others."
        )
    then = "Then repeat the diagnosis with that recording added to --estimation."
    if not content["next_experiment"]["signal_generator"]:
        return then
    return (
        f"Let your machine follow the input of {origin.output / SIGNAL_FILE}, at first at a tenth of its "
        f"size, and save a log of it. {then}"
    )


def _record(content: dict[str, Any], origin: Origin) -> str:
    """What records it, and what diagnoses it with the recordings that there are; nothing where no command
    makes the recording: one that reads it would fail."""
    if not _driven(content):
        return ""
    recording = str(origin.output / RECORDING)
    words = ["haptic-teleop", "diagnose", "--model", origin.model]
    words += ["--estimation", *origin.estimation, recording]
    words += ["--validation", *origin.validation] if origin.validation else []
    words += ["--mapping", origin.mapping] if origin.mapping else []
    diagnosed = shlex.join([*words, "--allow-gaps", "--output", str(origin.output / "with_next_recording")])
    acquire = ["haptic-teleop", "acquire", "--config", str(origin.output / FILE), "--output", recording]
    return f"{shlex.join(acquire)}\n{diagnosed}"


def _driven(content: dict[str, Any]) -> bool:
    """Whether there is an experiment that `acquire` runs."""
    return content["robot"] in ("sfj", "omni") and bool(content["next_experiment"]["signal_generator"])
