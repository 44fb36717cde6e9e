"""The next experiment: which excitation would tell two models apart, judged by simulating both."""

from __future__ import annotations

from dataclasses import dataclass
from math import copysign, erf, floor, isfinite, log10, sqrt, trunc

import numpy as np

from haptic_teleop_control.robots import PAIRS, SFJ_STAGES
from haptic_teleop_control.signals import SignalGenerator
from haptic_teleop_sim.kernel import simulate
from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.estimation.gauss_newton import Fit, fit_parameters
from haptic_teleop_sysid.estimation.records import Record

from .scales import Scales


@dataclass(frozen=True)
class Suggestion:
    """A signal-generator setting (flat parameters of the stage), what it would separate, and how surely: the
    probability that the better of the two models would be told after the experiment."""

    why: str
    signal_generator: dict[str, object]
    expected_discrimination: float


def menu(model: Model, scales: Scales, period: float) -> list[dict[str, object]]:
    """Settings of the signal generator to choose from: multisines and slow triangles of several amplitudes
    and bands, in effort (N·m), within the recommended current.
    """
    stage = next((stage for stage, axis in PAIRS.items() if model.joint in (stage, axis)), "stage1")
    rms = scales.size["torque"]
    limit = 4.0 * rms
    if model.robot == "sfj":
        limit = SFJ_STAGES[model.joint].recommended_current * SFJ_STAGES[model.joint].torque_constant
    options: list[dict[str, object]] = []
    for share in (0.4, 1.0, 2.0):
        for f_max in (2.0, 8.0, min(25.0, 0.2 / period)):
            options.append(
                {
                    f"{stage}.multisine.enabled": True,
                    f"{stage}.multisine.rms": float(min(share * rms, 0.4 * limit)),
                    f"{stage}.multisine.f_min": 0.1,
                    f"{stage}.multisine.f_max": f_max,
                    f"{stage}.multisine.period": 10.0,
                }
            )
        options.append(
            {
                f"{stage}.triangle.enabled": True,
                f"{stage}.triangle.amplitude": float(min(1.6 * share * rms, limit)),
                f"{stage}.triangle.period": 6.0,
            }
        )
    common = {"kind": "effort", "rate": 1.0 / period, f"{stage}.enabled": True}
    found = [{**common, **o, f"{stage}.saturation": float(limit)} for o in options]
    return [{name: _short(value) for name, value in option.items()} for option in found]


def _short(value: object) -> object:
    """A number with four digits, rounded towards zero, so that no limit is exceeded."""
    if not isinstance(value, float) or value == 0.0 or not isfinite(value):
        return value
    unit = 10.0 ** (floor(log10(abs(value))) - 3)
    return float(f"{trunc(value / unit + copysign(1e-9, value)) * unit:.6g}")


def told_apart(truth: Fit, rival: Fit, input_: np.ndarray, record: Record, seed: int = 1) -> float:
    """Nats by which a recording of ``truth`` under ``input_`` would speak against ``rival`` after a re-fit of
    the rival's structure; simulated with the fitted noise level at the motor.
    """
    generator = np.random.default_rng(seed)
    dt, n = record.dt, len(input_)
    decay = truth.noise.decay(dt)[0]
    white = generator.standard_normal(n) * truth.noise.motor_torque * np.sqrt(1 - decay**2)
    disturbance = np.zeros(n)
    for i in range(1, n):
        disturbance[i] = decay * disturbance[i - 1] + white[i]
    ktg = float(truth.model.parameters["torque_constant"])
    path = simulate(truth.model, input_ + disturbance / ktg, dt)
    if not np.all(np.isfinite(path.states)) or np.max(np.abs(path.states[:, :2])) > 3.0:
        return 0.0
    steps = np.maximum(np.array(record.resolution), 1e-12)
    measured = np.rint(np.column_stack([path.motor_position, path.arm_position]) / steps) * steps
    made = Record("simulated", dt, input_, measured, np.zeros(n), record.resolution)
    right = fit_parameters(truth.model, truth.noise, [made], iterations=3)
    wrong = fit_parameters(rival.model, rival.noise, [made], iterations=5)
    gain = right.log_likelihood - wrong.log_likelihood
    return float(gain) if np.isfinite(gain) else 0.0


def suggest(
    first: Fit, second: Fit, names: tuple[str, str], record: Record, scales: Scales, seconds: float = 12.0
) -> Suggestion | None:
    """The excitation of the menu that separates two fitted models best; None when none could be simulated."""
    time = record.dt * np.arange(int(seconds / record.dt))
    best: tuple[float, dict[str, object]] | None = None
    for option in menu(first.model, scales, record.dt):
        series = SignalGenerator.from_parameters(option).series(time)
        torque = series[:, 1 if "stage2.enabled" in option else 0]
        nats = told_apart(first, second, torque / float(first.model.parameters["torque_constant"]), record)
        if best is None or nats > best[0]:
            best = (nats, option)
    if best is None:
        return None
    nats, option = best
    # Two equally likely models, the likelihood ratio about normal with mean nats and variance 2 nats.
    power = 0.5 * (1.0 + erf(sqrt(max(nats, 0.0) / 2.0) / sqrt(2.0)))
    why = f"separates {names[0]} from {names[1]}: {nats:.0f} nats expected over {seconds:.0f} s"
    return Suggestion(why, option, round(power, 4))
