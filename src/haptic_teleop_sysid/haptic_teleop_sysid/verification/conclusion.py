"""The first line of a verification: what happened, whether it is good, what to do."""

from __future__ import annotations

from collections.abc import Sequence

from haptic_teleop_sysid.report import Status
from haptic_teleop_sysid.verification.merit import StageMerit
from haptic_teleop_sysid.verification.run import Run
from haptic_teleop_sysid.verification.verdicts import failures, verdicts


def conclusion(
    runs: Sequence[Run], labels: Sequence[str], not_simulated: Sequence[str] = ()
) -> tuple[Status, str, str]:
    """Return how good it is, what happened and what to do, of one run or of several laid over each other.
    not_simulated: labels of the runs over which no simulation could be laid."""
    failed = [(run, label) for run, label in zip(runs, labels, strict=True) if run.failed]
    if failed:
        run, label = failed[0]
        first = failures(run)[0][1].rstrip(".")
        head = f"{len(failed)} of {len(runs)} runs failed. {label}: " if len(runs) > 1 else ""
        if not head and (run.faults or not (run.cut_off or run.problems)):
            head = "The run failed. "
        return "bad", f"{head}{first}.", _remedy(run)
    heads = [label if len(runs) > 1 else "" for label in labels]
    named = list(zip(runs, heads, strict=True))
    worst = [(head, text) for run, head in named for status, text in verdicts(run) if status == "bad"]
    happened = _happened(runs[0]) if len(runs) == 1 else _all_happened(runs, labels)
    if worst:
        head, text = worst[0]
        ended = f"{head} came to its end" if head else "The run came to its end"
        return "bad", f"{ended}, but not as promised. {text}", (
            "look at the pictures below at the time that is told; then at the settings of that stage."
        )  # fmt: skip
    if any(status == "fair" for run in runs for status, _ in verdicts(run)):
        return "fair", happened, "nothing failed; read the notes below before you build on it."
    if not_simulated:
        which = ", ".join(not_simulated) if len(runs) > 1 else "it"
        return "fair", happened, (
            f"nothing recorded is wrong, but no simulation could be laid over {which}: read below why."
        )  # fmt: skip
    return "good", happened, "nothing is wrong: zoom into the pictures, or change the scenario and repeat."


def _remedy(run: Run) -> str:
    """What to do about what a failed run's first sentence tells."""
    if run.faults:
        return (
            "put right what is told first, record again, and verify once more; what came after it may only "
            "follow from it."
        )
    if not run.complete:
        return f"`haptic-teleop recover {run.name}` saves all that is whole; verify that, or record again."
    if run.cut_off:
        return "let it run to its end; the figures below are of the part that was recorded."
    return "lower the gains of that stage, record again, and verify once more."


def _all_happened(runs: Sequence[Run], labels: Sequence[str]) -> str:
    """One line of what several runs have in common, and where they lie apart."""
    told = []
    for stage in dict.fromkeys(stage for run in runs for stage in run.merits):
        pairs = zip(runs, labels, strict=True)
        named = [(run.merits[stage], one) for run, one in pairs if stage in run.merits]
        text = _stage_of_all(named)
        told += [f"{named[0][0].title} {text}"] if text else []
    head = f"{len(runs)} runs of scenario {runs[0].scenario} came to their end."
    return f"{head} {'; '.join(told)}." if told else f"{head} No stage was given a command that did anything."


def _stage_of_all(named: Sequence[tuple[StageMerit, str]]) -> str:
    parts = []
    if speeds := [merit.free[0].speed for merit, _ in named if merit.free]:
        parts.append(f"moves freely at {_range(speeds, 2)} rad/s")
    pressing = [(merit.contacts[0], label) for merit, label in named if merit.contacts]
    if pressing:
        torques = [contact.settled_torque for contact, _ in pressing]
        most, label = max(((c.overshoot_percent, label) for c, label in pressing), key=lambda one: one[0])
        parts.append(f"presses with {_range(torques, 3)} N·m, overshoot at most {most:.0f} % ({label})")
    return " and ".join(parts)


def _range(values: Sequence[float], digits: int) -> str:
    low, high = f"{min(values):.{digits}f}", f"{max(values):.{digits}f}"
    return low if low == high else f"{low} to {high}"


def _happened(run: Run) -> str:
    """One sentence of what the robots did."""
    told = [text for merit in run.merits.values() if (text := _stage(merit))]
    head = f"Scenario {run.scenario} ran to its end. "
    if not told:
        return f"{head}No stage was given a command that did anything."
    return f"{head}{'; '.join(told)}."


def _stage(merit: StageMerit) -> str:
    parts = []
    if merit.free:
        one = merit.free[0]
        how = "moves freely at" if one.steady else "moves freely, finally at"
        parts.append(f"{how} {one.speed:.2f} rad/s")
    if merit.contacts and merit.contacts[0].cut_off:
        parts.append("meets the wall just before the recording ends")
    elif merit.contacts:
        one = merit.contacts[0]
        parts.append(f"presses with {one.settled_torque:.3f} of {one.desired_torque:.3f} N·m asked")
    return f"{merit.title} {' and '.join(parts)}" if parts else ""
