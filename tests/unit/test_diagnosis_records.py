"""What a diagnosis makes of recordings: cut apart at holes, refused where there is nothing to learn from."""

from dataclasses import replace

import numpy as np
import pytest
from identification_plants import STAGE, stage_recording

from haptic_teleop_control.errors import RecordingError
from haptic_teleop_sysid.diagnosis.evidence.recorded_currents import Currents
from haptic_teleop_sysid.diagnosis.evidence.shown_by_current import _starts, shown_by_current
from haptic_teleop_sysid.diagnosis.inputs.plausible import refuse_copies, with_contradictions
from haptic_teleop_sysid.diagnosis.usable import records_of
from haptic_teleop_sysid.recordings.dataset import load_dataset


@pytest.fixture(scope="module")
def data():
    return load_dataset(stage_recording(seed=3, seconds=6.0), STAGE)


def holed(data, *holes):
    valid = np.ones(len(data), dtype=bool)
    for start, stop in holes:
        valid[start:stop] = False
    return replace(data, valid=valid)


def test_a_recording_without_holes_is_one_record_driven_by_the_command(data):
    (record,) = records_of([data])
    assert len(record) == len(data)
    np.testing.assert_array_equal(record.input, data.commanded_input)


def test_a_hole_cuts_a_recording_apart_and_what_happened_in_it_is_nobody_s_effect(data):
    first, second = records_of([holed(data, (1200, 1500))])
    assert (len(first), len(second)) == (1200, len(data) - 1500)
    assert second.start == pytest.approx(data.start + 1500 * data.dt)
    assert np.isfinite(second.measured).all()


@pytest.mark.parametrize(("before", "pieces"), [(250, 2), (249, 1)])
def test_pieces_that_are_too_short_to_say_anything_are_left_out(data, before, pieces):
    found = records_of([holed(data, (before, before + 50))])
    assert len(found) == pieces and len(found[-1]) == len(data) - before - 50


def test_nothing_but_short_pieces_is_refused(data):
    step = 240
    with pytest.raises(RecordingError, match="without a hole"):
        records_of([holed(data, *((k, k + 40) for k in range(step, len(data), step)))])


def test_an_angle_that_is_read_seldom_is_refused_with_what_to_do(data):
    """An encoder read at 170 Hz in a log at 1 kHz was asked to be recorded for longer."""
    seldom = holed(data, *((k + 1, k + 6) for k in range(0, len(data) - 6, 6)))
    with pytest.raises(RecordingError, match=r"read about once in 6 samples.*one row for each reading"):
        records_of([seldom])


def test_short_recordings_count_each_and_one_that_is_too_short_is_refused(data):
    """A lab that records one move after the other has many recordings of a few seconds; an arm's log of 12 s
    at 30 Hz, 363 samples, was refused."""
    n = len(data)
    moves = [replace(holed(data, (0, k), (k + 300, n)), name=f"move{k}") for k in (600, 1200, 1800)]
    assert [len(r) for r in records_of(moves)] == [300] * 3
    assert [len(r) for r in records_of(moves[:1])] == [300]
    with pytest.raises(RecordingError, match="has 200 samples without a hole"):
        records_of([*moves, holed(data, (200, n))])


@pytest.mark.parametrize(("field", "what"), [("commanded_input", "input"), ("motor_position", "motor angle")])
def test_what_does_not_change_is_named_with_its_joint(data, field, what):
    with pytest.raises(RecordingError, match=f"the {what} of stage1 does not change"):
        records_of([replace(data, **{field: np.full(len(data), 0.1)})])


def test_efforts_of_different_units_contradict_each_other(data):
    assert data.input_source == "measured effort"
    assert with_contradictions(data) is data
    milliamperes = replace(data, input=1000.0 * data.input)
    assert "another unit" in with_contradictions(milliamperes).problems[-1]


def test_an_arm_that_never_moves_beside_its_motor_is_said(data):
    dead = with_contradictions(replace(data, arm_position=np.zeros(len(data))))
    assert "its encoder is dead, or the arm is held" in dead.problems[-1]


def test_a_recording_under_another_name_proves_nothing(data):
    other = load_dataset(stage_recording(seed=4, seconds=6.0), STAGE)
    refuse_copies([data, other])
    half = {
        name: getattr(data, name)[:1500]
        for name in ("input", "commanded_input", "motor_position", "arm_position", "valid")
    }
    for again in (replace(data, name="again"), replace(data, name="again", start=data.start + 60.0)):
        with pytest.raises(RecordingError, match="again holds the readings"):
            refuse_copies([data, other, again])
    with pytest.raises(RecordingError, match="the readings of again once more"):
        refuse_copies([replace(data, name="again", **half), data])


def test_the_currents_are_asked_for_no_delay_that_a_model_may_not_have(data):
    """At 250 Hz and below, 64 samples are longer than the longest delay."""
    slow = replace(data, dt=0.01)
    found = shown_by_current(STAGE, [slow], [slow])
    assert all(one.effect.parameters["delay"] <= 0.25 for one in found if one.effect.effect == "input_delay")
    assert max(_starts("input_delay", STAGE, [slow])) > 0.2


def test_a_delay_of_a_long_recording_is_looked_for_where_the_command_changes_most():
    long = load_dataset(stage_recording(seed=3, seconds=40.0), STAGE)
    moving = np.arange(len(long)) >= 12_000
    command = np.where(moving, np.asarray(long.commanded_input), 0.0)
    noise = np.random.default_rng(1).normal(0.0, 1e-4, len(long))
    late = replace(
        long, commanded_input=command, input=np.roll(command, 17) + noise, input_source="measured effort"
    )
    best = shown_by_current(STAGE, [late], [late])[0]
    assert best.effect.effect == "input_delay"
    assert best.effect.parameters["delay"] == pytest.approx(17 * long.dt, abs=1e-4)
    currents = Currents.of(late)
    part = currents.liveliest
    assert len(part.command) == 8192 and part.good.sum() == 8192 - 64
    # It begins at a quarter of its length, and in it the command moves all the time.
    begins = np.arange(0, len(long) - 8192 + 1, 2048)
    assert any(np.array_equal(part.command, command[b : b + 8192]) for b in begins if b >= 12_000 - 2048)


def test_all_of_a_short_recording_or_of_one_with_many_holes_is_lively(data):
    short = Currents.of(replace(data, input_source="measured effort"))
    assert short.liveliest is short
    long = load_dataset(stage_recording(seed=3, seconds=40.0), STAGE)
    holed_current = np.where(np.arange(len(long)) % 3 > 0, np.nan, np.asarray(long.input))
    rare = Currents.of(replace(long, input=holed_current, input_source="measured effort"))
    assert rare.liveliest is rare
