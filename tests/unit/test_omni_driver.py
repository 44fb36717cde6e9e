"""The driver of the Omni on an emulated device: angles, torques, calibration, losses, the end."""

import math
from dataclasses import replace

import numpy as np
import pytest
import yaml
from device_rigs import OmniRig, StillOmni

from haptic_teleop_control.device import DeviceError, ReadResult, Reporter
from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_omni.build import ALL_FAULTS, make_driver
from haptic_teleop_omni.driver import OmniDriver
from haptic_teleop_omni.layout import load_layout, parse_layout
from haptic_teleop_omni.settings import OmniDriverSettings
from haptic_teleop_omni.torque_budget import TorqueBudget, TorqueLimits

PUSH = (0.0, 0.1, -0.05)  # N·m
COUNT = 4.1e-4  # rad
STEP = 2.5e-4  # N·m


def idle(rig: OmniRig) -> bool:
    return not rig.device.torque.any() and not rig.device.motors_on


def test_the_first_angles_are_those_of_the_calibration_pose():
    rig = OmniRig(calibration__angles=[0.1, -0.2, 0.3])
    assert rig.cycle() is ReadResult.STATE
    assert rig.driver.position == pytest.approx([0.1, -0.2, 0.3])
    assert not rig.driver.velocity.any()


def test_angles_follow_the_device_through_the_wrap_of_its_counters():
    plant = StillOmni()
    rig = OmniRig(plant)
    for angle in np.concatenate([np.arange(0.0, 0.6, 0.01), np.arange(0.6, -0.6, -0.01)]):
        plant.angles[:] = angle  # X starts 536 counts below 2^16, Y 300 above 0
        rig.cycle()
        rig.cycle()
        assert np.abs(rig.driver.position - angle).max() <= COUNT


def test_a_steady_turn_has_its_speed():
    plant = StillOmni()
    rig = OmniRig(plant)
    for sample in range(400):
        plant.angles[:] = 0.002 * sample
        rig.cycle()
    assert rig.driver.velocity == pytest.approx([2.0] * 3, rel=0.15)  # a count per sample is 0.41 rad/s
    assert rig.driver.counter.lost == 0


def test_a_torque_arrives_in_steps_of_the_output_and_is_published_as_applied():
    rig = OmniRig()
    rig.run(3, PUSH)
    assert rig.plant.given[-1] == pytest.approx(PUSH, abs=STEP / 2)
    assert rig.driver.effort == pytest.approx(rig.plant.given[-1], abs=1e-12)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_no_torque_beyond_the_peak(sign):
    rig = OmniRig()
    rig.run(3, (5.0 * sign,) * 3)
    assert np.all(np.abs(rig.device.torque) <= 0.446)
    assert np.all(np.abs(rig.device.torque) > 0.446 - STEP)


def test_the_peak_lasts_its_time_and_then_the_axis_weakens_to_its_continuous_torque():
    rig = OmniRig(torque__time=0.5)
    rig.run(499, (0.0, 1.0, 0.0))
    assert rig.device.torque[1] > 0.44
    rig.run(20, (0.0, 1.0, 0.0))
    assert rig.device.torque[1] == pytest.approx(0.119, abs=STEP)
    assert rig.latch.latched is None


def test_a_weakened_axis_recovers_when_half_of_its_excess_is_gone():
    budget = TorqueBudget(1, TorqueLimits(peak=0.4, continuous=0.1, time=1.0, ramp_time=0.0))
    while not budget.weakened[0]:
        budget.step([0.4], 0.01)
    rests = 0
    while budget.weakened[0]:
        budget.rest(0.01)
        rests += 1
    # Half of (0.4² - 0.1²) x 1 s at 0.1² per second.
    assert rests * 0.01 == pytest.approx(0.075 / 0.01, abs=0.16)  # one step of 0.4 further than the capacity


def test_no_more_flows_for_ever_than_the_device_bears():
    with pytest.raises(ConfigurationError, match="continuous"):
        TorqueLimits(continuous=0.2)


def test_torque_ramps_in_after_a_start_and_after_every_pause():
    rig = OmniRig(torque__ramp_time=0.1)
    for _ in range(2):
        rig.run(50, (0.0, 0.2, 0.0))
        assert rig.device.torque[1] == pytest.approx(0.1, abs=0.003)
        rig.run(100, (0.0, 0.2, 0.0))
        assert rig.device.torque[1] == pytest.approx(0.2, abs=STEP)
        rig.run(1)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_torque_that_is_not_finite_is_a_fault_and_the_motors_go_off(value):
    rig = OmniRig()
    rig.run(3, PUSH)
    rig.cycle((0.0, value, 0.0))
    assert rig.latch.latched == "non_finite_command"
    assert idle(rig)
    rig.run(3, PUSH)
    assert idle(rig), "latched"
    rig.reset()
    rig.run(3, PUSH)
    assert not idle(rig)


# Calibration.


def test_in_the_inkwell_the_device_is_calibrated_after_resting_there_and_not_before():
    rig = OmniRig(calibration__method="dock", docked=0.5)
    results = [rig.cycle(PUSH) for _ in range(300)]
    assert results.index(ReadResult.STATE) == 199
    assert not any(given.any() for given in rig.plant.given[:199])


def test_a_device_that_never_was_in_its_inkwell_publishes_nothing_and_gets_no_torque():
    rig = OmniRig(calibration__method="dock", docked=0.0)
    results = {rig.cycle(PUSH) for _ in range(500)}
    assert results == {ReadResult.NOTHING}
    assert idle(rig)
    assert "inkwell" in rig.driver.describe()


def test_button_1_calibrates_while_the_device_is_held_still():
    plant = StillOmni()
    rig = OmniRig(plant, calibration__method="button", calibration__hold=0.1)
    rig.device.buttons[0] = True
    for sample in range(300):  # moving: no pose
        plant.angles[:] = 0.001 * sample
        assert rig.cycle() is ReadResult.NOTHING
    results = [rig.cycle() for _ in range(150)]
    assert ReadResult.STATE in results
    assert rig.driver.position == pytest.approx([0.0] * 3, abs=2 * COUNT)


def test_after_a_lost_device_the_calibration_begins_anew():
    rig = OmniRig(calibration__method="dock", docked=0.3)
    rig.run(250)
    assert rig.driver.calibration.done
    rig.device.unplug()
    assert rig.cycle(PUSH) is ReadResult.LOST
    assert rig.latch.latched == "device_lost"
    rig.device.plug()
    rig.reset()
    assert rig.cycle() is ReadResult.NOTHING


def test_where_the_driver_has_lost_the_angles_it_lights_the_inkwell_and_the_emulated_operator_docks_again():
    away = [0.4, 0.3, -0.2]
    rig = OmniRig(calibration__method="dock", docked=0.3)
    rig.device._renew = StillOmni
    rig.run(600, PUSH)
    assert not idle(rig)
    rig.plant.angles = np.array(away)
    rig.run(2)
    assert rig.latch.latched == "over_speed"
    rig.run(3000)
    assert rig.latch.latched == "over_speed", "nobody has reset it"
    assert rig.driver.position == pytest.approx(away, abs=2 * COUNT), "and the light is off until then"
    rig.reset()
    results = [rig.cycle(PUSH) for _ in range(2500)]
    assert rig.latch.latched is None
    # Half a second until it is noticed, a second's way, and what the calibration asks for.
    assert results.index(ReadResult.STATE) == pytest.approx(500 + 1000 + 200, abs=5)
    assert rig.driver.position == pytest.approx([0.0] * 3, abs=2 * COUNT)
    assert not idle(rig)


# Packets.


def test_lost_reports_are_counted_and_the_velocity_takes_their_time_into_account():
    plant = StillOmni()
    rig = OmniRig(plant)
    for sample in range(300):
        plant.angles[:] = 0.0041 * sample  # ten counts per millisecond
        rig.cycle()
    rig.device.drop = 4
    plant.angles[:] = 0.0041 * 304
    rig.cycle()
    assert rig.driver.counter.lost == 4
    assert rig.driver.velocity == pytest.approx([4.1] * 3, rel=0.02)
    assert rig.latch.latched is None


def test_a_late_host_takes_the_newest_report():
    plant = StillOmni()
    rig = OmniRig(plant)
    rig.run(10)
    plant.angles[:] = 0.05
    rig.clock.advance(0.03)
    rig.cycle()
    assert rig.driver.position == pytest.approx([0.05] * 3, abs=COUNT)
    assert rig.driver.late == 29


def test_a_silent_device_is_a_fault_within_its_patience_and_the_motors_go_off():
    rig = OmniRig(silence=0.02)
    rig.run(5, PUSH)
    rig.device.silent = True
    begun = rig.clock.now()
    rig.cycle(PUSH)
    assert rig.latch.latched == "silent"
    assert (rig.clock.now() - begun) * 1e-9 <= 0.0201
    assert idle(rig)


def test_single_malformed_reports_are_counted_and_several_in_a_row_are_a_fault():
    rig = OmniRig(bad_reports=3)
    rig.run(5, PUSH)
    rig.device.corrupt = 2
    rig.run(5, PUSH)
    assert rig.latch.latched is None
    assert rig.driver.malformed == 2
    rig.device.corrupt = 3
    rig.run(5, PUSH)
    assert rig.latch.latched == "malformed_report"
    assert idle(rig)


def test_a_jump_of_an_encoder_switches_the_motors_off():
    plant = StillOmni()
    rig = OmniRig(plant)
    rig.run(5, PUSH)
    plant.angles[2] = 1.0
    rig.run(2, PUSH)
    assert rig.latch.latched == "over_speed"
    assert "omni_z" in rig.latch.sentence
    assert idle(rig)


def test_after_a_jump_of_an_encoder_a_reset_asks_for_a_new_calibration():
    plant = StillOmni()
    rig = OmniRig(plant, calibration__method="button", calibration__hold=0.01)
    rig.device.buttons[0] = True
    rig.run(20)
    rig.device.buttons[0] = False
    plant.angles[2] = 1.0
    rig.run(2, PUSH)
    rig.reset()
    assert {rig.cycle(PUSH) for _ in range(50)} == {ReadResult.NOTHING}
    assert idle(rig)
    rig.device.buttons[0] = True
    rig.run(20)
    assert rig.driver.position == pytest.approx([0.0] * 3, abs=COUNT), "where it is held now"


def test_reports_that_are_older_than_the_last_do_not_move_the_angles():
    plant = StillOmni()
    rig = OmniRig(plant)
    fresh = rig.device.read
    old = fresh(1.0)
    plant.angles[:] = 0.05
    rig.run(40)
    position = rig.driver.position.copy()
    for repetition in range(2):
        rig.device.read = lambda timeout: old if timeout else None
        assert rig.cycle(PUSH) is ReadResult.NOTHING
        assert rig.driver.counter.stale == repetition + 1
    assert np.all(rig.driver.position == position)
    assert rig.latch.latched is None, "one that goes on is a fault, see bad_reports"
    rig.cycle(PUSH)
    assert rig.latch.latched == "frozen_counter"
    assert idle(rig)


def test_a_device_that_counts_its_reports_anew_has_lost_its_origin():
    rig = OmniRig(calibration__method="dock", docked=0.3)
    rig.run(2000)
    assert rig.driver.calibration.done
    rig.device._start = rig.clock.now()
    rig.device._tick = 400  # a device that began again, and is not in its inkwell
    rig.device._start -= 400 * 1_000_000
    rig.cycle(PUSH)
    assert rig.latch.latched == "counter_restart"
    assert idle(rig)
    rig.reset()
    assert {rig.cycle(PUSH) for _ in range(50)} == {ReadResult.NOTHING}
    assert idle(rig)


def test_encoders_of_different_widths_wrap_each_at_its_own():
    content = broken("input/fields/encoder_y/mask", 0xFFF)
    layout = parse_layout(content, "narrow.yaml")
    plant = StillOmni()
    rig = OmniRig(plant)
    rig.device._layout = layout
    rig.driver = OmniDriver(rig.settings, layout, rig.device, rig.reporter)
    rig.driver.open()
    for angle in np.arange(0.0, 4.0, 0.02):  # 12 bits of 4.1e-4 rad are 1.68 rad
        plant.angles[:] = angle
        rig.cycle()
        rig.cycle()
    assert rig.driver.position == pytest.approx(plant.angles, abs=2 * COUNT)


def test_an_unplugged_device_is_a_fault_and_nothing_more_is_asked_of_it():
    rig = OmniRig()
    rig.run(5, PUSH)
    rig.device.unplug()
    assert rig.cycle(PUSH) is ReadResult.LOST
    assert rig.latch.latched == "device_lost"
    assert rig.cycle(PUSH) is ReadResult.LOST
    with pytest.raises(DeviceError):
        rig.driver.open()


def test_at_the_end_the_device_is_told_to_switch_its_motors_off():
    rig = OmniRig()
    rig.run(5, PUSH)
    assert not idle(rig)
    rig.driver.close()
    assert idle(rig)
    rig.driver.close()


# Layouts.


class RealDevice:
    """A transport that claims to be a real device and fails the test when something is sent to it."""

    name = "hid"
    emulated = False
    identity = "2988:0304:T1"
    serial = "T1"

    def open(self) -> None: ...

    def read(self, timeout: float) -> bytes | None:
        return bytes(64) if timeout else None

    def write(self, report: bytes) -> None:
        pytest.fail(f"sent {report.hex()} with a layout that nobody has confirmed")

    def close(self) -> None: ...

    def describe(self) -> str:
        return "a real device"


TOUCH = load_layout("touch_hid")
OTHERS = [
    "", "true", "2988:0304:T1", TOUCH.confirmation("2988:0304:T2"), TOUCH.confirmation("").strip(),
    load_layout("emulator").confirmation("2988:0304:T1"),
    replace(TOUCH, output=replace(TOUCH.output, length=65)).confirmation("2988:0304:T1"),
]  # fmt: skip


@pytest.mark.parametrize("stated", OTHERS)
def test_without_the_words_for_this_device_and_layout_nothing_is_ever_sent_to_it(stated):
    reporter, latch = Reporter.to_latch(ALL_FAULTS)
    settings = OmniDriverSettings.from_parameters(
        {"calibration.method": "start", "layout_confirmed_for": stated}
    )
    driver = OmniDriver(settings, TOUCH, RealDevice(), reporter)
    driver.open()
    for _ in range(10):
        driver.read()
        driver.write(np.array(PUSH))
    driver.close()
    assert not driver.may_drive
    needed = f'layout_confirmed_for: "{TOUCH.confirmation("2988:0304:T1")}"'
    assert needed in driver.describe()
    assert needed in driver.measurements()["torque output"]
    assert latch.counts["layout_not_confirmed"] == (1 if stated else 0), "wrong words are no silence"
    if stated:
        assert needed in latch.sentence
        latch.reset()
        driver.reset()
        assert latch.latched == "layout_not_confirmed"


def test_the_words_that_the_refusal_spells_out_are_those_that_let_torques_through():
    device = RealDevice()
    sent: list[bytes] = []
    device.write = sent.append
    reporter, latch = Reporter.to_latch(ALL_FAULTS)
    asked = OmniDriver(OmniDriverSettings(), TOUCH, device, reporter)
    asked.open()
    text = asked.describe().split('layout_confirmed_for: "')[1].split('"')[0]
    settings = OmniDriverSettings.from_parameters({"layout_confirmed_for": text})
    driver = OmniDriver(settings, TOUCH, device, reporter)
    assert not driver.may_drive, "not before it is known which device it is"
    driver.open()
    assert driver.may_drive
    driver.close()
    assert sent and latch.latched is None
    device.identity = "2988:0304:T2"  # another one in its place
    driver.reset()
    assert not driver.may_drive
    assert latch.latched == "layout_not_confirmed"


@pytest.mark.parametrize("key", ["verified", "layout_confirmed_for"])
def test_a_layout_file_cannot_carry_the_confirmation_itself(key):
    content = broken("name", "mine") | {key: True}
    with pytest.raises(ConfigurationError, match=key) as caught:
        parse_layout(content, "mine.yaml")
    assert key != "verified" or "layout_confirmed_for" in str(caught.value)


def broken(path: str, value: object) -> dict:
    content = yaml.safe_load((load_folder() / "emulator.yaml").read_text())
    target, *keys = path.split("/")
    place = content
    for key in (target, *keys[:-1]) if keys else ():
        place = place[key]
    if value is None:
        del place[(keys or [target])[-1]]
    else:
        place[(keys or [target])[-1]] = value
    return content


def load_folder():
    from importlib.resources import files

    return files("haptic_teleop_omni") / "layouts"


@pytest.mark.parametrize(
    ("path", "value", "words"),
    [
        ("input/fields/encoder_y", None, ["input", "lacks encoder_y"]),
        ("input/fields/encoder_y/offset", 43, ["encoder_y: offset", "42"]),
        ("input/fields/encoder_y/type", "u15", ["encoder_y: type", "u16"]),
        ("input/fields/encoder_y/scale", 0, ["encoder_y: scale"]),
        ("input/fields/encoder_w", {"offset": 0, "type": "u8"}, ["encoder_w is unknown"]),
        ("output/checksum", "md5", ["checksum", "xor8"]),
        ("output/fields/torque_x/idle", 5000, ["torque_x: idle", "4095"]),
        ("output/fields/torque_x/maximum", 40000, ["torque_x: minimum", "32767"]),
        ("output/fields/motors_on/mask", 0x3F, ["motors_on: mask", "u8"]),
        ("output", None, ["output is missing"]),
    ],
)
def test_a_mistake_in_a_layout_is_named(path, value, words):
    with pytest.raises(ConfigurationError) as caught:
        parse_layout(broken(path, value), "mine.yaml")
    for word in ["mine.yaml", *words]:
        assert word in str(caught.value)


def test_a_layout_that_is_not_there_is_answered_with_those_that_are():
    with pytest.raises(ConfigurationError, match="emulator, openhaptics, touch_hid"):
        load_layout("nowhere.yaml")


def test_a_real_device_that_is_not_there_is_a_device_error_and_no_traceback():
    pytest.importorskip("hidraw", reason="hidapi is not installed")
    driver = make_driver({"device": "hardware", "transport": "hid"}, Reporter.to_latch({})[0])
    with pytest.raises(DeviceError, match=r"2988:0304.*FireWire"):
        driver.open()
