"""Codec and limits of the drivers for any input that a machine can hold."""

import math
import struct
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

sys.path.insert(0, str(Path(__file__).parents[1] / "unit"))
from device_rigs import OmniRig, SfjRig

from haptic_teleop_2dsfj.amplifier import Amplifier
from haptic_teleop_2dsfj.build import all_faults
from haptic_teleop_2dsfj.driver import SfjDriver
from haptic_teleop_2dsfj.encoders import EncoderBank
from haptic_teleop_2dsfj.overload import Overload
from haptic_teleop_2dsfj.settings import SfjDriverSettings
from haptic_teleop_control.device import Reporter
from haptic_teleop_omni.codec import ReportCodec, raw_of, value_of
from haptic_teleop_omni.layout import Field, Report, load_layout
from haptic_teleop_omni.torque_budget import TorqueBudget, TorqueLimits
from haptic_teleop_omni.tracking import PacketCounter, Unwrapper

ANY = st.floats(allow_nan=True, allow_infinity=True)
REPORTS = [load_layout(name) for name in ("emulator", "openhaptics", "touch_hid")]
DIRECTIONS = [report for layout in REPORTS for report in (layout.input, layout.output)]
NUMBERED = Report(
    9, 3, "xor8",
    {"a": Field("a", 1, "u16", shift=5, mask=0x7FF, invert=True), "b": Field("b", 1, "u8", mask=0x1F),
     "c": Field("c", 3, "i32")},
)  # fmt: skip


@given(st.data())
def test_what_is_encoded_is_decoded_again(data):
    report = data.draw(st.sampled_from([*DIRECTIONS, NUMBERED]))
    values = {
        name: data.draw(st.integers(*field.limits), label=name) for name, field in report.fields.items()
    }
    codec = ReportCodec(report)
    encoded = codec.encode(values)
    assert len(encoded) == report.length
    assert codec.decode(encoded) == values


@given(st.sampled_from([*DIRECTIONS, NUMBERED]), st.binary(max_size=80))
def test_any_bytes_decode_to_values_within_the_fields_or_to_a_reason(report, data):
    codec = ReportCodec(report)
    values = codec.decode(data)
    if values is None:
        assert codec.problem
        return
    assert len(data) == report.length
    for name, value in values.items():
        assert abs(value) < 1 << report.fields[name].bits


@given(st.binary(min_size=44, max_size=44))
def test_the_emulator_s_input_agrees_with_an_independent_reading_of_its_words(data):
    words = struct.unpack("<22H", data)
    values = ReportCodec(REPORTS[0].input).decode(data)
    assert [values[f"encoder_{axis}"] for axis in "xyz"] == list(words[2:5])
    assert [values[f"gimbal_{axis}"] for axis in "xyz"] == [word >> 5 for word in words[5:8]]
    status = words[9] >> 8
    assert values["button_1"] == 1 - (status & 1)
    assert values["docked"] == 1 - (status >> 2 & 1)
    assert values["counter"] == words[16] | words[17] << 16


@given(ANY, st.floats(0.0, 1.0))
def test_a_raw_torque_never_means_more_than_its_limit(value, limit):
    field = REPORTS[0].output.fields["torque_x"]
    raw = raw_of(field, value, limit)
    assert field.limits[0] <= raw <= field.limits[1]
    assert abs(value_of(field, raw)) <= limit
    if not math.isfinite(value):
        assert raw == field.idle
    elif abs(value) <= min(limit, 0.5) - 2.5e-4:
        assert value_of(field, raw) == pytest.approx(value, abs=1.26e-4)


@given(st.lists(st.integers(-30_000, 30_000), max_size=60), st.sampled_from([16, 24, 32]), st.integers(0))
def test_counters_that_wrap_give_back_the_way_that_was_gone(steps, bits, start):
    span = 1 << bits
    raw = Unwrapper([bits])
    raw.step([start % span])
    bank = EncoderBank([1.0], bits)
    way = 0
    for step in steps:
        way += step
        raw.step([(start + way) % span])
        bank.step([(way + span // 2) % span - span // 2])
    assert raw.total == [way]
    assert bank.angle[0] == way


@given(st.lists(st.integers(1, 1000), max_size=60), st.integers(0, 2**32 - 1))
def test_a_packet_counter_knows_how_many_were_lost(periods, start):
    counter = PacketCounter(32)
    counter.step(start)
    now = start
    for elapsed in periods:
        now += elapsed
        assert counter.step(now % 2**32) == elapsed
    assert counter.lost == sum(periods) - len(periods)


@given(st.lists(st.integers(0, 2**32 - 1), max_size=60), st.sampled_from([1, 8, 16, 32]))
def test_a_packet_counter_takes_any_numbers_and_counts_each_report_once(numbers, bits):
    counter = PacketCounter(bits)
    steps = [counter.step(number % 2**bits) for number in numbers]
    assert all(step >= -1 for step in steps)
    assert steps.count(0) == counter.repeated + counter.stale
    assert steps.count(-1) == counter.restarts
    assert sum(step - 1 for step in steps if step > 0) == counter.lost


@given(st.integers(1, 1000), st.integers(0, 2**32 - 1))
def test_a_report_that_is_older_than_the_last_is_not_taken_and_changes_nothing(age, start):
    counter = PacketCounter(32)
    counter.step(start)
    assert counter.step((start - age) % 2**32) == 0
    assert counter.stale == 1
    assert counter.step((start + 1) % 2**32) == 1


@given(ANY, st.floats(0.01, 1.2), st.sampled_from([-1, 1]))
def test_the_amplifier_s_voltage_never_means_more_than_the_limit(current, limit, sign):
    amplifier = Amplifier(command_sign=sign)
    step = 20.0 / 4096
    volts = amplifier.volts(current, limit, step, 9.99)
    assert math.isfinite(volts)
    assert abs(amplifier.commanded(volts)) <= limit
    assert volts / step == pytest.approx(round(volts / step), abs=1e-6)
    if math.isfinite(current) and abs(current) < limit - step:
        assert amplifier.commanded(volts) == pytest.approx(current, abs=0.26 * step)


@given(st.lists(st.tuples(ANY, ANY), max_size=12))
def test_whatever_is_commanded_the_2dsfj_gets_a_finite_current_within_its_limits(commands):
    rig = SfjRig()
    for command in commands:
        rig.cycle(command)
    rig.cycle()
    for first, second in rig.plant.given:
        assert abs(first) <= 0.94
        assert abs(second) <= 1.2
    if any(not math.isfinite(value) for command in commands for value in command):
        assert rig.latch.latched == "non_finite_command"


MOMENTS = st.lists(
    st.tuples(
        st.tuples(ANY, ANY) | st.tuples(st.floats(-9.0, 9.0), st.floats(-2.0, 2.0)) | st.none(),
        st.tuples(*[st.sampled_from([1, 1, 1, 0])] * 4),
        st.sampled_from([0.0, 0.0, 0.003, 0.01, 0.05]),
        st.booleans(),
    ),
    max_size=25,
)


@given(MOMENTS, st.floats(0.05, 0.94), st.floats(-0.2, 0.2), st.floats(1.0, 1000.0))
def test_no_mixture_of_commands_switches_pauses_and_resets_passes_a_limit(moments, limit, drift, slew):
    rig = SfjRig(
        stage1__current_limit=limit, stage1__drift_correction=drift, stage1__current_slew=slew,
        limit_switches__debounce=1,
    )  # fmt: skip
    for command, levels, pause, reset in moments:
        rig.hil.stuck.update(enumerate(levels))
        rig.clock.advance(pause)
        if reset:
            rig.reset()
        rig.cycle(command)
        flowing = [
            -0.5 * volts if on else 0.0 for volts, on in zip(rig.hil.volts, rig.hil.amplifier_on, strict=True)
        ]
        for stage, (current, most) in enumerate(zip(flowing, (limit, 1.2), strict=True)):
            assert abs(current) <= most
            assert not (current > 0.0 and levels[2 * stage] == 0), "towards MAX, which is pressed"
            assert not (current < 0.0 and levels[2 * stage + 1] == 0), "towards MIN, which is pressed"
        if rig.latch.latched or command is None:
            assert flowing == [0.0, 0.0]
            assert not any(rig.hil.amplifier_on)
    assert rig.latch.counts["board_error"] == 0
    for first, second in rig.plant.given:
        assert abs(first) <= limit
        assert abs(second) <= 1.2


class AnyBoard:
    """A board that delivers what a test says, and remembers the volts of its outputs."""

    def __init__(self, settings, samples) -> None:
        self.settings, self._samples = settings, list(samples)
        self.counts, self.sense_volts = np.zeros(4, dtype=np.int32), np.zeros(2)
        self.switch_levels = np.ones(4, dtype=np.int8)
        self.periods, self.enabled, self.volts = 1, False, (0.0, 0.0)
        self.lag, self.sampling = None, ""

    def open(self) -> None: ...

    def read(self) -> None:
        counts, volts, levels, self.periods = self._samples.pop(0)
        self.counts[:], self.sense_volts[:], self.switch_levels[:] = counts, volts, levels

    def write(self, first: float, second: float) -> None:
        self.volts = (first, second)

    def enable(self, on: bool) -> None:
        self.enabled = on

    def reload_watchdog(self) -> bool:
        return True

    def watchdog_expired(self) -> bool:
        return False

    def rearm_watchdog(self) -> None: ...

    def close(self) -> None:
        self.enabled = False


SAMPLES = st.tuples(
    st.tuples(*[st.integers(-(2**31), 2**31 - 1) | st.integers(-50, 50)] * 4),
    st.tuples(ANY, ANY) | st.just((0.0, 0.0)),
    st.tuples(*[st.integers(-128, 127)] * 4) | st.just((1, 1, 1, 1)),
    st.integers(1, 2**31) | st.just(1),
)


@given(st.lists(SAMPLES, min_size=1, max_size=20))
def test_whatever_a_board_delivers_the_driver_goes_on_and_its_states_are_finite(samples):
    settings = SfjDriverSettings.from_parameters({})
    reporter, latch = Reporter.to_latch(all_faults())
    board = AnyBoard(settings.board, samples)
    driver = SfjDriver(settings, board, reporter)
    driver.open()
    for _, sense, _, _ in samples:
        driver.read()
        driver.write(np.array([2.0, 0.4]))
        for values in (driver.position, driver.velocity, driver.effort):
            assert np.isfinite(values).all()
        if not np.isfinite(sense).all():
            assert latch.latched
        if latch.latched:
            assert not board.enabled


@given(st.lists(st.binary(min_size=44, max_size=44), max_size=20))
def test_whatever_reports_a_device_sends_the_states_are_finite_and_the_torque_within_its_peak(reports):
    rig = OmniRig()
    pending = list(reports)
    rig.device.read = lambda timeout: pending.pop(0) if pending and timeout else None
    for _ in reports:
        rig.cycle((0.1, 9.0, -9.0))
        for values in (rig.driver.position, rig.driver.velocity, rig.driver.effort):
            assert np.isfinite(values).all()
        assert np.abs(rig.device.torque).max() <= 0.446
        if rig.latch.latched:
            assert not rig.device.motors_on


@given(st.lists(st.tuples(ANY, ANY, ANY), max_size=12))
def test_whatever_is_commanded_the_omni_gets_a_finite_torque_within_its_peak(commands):
    rig = OmniRig()
    for command in commands:
        rig.cycle(command)
    rig.cycle()
    for torque in rig.plant.given:
        assert np.all(np.abs(torque) <= 0.446)


@given(st.lists(st.binary(max_size=60), max_size=20))
def test_whatever_bytes_a_device_sends_the_driver_goes_on_and_its_states_are_finite(reports):
    rig = OmniRig()
    pending = list(reports)
    rig.device.read = lambda timeout: pending.pop(0) if pending and timeout else None
    for _ in reports:
        rig.cycle((0.1, 0.1, 0.1))
        assert np.isfinite(rig.driver.position).all()
        assert np.isfinite(rig.driver.velocity).all()


@given(st.lists(st.floats(0.0, 2.0), min_size=1, max_size=200))
def test_i2t_trips_exactly_when_the_excess_does(currents):
    overload = Overload(0.5, 1.0, 0.2)
    excess, tripped = 0.0, False
    for current in currents:
        excess = max(0.0, excess + (current**2 - 0.25) * 0.01)
        tripped = overload.step(current, 0.01)
        assert tripped == (excess > 0.75 * 0.2)


@given(st.lists(st.floats(-10.0, 10.0), min_size=1, max_size=300))
def test_the_torque_s_long_term_heat_is_bounded(torques):
    limits = TorqueLimits(peak=0.4, continuous=0.1, time=0.1, ramp_time=0.0)
    budget = TorqueBudget(1, limits)
    flowed = [budget.step([torque], 0.01)[0] for torque in torques]
    heat = sum(value**2 - 0.01 for value in flowed) * 0.01
    assert max(abs(value) for value in flowed) <= 0.4
    assert heat <= (0.16 - 0.01) * 0.1 + 0.16 * 0.01
