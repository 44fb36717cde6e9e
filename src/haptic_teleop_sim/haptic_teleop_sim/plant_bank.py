"""Several joints with one clock, as the flat arrays that the compiled stepping functions take."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .kernel import pack, stepping
from .model import Model

FloatArray = NDArray[np.float64]


class PlantBank:
    """m models in motion, at rest at zero at first.

    `arrays` is the tuple described in `kernel/stepping.py`, shared with compiled loops. `dt` > 0: s; raises
    ValueError otherwise.
    """

    def __init__(self, models: Sequence[Model], dt: float) -> None:
        if not (math.isfinite(dt) and dt > 0.0):
            raise ValueError(f"the sample time must be a positive number of seconds, not {dt!r}")
        self.models = tuple(models)
        self.dt = float(dt)
        self._packed = packed = [pack(model) for model in self.models]
        m = len(packed)
        layout = np.zeros((m, 11), dtype=np.int64)
        delay = np.zeros((m, 2))
        codes, in_codes, out_codes, p = [], [], [], []
        first = np.zeros(
            6, dtype=np.int64
        )  # so far: states, effects, input effects, outputs, parameters, memory
        for i, one in enumerate(packed):
            layout[i, 0] = one.rigid
            layout[i, 1] = one.substeps(dt)
            layout[i, 10] = {"other_angle": 1, "other_velocity": 2}.get(one.other, 0)
            counts = (one.states, len(one.codes), len(one.in_codes), len(one.out_codes))
            for g, count in enumerate(counts):
                layout[i, 2 + 2 * g : 4 + 2 * g] = first[g], first[g] + count
            # Offsets into the arrays that all joints share; the states stay relative to the joint's own.
            codes.append(_shifted(one.codes, {3: first[4]}))
            in_codes.append(_shifted(one.in_codes, {1: first[4], 2: first[5]}))
            moments = one.in_codes[:, 3]  # -1: keeps none
            in_codes[-1][:, 3] = np.where(moments >= 0, moments + first[5], -1)
            out_codes.append(_shifted(one.out_codes, {2: first[4]}))
            p.append(one.p)
            first += np.array([*counts, len(one.p), one.memory])
            for channel, offset in one.skew:
                if channel < 2:
                    delay[i, channel] += one.p[offset] / dt
        # A reading from the future is none: an encoder stamped early shows the present.
        delay = np.maximum(delay, 0.0)
        self.states = np.zeros(first[0])
        self._clock = np.zeros(1, dtype=np.int64)
        self._layout = layout
        self._memory = np.zeros(max(int(first[5]), 1))
        self._past = np.zeros((m, int(delay.max(initial=0.0)) + 2, 2))
        self._nothing = np.zeros(m)
        self.arrays = (
            self.dt,
            self._clock,
            layout,
            self.states,
            np.array([one.base for one in packed]),
            np.array([one.torque_constant for one in packed]),
            np.concatenate(codes),
            np.concatenate(p),
            np.concatenate(in_codes),
            np.concatenate(out_codes),
            self._memory,
            delay,
            self._past,
            np.zeros(3 * int(max(one.states for one in packed))),
        )
        self._functions = stepping()
        self._angles = np.zeros((m, 2))
        self.reset()

    def __len__(self) -> int:
        return len(self.models)

    def reset(self, initial_states: Sequence[ArrayLike | None] | None = None) -> None:
        """Put each joint to a state (4,) - motor and arm angle, motor and arm velocity -, time and memory to
        zero."""
        for i, packed in enumerate(self._packed):
            start = None if initial_states is None else initial_states[i]
            values = np.zeros(4) if start is None else np.asarray(start, dtype=np.float64)
            self.state(i)[:] = packed.initial_state(*values[:4])
        self._memory[:] = 0.0
        self._clock[0] = 0

    def state(self, joint: int) -> FloatArray:
        """State of one joint, a view: motor and arm angle (rad), motor and arm velocity (rad/s), own states
        of effects, disturbance torque at motor and arm (N·m).
        """
        return self.states[self._layout[joint, 2] : self._layout[joint, 3]]

    @property
    def time(self) -> float:
        """s since the last reset."""
        return int(self._clock[0]) * self.dt

    def step(
        self,
        inputs: FloatArray,
        external_torque: FloatArray | None = None,
        exogenous: FloatArray | None = None,
    ) -> None:
        """Advance by one sample: `inputs` (m,) in A or N·m, `external_torque` (m,) N·m at the arms (at the
        body where it is rigid), `exogenous` (m,) what it follows of the other stage's arm
        (`Packed.other`): acceleration, rad/s², or angle or velocity.
        """
        self._functions.bank_step(
            inputs,
            self._nothing if external_torque is None else external_torque,
            self._nothing if exogenous is None else exogenous,
            self.arrays,
        )

    def readings(self) -> FloatArray:
        """(m, 2) what the encoders show now, rad, before quantisation: motor, arm. To be called at every
        sample where a model delays its readings.
        """
        self._functions.bank_read(self.arrays, self._angles)
        return self._angles


def _shifted(codes: NDArray[np.int64], shifts: Mapping[int, int]) -> NDArray[np.int64]:
    """A copy with offsets added to some columns."""
    copy = codes.copy()
    for column, offset in shifts.items():
        copy[:, column] += offset
    return copy
