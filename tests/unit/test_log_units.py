"""Units and headers as people write them mean what they say, and nothing else is understood."""

import math

import pytest

from haptic_teleop_sysid.logs.headers import split_header, words_of
from haptic_teleop_sysid.logs.units import unit_of

TURN = 2.0 * math.pi


@pytest.mark.parametrize(
    ("texts", "factor", "quantity"),
    [
        (("ms", "msec", "milliseconds"), 1e-3, "time"),
        (("us", "µs"), 1e-6, "time"),
        (("deg", "°", "degrees"), TURN / 360, "angle"),
        (("rev", "turns", "U"), TURN, "angle"),
        (("rpm", "1/min", "min^-1", "U/min", "rev/min"), TURN / 60, "angular velocity"),
        (("deg/s", "°/s", "deg*s^-1", "deg s⁻¹", "dps"), TURN / 360, "angular velocity"),
        (("rad/s", "rad s^-1"), 1.0, "angular velocity"),
        (("Nmm", "N*mm", "N·mm", "mNm", "mN*m"), 1e-3, "torque"),
        (("Nm", "N m", "N.m", "N·m"), 1.0, "torque"),
        (("kgf*cm",), 0.0980665, "torque"),
        (("lbf*in",), 0.112984829, "torque"),
        (("mm/s",), 1e-3, "velocity"),
        (("mA",), 1e-3, "current"),
        (("counts", "ticks", "inc"), 1.0, "count"),
        (("%", "percent", "pct"), 0.01, "share of full drive"),
        (("pu",), 1.0, "share of full drive"),
    ],
)
def test_a_unit_is_known_in_every_spelling(texts, factor, quantity):
    for text in texts:
        unit = unit_of(text)
        assert unit is not None, text
        assert unit.factor == pytest.approx(factor, rel=1e-9)
        assert unit.quantity == quantity


@pytest.mark.parametrize(
    "text", ["", "foo", "nm", "9**9**9**9", "__import__('os')", "m" * 1000, "deg/", "Hz", "s^9", "()"]
)
def test_what_is_no_unit_is_none(text):
    assert unit_of(text) is None


def test_a_gain_carries_one_unit_to_another():
    volts, gain = unit_of("V"), unit_of("N*m/V")
    assert volts is not None and gain is not None
    assert (volts * gain).quantity == "torque"


@pytest.mark.parametrize(
    ("header", "label", "unit"),
    [
        ("time [ms]", "time", "ms"),
        ("torque (Nmm)", "torque", "Nmm"),
        ("t / ms", "t", "ms"),
        ("angle_deg", "angle", "deg"),
        ("speed_rad_per_s", "speed", "rad/s"),
        ("time_s", "time", "s"),
        ("q_m", "q_m", ""),  # the motor's angle, no length
        ("i_A", "i_A", ""),
        ("x[1]", "x[1]", ""),
        ("angle (measured)", "angle (measured)", ""),
    ],
)
def test_a_header_is_told_from_its_unit(header, label, unit):
    assert split_header(header) == (label, unit)


def test_the_words_of_a_name_are_found():
    assert words_of("motorPos_2") == ("motor", "pos", "2")
    assert words_of("Actual Position") == ("actual", "position")
