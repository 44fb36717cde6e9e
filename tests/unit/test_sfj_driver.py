"""The driver of the 2DSFJ on an emulated board: signs, limits, switches, faults, the end."""

import math

import numpy as np
import pytest
from device_rigs import SfjRig, StillRobot

from haptic_teleop_2dsfj.board_settings import BoardSettings
from haptic_teleop_2dsfj.build import make_driver
from haptic_teleop_2dsfj.emulated_electronics import Electronics
from haptic_teleop_2dsfj.settings import SfjDriverSettings
from haptic_teleop_2dsfj.stage_settings import StageSettings
from haptic_teleop_control.device import DeviceError, ReadResult, Reporter
from haptic_teleop_control.errors import ConfigurationError

PUSH = (2.0, 0.4)  # N·m
STEP = 20.0 / 4096 * 0.5  # A per step of a 12-bit output over ±10 V at 0.5 A/V


def off(rig: SfjRig) -> bool:
    """Nothing flows, neither now nor at the next sample, and the enable lines say disabled."""
    return not rig.hil.volts.any() and not any(rig.hil.amplifier_on)


def test_a_positive_effort_is_a_counter_clockwise_current_and_a_negative_voltage():
    rig = SfjRig()
    rig.run(3, PUSH)
    assert rig.hil.volts[0] == pytest.approx(-2.0 * 2.0 / 8.925, abs=STEP)
    assert rig.plant.given[-1] == pytest.approx((2.0 / 8.925, 0.4 / 1.392), abs=STEP)


def test_what_is_measured_is_what_flows_with_the_sign_of_the_command():
    rig = SfjRig()
    rig.run(4, PUSH)
    flowing = rig.plant.given[-1]
    steps = 20.0 / 2**14 * 2.0  # A per step of a 14-bit input at 2 A/V
    assert rig.driver.effort[0] == pytest.approx(flowing[0] * 8.925, abs=steps * 8.925)
    assert rig.driver.effort[2] == pytest.approx(flowing[1] * 1.392, abs=steps * 1.392)


def test_angles_come_from_the_counters_through_100_80_and_6_23():
    plant = StillRobot()
    rig = SfjRig(plant)
    rig.cycle()
    plant.angles[:] = [0.05, 0.04, -0.05, -0.08]
    for _ in range(400):
        rig.driver.read()
    turn = 2.0 * math.pi / 4096
    resolution = [turn / 100, turn / 6.23, turn / 80, turn / 6.23]
    assert np.all(np.abs(rig.driver.position - plant.angles) <= np.array(resolution))
    assert rig.driver.effort[1] == pytest.approx(3.971 * 0.01, abs=3.971 * resolution[1])
    assert rig.driver.effort[3] == pytest.approx(3.891 * 0.03, abs=3.891 * resolution[3])
    assert np.abs(rig.driver.velocity).max() < 1e-6


def test_the_pose_at_the_start_is_zero_whatever_the_counters_held():
    rig = SfjRig(StillRobot(np.array([0.7, 0.7, -0.3, -0.3])))
    rig.cycle()
    assert np.all(rig.driver.position == 0.0)


def test_counters_that_wrap_give_continuous_angles():
    plant = StillRobot()
    rig = SfjRig(
        plant, Electronics(counter_bits=16), board__counter_bits=16,
        supervisor__highest_speed=1e6, stage1__deflection_trip=1.0,
    )  # fmt: skip
    turn = 2.0 * math.pi / 409_600
    for count in range(0, 70_000, 10_000):  # passes 2^15
        plant.angles[0] = plant.angles[1] = count * turn
        rig.cycle()
        assert rig.driver.position[0] == pytest.approx(count * turn, abs=1e-12)


def test_before_the_first_command_the_amplifier_is_off():
    rig = SfjRig()
    rig.run(5)
    assert off(rig)


@pytest.mark.parametrize(("effort", "limit"), [((50.0, 0.0), 0.94), ((0.0, -50.0), 1.2)])
def test_more_than_the_motor_carries_never_flows(effort, limit):
    rig = SfjRig()
    rig.run(3, effort)
    strongest = max(abs(value) for value in rig.plant.given[-1])
    assert limit - STEP < strongest <= limit


def test_without_a_word_the_recommended_current_is_the_limit():
    rig = SfjRig(stage1__current_limit=StageSettings.nominal("stage1").current_limit,
                 stage2__current_limit=StageSettings.nominal("stage2").current_limit)  # fmt: skip
    rig.run(20, (50.0, -50.0))
    assert 0.5 - STEP < np.abs(rig.plant.given).max() <= 0.5, "thesis 2.4.4"


def test_a_limit_above_the_motor_s_is_refused():
    with pytest.raises(ConfigurationError, match=r"stage2\.current_limit is 1\.3 A.*1\.2 A"):
        SfjDriverSettings.from_parameters({"stage2.current_limit": 1.3})


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_an_effort_that_is_not_finite_is_a_fault_and_the_amplifier_goes_off(value):
    rig = SfjRig()
    rig.run(3, PUSH)
    rig.cycle((value, 0.4))
    assert rig.latch.latched == "non_finite_command"
    assert off(rig)


def test_the_drift_correction_flows_on_top_of_every_command_but_only_while_there_is_one():
    rig = SfjRig(stage1__drift_correction=0.05)
    rig.run(3, (0.0, 0.0))
    assert rig.plant.given[-1][0] == pytest.approx(0.05, abs=STEP)
    rig.run(2)
    assert rig.plant.given[-1] == (0.0, 0.0)


def test_a_correction_of_the_sense_takes_its_offset_away():
    plant = StillRobot(sensed=np.array([-0.015, -0.02]))
    rig = SfjRig(plant, stage1__current_sense__correction=-0.015)
    rig.run(2)
    assert abs(rig.driver.measured[0]) < 0.0013  # half a step of the input
    assert rig.driver.measured[1] == pytest.approx(-0.02, abs=0.0013)


def test_the_slew_limit_holds_for_every_sample():
    rig = SfjRig(stage1__current_slew=10.0)
    rig.run(30, (50.0, 0.0))
    currents = [given[0] for given in rig.plant.given]
    assert max(np.diff(currents)) <= 10.0 / 500.0 + STEP
    assert max(currents) == pytest.approx(20 * 10.0 / 500.0 + 8 * 10.0 / 500.0, abs=0.05)


def test_i2t_trips_when_its_time_at_the_limit_is_over_and_not_before():
    rig = SfjRig(stage1__i2t__time=0.2, stage1__i2t__continuous=0.3, supervisor__frozen_time=10.0)
    rig.run(99, (50.0, 0.0))
    assert rig.latch.latched is None
    rig.run(3, (50.0, 0.0))
    assert rig.latch.latched == "overload"
    assert "STAGE 1" in rig.latch.sentence
    assert off(rig)


@pytest.mark.parametrize("late", [0.0, 0.009])
def test_i2t_trips_at_the_same_time_however_many_samples_are_missed(late):
    rig = SfjRig(
        stage1__i2t__time=0.5,
        stage1__i2t__continuous=0.3,
        board__watchdog=0.2,
        supervisor__frozen_time=10.0,
    )
    while rig.latch.latched is None and rig.clock.now() < 2e9:
        rig.clock.advance(late)
        rig.cycle((50.0, 0.0))
    assert rig.latch.latched == "overload"
    assert rig.clock.now() * 1e-9 == pytest.approx(0.5, abs=0.015)


def test_the_continuous_current_flows_for_ever():
    rig = SfjRig(stage1__i2t__time=0.05, stage1__i2t__continuous=0.3)
    rig.run(2000, (0.3 * 8.925, 0.0))
    assert rig.latch.latched is None


# The board.


def test_a_stalled_loop_meets_the_watchdog_and_stays_off_until_reset():
    rig = SfjRig()
    rig.run(5, PUSH)
    assert any(rig.plant.given[-1])
    rig.clock.advance(0.1)
    passed = len(rig.plant.given)
    rig.cycle(PUSH)
    stalled = rig.plant.given[passed:]
    flowing = sum(1 for given in stalled if any(given)) * 0.002
    assert 0.018 <= flowing <= 0.024, "the board itself went to 0 V after 20 ms, long before the program woke"
    assert rig.latch.latched == "watchdog_expired"
    assert rig.driver.missed >= 48
    rig.run(3, PUSH)
    assert off(rig)
    rig.reset()
    rig.run(3, PUSH)
    assert any(rig.plant.given[-1])


def test_an_unplugged_board_is_a_fault_and_comes_back_with_a_reset():
    rig = SfjRig()
    rig.run(3, PUSH)
    rig.hil.unplug()
    assert rig.cycle(PUSH) is ReadResult.LOST
    assert rig.latch.latched == "board_error"
    assert rig.cycle(PUSH) is ReadResult.LOST
    rig.reset()
    assert rig.latch.latched == "board_error", "still unplugged"
    rig.hil.plug()
    rig.reset()
    rig.run(3, PUSH)
    assert rig.latch.latched is None
    assert any(rig.plant.given[-1])


@pytest.mark.parametrize(
    "call", ["task_read", "watchdog_reload", "write_analog", "write_digital", "task_get_buffer_overflows"]
)
def test_whatever_call_the_board_refuses_the_output_is_zero_and_its_code_is_named(call):
    rig = SfjRig()
    if call != "write_digital":
        rig.run(3, PUSH)
    rig.hil.refuse(call, -1073)
    rig.run(2, PUSH)
    assert rig.latch.latched == "board_error"
    assert call in rig.latch.sentence
    assert "-1073" in rig.latch.sentence
    assert off(rig)
    assert not rig.hil.opened, "the board was released"


@pytest.mark.parametrize(
    "call", ["open", "set_encoder_counts", "task_create_reader", "watchdog_start", "task_start"]
)
def test_a_board_that_refuses_to_start_is_released_with_its_outputs_off(call):
    rig = SfjRig()
    rig.driver.close()
    rig.hil.refuse(call, -5)
    with pytest.raises(DeviceError, match="-5"):
        rig.driver.open()
    assert off(rig)
    assert not rig.hil.opened


@pytest.mark.parametrize("broken", ["write_analog", "write_digital", "task_stop", "watchdog_stop"])
def test_closing_goes_on_when_one_of_its_steps_fails(broken):
    rig = SfjRig()
    rig.run(3, PUSH)
    rig.hil.refuse(broken, -1)
    rig.driver.close()
    assert not rig.hil.opened
    rig.clock.advance(0.03)  # what could not be written the board's watchdog does
    rig.hil.open("q8", "0")
    assert off(rig)


def test_a_killed_driver_leaves_its_board_to_the_watchdog_and_the_next_one_can_use_it():
    rig = SfjRig()
    rig.run(5, PUSH)
    assert all(rig.hil.amplifier_on)
    rig.clock.advance(0.021)
    heir = rig.board()
    rig.hil.open("q8", "0")
    assert off(rig), "before anybody has written anything"
    heir.open()
    assert off(rig)
    heir.read()
    assert heir.reload_watchdog()
    heir.enable(True)
    heir.write(-0.5, 0.0)
    assert rig.hil.volts[0] == pytest.approx(-0.5, abs=STEP)


def test_a_watchdog_that_expires_between_a_sample_and_its_output_is_no_lost_board():
    plant = StillRobot()
    rig = SfjRig(plant)
    rig.run(5, PUSH)
    plant.angles[:] = 0.01
    rig.driver.read()
    rig.clock.advance(0.03)
    rig.driver.write(np.array(PUSH))
    assert rig.latch.latched == "watchdog_expired"
    assert off(rig)
    rig.reset()
    rig.run(3, PUSH)
    assert any(rig.plant.given[-1])
    assert rig.driver.position == pytest.approx([0.01] * 4, abs=3e-4), "the origin of the angles is kept"


def test_an_expired_board_takes_no_output_until_its_watchdog_is_cleared():
    rig = SfjRig()
    rig.cycle()
    rig.clock.advance(0.03)
    for call in (lambda: rig.driver.board.write(0.5, 0.5), lambda: rig.driver.board.enable(True)):
        with pytest.raises(DeviceError, match="watchdog has expired"):
            call()
    rig.driver.board.rearm_watchdog()
    rig.driver.board.enable(True)
    assert all(rig.hil.amplifier_on)


def test_a_plant_that_does_not_exist_is_named():
    with pytest.raises(ConfigurationError, match=r"emulated\.plant is 'nothing:there'"):
        make_driver({"device": "emulated", "emulated.plant": "nothing:there"}, Reporter.to_latch({})[0])


# What sensors may show.


@pytest.mark.parametrize(
    ("spoil", "fault"),
    [
        (lambda rig: rig.plant.angles.__setitem__(slice(0, 2), [1.0, 1.0]), "encoder_jump"),
        (lambda rig: setattr(rig.plant, "sensed", np.array([math.nan, 0.0])), "non_finite_measurement"),
    ],
)
def test_one_impossible_sample_is_enough(spoil, fault):
    rig = SfjRig()
    rig.run(5, PUSH)
    spoil(rig)
    rig.run(2, PUSH)
    assert rig.latch.latched == fault
    assert off(rig)
    assert np.isfinite(rig.driver.effort).all()


def test_an_arm_that_is_bent_too_far_stops_the_drive():
    plant = StillRobot()
    rig = SfjRig(plant)
    for angle in np.arange(0.0, 0.5, 0.05):
        plant.angles[0] = angle
        rig.cycle((0.0, 0.0))
    assert rig.latch.latched == "deflection"


def test_an_amplifier_without_power_is_found_within_its_time():
    plant = StillRobot(sensed=np.zeros(2))
    rig = SfjRig(plant)
    rig.run(40, (5.0, 0.0))
    assert rig.latch.latched == "amplifier"


def test_a_dead_encoder_is_found_when_almost_all_current_flows():
    rig = SfjRig()
    rig.run(140, (50.0, 0.0))
    assert rig.latch.latched == "encoder_frozen"
    assert "STAGE 1" in rig.latch.sentence


def test_a_drive_that_presses_against_a_wall_with_all_its_current_is_not_taken_for_a_dead_encoder():
    plant = StillRobot()
    rig = SfjRig(plant, stage2__current_limit=0.5)
    rig.run(3, (0.0, 1.0))
    for _ in range(20):  # 0.11 rad, 0.43 of the 0.7 N·m: friction holds the rest
        plant.angles[2] += 0.0055
        rig.cycle((0.0, 1.0))
    rig.run(1000, (0.0, 1.0))
    assert rig.latch.latched is None
    # Bent against its current: the drive has turned, and its encoder is silent.
    plant.angles[2:] = [0.0, 0.11]
    rig.driver.encoders.reset()
    rig.run(140, (0.0, 1.0))
    assert rig.latch.latched == "encoder_frozen"


def test_missed_samples_are_counted_and_the_velocity_takes_their_time_into_account():
    plant = StillRobot()
    rig = SfjRig(plant, board__watchdog=0.2)
    for sample in range(300):
        rig.cycle()
        plant.angles[:] = 0.004 * (sample + 1)  # 2 rad/s
    rig.clock.advance(0.02)
    plant.angles[:] = 0.004 * 309  # ten samples after the last, which showed 299
    rig.cycle()
    assert rig.driver.missed == 9
    assert rig.driver.velocity == pytest.approx([2.0] * 4, rel=0.02)


def test_a_channel_named_twice_is_refused():
    with pytest.raises(ConfigurationError, match=r"board\.encoders names a channel twice"):
        BoardSettings(encoders=(0, 1, 2, 2))


def test_a_watchdog_shorter_than_two_samples_is_refused():
    with pytest.raises(ConfigurationError, match=r"board\.watchdog"):
        BoardSettings(rate=100.0, watchdog=0.01)


def test_a_closed_board_is_asked_nothing():
    rig = SfjRig()
    board = rig.board()
    with pytest.raises(DeviceError, match="not open"):
        board.read()
