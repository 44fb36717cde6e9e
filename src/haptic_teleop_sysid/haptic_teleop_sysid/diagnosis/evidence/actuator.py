"""What the measured current shows and what the motion shows, put together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.estimation.records import Record
from haptic_teleop_sysid.estimation.step_limits import Limits
from haptic_teleop_sysid.estimation.whole_fit import fit_whole

from ..hypotheses.explanation import Explanation
from ..hypotheses.material import material
from ..inputs.scales import Scales
from .certainty import standard_errors
from .held_out import judged
from .recorded_currents import SHOWN
from .shown_by_current import Shown

#: Nats behind the best one from which an effect in the currents is not asked of the motion any more.
_FAR_BEHIND = 200.0
_STEPS = 15


def joined(
    fit: Fit,
    lab: Model,
    found: Sequence[Explanation],
    shown: Sequence[Shown],
    estimation: Sequence[Record],
    validation: Sequence[Record],
    scales: Scales,
    limits: Limits,
) -> list[Explanation]:
    """The explanations ``found`` in the motion, those of the actuator judged by both, and those of the
    currents that the motion did not promise; ``lab``: the model by which the currents were read.

    An effect behind the sense shows in both: its parameter is the one that is known better, from the motion
    alone or from the currents alone.  A stamp shows in the currents, and the motion follows the command.
    """
    lab_constant = lab.parameters["torque_constant"]
    best = max(s.gain + s.held_out for s in shown)
    near = [s for s in shown if s.gain + s.held_out > best - _FAR_BEHIND and s.gain > 0.0]
    # A command that was stamped wrong stays for the motion alone to tell.
    judged_twice = {(s.effect.effect, near[0].effect.location) for s in near if not _a_stamp(s.effect)}
    result = [e for e in found if (e.effect.effect, e.effect.location) not in judged_twice]
    present = {(e.effect, e.location) for e in fit.model.effects}
    index = len(fit.model.effects)
    for s in near:
        name, location = s.effect.effect, s.effect.location
        if (name, location) in present:
            continue
        if _a_stamp(s.effect):
            result.append(
                Explanation(
                    fit,
                    s.gain,
                    s.held_out,
                    material(s.effect, scales.driven(fit.model)),
                    index,
                    by_current=s.gain + s.held_out,
                    std={f"{location}.{name}.{SHOWN[name]}": s.std},
                    beside=s.effect,
                )
            )
            continue
        parameter = f"{location}.{name}.{SHOWN[name]}"
        fits = [_held(fit, s, parameter, lab_constant, estimation, limits)]
        fits += [e.fit for e in found if (e.effect.effect, e.effect.location) == (name, location)]
        known = [max(_shown_here(f, index, s, lab_constant), 0.0) for f in fits]
        for e in judged(fit, fits, estimation, validation, scales, known=known):
            unit = _unit(e.fit, s.effect, lab_constant)
            if parameter in e.fit.free and standard_errors(e.fit).get(parameter, 0.0) > unit * s.std:
                continue  # the currents know it better
            here = _shown_here(e.fit, index, s, lab_constant)
            both = here + s.held_out
            std = {} if parameter in e.fit.free else {parameter: unit * s.std}
            result.append(
                replace(
                    e,
                    gain=e.gain + here,
                    held_out=e.held_out + s.held_out,
                    by_current=max(both, 1e-9),
                    std=std,
                )
            )
    return sorted(result, key=lambda e: (not e.material, -e.score))


def _a_stamp(effect: Effect) -> bool:
    """Whether it shows in the record alone: the motion follows the command."""
    return effect.entry.kind == "skew"


def _a_torque(effect: Effect) -> bool:
    """Whether what the current shows of it is a torque."""
    return effect.entry.parameter(SHOWN[effect.effect]).unit == "N*m"


def _unit(fit: Fit, effect: Effect, lab_constant: float) -> float:
    """What one unit of what the current shows of an effect, by the lab's torque constant, is in a fit."""
    return fit.model.parameters["torque_constant"] / lab_constant if _a_torque(effect) else 1.0


def _shown_here(fit: Fit, index: int, shown: Shown, lab_constant: float) -> float:
    """Nats that the currents of the estimation recordings give at a fit's value of what they show."""
    value = fit.model.effects[index].parameters[SHOWN[shown.effect.effect]]
    return shown.value_nats(value / _unit(fit, shown.effect, lab_constant))


def _held(
    fit: Fit, shown: Shown, parameter: str, lab_constant: float, records: Sequence[Record], limits: Limits
) -> Fit:
    """The fit with the effect as the currents have it. What they have is a current: a limit or a dead band in
    N·m goes with the torque constant, which the fit moves."""
    name, location = shown.effect.effect, shown.effect.location
    own = SHOWN[name]
    ended = fit
    for _ in range(2 if _a_torque(shown.effect) else 1):
        value = shown.effect.parameters[own]
        if _a_torque(shown.effect):
            value *= ended.model.parameters["torque_constant"] / lab_constant
        wider = fit.model.with_effects(Effect(name, location, {own: value}))
        held = replace(wider, fixed=(*wider.fixed, parameter))
        ended = fit_whole(held, fit.noise, records, iterations=_STEPS, limits=limits)
    return ended
