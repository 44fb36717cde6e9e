"""Which columns of a log are the positions and velocities of a joint, of its motor and of its arm."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from haptic_teleop_sysid.logs.derivatives import Free
from haptic_teleop_sysid.logs.guess import TimeGuess, guess_units
from haptic_teleop_sysid.logs.headers import unknown_unit
from haptic_teleop_sysid.logs.input_column import input_column
from haptic_teleop_sysid.logs.log import Log
from haptic_teleop_sysid.logs.mapping import Entry
from haptic_teleop_sysid.logs.proposal import (
    FILL,
    GUESSED,
    LIKELY,
    MISSING,
    STATED,
    Choice,
    Doubt,
    Draft,
    entry_of,
    left_over,
)
from haptic_teleop_sysid.logs.roles import Candidate
from haptic_teleop_sysid.logs.units import SHARE, unit_of


def joint_columns(
    log: Log,
    joint: str,
    states: Sequence[Candidate],
    candidates: Sequence[Candidate],
    lost: Sequence[Candidate],
    time: TimeGuess | None,
    free: Free | None,
) -> Draft:
    """Return the columns of one joint: positions and velocities of motor and arm, and the input. ``states``:
    positions and velocities of all joints; ``lost``: candidates whose columns hold no numbers; ``free``:
    columns that no name gives a role, None to leave them out."""
    draft = Draft(joint)
    found, chosen = draft.found, draft.chosen
    own = _of_one_group([c for c in states if c.joint == joint], draft)
    rivals = [c for c in lost if c.joint == joint and c.role in ("position", "velocity") and not c.command]
    for role in ("position", "velocity"):
        _parts(log, role, [c for c in own if c.role == role], rivals, draft)
    if free is not None:
        _by_values(log, free, draft)
    input_column(log, draft, candidates, lost, states)
    motors: list[Candidate] = []
    if not any(name.startswith("motor") for name in found):
        arms = any(name.startswith("arm") for name in found)
        motors = [c for c in rivals if c.part != "arm"] if arms else []
        for role in () if motors else ("position", "velocity"):
            if f"arm_{role}" in found:  # one encoder, whatever it is called, is the joint's
                found[f"motor_{role}"] = found.pop(f"arm_{role}")
                chosen[f"motor_{role}"] = chosen.pop(f"arm_{role}")
    guess_units(log, chosen, found, time)
    for name, choice in found.items():
        column = chosen[name].column if name in chosen else None
        if column is None:
            continue
        unit, kind = unit_of(column.known), name.rpartition("_")[2]
        if not column.known and (other := unknown_unit(column.name)):
            choice.less(MISSING, f"its header says {other!r}, which is no unit that is known here")
            choice.entry = replace(choice.entry, unit="")
        elif unit is not None and unit.quantity == SHARE and kind != "input":
            choice.less(MISSING, f"its header says {column.known!r}: of what? give gain and gain_unit, too")
    for rival in motors[:1]:  # what is the arm's is not the motor's because the motor's is lost
        found[f"motor_{rival.role}"] = Choice(Entry(FILL), MISSING, [rival.column.unusable])
        if rival.column.text is None:
            draft.lacking.append(_no_motor(rival, chosen))
    return draft


def _no_motor(lost: Candidate, chosen: dict[str, Candidate]) -> str:
    """What is said where the motor's column holds no number."""
    arm = next(c.column.name for name, c in chosen.items() if name.startswith("arm"))
    return (
        f"{lost.column.unusable}, and is the motor's {lost.role} by its name: record it; if {arm!r} is the "
        "joint's only encoder, give it in a mapping as the motor's"
    )


def _by_values(log: Log, free: Free, draft: Draft) -> None:
    """Give what lacks a velocity or a position the free column that is its derivative or integral."""
    chosen = draft.chosen
    for part in ("motor", "arm"):
        for have, lack in (("position", "velocity"), ("velocity", "position")):
            if f"{part}_{have}" not in chosen or f"{part}_{lack}" in chosen:
                continue
            known = chosen[f"{part}_{have}"].column
            pair = free.velocity_of(known) if have == "position" else free.position_of(known)
            if pair is None:
                continue
            column = pair.velocity if have == "position" else pair.position
            free.use(column)
            name = f"{part}_{lack}"
            why = f"{part} {lack} by its values: {pair.told}"
            chosen[name] = Candidate(column, lack, part, draft.joint, False, False, False, why)
            draft.found[name] = Choice(entry_of(log, column), LIKELY, [why])
    taken = {name: candidate.column for name, candidate in chosen.items()}
    draft.opened += free.doubts(draft.joint or "joint", taken)


def _of_one_group(own: list[Candidate], draft: Draft) -> list[Candidate]:
    """The candidates that share their rows: those of joint states, or of the group that has most."""
    groups = list(dict.fromkeys(c.column.group for c in own))
    if len(groups) < 2:
        return own
    best = max(groups, key=lambda g: ("joint_states" in g, sum(c.column.group == g for c in own)))
    others = ", ".join(g for g in groups if g != best)
    draft.doubt(f"{others} may be of {draft.named} as well as {best}")
    return [c for c in own if c.column.group == best]


def _parts(log: Log, role: str, own: list[Candidate], rivals: Sequence[Candidate], draft: Draft) -> None:
    """Motor and arm among the candidates of one role; ``rivals``: columns that would be, and hold no
    numbers."""
    lost = [c for c in rivals if c.role == role]
    by_part = {part: [c for c in own if c.part == part] for part in ("motor", "arm", "")}
    for part in ("motor", "arm"):
        if len(by_part[part]) > 1:
            names = " and ".join(repr(c.column.name) for c in by_part[part])
            draft.doubt(f"{names} may each be the {role} of the {part}", f"{part}_{role}")
    rest = list(by_part[""])
    doubtful = len(rest) > 1 or (bool(rest) and bool(by_part["motor"]))
    for part in ("motor", "arm"):
        if by_part[part]:
            pick = by_part[part][0]
        elif rest and (part == "motor" or by_part["motor"] or len(by_part[""]) > 1):
            pick = rest.pop(0)
        else:
            continue
        choice = Choice(
            entry_of(log, pick.column),
            STATED if pick.stated else LIKELY,
            [f"{part} {pick.why or f'{role} by its name'}"],
        )
        if not pick.part and doubtful:
            choice.less(GUESSED, f"nothing says whether it is the motor's or the arm's {role}")
        elif not pick.part and part == "arm":
            choice.less(GUESSED, "the one that is not the motor's")
        if len(by_part[part]) > 1:
            choice.less(GUESSED, "the first of several")
        rival = next((c for c in lost if not pick.part and c.part in (part, "")), None)
        if rival is not None:
            choice.less(GUESSED, left_over(rival))
        draft.found[f"{part}_{role}"], draft.chosen[f"{part}_{role}"] = choice, pick
    if rest:
        draft.opened += [Doubt(f"{c.column.name!r} may be a {role}, too", column=c.column.name) for c in rest]
