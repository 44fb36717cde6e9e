"""Coming near the best parameters from a distance: first a predictor that looks far ahead, then the
one-step one.

Tuned at a start that is far off, the noise model takes the model's error for a disturbance torque, and the
predictor then follows the measurement whatever the parameters are: the search stops where it began.  So the
levels are first set by hand: encoders so noisy that the observer trusts the model over many samples, nearly a
simulation, whose errors show every wrong parameter; then less noisy ones, each fit starting from the last.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from haptic_teleop_sim.kernel import pack
from haptic_teleop_sim.model import Model

from .fit import Fit
from .noise import NoiseModel
from .parallel import side_by_side
from .prediction_fit import fit_parameters
from .records import Record, thinned, thinned_to
from .step_limits import Limits
from .tuning import initial_noise
from .whole_fit import fit_whole, noise_starts

#: Encoder noise of each stage as a share of the motion's standard deviation.
STAGES = (0.1, 0.003)
#: Iterations of the first stage after which starts are compared.
FEW_STEPS = 8
#: Hz that the first stage makes do with.
_COARSE_RATE = 250.0
#: Iterations of the one-step predictor, and nats that its last step may still promise: a tenth of a standard
#: error.
_MOST, _ENOUGH = 30, 0.005
_MOTOR_SHARE, _ARM_SHARE = 0.02, 0.0004


def distrustful_noise(model: Model, records: Sequence[Record], share: float) -> NoiseModel:
    """A noise model whose encoders err by ``share`` of the motion (never less than their resolution), and
    whose disturbances are 2 % (motor) and 0.04 % (arm) of the rms input torque."""
    base = initial_noise(pack(model), records)
    spread = np.array(
        [
            [np.nanstd(r.measured[:, c]) if np.any(np.isfinite(r.measured[:, c])) else np.nan for c in (0, 1)]
            for r in records
        ]
    )
    motor = share * float(np.mean(spread[:, 0]))
    # An arm that was not measured has no encoder; the number is then not used.
    arm = share * float(np.mean(spread[:, 1])) if np.all(np.isfinite(spread[:, 1])) else motor
    torque = base.motor_torque / 0.05
    return NoiseModel(
        _MOTOR_SHARE * torque, _ARM_SHARE * torque, max(motor, base.motor_angle), max(arm, base.arm_angle)
    )


def is_shape(model: Model, name: str) -> bool:
    """Whether a parameter says how an effect looks rather than how large it is."""
    for effect in model.effects:
        head = f"{effect.location}.{effect.effect}."
        if name.startswith(head):
            return effect.entry.parameter(name.removeprefix(head)).neutral is None
    return False


def approach(
    model: Model,
    records: Sequence[Record],
    *,
    free: tuple[str, ...] | None = None,
    limits: Limits | None = None,
    iterations: int = 20,
    stages: Sequence[float] = STAGES,
    progress: Callable[[int, float], None] | None = None,
) -> Fit:
    """Fit the free parameters with predictors that look less and less far ahead; the last stage's fit.

    Its ``log_likelihood`` compares starts (same stages, same recordings), not models: the levels are not
    tuned.
    """
    free = model.free_parameters() if free is None else free
    fit: Fit | None = None
    coarse = [thinned(record, _COARSE_RATE) for record in records]
    for number, share in enumerate(stages):
        used = coarse if number == 0 else records
        # First without the shapes (a Stribeck velocity, a gap): while the sizes are wrong they run away.
        for chosen in (tuple(n for n in free if not is_shape(model, n)), free) if number == 0 else (free,):
            noise = distrustful_noise(model, used, share)
            fit = fit_parameters(
                model, noise, used, free=chosen, iterations=iterations, limits=limits, progress=progress
            )
            if np.isfinite(fit.log_likelihood):
                model = fit.model
    if fit is None:
        raise ValueError("no stage was given")
    return fit


def nearest_start(starts: Sequence[Model], records: Sequence[Record]) -> Model:
    """Of several starts of one model the one from which a few steps of the far-sighted predictor come
    nearest."""
    if len(starts) == 1:
        return starts[0]
    reached = side_by_side(
        lambda one: approach(one, records, iterations=FEW_STEPS, stages=STAGES[:1]).log_likelihood, starts
    )
    return starts[int(np.argmax(reached))]


def fit_far_and_near(
    model: Model,
    records: Sequence[Record],
    *,
    free: tuple[str, ...] | None = None,
    limits: Limits | None = None,
    progress: Callable[[int, float], None] | None = None,
) -> tuple[Fit, Fit]:
    """Two fits: of the predictor that looks far ahead (`approach`, its last stage), and from there of the
    one-step predictor, parameters and noise levels together (`fit_whole`).

    They agree when the model is right, and the second is then the surer. Where something is missing that acts
    within few samples (a contact that gives before it slides), the second can be far off."""
    far = approach(model, records, free=free, limits=limits, progress=progress)
    few = thinned_to(records)

    def whole(start: tuple[Model, NoiseModel]) -> Fit:
        return fit_whole(*start, few, free=free, limits=limits, iterations=_MOST, progress=progress)

    # From a quiet noise model, so that the disturbance does not grow until it replaces friction.
    near = whole((far.model, distrustful_noise(far.model, few, 0.0)))
    if not (far.converged and near.converged):
        others = [(one, noise) for one in (far.model, model) for noise in noise_starts(one, few)]
        near = max([near, *side_by_side(whole, others)], key=lambda one: one.log_likelihood)
    if np.isfinite(near.log_likelihood):
        common: Any = {"free": free, "limits": limits, "progress": progress}
        near = fit_whole(near.model, near.noise, records, iterations=_MOST, enough=_ENOUGH, **common)
        if not near.converged:
            # Where hardly any noise is left, derivatives through the observer's gain, which are differences,
            # are too rough for the last digits; those at its levels are exact.
            near = fit_parameters(near.model, near.noise, records, **common)
    return far, near
