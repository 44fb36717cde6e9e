"""One joint as a plant that is stepped sample by sample: the same compiled equations as a whole simulation."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .kernel import kernel, pack
from .model import Model

FloatArray = NDArray[np.float64]


class Plant:
    """A model in motion.

    ``dt`` > 0: sample time, s.  ``initial_state``: (4,) motor and arm angle (rad), motor and arm velocity (rad/s);
    at rest at zero by default.
    """

    def __init__(self, model: Model, dt: float, initial_state: ArrayLike | None = None) -> None:
        if not (math.isfinite(dt) and dt > 0.0):
            raise ValueError(f"the sample time must be a positive number of seconds, not {dt!r}")
        self.model = model
        self.dt = dt
        self._packed = packed = pack(model)
        self._delays = [(channel, float(packed.p[offset])) for channel, offset in packed.skew if channel < 2]
        self._kernel = kernel()
        self._substeps = packed.substeps(dt)
        self._work = np.zeros((5, packed.states))
        self._memory = np.zeros(packed.memory)
        self.time = 0.0
        self.state = packed.initial_state()
        self.reset(initial_state)

    def reset(self, initial_state: ArrayLike | None = None) -> None:
        """Put the plant to a state, time and all memory to zero."""
        start = np.zeros(4) if initial_state is None else np.asarray(initial_state, dtype=np.float64)
        self.state = self._packed.initial_state(*start[:4])
        self._memory[:] = 0.0
        self.time = 0.0
        self._past: list[FloatArray] = []

    def step(self, input_: float, external_torque: float = 0.0, exogenous: float = 0.0) -> None:
        """Advance by one sample: ``input_`` in A (sfj) or N·m acts over it, ``external_torque`` (N·m) at the arm."""
        packed = self._packed
        if self._delays:
            self._remember()
        torque = input_ * packed.torque_constant
        if len(packed.in_codes):
            one = np.array([torque])
            self._kernel.actuate_series(one, self.time, self.dt, packed.in_codes, packed.p, self._memory, one)
            torque = float(one[0])
        if packed.rigid:
            torque, external_torque = torque + external_torque, 0.0
        self._kernel.advance(self.state, self.time, self.dt, self._substeps, torque, external_torque, exogenous,
                             packed.rigid, packed.base, packed.codes, packed.p, self._work)
        self.time += self.dt

    def _remember(self) -> None:
        depth = int(max(d for _, d in self._delays) / self.dt) + 2
        self._past.append(self.state[:2].copy())
        del self._past[:-depth]

    def readings(self) -> tuple[float, float]:
        """What the two encoders show now, rad, before quantisation: motor, arm."""
        packed = self._packed
        angles = [float(self.state[0]), float(self.state[1])]
        for channel, delay in self._delays:
            # Linear between the samples kept; before the first one the axis stood still.
            history = [float(p[channel]) for p in self._past] + [angles[channel]]
            angles[channel] = float(np.interp(len(history) - 1 - delay / self.dt, np.arange(len(history)), history))
        if len(packed.out_codes):
            angles = [float(self._kernel.encoder_reading(a, c, packed.out_codes, packed.p)) for c, a in enumerate(angles)]
        return angles[0], angles[1]

    @property
    def finite(self) -> bool:
        """False when the state has left the finite numbers."""
        return bool(np.all(np.isfinite(self.state)))
