"""Explanations judged by freely running simulation, where one-step prediction is blind."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

import numpy as np

from haptic_teleop_sim.kernel import pack
from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.estimation.likelihood import likelihood_of
from haptic_teleop_sysid.estimation.noise import NoiseModel
from haptic_teleop_sysid.estimation.parallel import side_by_side
from haptic_teleop_sysid.estimation.prediction_fit import fit_parameters
from haptic_teleop_sysid.estimation.records import Record
from haptic_teleop_sysid.estimation.tuning import MOTOR_SHARE, initial_noise

from ..hypotheses.candidates import candidates
from ..hypotheses.explanation import Explanation
from ..hypotheses.material import material
from ..inputs.scales import Scales, within_reach
from ..starts.screen import Screened, best_per_effect, screen

#: Disturbance torque of the observer relative to the rms input torque, and its correlation time, s: the
#: observer then takes about a second to follow what its model does not explain.
_DISTURBANCE, _TIME = 0.01, 0.5
_MOST_FITS = 12


def simulation_noise(fit: Fit, records: Sequence[Record]) -> NoiseModel:
    """A noise model whose observer hardly corrects, fixed to the structure of ``fit`` so that no model can
    win by having itself corrected more.
    """
    packed = pack(fit.model)
    start = initial_noise(packed, records)
    level = start.motor_torque / MOTOR_SHARE * _DISTURBANCE
    return replace(
        start,
        motor_torque=level,
        arm_torque=level,
        motor_time=_TIME,
        arm_time=_TIME,
        reference=packed.linear,
    )


def mechanical(effects: Iterable[Effect]) -> list[Effect]:
    """Torques on motor, arm and joint: what changes the scale of the input or of a reading could imitate
    anything when a model runs freely, by making it forget its input.
    """
    return [
        e
        for e in effects
        if e.entry.kind in ("torque", "friction")
        and not (e.entry.unnamed or e.location.endswith("_actuator"))
    ]


def explore_simulated(
    fit: Fit,
    lab: Model,
    estimation: Sequence[Record],
    validation: Sequence[Record],
    scales: Scales,
    progress: Callable[[str], None],
) -> list[Explanation]:
    """Explanations by one further mechanical effect, all with the same observer; their gains are not nats of
    independent errors and only rank them.
    """
    progress("screening mechanical effects")
    tried = mechanical(candidates(fit.model, estimation, scales))
    screened = best_per_effect(screen(fit, estimation, tried))[:_MOST_FITS]
    before = likelihood_of(pack(fit.model), fit.noise, validation)
    index = len(fit.model.effects)

    def explained(s: Screened) -> Explanation | None:
        progress(f"fitting {s.effect.effect} at {s.effect.location}")
        fits = [
            fit_parameters(
                m.with_effects(s.effect),
                fit.noise,
                estimation,
                iterations=15,
                limits=within_reach(lab, scales),
            )
            for m in (fit.model, lab)
        ]
        best = max(fits, key=lambda f: f.log_likelihood)
        if not np.isfinite(best.log_likelihood):
            return None
        after = likelihood_of(pack(best.model), best.noise, validation)
        return Explanation(
            best,
            best.log_likelihood - fit.log_likelihood,
            after - before,
            material(best.model.effects[index], scales.driven(best.model)),
            index,
        )

    found = [e for e in side_by_side(explained, screened) if e is not None]
    return sorted(found, key=lambda e: (not e.material, -e.score))
