"""What the diagnosis finds where nothing is hidden: recordings simulated from the fit, and what has to exceed
them."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_rigs import MODEL, explanation, fit_of, joint_record
from identification_plants import STAGE, stage_recording

from haptic_teleop_control.errors import RecordingError
from haptic_teleop_sim.kernel import pack
from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.diagnosis import explain as explaining
from haptic_teleop_sysid.diagnosis import input_times
from haptic_teleop_sysid.diagnosis import run as diagnosis
from haptic_teleop_sysid.diagnosis.believed import alarm
from haptic_teleop_sysid.diagnosis.decision.search.decide import Choice
from haptic_teleop_sysid.diagnosis.decision.search.nulls import Null, beyond_chance, nulls
from haptic_teleop_sysid.diagnosis.decision.search.rounds import SearchResult
from haptic_teleop_sysid.diagnosis.decision.words import chance_sentence
from haptic_teleop_sysid.diagnosis.evidence.null_records import (
    disturbed_as,
    levels_of,
    null_dataset,
    null_record,
)
from haptic_teleop_sysid.diagnosis.inputs.scales import recording_scales
from haptic_teleop_sysid.diagnosis.usable import records_of, sense_follows
from haptic_teleop_sysid.estimation.likelihood import innovations
from haptic_teleop_sysid.estimation.whole_fit import fit_from_scratch
from haptic_teleop_sysid.recordings.dataset import load_dataset


@pytest.fixture(scope="module")
def fitted():
    record = joint_record(11)
    return fit_from_scratch(MODEL, [record]), record


def test_a_null_recording_is_estimated_as_the_recording_that_it_stands_for(fitted):
    fit, record = fitted
    null = null_record(fit, disturbed_as(fit, record), record, np.random.default_rng(2))
    again = fit_from_scratch(MODEL, [null])
    # A torque that is forgotten within a sample or two acts by its size and its memory together.
    power = [f.noise.motor_torque**2 * f.noise.motor_time for f in (fit, again)]
    assert power[1] == pytest.approx(power[0], rel=0.4)
    for name, value in again.model.parameters.items():
        assert value == pytest.approx(fit.model.parameters[name], rel=0.03), name
    # The observer is as surprised by it; the likelihood knows levels only relative to each other.
    power = [
        np.mean(innovations(pack(fit.model), fit.noise, r).innovation[200:] ** 2, axis=0)
        for r in (record, null)
    ]
    np.testing.assert_allclose(power[1], power[0], rtol=0.15)
    # Readings lie on the encoders' grid, and two draws are two recordings.
    steps = null.measured / np.array(record.resolution)
    np.testing.assert_allclose(steps, np.rint(steps), atol=1e-6)
    other = null_record(fit, disturbed_as(fit, record), record, np.random.default_rng(3))
    assert not np.array_equal(other.measured, null.measured)


def test_readings_that_are_missing_are_missing_in_a_null_recording(fitted):
    fit, record = fitted
    holed = replace(record, measured=record.measured.copy())
    holed.measured[100:120, 1] = np.nan
    null = null_record(fit, fit.noise, holed, np.random.default_rng(2))
    assert np.array_equal(np.isnan(null.measured), np.isnan(holed.measured))


@pytest.fixture(scope="module")
def stage():
    """Two data sets of stage 1 whose current comes late, and the re-estimated structure."""
    late = STAGE.with_effects(Effect("input_delay", "stage1_actuator", {"delay": 0.01}))
    data = [
        load_dataset(stage_recording(truth, seed=s, seconds=8.0), STAGE)
        for s, truth in ((1, late), (2, STAGE))
    ]
    return data, fit_from_scratch(STAGE, records_of(data[1:]))


def test_a_null_data_set_is_what_the_model_makes_of_the_same_command(stage):
    (data, _), fit = stage
    holed = replace(data, valid=np.ones(len(data), dtype=bool))
    holed.valid[1500:1700] = False
    null = null_dataset(fit, holed, levels_of(fit, holed), np.random.default_rng(1))
    np.testing.assert_array_equal(null.commanded_input, data.commanded_input)
    np.testing.assert_array_equal(null.valid, holed.valid)
    made, given = (records_of([d]) for d in (null, holed))
    assert [(r.start, len(r)) for r in made] == [(r.start, len(r)) for r in given]
    assert not np.array_equal(made[0].measured, given[0].measured)
    speed = np.gradient(null.motor_position, null.dt)[200:1400]
    assert np.std(null.motor_velocity[200:1400] - speed) < 0.3 * np.std(speed)
    # What the current differs by from its command says nothing of the actuator any more.
    assert sense_follows([null]) == sense_follows([data])
    left = null.input - null.commanded_input
    assert np.std(left) == pytest.approx(np.std(data.input - data.commanded_input))
    change = np.gradient(null.commanded_input)
    assert abs(np.corrcoef(left, change)[0, 1]) < 0.1


def test_a_model_that_runs_away_has_no_nulls(stage):
    (data, _), fit = stage
    pushed = replace(data, commanded_input=1e307 * np.sign(data.commanded_input))
    with pytest.raises(RecordingError, match="leave --nulls out"):
        null_dataset(fit, pushed, [fit.noise], np.random.default_rng(1))


@pytest.mark.long
def test_nulls_go_through_the_diagnosis_itself(stage, monkeypatch):
    """Through the same functions, with data sets in place of the recordings."""
    (data, other), fit = stage
    seen = []

    def explain(model, estimation, validation, say):
        seen.append((model, estimation, validation))
        result = SearchResult(fit, fit, (), (), recording_scales(STAGE, records_of([other])))
        records = [records_of(part) for part in (estimation, validation)]
        course = explaining.Course.of(fit.model, [*estimation, *validation])
        said = explaining.search_groups(model, *records, result.scales)
        second_method = explaining.judge_groups(said, result.scales, lambda m: (0.5, 0.5), (0.5, 0.5))
        horizons = explaining.Horizons((course,), 1)
        parts = (course, horizons, result, result, False, second_method, 10.0)
        return explaining.Explained(model, *records, *parts)

    monkeypatch.setattr(input_times, "explain", explain)
    diagnosis.diagnose(STAGE, [data], [other], null_count=0)
    found = explain(STAGE, [data], [other], None)
    chance = nulls(alarm, STAGE, found.result, [data], [other], 2, jobs=1)
    assert len(chance) == 2
    assert [len(e) for _, e, _ in seen] == [1, 1, 1, 1]
    for _, estimation, validation in seen[2:]:
        np.testing.assert_array_equal(estimation[0].commanded_input, data.commanded_input)
        assert not np.array_equal(validation[0].motor_position, other.motor_position)


@pytest.mark.long
def test_nothing_hidden_raises_no_alarm(stage):
    (_, data), fit = stage
    other = load_dataset(stage_recording(seed=3, seconds=6.0), STAGE)
    result = SearchResult(fit, fit, (), (), recording_scales(STAGE, records_of([data])))
    (found,) = nulls(alarm, STAGE, result, [data], [other], 1, jobs=1)
    assert not found.alarm
    assert found.score < 20.0


def result_of(*scores, by_current=0.0):
    choices = [
        Choice(replace(explanation("coulomb_friction", s, 1.0), by_current=by_current), 1.0) for s in scores
    ]
    scales = recording_scales(MODEL, [joint_record(1, seconds=1.0)])
    return SearchResult(fit_of(), choices[-1].chosen.fit, tuple(choices), (), scales)


def test_what_chance_finds_as_well_is_dropped_with_all_that_came_after_it():
    chance = [Null(25.0, True), Null(3.0, False)]
    assert len(beyond_chance(result_of(100.0, 50.0), chance).choices) == 2
    left = beyond_chance(result_of(100.0, 20.0, 60.0), chance)
    assert len(left.choices) == 1
    assert left.final is left.choices[0].chosen.fit
    none = beyond_chance(result_of(20.0), chance)
    assert none.choices == ()
    assert none.final is none.baseline


def test_what_the_currents_show_is_not_judged_by_the_motion():
    chance = [Null(25.0, True)]
    assert len(beyond_chance(result_of(20.0, by_current=15.0), chance).choices) == 1


def test_something_without_a_name_has_to_exceed_chance_as_well():
    result = result_of(100.0)
    weak, strong = (
        replace(result, nameless=Choice(explanation("steep_drag", s, 0.0, coefficient=1.0), 1.0))
        for s in (20.0, 200.0)
    )
    chance = [Null(25.0, False)]
    assert beyond_chance(weak, chance).nameless is None
    assert beyond_chance(strong, chance).nameless is strong.nameless
    assert beyond_chance(replace(strong, choices=result_of(10.0).choices), chance).nameless is None


def test_what_chance_took_away_is_told():
    found = {"scores": [2.0, 25.0], "alarms": 1, "dropped": ["coulomb_friction at stage1_motor"]}
    said = chance_sentence(found)
    assert "a log-likelihood of 25.0; coulomb_friction at stage1_motor did not exceed" in said
    assert chance_sentence({**found, "dropped": []}).endswith("25.0")
