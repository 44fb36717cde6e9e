"""From the library's angles to the thesis' axes (2.3.1) and back for torques.

    phi = sign (B theta - zero)      theta: angles that the HD library reports, rad
    T   = B' (sign tau)              tau: torques about the thesis' axes, so that power is the same in both

B is one, unless the third reading is to be taken relative to the second link: then its row is (0, -1, 1). The
library states the third angle against the vertical, which is what the thesis says of its axis, too: moving
the first arm does not change the second arm's reading (2.3.3).
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import astuple, dataclass

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.quantities import check_quantities, quantity

PREFIX = "openhaptics."


@dataclass(frozen=True)
class AxisMap:
    """The defaults are for the library's angles: left, up and out positive in the vendor's reference and in
    the thesis alike; Y neutral in the middle of its 2 to 102 degrees, Z in the middle of what a published
    model of the device allows there (both *assumed*). Raises ConfigurationError naming the field."""

    sign: tuple[float, ...] = quantity(
        (1.0, 1.0, 1.0),
        "",
        "of x, y, z against the library's angles: 1.0 or -1.0",
        name="axis_sign",
        length=3,
    )
    zero: tuple[float, ...] = quantity(
        (0.0, 0.908, 1.128),
        "rad",
        "the library's angles at neutral: x, y, z",
        name="axis_zero",
        minimum=-6.3,
        maximum=6.3,
        length=3,
    )
    relative_z: bool = quantity(
        False, "", "whether z is the third angle less the second", name="axis_relative_z"
    )

    def __post_init__(self) -> None:
        check_quantities(self)
        if any(abs(sign) != 1.0 for sign in self.sign):
            raise ConfigurationError(
                f"{PREFIX}axis_sign is {list(self.sign)}; write 1.0 or -1.0 for each axis."
            )

    @property
    def digest(self) -> str:
        """Eight hexadecimal digits; others for any other map."""
        return hashlib.sha256(repr(astuple(self)).encode()).hexdigest()[:8]

    def angles(self, device: Sequence[float]) -> list[float]:
        """Angles about neutral (3,), rad, from those of the device (3,), rad."""
        x, y, z = device
        raw = (x, y, z - y if self.relative_z else z)
        return [s * (value - zero) for s, value, zero in zip(self.sign, raw, self.zero, strict=True)]

    def device_torque(self, torque: Sequence[float]) -> list[float]:
        """What the device is to be told (3,), N·m, for torques about the axes (3,), N·m."""
        x, y, z = (s * value for s, value in zip(self.sign, torque, strict=True))
        return [x, y - z if self.relative_z else y, z]

    def axis_torque(self, device: Sequence[float]) -> list[float]:
        """The reverse of `device_torque`."""
        x, y, z = device
        raw = (x, y + z if self.relative_z else y, z)
        return [s * value for s, value in zip(self.sign, raw, strict=True)]


IDENTITY = AxisMap(zero=(0.0, 0.0, 0.0))
"""For devices whose layout and calibration give the axes as they are."""
