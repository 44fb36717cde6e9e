"""The next experiment: which excitation would tell two models apart, or make a size surer, judged by
simulating it within the robot's limits."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import copysign, erf, floor, isfinite, log10, sqrt, trunc

import numpy as np
import scipy

from haptic_teleop_control.acquisition import SIGNAL, Acquisition
from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.robots import OMNI_AXES, SFJ_STAGES
from haptic_teleop_control.signals import SignalGenerator
from haptic_teleop_sim.kernel import simulate
from haptic_teleop_sim.model import Model
from haptic_teleop_sim.position_loop import in_position_loop
from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.estimation.prediction_fit import fit_parameters, normal_equations
from haptic_teleop_sysid.estimation.records import Record

from ..evidence.certainty import standard_errors
from ..inputs.scales import Scales

#: s of the experiment.
SECONDS = 12.0
#: At rest before it, s.
_DELAY = 1.0
#: rad/s and rad at which `acquire` aborts, as in its example files; share of a limit that a simulated
#: experiment may reach.
_SPEEDS = {"stage1": 3.0, "stage2": 8.0}
_OMNI_SPEED, _DEFLECTION, _MARGIN = 15.0, 0.5, 0.8
#: Factor over the recorded travel up to which a machine of which nothing is known may be sent.
_FARTHER = 2.0
#: Gain of the position loop in which an axis of the Omni is identified, N·m/rad (thesis 3.2.1).
_LOOP = 1.0


@dataclass(frozen=True)
class Suggestion:
    """An experiment (flat parameters of `acquire`), what it is good for, and how surely: the probability that
    the better of two models would be told after it."""

    why: str
    signal_generator: dict[str, object]
    expected_discrimination: float
    #: Least and greatest angle of the motor in its simulation, in the unit of the recordings.
    travel: tuple[float, float]


def menu(model: Model, scales: Scales, period: float) -> list[dict[str, object]]:
    """Experiments to choose from: multisines and slow triangles of several amplitudes and bands, as flat
    parameters of `acquire`, in its units and within its limits: A for a stage, rad in a position loop for an
    axis of the Omni; of another machine in the unit of its input, to be run by its own controller."""
    common: dict[str, object] = {"rate": 1.0 / period}
    if model.robot == "sfj":
        size = scales.size["torque"] / float(model.parameters["torque_constant"])
        limit = SFJ_STAGES[model.joint].recommended_current
        common |= {"joint": model.joint, "control": "open_loop", "limit.position": 1.2}
        common |= {"limit.velocity": _SPEEDS[model.joint], "limit.deflection": _DEFLECTION}
    elif model.robot == "omni":
        axis = OMNI_AXES[model.joint]
        reach = min(-axis.lower, axis.upper)
        size, limit = scales.span(0) / 4.0, 0.7 * reach
        common |= {"joint": model.joint, "control": "position", "gain": _LOOP, "limit.position": reach}
        common |= {"limit.velocity": _OMNI_SPEED}
    else:
        size = scales.size["torque"] / float(model.parameters["torque_constant"])
        limit = scales.size["peak"] / float(model.parameters["torque_constant"])
    common |= {"enabled": True, "delay": _DELAY, "duration": SECONDS, "saturation": float(limit)}
    own = {"rate", "joint", "control", "gain"}
    common = {n if n in own or n.startswith("limit.") else f"{SIGNAL}.{n}": v for n, v in common.items()}
    found = []
    for share in (0.4, 1.0, 2.0):
        for f_max in (2.0, 8.0, min(25.0, 0.2 / period)):
            rms = float(min(share * size, 0.4 * limit))
            signal = {"enabled": True, "rms": rms, "f_min": 0.1, "f_max": f_max, "period": 10.0}
            found.append({**common, **{f"{SIGNAL}.multisine.{n}": v for n, v in signal.items()}})
        signal = {"enabled": True, "amplitude": float(min(1.6 * share * size, limit)), "period": 6.0}
        found.append({**common, **{f"{SIGNAL}.triangle.{n}": v for n, v in signal.items()}})
    return [{name: _short(value) for name, value in option.items()} for option in found]


def _short(value: object) -> object:
    """A number with four digits, rounded towards zero, so that no limit is exceeded."""
    if not isinstance(value, float) or value == 0.0 or not isfinite(value):
        return value
    unit = 10.0 ** (floor(log10(abs(value))) - 3)
    return float(f"{trunc(value / unit + copysign(1e-9, value)) * unit:.6g}")


def times(period: float) -> np.ndarray:
    """When an experiment is sampled (n,), s, at rest first."""
    return period * np.arange(int((_DELAY + SECONDS) / period))


def series(model: Model, option: dict[str, object], time: np.ndarray) -> np.ndarray | None:
    """The signal (n,) of an experiment at times (n,), s; None where `acquire` would refuse it."""
    try:
        if model.robot == "generic":
            return SignalGenerator.from_parameters(dict(option), (SIGNAL,)).series(time)[:, 0]
        return Acquisition.from_parameters(option, "the suggestion").series(time)
    except ConfigurationError:
        return None


def simulated_experiment(
    fit: Fit, option: dict[str, object], record: Record, scales: Scales, seed: int = 1
) -> Record | None:
    """The recording that a fitted model would give of an experiment, with the fitted noise level at the
    motor; None where it reaches a limit (_MARGIN)."""
    signal = series(fit.model, option, times(record.dt))
    if signal is None:
        return None
    n = len(signal)
    decay = fit.noise.decay(record.dt)[0]
    white = np.random.default_rng(seed).standard_normal(n) * fit.noise.motor_torque * np.sqrt(1 - decay**2)
    gain = float(str(option.get("gain", 0.0))) if option.get("control") == "position" else 0.0
    ktg = float(fit.model.parameters["torque_constant"])
    model = in_position_loop(fit.model, ktg * gain) if gain else fit.model
    path = simulate(
        model,
        gain * signal if gain else signal,
        record.dt,
        motor_torque=scipy.signal.lfilter([1.0], [1.0, -decay], white),
    )
    limits = {n.removeprefix("limit."): float(str(v)) for n, v in option.items() if n.startswith("limit.")}
    travel, speed = (float(np.max(np.abs(v))) for v in (path.states[:, 0], path.states[:, 2]))
    bent = float(np.max(np.abs(path.states[:, 0] - path.states[:, 1])))
    for name, value in (("position", travel), ("velocity", speed), ("deflection", bent)):
        # Written so that a value that is no number is beyond them, too.
        if not value <= _MARGIN * limits.get(name, np.inf):
            return None
    if fit.model.robot == "generic" and not travel <= _FARTHER * scales.span(0):
        return None
    steps = np.maximum(np.array(record.resolution), 1e-12)
    measured = np.rint(np.column_stack([path.motor_position, path.arm_position]) / steps) * steps
    input_ = gain * (signal - measured[:, 0]) if gain else signal
    return Record("simulated", record.dt, input_, measured, np.zeros(n), record.resolution)


def told_apart(truth: Fit, rival: Fit, made: Record) -> float:
    """Nats by which a simulated recording of ``truth`` would speak against ``rival`` after a re-fit of the
    rival's structure."""
    right = fit_parameters(truth.model, truth.noise, [made], iterations=3)
    wrong = fit_parameters(rival.model, rival.noise, [made], iterations=5)
    gain = right.log_likelihood - wrong.log_likelihood
    return float(gain) if np.isfinite(gain) else 0.0


def _made(fit: Fit, record: Record, scales: Scales) -> Iterator[tuple[dict[str, object], Record]]:
    for option in menu(fit.model, scales, record.dt):
        made = simulated_experiment(fit, option, record, scales)
        if made is not None:
            yield option, made


def probability(nats: float) -> float:
    """That the better of two equally likely models is told by a log-likelihood ratio that is about normal
    with mean ``nats`` and variance 2 ``nats``."""
    return round(0.5 * (1.0 + erf(sqrt(max(nats, 0.0) / 2.0) / sqrt(2.0))), 4)


def suggest(
    first: Fit, second: Fit, names: tuple[str, str], record: Record, scales: Scales
) -> Suggestion | None:
    """The excitation of the menu that separates two fitted models best; None when none could be simulated."""
    found = [(told_apart(first, second, made), option, made) for option, made in _made(first, record, scales)]
    if not found:
        return None
    nats, option, made = max(found, key=lambda one: one[0])
    why = (
        f"separates {names[0]} from {names[1]}: their log-likelihoods are expected to differ by {nats:.0f} "
        f"after {SECONDS:.0f} s"
    )
    return Suggestion(why, option, probability(nats), _travel(made))


def sharpen(fit: Fit, parameter: str, size: float, record: Record, scales: Scales) -> Suggestion | None:
    """The excitation of the menu that gives ``parameter`` of a fitted model (full name) the smallest standard
    error; ``size``: how far its value is from none, in its unit. None when none could be simulated."""
    found = []
    for option, made in _made(fit, record, scales):
        information, _, value = normal_equations(fit.model, fit.noise, [made], fit.free)
        if np.isfinite(value):
            error = standard_errors(replace(fit, information=information)).get(parameter, np.inf)
            if 0.0 < error < np.inf:
                found.append((error, option, made))
    if not found or not size > 0.0:
        return None
    error, option, made = min(found, key=lambda one: one[0])
    share = 100.0 * max(error / size, _form(fit, parameter))
    why = f"{SECONDS:.0f} s of it are expected to give it to ± {share:.2g} %"
    return Suggestion(why, option, probability(0.5 * (size / error) ** 2), _travel(made))


def _travel(made: Record) -> tuple[float, float]:
    """Least and greatest angle of the motor in a simulated experiment."""
    return float(np.min(made.measured[:, 0])), float(np.max(made.measured[:, 0]))


def _form(fit: Fit, parameter: str) -> float:
    """Share of a size that the form of its law is off by (full name of the parameter)."""
    location, name, own = parameter.split(".")
    effect = next(e for e in fit.model.effects if (e.location, e.effect) == (location, name))
    return effect.entry.parameter(own).form
