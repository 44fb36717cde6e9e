"""What an exported model is measured on: a recording, or the model's own response to a multisine."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_control.robots import OMNI_PEAK_TORQUE, OMNI_RATE_HZ, SFJ_RATE_HZ, SFJ_STAGES
from haptic_teleop_control.signals.multisine import multisine_coefficients
from haptic_teleop_control.signals.settings import Multisine
from haptic_teleop_sim.kernel import simulate
from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.estimation.records import with_trusted_input
from haptic_teleop_sysid.logs.opened import open_recording
from haptic_teleop_sysid.recordings.dataset import DataSet, load_dataset
from haptic_teleop_sysid.recordings.preparation import refuse_huge, with_damage_told
from haptic_teleop_sysid.simulation.fit import choose_windows, fit_percent, simulated_fit
from haptic_teleop_sysid.simulation.windows import Windows

Array = NDArray[np.float64]
Fits = dict[str, float]
REACH = 0.3
"""Root mean square of the motor's angle, rad, that the multisine aims at with the structure alone."""
OVER_FRICTION = 1.5
"""Root mean square of the multisine's torque, at least, over all dry friction and dead zones of the model."""


class Reference(Protocol):
    """Something that a model's fit, in percent by signal, can be measured on."""

    @property
    def input(self) -> Array:
        """What drives the model, (n,), held over each sample."""
        ...

    @property
    def dt(self) -> float:
        """Period of a sample, s."""
        ...

    @property
    def exogenous(self) -> Array | None:
        """Acceleration of the robot's other arm (n,), rad/s², None where it is not known."""
        ...

    def fit(self, model: Model) -> Fits:
        """Return the fit, in percent, of a model of that joint."""
        ...

    def described(self) -> dict[str, Any]:
        """Return what it is, as JSON."""
        ...


def responses(model: Model, input_: Array, dt: float) -> dict[str, Array]:
    """Return what the encoders show of the model's response from rest, (n,) by `motor_position` and so on."""
    found = simulate(model, input_, dt)
    names = ("motor",) if model.rigid else ("motor", "arm")
    return {f"{p}_{s}": getattr(found, f"{p}_{s}") for p in names for s in ("position", "velocity")}


@dataclass(frozen=True)
class Simulated:
    """The response of `model` from rest to a multisine `settings`, the rms of which is in the model's
    input."""

    model: Model
    settings: Multisine
    input: Array
    dt: float
    exogenous: Array | None = None

    def fit(self, model: Model) -> Fits:
        """Return the fit of `model` to the response of the exported one."""
        truth, other = (responses(m, self.input, self.dt) for m in (self.model, model))
        return {_name(self.model, signal): fit_percent(y, other[signal]) for signal, y in truth.items()}

    def described(self) -> dict[str, Any]:
        """Return the multisine's settings."""
        s = self.settings
        unit = {"sfj": "A", "omni": "N*m"}.get(self.model.robot, "N*m (or N)")
        return {"kind": "multisine", "rms": s.rms, "unit": unit, "period_s": s.period, "f_min_hz": s.f_min,
                "f_max_hz": s.f_max, "seed": s.seed, "samples": len(self.input), "dt_s": self.dt}  # fmt: skip


@dataclass(frozen=True)
class Recorded:
    """A recording, over windows that the exported model chose."""

    dataset: DataSet
    windows: Windows

    @property
    def input(self) -> Array:
        """The recorded input (n,)."""
        return self.dataset.input

    @property
    def dt(self) -> float:
        """s."""
        return self.dataset.dt

    @property
    def exogenous(self) -> Array | None:
        """The other arm's acceleration (n,), rad/s², where recorded."""
        return self.dataset.exogenous

    def fit(self, model: Model) -> Fits:
        """Return the fit of `model` to the recording."""
        return simulated_fit(model, self.dataset, self.windows).percent

    def described(self) -> dict[str, Any]:
        """Return the recording's name and windows."""
        d, w = self.dataset, self.windows
        return {"kind": "recording", "bag": d.name, "samples": len(d), "dt_s": d.dt,
                "window_s": w.seconds, "why": w.why}  # fmt: skip


def recorded(
    model: Model, bag: str | Path, allow_gaps: bool = False, mapping: str | Path | None = None
) -> Recorded:
    """Return the recording, or a log by a ``mapping``; errors as `open_recording` and `load_dataset`."""
    refuse_huge(bag)
    recording = open_recording(bag, mapping)
    dataset = with_trusted_input(load_dataset(recording, model, str(bag), allow_gaps))
    dataset = with_damage_told(dataset, recording)
    return Recorded(dataset, choose_windows(model, dataset))


def multisine(model: Model, rms: float | None = None, seconds: float = 20.0) -> Simulated:
    """Return the model's response to an odd random-phase multisine from 0.1 to 10 Hz, in periods of 10 s.

    rms: in the model's input; by default what moves the structure alone by REACH, or OVER_FRICTION times what
    has to be overcome, whichever is more.
    """
    dt = 1.0 / (OMNI_RATE_HZ if model.robot == "omni" else SFJ_RATE_HZ)
    unit = Multisine(enabled=True, rms=1.0, period=10.0, f_min=0.1, f_max=10.0)
    samples = max(2, round(seconds / dt))
    wave = _wave(unit, samples, dt)
    if rms is None:
        plain = Model(model.robot, model.joint, model.structure, model.parameters)
        reach = REACH / max(float(np.std(responses(plain, wave, dt)["motor_position"])), 1e-12)
        most = max(reach, OVER_FRICTION * _held(model) / model.parameters["torque_constant"])
        rms = float(f"{min(most, _allowed(model) / float(np.max(np.abs(wave)))):.3g}")
    settings = Multisine(enabled=True, rms=rms, period=10.0, f_min=0.1, f_max=10.0)
    return Simulated(model, settings, rms * wave, dt)


def _held(model: Model) -> float:
    """Torque that has to be overcome before anything moves, N·m: dry frictions and dead zones, at most."""
    total = 0.0
    for e in model.effects:
        dry = e.entry.memory != "" or e.effect == "dead_zone"
        total += sum(v for n, v in e.values.items() if dry and e.entry.parameter(n).unit == "N*m")
    return total


def _allowed(model: Model) -> float:
    """Largest input that the robot takes: A or N·m; infinite for one that nothing is known of."""
    if model.robot == "sfj":
        return 0.99 * SFJ_STAGES[model.joint].current_limit
    return 0.99 * OMNI_PEAK_TORQUE if model.robot == "omni" else np.inf


def _wave(settings: Multisine, samples: int, dt: float) -> Array:
    t = dt * np.arange(samples)
    turns = 2.0 * np.pi * np.outer(t, list(settings.harmonics())) / settings.period
    return np.real(np.exp(1j * turns) @ np.array(multisine_coefficients(settings)))


def _name(model: Model, signal: str) -> str:
    place, _, what = signal.partition("_")
    return f"{model.joint}_{place}.{what}"
