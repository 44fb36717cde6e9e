"""An `unknown` at the motor that is the actuator's: what is missing follows the input or is a share of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from haptic_teleop_sim.model import STRUCTURES
from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.estimation.records import Record

from ...evidence.feedback import in_open_loop
from ...evidence.fine_curve import follows_input_finely
from ...evidence.held_out import with_both_kinds
from ...evidence.in_proportion import in_proportion, with_the_input
from ...evidence.inverse_dynamics.latent import INPUT
from ...evidence.measured_map import MeasuredMap
from ...evidence.over_the_input import over_the_input
from ...evidence.residual import INPUT_TORQUE
from ...policy import LEAST_EXPLAINED, NEARLY_ALL
from ..adequacy import left_size
from ..coloured import driven
from ..name_tests.place import effect_of
from ..verdict import Verdict

#: When it shows, in the words of diagnosis.json.
WITH_THE_INPUT = "input and time"


def at_the_actuator(
    verdict: Verdict, baseline: Fit, learn: Sequence[Record], judge: Sequence[Record], cutoff: float
) -> tuple[Verdict, dict[str, float] | None]:
    """The `unknown` verdict at the actuator, where what is missing at the motor follows the input of
    recordings that were not fitted, which no controller made, more than any motion; where most of it follows
    the input in detail; where a function of the input alone explains most of it (see `over_the_input`,
    ``cutoff``: Hz); or where it is in proportion to the input and not to any motion, by a factor that
    changes; and what each quantity gains so, nats, None where that was not asked. ``baseline``: the structure
    alone, as it fits the estimation recordings ``learn``."""
    model = baseline.model
    actuator = model.location("actuator")
    if not _asked(verdict, baseline):
        return verdict, None
    both = with_both_kinds(baseline, learn, judge)
    told, *others = verdict.where
    if told["condition"] == INPUT_TORQUE and in_open_loop(*both[1]):
        return replace(verdict, where=[{**told, "equation": actuator}, *others]), None
    in_detail = follows_input_finely(both) / max(driven(baseline, learn), 1e-300)
    fine = in_detail**2 > LEAST_EXPLAINED * left_size(baseline, [*learn, *judge]) ** 2
    named = [effect_of(f) for f in verdict.findings]
    if fine or over_the_input(model, named, learn, judge, cutoff):
        where = {**told, "equation": actuator, "condition": INPUT_TORQUE}
        return replace(verdict, where=[where, *others]), None
    gains = in_proportion(both, baseline.free)
    if not with_the_input(gains, model.rigid):
        return verdict, gains
    where = {**told, "equation": actuator, "condition": WITH_THE_INPUT}
    return replace(verdict, where=[where, *others]), gains


def drawn_over_the_input(
    verdict: Verdict,
    mapped: MeasuredMap,
    baseline: Fit,
    learn: Sequence[Record],
    judge: Sequence[Record],
    cutoff: float,
) -> Verdict:
    """The `unknown` verdict at the actuator, where the map that is put into the model is one over the input
    and the motor's angle, and explains NEARLY_ALL of what is missing at the motor, or one over the input that
    explains more than any motion (see `over_the_input`); ``baseline``, ``learn``, ``judge``, ``cutoff``: as
    in `at_the_actuator`."""
    model = baseline.model
    if not _asked(verdict, baseline) or mapped.effect is None:
        return verdict
    if mapped.quantities[:1] != (INPUT,):
        return verdict
    if len(mapped.quantities) == 1:
        named = [effect_of(f) for f in verdict.findings]
        if not over_the_input(model, named, learn, judge, cutoff):
            return verdict
    elif (mapped.explained or 0.0) < NEARLY_ALL:
        return verdict
    actuator = model.location("actuator")
    told, *others = verdict.where
    where = {**told, "equation": actuator, "condition": " and ".join(mapped.quantities)}
    return replace(verdict, where=[where, *others])


def _asked(verdict: Verdict, baseline: Fit) -> bool:
    """Whether something unknown is at the motor, and nothing at the actuator yet: an effect there, of the
    model or found, takes a share of the input itself."""
    model = baseline.model
    motor, actuator = model.location("motor"), model.location("actuator")
    told_at = [where["equation"] for where in verdict.where[:1]]
    there = [e.location for e in model.effects] + [f["location"] for f in verdict.findings]
    if verdict.kind != "unknown" or told_at != [motor] or actuator in there:
        return False
    return not _ended_at_a_bound(baseline)


def _ended_at_a_bound(fit: Fit) -> bool:
    """Whether a parameter of the structure is as far off as is possible: everything predicts better beside a
    structure that ended elsewhere. No damping at all is possible, too."""
    own = STRUCTURES[fit.model.structure]
    return any(name in own and fit.model.parameters[name] > 1e-6 for name in fit.at_bound)
