"""One joint as a plant that is stepped sample by sample: the same compiled equations as a whole simulation.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .model import Model
from .plant_bank import PlantBank

FloatArray = NDArray[np.float64]


class Plant:
    """A model in motion.

    ``dt`` > 0: sample time, s.  ``initial_state``: (4,) motor and arm angle (rad), motor and arm velocity
    (rad/s); at rest at zero by default.  ``state``: the four and more, see `PlantBank.state`.
    """

    def __init__(self, model: Model, dt: float, initial_state: ArrayLike | None = None) -> None:
        self.model = model
        self.dt = float(dt)
        self._bank = PlantBank([model], dt)
        self._one = np.zeros((3, 1))
        self.reset(initial_state)

    def reset(self, initial_state: ArrayLike | None = None) -> None:
        """Put the plant to a state, time and all memory to zero."""
        self._bank.reset([initial_state])
        self._bank.readings()

    def step(self, input_: float, external_torque: float = 0.0, exogenous: float = 0.0) -> None:
        """Advance by one sample: ``input_`` in A (sfj) or N·m acts over it, ``external_torque`` (N·m) at the
        arm, ``exogenous`` is the other stage's arm acceleration (rad/s²).
        """
        one = self._one
        one[0, 0], one[1, 0], one[2, 0] = input_, external_torque, exogenous
        self._bank.step(one[0], one[1], one[2])
        self._bank.readings()

    def readings(self) -> tuple[float, float]:
        """What the two encoders show now, rad, before quantisation: motor, arm."""
        angles = self._bank.readings()
        return float(angles[0, 0]), float(angles[0, 1])

    @property
    def state(self) -> FloatArray:
        """A view of the state."""
        return self._bank.state(0)

    @property
    def time(self) -> float:
        """s since the last reset."""
        return self._bank.time

    @property
    def finite(self) -> bool:
        """False when the state has left the finite numbers."""
        return bool(np.all(np.isfinite(self.state)))
