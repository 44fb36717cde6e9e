"""Prediction error as a method: from one start or several, and with a doubt about the one-step predictor.

When the model is right, the predictor that looks one sample ahead is the surest. Where something is missing
that acts within few samples (a contact that gives before it slides, a delay), it may take friction for a
disturbance. The predictor that looks further ahead hardly notices what is quick and small. So both are
estimated, and where the simulated response with the values of the first is clearly worse, the second is
believed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from haptic_teleop_sim.kernel import pack
from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.recordings.dataset import DataSet
from haptic_teleop_sysid.simulation.fit import choose_windows, simulated_fit
from haptic_teleop_sysid.simulation.windows import Windows

from .derivative_free import searched_without_derivatives
from .fit import Fit
from .graduated import FEW_STEPS, STAGES, approach, distrustful_noise, fit_far_and_near
from .likelihood import channels
from .noise import NoiseModel, linearised, observer_gain
from .prediction_fit import fit_parameters
from .progress import Progress, silent
from .records import Record, records_from
from .result import Estimate, FarSighted, Misled
from .riccati import exponential
from .step_limits import Limits, bounds
from .uncertainty import MEMORY, uncertainty
from .whole_fit import fit_whole

#: Further starts lie within this factor of the given one, either side.
SPREAD = 3.0
#: The far-sighted predictor's values are taken where their simulated response errs by less than this share of
#: the other's (measured: right models 0.84 to 1.02, where a contact gave before it slid 0.17),
CLEARLY_BETTER = 0.8
#: and the other's by more than this share of the angles' spread.
NOTICEABLE = 0.02
#: Relative difference of the two predictors' parameters up to which nothing is simulated.
ALIKE = 0.1
#: Nats from which parameters and noise levels fitted together have left a hollow.
HOLLOW = 30.0
#: Iterations of the far-sighted predictor once it is the one to believe.
ITERATIONS = 60


def prediction_error(
    model: Model,
    datasets: Sequence[DataSet],
    at_rest: bool = False,
    multi_start: int = 1,
    seed: int = 1,
    limits: Limits | None = None,
    others: Sequence[Model] = (),
    progress: Progress = silent,
) -> Estimate:
    """Estimate the free parameters from data sets with the input that acted (`with_trusted_input`): from the
    model's values, from those of ``others``, and from ``multi_start`` - 1 that are drawn."""
    records = [piece for d in datasets for piece in records_from(d, at_rest)]
    starts = [model, *others, *further_starts(model, records, multi_start - 1, seed, limits)]
    steps = len(starts) + 1

    def stage(number: int, name: str) -> Callable[[int, float], None]:
        return lambda iteration, _: progress(
            f"{name}, step {iteration}", (number + 1.0 - 0.7**iteration) / steps
        )

    reached: list[Fit] = []
    for i, start in enumerate(starts if len(starts) > 1 else []):
        tell = stage(i, f"start {i + 1} of {len(starts)}")
        reached.append(
            approach(start, records, limits=limits, iterations=FEW_STEPS, stages=STAGES[:1], progress=tell)
        )
    begin = max(reached, key=lambda one: one.log_likelihood).model if reached else model
    far, fit = fit_far_and_near(begin, records, limits=limits, progress=stage(steps - 1, "predictor"))
    far, fit = _led_out(far, fit, begin, records, limits)
    progress("uncertainty", 1.0)
    misled = _misled(far, fit, records, datasets)
    memory = MEMORY
    if misled is not None:
        fit = fit_parameters(far.model, far.noise, records, iterations=ITERATIONS, limits=limits)
        fit = searched_without_derivatives(fit, records, limits)
        memory = max(MEMORY, misled.ahead)
    if not np.isfinite(fit.log_likelihood):
        message = (
            "the model predicts nothing from this start: its response runs away; try other start values, "
            "or --multi-start"
        )
        return Estimate(model, model, "prediction-error", False, message, 0.0, fit.iterations)
    unsure = uncertainty(fit, records, memory, tuned=misled is None)
    likelihoods = tuple(one.log_likelihood for one in reached)
    return Estimate(
        fit.model, model, "prediction-error", fit.converged, fit.message, 0.0, fit.iterations, fit, unsure,
        likelihoods, misled=misled,
    )  # fmt: skip


def _led_out(
    far: Fit, near: Fit, start: Model, records: Sequence[Record], limits: Limits | None
) -> tuple[Fit, Fit]:
    """Both predictors' fits; where they disagree or a parameter ended at its bound, what parameters and noise
    levels find together from there (and with that parameter as at the ``start``), if that is far better and
    the predictor that looks ahead stays with it.

    A single start can end in a hollow. Where the recording
    itself misleads the one-step predictor, the other one moves away again, and nothing changes.
    """
    if not np.isfinite(near.log_likelihood) or (_agree(far, near) and not near.at_bound):
        return far, near
    begun = start.parameter_values()
    models = [near.model, near.model.with_values({n: begun[n] for n in near.at_bound})]
    fits = [
        fit_whole(model, near.noise, records, free=near.free, limits=limits, iterations=20)
        for model in models[: 2 if near.at_bound else 1]
    ]
    whole = max(fits, key=lambda one: one.log_likelihood)
    if not whole.log_likelihood > near.log_likelihood + HOLLOW:
        return far, near
    noise = distrustful_noise(whole.model, records, STAGES[-1])
    again = fit_parameters(whole.model, noise, records, iterations=ITERATIONS, limits=limits)
    return (again, whole) if _agree(again, whole) else (far, near)


def _misled(far: Fit, near: Fit, records: Sequence[Record], datasets: Sequence[DataSet]) -> Misled | None:
    """What to tell where the one-step predictor is not to be believed, else None."""
    if not np.isfinite(far.log_likelihood) or _agree(far, near):
        return None
    windows = [choose_windows(far.model, d) for d in datasets]
    errors = [_simulated_error(fit, datasets, windows) for fit in (near, far)]
    if not errors[0] > NOTICEABLE or not errors[1] < CLEARLY_BETTER * errors[0]:
        return None
    values = near.model.parameter_values()
    ahead = max(look_ahead(far.model, far.noise, record) for record in records)
    return Misled({n: values[n] for n in near.free}, errors[0], errors[1], ahead)


def _agree(one: Fit, other: Fit) -> bool:
    """Whether all parameters are the same to ALIKE: then it hardly matters which to believe."""
    a, b = one.model.parameter_values(), other.model.parameter_values()
    return all(abs(a[n] - b[n]) <= ALIKE * abs(b[n]) for n in other.free)


def _simulated_error(fit: Fit, datasets: Sequence[DataSet], windows: Sequence[Windows]) -> float:
    """Error of the simulated angles relative to their spread, root mean square over angles and recordings;
    infinite where the response runs away."""
    if not np.isfinite(fit.log_likelihood):
        return float("inf")
    shares = []
    for dataset, chosen in zip(datasets, windows, strict=True):
        percent = simulated_fit(fit.model, dataset, chosen).percent
        shares += [1.0 - v / 100.0 for name, v in percent.items() if name.endswith("position")]
    return float(np.sqrt(np.mean(np.square(shares))))


def cross_checked(
    found: Estimate, datasets: Sequence[DataSet], at_rest: bool, limits: Limits | None
) -> Estimate:
    """The estimate with what the predictor that looks farthest ahead finds from there (`FarSighted`)."""
    records = [piece for d in datasets for piece in records_from(d, at_rest)]
    noise = distrustful_noise(found.model, records, STAGES[0])
    fit = fit_parameters(found.model, noise, records, iterations=ITERATIONS, limits=limits)
    ahead = max(look_ahead(fit.model, noise, record) for record in records)
    # Friction makes its likelihood rough: where no step gains anything any more is near enough.
    if not fit.converged and fit.iterations == ITERATIONS:
        return replace(found, far_sighted=FarSighted({}, ahead))
    unsure = uncertainty(fit, records, max(MEMORY, ahead), tuned=False)
    values = fit.model.parameter_values()
    told = {n: (values[n], float(std)) for n, std in zip(unsure.names, unsure.std, strict=True)}
    return replace(found, far_sighted=FarSighted(told, ahead))


def look_ahead(model: Model, noise: NoiseModel, record: Record) -> float:
    """Time constant, s, with which the observer of the linearised joint forgets: of its slowest pole."""
    packed = pack(model)
    used = channels(packed, record)
    gain = observer_gain(packed, noise, record.dt, used)
    keep = [0, 2, 4] if packed.rigid else list(range(6))
    places = [{4: -2, 5: -1}.get(state, state) for state in keep]
    a, c = linearised(packed, noise.reference)
    transition = exponential(a * record.dt)
    transition[4, 4], transition[5, 5] = noise.decay(record.dt)
    correction = np.eye(len(keep)) - gain[np.ix_(places, used)] @ c[np.ix_(used, keep)]
    poles = np.abs(np.linalg.eigvals(transition[np.ix_(keep, keep)] @ correction))
    return float(-record.dt / np.log(min(max(float(np.max(poles)), 1e-6), 1.0 - 1e-9)))


def further_starts(
    model: Model, records: Sequence[Record], count: int, seed: int, limits: Limits | None
) -> list[Model]:
    """`count` starts around the model's values, drawn at random within a factor of SPREAD and the bounds."""
    random = np.random.default_rng(seed)
    free, values = model.free_parameters(), model.parameter_values()
    low, high = bounds(model, free, limits)
    centre = np.array([values[n] for n in free])
    drawn = [
        np.clip(centre * SPREAD ** random.uniform(-1, 1, len(free)), low, high) for _ in range(count)
    ]
    return [model.with_values(dict(zip(free, one, strict=True))) for one in drawn]
