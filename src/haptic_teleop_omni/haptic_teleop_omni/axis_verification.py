"""Layout and axis map of an Omni, verified by hand, axis by axis: each must answer as the thesis defines it
(2.3.1: left, up and out are positive)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_control.device import ReadResult
from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_omni.axis_map import PREFIX
from haptic_teleop_omni.driver import AXES, OmniDriver

Array = NDArray[np.float64]

MOVES = (
    "LEFT, by turning the base, about 20 degrees",
    "UP, by lifting the upper arm, about 20 degrees; the lower arm keeps its direction",
    "OUT, towards you, by swinging the lower arm, about 20 degrees; the upper arm stays",
)
LEAST, BESIDE = 0.15, 0.5
"""rad that an axis has to be moved; share of it by which the others may move along."""

OFF_NEUTRAL = 0.15
"""rad by which an axis may be off where the user holds the neutral pose."""

AVERAGED = 20
"""States in each pose."""

TRIES = 3
"""Of each move."""


class AxisVerification:
    """One verification. pressed: whether the user has pressed Enter since the last look; say: takes a line;
    fault: the sentence of what the driver has reported, or ""."""

    def __init__(
        self,
        driver: OmniDriver,
        pressed: Callable[[], bool],
        say: Callable[[str], None],
        fault: Callable[[], str],
    ) -> None:
        self._driver, self._pressed, self._say, self._fault = driver, pressed, say, fault
        self._button = True  # one that is held from before is no answer
        self.moved: dict[str, list[float]] = {}

    def verify(self) -> bool:
        """Whether everything is as it should be; what is not is said, with the parameter that mends it."""
        self._say(self._driver.describe())
        self._say("The force is off and stays off. Enter, or button 1 of the stylus, goes on; Ctrl-C ends.")
        if not self._calibrated():
            return False
        start = self._hold("Hold the neutral pose: base straight, Y and Z in the middle of their ranges")
        good = self._neutral(start)
        for axis in range(3):
            end = self._move(axis, start)
            if end is None:
                return False
            good = self._judge(axis, end - start) and good
            start = end
        return good

    def _calibrated(self) -> bool:
        if not self._driver.calibration.done:
            self._say(f"Calibration: {self._driver.calibration.advice}")
        while not self._driver.calibration.done:
            self._read()
        self._say("Calibration: done")
        return True

    def _hold(self, what: str) -> Array:
        self._say(f"{what}, then Enter:")
        while not self._answered():
            self._read()
        total = np.zeros(3)
        for _ in range(AVERAGED):
            self._read()
            total += self._driver.position
        return total / AVERAGED

    def _neutral(self, position: Array) -> bool:
        text = " ".join(f"omni_{axis} {value:+.3f}" for axis, value in zip(AXES, position, strict=True))
        if np.abs(position).max() <= OFF_NEUTRAL:
            self._say(f"  neutral: {text} rad, good")
            return True
        zero = self._zero(position)
        self._say(f"  NOT neutral: {text} rad; hold it better, or set {zero}")
        return False

    def _zero(self, position: Array) -> str:
        driver = self._driver
        if not driver.layout.input.absolute:
            return "calibration.angles to what the pose is"
        axes = driver.axis_map
        values = [z + s * p for z, s, p in zip(axes.zero, axes.sign, position, strict=True)]
        return f"{PREFIX}axis_zero: [{', '.join(f'{value:.3f}' for value in values)}]"

    def _move(self, axis: int, start: Array) -> Array | None:
        for _ in range(TRIES):
            end = self._hold(f"omni_{AXES[axis]}: move the stylus {MOVES[axis]}, and stay there")
            if np.abs(end - start).max() >= LEAST:
                return end
            self._say(f"  no axis moved by {LEAST:g} rad: once more, and farther")
        self._say("  NOT verified: this axis was not moved")
        return None

    def _judge(self, axis: int, change: Array) -> bool:
        name = f"omni_{AXES[axis]}"
        self.moved[name] = [round(float(value), 3) for value in change]
        text = " ".join(f"{AXES[k]} {value:+.3f}" for k, value in enumerate(change))
        beside = np.delete(np.abs(change), axis).max()
        if np.abs(change).argmax() != axis:
            other = AXES[int(np.abs(change).argmax())]
            remedy = "move one axis alone" if self._absolute else "move one axis alone, or mend the layout"
            self._say(f"  WRONG axis ({text} rad): omni_{other} moved most; {remedy}")
        elif change[axis] < 0.0:
            self._say(f"  WRONG sign ({text} rad): {self._sign(axis)}")
        elif beside > BESIDE * abs(change[axis]):
            also = "; where Z follows Y by itself, change openhaptics.axis_relative_z" if axis == 1 else ""
            self._say(f"  NOT alone ({text} rad): another axis moved along, try again{also}")
        else:
            self._say(f"  {name}: {text} rad, good")
            return True
        return False

    def _sign(self, axis: int) -> str:
        if not self._absolute:
            return f"change the signs of encoder_{AXES[axis]}'s and torque_{AXES[axis]}'s scale in the layout"
        sign = list(self._driver.axis_map.sign)
        sign[axis] = -sign[axis]
        return f"set {PREFIX}axis_sign: {sign}, and axis_zero stays"

    @property
    def _absolute(self) -> bool:
        return self._driver.layout.input.absolute

    def _answered(self) -> bool:
        button = self._driver.buttons[0]
        by_button, self._button = button and not self._button, button
        return self._pressed() or by_button

    def _read(self) -> None:
        if self._driver.read() is ReadResult.LOST or self._fault():
            raise ConfigurationError(f"the verification ends: {self._fault() or 'the device is lost'}")
