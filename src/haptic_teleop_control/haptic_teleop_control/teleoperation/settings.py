"""The parameters of the teleoperation, beside those of the two sides."""

from __future__ import annotations

from haptic_teleop_control.parameters import Parameter
from haptic_teleop_control.quantities import parameters_of
from haptic_teleop_control.teleoperation.link_model import LinkSettings
from haptic_teleop_control.teleoperation.passivity import PassivitySettings

ROBOTS = ("omni", "sfj")

MEASURED_ROUND_TRIP = {"sfj": 0.1, "omni": 0.025}
"""Slave -> s of the link's round trip. Measured with a firm hand, it was passive to 50 ms each way with the
2DSFJ as slave, and to 10 ms but not 20 ms with the Omni: 10 ms each way read as 22 ms, because the age of a
state includes the sampling (docs/teleoperation.md)."""

TELEOPERATION: list[Parameter] = [
    Parameter(
        "master",
        "omni",
        choices=ROBOTS,
        runtime=True,
        meaning="robot that the operator holds; swapped with slave while nothing is driven, or by ~/swap",
    ),
    Parameter("slave", "sfj", choices=ROBOTS, runtime=True, meaning="robot that touches the environment"),
    Parameter(
        "command_source",
        "reference",
        choices=("reference", "device"),
        meaning="who leads; reference: the signal generator; device: the operator's hand",
    ),
    Parameter("timeout", 0.05, "s", 0.005, 0.2, meaning="largest age of an input that is used"),
    Parameter(
        "auto_engage",
        True,
        runtime=True,
        meaning="engage without the operator. Set false on real robots; `scenario` refuses true with a "
        "hardware driver",
    ),
    Parameter(
        "align.angle",
        0.0873,
        "rad",
        0.0,
        1.0,
        runtime=True,
        meaning="largest offset of the master from neutral at which it may engage; 5 degrees",
    ),
    Parameter(
        "align.speed",
        0.2,
        "rad/s",
        0.0,
        100.0,
        runtime=True,
        meaning="largest speed of the slave at which it may engage",
    ),
    Parameter(
        "ramp_time", 0.2, "s", 0.0, 5.0, runtime=True, meaning="from zero to full output after engaging"
    ),
    Parameter(
        "ramp_out_time",
        0.05,
        "s",
        0.0,
        0.5,
        runtime=True,
        meaning="from the last output to zero after disengaging, and of the slave after most faults",
    ),
    Parameter("link", False, meaning="couple through the topics of the node `link` instead of directly"),
    Parameter(
        "maximum_round_trip",
        0.0,
        "s",
        0.0,
        2.0,
        runtime=True,
        meaning="mean age of the other side's stamps, both ways together, beyond which it does not couple; "
        "0: the measured limit of these roles, "
        + ", ".join(f"{limit:g} s for slave {slave}" for slave, limit in MEASURED_ROUND_TRIP.items()),
    ),
    *parameters_of(PassivitySettings(), "passivity."),
]


def longest_round_trip(maximum: float, slave: str) -> float:
    """s beyond which it does not couple: `maximum` (the parameter maximum_round_trip, s, 0 or more) where it
    is stated, and where it is 0 what was measured with the robot `slave`, "sfj" or "omni", as slave."""
    return maximum if maximum > 0.0 else MEASURED_ROUND_TRIP[slave]


LINK: list[Parameter] = parameters_of(LinkSettings(), runtime=False)
"""Of the node `link`."""
