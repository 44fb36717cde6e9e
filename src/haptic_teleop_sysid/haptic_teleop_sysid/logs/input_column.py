"""Which column of a log is the input of a joint."""

from __future__ import annotations

from collections.abc import Sequence

from haptic_teleop_sysid.logs.evidence import still
from haptic_teleop_sysid.logs.log import Column, Log
from haptic_teleop_sysid.logs.proposal import GUESSED, LIKELY, STATED, Choice, Draft, entry_of, left_over
from haptic_teleop_sysid.logs.roles import Candidate, candidate, counts_rows, input_unit_by_name, says_nothing

#: Columns that are offered where none is an input by its name.
_FEW = 6


def input_column(
    log: Log,
    draft: Draft,
    candidates: Sequence[Candidate],
    lost: Sequence[Candidate],
    states: Sequence[Candidate],
) -> None:
    """Give a joint's draft the column that is its input, or a doubt. ``lost``: candidates whose columns hold
    no numbers; ``states``: positions and velocities of all joints."""
    joint = draft.joint
    alone = len({c.joint for c in states}) == 1
    beside = [c for c in lost if c.role in ("position", "velocity") and c.joint != joint]
    rivals = [c for c in lost if c.role == "input" and (c.joint == joint or alone)]
    own = [c for c in candidates if c.role == "input" and (c.joint == joint or (alone and not c.joint))]
    if alone and not own:
        own = [c for c in candidates if c.role == "input"]
    if not own:
        draft.doubt(f"no column is the input (torque, force, current, voltage) of {draft.named}", "input")
        return
    rank = {"N*m": 0, "N": 0, "A": 1, "V": 2}
    groups = {c.column.group for c in draft.chosen.values()}

    def order(c: Candidate) -> tuple[int | bool, ...]:
        named = input_unit_by_name(c.column)
        pushes = bool(log.stamps) and (c.column.known or named) == "N"  # the joints of ROS mostly turn
        asked = 0 if c.measured else 2 if c.command else 1
        idle = not c.column.unusable and still(c.column.values)
        return idle, c.column.group not in groups, pushes, rank.get(named, 0), asked

    pick = min(own, key=order)
    sure = STATED if pick.stated else GUESSED if pick.why else LIKELY
    choice = Choice(entry_of(log, pick.column), sure, [pick.why or "input by its name"])
    if still(pick.column.values) and not pick.stated:
        choice.less(GUESSED, "it is constant: a joint is identified by an input that changes")
    if log.stamps and pick.column.group not in groups:
        choice.less(GUESSED, f"of {pick.column.group}: nothing says that it drives this joint")
    if rivals and order(best := min(rivals, key=order)) <= order(pick):
        choice.less(GUESSED, left_over(best))
    if alone and beside and pick.joint != joint:
        choice.less(GUESSED, f"it may drive another joint, for {beside[0].column.unusable}")
    if len(own) > 1:
        names = ", ".join(repr(c.column.name) for c in own if c is not pick)
        draft.doubt(f"{names} may be the input as well as {pick.column.name!r}", "input")
        choice.less(LIKELY, f"{names} may be it, too")
    draft.found["input"], draft.chosen["input"] = choice, pick


def no_input(unused: Sequence[Column], lost: Sequence[Candidate]) -> list[str]:
    """Return what is said where no joint has an input and none of the other columns could be one; else
    nothing."""
    for column in unused:
        other = candidate(column)
        could_be = says_nothing(column) if other is None else other.role == "input"
        if could_be and not counts_rows(column) and not still(column.values):
            return []
    empty = [c.column.unusable for c in lost if c.role == "input"]
    why = f" ({empty[0]})" if empty else ""
    what = "torque, force, current, voltage, PWM"
    moving = [
        repr(c.name) for c in unused if candidate(c) is None and not counts_rows(c) and not still(c.values)
    ]
    if moving and not why:
        return [
            f"there is no column that could be the input ({what}) by its name: if "
            f"{' or '.join(moving[:_FEW])} drives the joint, give it in a mapping; else record it"
        ]
    return [f"there is no column that could be the input ({what}){why}: record it"]
