"""The Omni through the vendor's HD library: angles, torques, calibration, and what goes wrong."""

import itertools
import math

import numpy as np
import pytest
from openhaptics_rig import NEUTRAL, HdRig

from haptic_teleop_control.device import ReadResult
from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_omni.confirmation import confirm
from haptic_teleop_omni.transports import openhaptics

PUSH = (0.02, 0.1, -0.05)  # N·m
COUNT = 4.1e-4  # rad, of the emulated device's encoders


@pytest.fixture
def rig(em, tmp_path):
    rig = HdRig(em, tmp_path)
    rig.settle()
    yield rig
    rig.driver.close()


@pytest.mark.parametrize("pacing", ["callback", "synchronous"])
def test_angles_buttons_and_torques_go_through_the_library_in_its_units(em, tmp_path, pacing):
    rig = HdRig(em, tmp_path, openhaptics__pacing=pacing)
    rig.settle()
    rig.move((0.1, -0.2, 0.3))
    em.c.em_buttons(0, 2)
    assert rig.cycle(PUSH) is ReadResult.STATE
    assert rig.driver.position == pytest.approx((0.1, -0.2, 0.3), abs=COUNT / 2 + 1e-6)
    assert rig.driver.buttons == (False, True)
    rig.run(2, PUSH)
    assert em.torque() == pytest.approx(PUSH, abs=1e-6)
    assert rig.driver.effort == pytest.approx(PUSH, abs=1e-6)
    assert rig.driver.counter.lost == 0
    rig.driver.close()
    assert em.off()


def test_a_process_that_stood_still_asks_the_device_before_it_calls_it_silent(em, tmp_path, monkeypatch):
    rig = HdRig(em, tmp_path, openhaptics__pacing="synchronous")
    rig.settle()
    later = itertools.count(0.0, 1.0)  # s, at every look at the clock
    monkeypatch.setattr(openhaptics.time, "monotonic", lambda: next(later))
    assert rig.cycle(PUSH) is ReadResult.STATE
    assert rig.latch.latched is None
    rig.driver.close()


def test_a_torque_acts_from_the_period_after_the_state_that_it_answers(rig, em):
    rig.run(5, (0.0, 0.0, 0.0))
    rig.cycle(PUSH)
    assert not em.torque().any()
    rig.tick()
    assert em.torque() == pytest.approx(PUSH, abs=1e-6)


@pytest.mark.parametrize(("sign", "relative"), [((1.0, -1.0, 1.0), False), ((-1.0, 1.0, -1.0), True)])
def test_the_axis_map_conserves_power_whatever_it_is(em, tmp_path, sign, relative):
    rig = HdRig(em, tmp_path, openhaptics__axis_sign=list(sign), openhaptics__axis_relative_z=relative)
    rig.settle()
    before, moved = rig.driver.position.copy(), np.array([0.041, 0.082, -0.0615])  # whole counts
    for share in np.linspace(0.0, 1.0, 20):
        em.place(NEUTRAL + share * moved)
        rig.cycle(PUSH)
    rig.run(3, PUSH)
    turned = rig.driver.position - before
    assert np.dot(em.torque(), moved) == pytest.approx(np.dot(PUSH, turned), abs=2e-6)
    assert turned[0] == pytest.approx(sign[0] * moved[0], abs=1e-6)
    third = moved[2] - moved[1] if relative else moved[2]
    assert turned[2] == pytest.approx(sign[2] * third, abs=1e-6)
    rig.driver.close()


def test_no_motor_gets_more_than_the_peak_where_the_map_adds_two_axes(em, tmp_path):
    options = {"openhaptics__axis_relative_z": True, "torque__peak": 0.05, "torque__continuous": 0.04}
    rig = HdRig(em, tmp_path, **options)
    rig.settle()
    rig.run(5, (0.0, 1.0, -1.0))
    assert em.torque() == pytest.approx([0.0, 0.05, -0.05], abs=1e-6)
    rig.driver.close()


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_no_torque_beyond_what_the_maker_s_example_allows_and_none_is_claimed(rig, em, sign):
    rig.run(3, (sign,) * 3)
    assert em.torque() == pytest.approx(sign * np.array([0.2, 0.35, 0.2]), abs=1e-9)
    assert rig.driver.effort == pytest.approx(em.torque(), abs=1e-9)


def test_the_budget_weakens_an_axis_and_the_ramp_takes_it_in_as_with_any_transport(em, tmp_path):
    rig = HdRig(em, tmp_path, torque__ramp_time=0.1, torque__time=0.5, torque__peak=0.3)
    rig.settle()
    rig.run(51, (0.0, 0.3, 0.0))
    assert em.torque()[1] == pytest.approx(0.15, abs=0.004)
    rig.run(400, (0.0, 0.3, 0.0))
    assert em.torque()[1] == pytest.approx(0.3, abs=1e-6)
    rig.run(300, (0.0, 0.3, 0.0))
    assert em.torque()[1] == pytest.approx(0.119, abs=1e-6)
    rig.driver.close()


# Calibration and confirmation.


def test_without_calibration_there_are_no_states_and_no_torque_and_the_inkwell_brings_it(em, tmp_path):
    rig = HdRig(em, tmp_path)
    em.c.em_inkwell(0, 0)
    rig.run(10)
    assert {rig.cycle(PUSH) for _ in range(200)} == {ReadResult.NOTHING}
    assert em.off()
    assert not rig.driver.docked
    assert "inkwell" in rig.driver.measurements()["calibration"]
    em.c.em_inkwell(0, 1)
    results = [rig.cycle(PUSH) for _ in range(200)]
    assert ReadResult.STATE in results
    assert rig.latch.latched is None, "angles jump when the library learns them, and nobody has moved"
    assert rig.driver.position == pytest.approx([0.0] * 3, abs=COUNT)
    assert em.torque() == pytest.approx(PUSH, abs=1e-6)
    rig.driver.close()


def test_the_library_is_never_asked_to_calibrate_while_a_torque_acts(rig, em):
    rig.run(3, PUSH)
    (_, push), known = rig.packets[-1], em.c.em_updates()
    em.c.em_uncalibrate(0)
    for _ in range(150):
        rig.transport.write(push)
        em.c.em_tick()
    assert em.torque() == pytest.approx(PUSH, abs=1e-6)
    assert em.c.em_updates() == known


def test_a_calibration_that_gets_lost_while_it_drives_takes_the_torque_away(rig, em):
    rig.run(3, PUSH)
    em.c.em_uncalibrate(0)
    em.c.em_inkwell(0, 0)
    rig.run(2, PUSH)
    assert rig.latch.latched in ("calibration_lost", "over_speed")
    rig.run(2, PUSH)
    assert em.off()
    rig.reset()
    assert {rig.cycle(PUSH) for _ in range(100)} == {ReadResult.NOTHING}
    assert em.off()


@pytest.mark.parametrize("change", [{}, {"openhaptics__axis_sign": [1.0, -1.0, 1.0]}, {"serial": "EM0009"}])
def test_an_unconfirmed_device_or_axis_map_gets_no_torque(em, tmp_path, change):
    path = tmp_path / "confirmed.yaml"
    if change:
        first = HdRig(em, tmp_path)
        words, identity = first.driver.confirmation, first.transport.identity
        first.driver.close()
        if serial := change.pop("serial", None):
            path.unlink()
            confirm(path, identity.replace("EM0001", serial), words, {})
    rig = HdRig(em, tmp_path, confirmed=False, **change)
    if rig.latch.latched:
        assert rig.latch.latched == "layout_not_confirmed"
        rig.latch.reset()
    rig.settle(PUSH)
    rig.run(20, PUSH)
    assert em.off()
    assert not [packet for channel, packet in rig.packets if channel == "write"]
    assert "doctor --omni" in rig.driver.describe()
    assert not rig.driver.effort.any()
    rig.driver.close()


def test_a_file_of_confirmations_that_makes_no_sense_is_named_with_the_remedy(em, tmp_path):
    (tmp_path / "confirmed.yaml").write_text("- a\n- b\n")
    with pytest.raises(ConfigurationError, match=r"confirmed\.yaml.*doctor --omni"):
        HdRig(em, tmp_path, confirmed=False)


# What goes wrong.


def test_an_unplugged_device_is_lost_with_the_remedy_and_a_reset_brings_it_back(rig, em):
    rig.run(3, PUSH)
    em.c.em_unplug(0, 1)
    assert rig.cycle(PUSH) is ReadResult.LOST
    assert rig.latch.latched == "device_lost"
    for word in ("HD_COMM_ERROR", "internal -28", "cable", "/dev/ttyACM*", "GTDD_HOME"):
        assert word in rig.latch.sentence
    assert em.off()
    assert not em.c.em_is_open(0)
    rig.reset()
    assert rig.latch.latched == "device_lost", "it is still away"
    em.c.em_unplug(0, 0)
    rig.reset()
    rig.settle(PUSH)
    assert rig.latch.latched is None
    assert em.torque() == pytest.approx(PUSH, abs=1e-6)


def test_warm_motors_are_a_fault_that_stays_until_they_have_cooled(rig, em):
    rig.run(3, PUSH)
    em.c.em_temperature(0, 1.05)
    rig.run(2, PUSH)
    assert rig.latch.latched == "warm_motors"
    assert "let them rest" in rig.latch.sentence
    assert em.off()
    rig.run(150, PUSH)
    assert rig.driver.measurements()["motor temperature"] == "1.05 of 1"
    rig.reset()
    rig.run(5, PUSH)
    assert rig.latch.latched == "warm_motors", "still warm"
    em.c.em_temperature(0, 0.4)
    rig.reset()
    rig.run(5, PUSH)
    assert rig.latch.latched is None
    assert em.torque() == pytest.approx(PUSH, abs=1e-6)


@pytest.mark.parametrize(
    ("code", "fault", "word"),
    [
        (0x0201, "force_refused", "torque.peak"),
        (0x0203, "force_refused", "HD_EXCEEDED_MAX_VELOCITY"),
        (0x0102, "library_error", "0x0102"),
        (0x0300, "device_lost", "switch the device off and on"),
        (0x0304, "device_lost", "HD_TIMER_ERROR"),
        (0x7777, "library_error", "0x7777"),
    ],
)
def test_every_error_of_the_library_is_a_fault_and_ends_the_torque_in_the_next_period(
    rig, em, code, fault, word
):
    rig.run(3, PUSH)
    em.c.em_error(code, 0)
    em.c.em_tick()
    em.c.em_tick()
    assert em.off(), "without a word from this side"
    rig.driver.read()
    rig.driver.write(np.array(PUSH))
    assert rig.latch.latched == fault
    assert word in rig.latch.sentence
    if fault != "device_lost":
        em.c.em_tick()
    assert em.off()


def test_of_several_errors_at_once_the_gravest_counts(rig, em):
    for code in (0x0102, 0x0302, 0x0200):
        em.c.em_error(code, -28 if code == 0x0302 else 0)
    assert rig.cycle(PUSH) is ReadResult.LOST
    assert "HD_COMM_ERROR" in rig.latch.sentence


@pytest.mark.parametrize("angle", [math.nan, math.inf, 1e30])
def test_an_angle_that_is_no_number_is_no_state(rig, em, angle):
    rig.run(3, PUSH)
    position = rig.driver.position.copy()
    em.place((0.0, angle, 0.0))
    assert rig.cycle(PUSH) is ReadResult.NOTHING
    assert rig.latch.latched == "library_error"
    assert np.array_equal(rig.driver.position, position)
    rig.tick()
    assert em.off()


def test_a_driver_that_stops_answering_loses_its_torque_in_the_library(rig, em):
    rig.run(3, PUSH)
    for tick in range(40):
        em.c.em_tick()
        assert bool(em.torque().any()) is (tick < 20), tick
    assert em.off()
    rig.driver.read()
    assert rig.latch.latched == "watchdog_expired"
    rig.run(5, PUSH)
    assert em.off(), "latched"
    rig.reset()
    rig.run(5, PUSH)
    assert em.torque() == pytest.approx(PUSH, abs=1e-6)


def test_a_callback_that_comes_late_is_counted_and_the_speed_takes_the_time_into_account(rig, em):
    for sample in range(300):
        em.place(NEUTRAL + 0.0041 * sample)  # ten counts per millisecond
        rig.cycle()
    em.c.em_late(4)
    em.place(NEUTRAL + 0.0041 * 304)
    rig.cycle()
    assert rig.driver.counter.lost == 4
    assert rig.driver.velocity == pytest.approx([4.1] * 3, rel=0.02)
    assert rig.latch.latched is None


def test_a_servo_thread_that_stands_still_is_silent_and_takes_nothing_along(rig, em):
    rig.run(3, PUSH)
    rig.driver.read()  # nobody ticks
    assert rig.latch.latched == "silent"
    em.c.em_tick()
    assert em.off()
