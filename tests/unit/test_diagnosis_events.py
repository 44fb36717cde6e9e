"""What acts at some times, or at one frequency, is said to do so, with the times and the frequency."""

import re
from dataclasses import replace

import numpy as np
import pytest
from disturbed_stage import DT, SECONDS, TIME, dataset, fitted
from identification_plants import STAGE

from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.diagnosis.decision.reasons import Doubt, momentary, rather_event, slipped
from haptic_teleop_sysid.diagnosis.decision.search.decide import Choice
from haptic_teleop_sysid.diagnosis.evidence import null_records
from haptic_teleop_sysid.diagnosis.evidence.events import _lines, bursts, moment, steady_line
from haptic_teleop_sysid.diagnosis.evidence.null_records import heavy_tailed
from haptic_teleop_sysid.diagnosis.evidence.whiteness import heaviness
from haptic_teleop_sysid.diagnosis.hypotheses.explanation import Explanation
from haptic_teleop_sysid.diagnosis.run import diagnose
from haptic_teleop_sysid.diagnosis.usable import records_of
from haptic_teleop_sysid.estimation.whole_fit import fit_from_scratch, fit_whole


def at_times(times, length, torque):
    return torque * np.any([(t <= TIME) & (t + length > TIME) for t in times], axis=0)


@pytest.fixture(scope="module")
def quiet():
    return fitted(dataset(1), dataset(2))


def test_nothing_stands_out_where_nothing_is_hidden(quiet):
    assert bursts(quiet) is None
    assert steady_line(quiet) is None
    assert heavy_tailed(quiet) is None
    assert rather_event(Doubt(None, "why", "throughout"), quiet) == Doubt(None, "why", "throughout")


def test_bursts_are_found_when_they_come():
    times = [[4.0, 9.5, 17.2], [2.2, 8.1]]
    sets = [dataset(i + 1, at_times(t, 0.15, 0.3)) for i, t in enumerate(times)]
    found = bursts(fitted(*sets))
    assert found.condition == "time"
    for expected, intervals in zip(times, found.intervals, strict=True):
        assert len(intervals) == len(expected)
        for t, (start, end) in zip(expected, intervals, strict=True):
            assert start < t + 0.15
            assert t - 0.1 <= start
            assert end < t + 0.6
    doubt = rather_event(Doubt(None, "why", "throughout"), fitted(*sets))
    assert (doubt.condition, doubt.intervals) == ("time", found.intervals[0])
    assert "2 more times" in doubt.why


def slow_bursts(seed, torque):
    """Torque (n,) of random bursts, each some tenths of a second of slow noise."""
    rng = np.random.default_rng(seed)
    slow = np.convolve(rng.standard_normal(len(TIME)), np.ones(8) / np.sqrt(8), "same")
    return torque * slow * np.any([(t <= TIME) & (t + 0.5 > TIME) for t in rng.uniform(1, 19, 5)], axis=0)


@pytest.mark.parametrize(("place", "torque"), [("at_arm", 0.02), ("added", 0.06)])
def test_slow_torques_that_come_and_go_are_seen_below_the_rounding_of_encoders(place, torque):
    sets = [dataset(seed, **{place: slow_bursts(seed, torque)}) for seed in (1, 2)]
    fits = fitted(*sets)
    assert heavy_tailed(fits) == ("added", "at_arm").index(place)
    _, verdict, _, _ = diagnose(STAGE, sets[:1], sets[1:])
    assert verdict.kind == "unknown"
    (where,) = verdict.where
    assert where["equation"] == ("stage1_motor" if place == "added" else "stage1_arm")
    assert "time" in where["condition"]


def test_a_joint_that_rests_half_of_the_time_is_not_now_and_then_disturbed():
    rests = (TIME % 4.0 < 2.0).astype(float)
    assert heavy_tailed(fitted(*(dataset(seed, driven=rests) for seed in (1, 2)))) is None


def test_a_coarse_encoder_whose_axis_is_slow_is_not_now_and_then_disturbed():
    """At 1 kHz it errs by the same for many samples: that was an alarm where nothing was hidden."""
    fits = []
    for seed in (1, 2):
        (record,) = records_of([dataset(seed)])
        step = 20.0 * record.resolution[1]
        measured = record.measured.copy()
        measured[:, 1] = step * np.round(measured[:, 1] / step)
        coarse = replace(record, measured=measured, resolution=(record.resolution[0], step))
        fits.append((fit_from_scratch(STAGE, [coarse]), [coarse]))
    assert max(heaviness(fits).values()) > 1.0, "sums are heavy"
    assert heavy_tailed(fits) is None, "as those of simulated recordings are"


@pytest.mark.parametrize(("largest", "told"), [(6.9, None), (0.6, 1)])
def test_one_simulated_recording_in_which_sums_are_small_is_no_proof(monkeypatch, quiet, largest, told):
    """An arm that rests for a second on an edge of its encoder's step errs otherwise than in its middle: sums
    of one simulated recording were a third of the next one's, and a clean recording was an alarm."""
    simulated = iter([0.4, 0.4, largest, *([0.4] * 20)])
    monkeypatch.setattr(
        null_records, "heaviness", lambda fits: {(1, 32): 1.5 if fits is quiet else next(simulated)}
    )
    assert heavy_tailed(quiet) == told


def test_what_happens_where_the_motor_is_far_out_says_so():
    # A torque of bursts whenever the motor is far out: time is not when, the angle is.
    sets = []
    for seed in (1, 2):
        angle = dataset(seed).motor_position
        far = np.abs(angle) > np.quantile(np.abs(angle), 0.93)
        noise = np.random.default_rng(seed).normal(size=len(TIME))
        sets.append(dataset(seed, 0.4 * noise * np.resize(far, len(TIME))))
    assert bursts(fitted(*sets)).condition == "large motor angle"


@pytest.mark.parametrize("frequency", [3.3, 17.0, 71.5])
def test_a_hum_is_heard_at_its_frequency(frequency):
    sets = [dataset(s, 0.03 * np.sin(2 * np.pi * frequency * TIME + s)) for s in (1, 2)]
    assert steady_line(fitted(*sets)) == pytest.approx(frequency, abs=1.0 / SECONDS)


def test_friction_is_no_hum():
    truth = STAGE.with_effects(Effect("coulomb_friction", "stage1_motor", {"torque": 0.1}))
    assert steady_line(fitted(dataset(1, truth=truth), dataset(2, truth=truth))) is None


def test_the_multiples_of_a_single_tone_are_its_answer_and_no_hum():
    rng = np.random.default_rng(1)
    time = 0.002 * np.arange(10000)
    drive = np.sin(2 * np.pi * 1.5 * time)
    noise = rng.standard_normal((10000, 2))
    third = noise + 0.8 * np.sin(2 * np.pi * 4.5 * time)[:, None]
    other = noise + 0.8 * np.sin(2 * np.pi * 17.2 * time)[:, None]
    assert _lines(third, drive, 0.002) == []
    assert _lines(other, drive, 0.002) == [pytest.approx(17.2)]


def test_what_is_gained_at_one_moment_is_told_from_what_is_gained_always():
    friction = Effect("coulomb_friction", "stage1_motor", {"torque": 0.05})
    records = records_of([dataset(1, truth=STAGE.with_effects(friction))])
    before = fit_from_scratch(STAGE, records)
    after = fit_whole(STAGE.with_effects(friction), before.noise, records, iterations=15)
    assert moment(before, after, records) is None
    assert moment(before, before, records) is None
    # An encoder that slipped and was not put back is explained by whatever absorbs the jump.
    (steady,) = records_of([dataset(1)])
    measured = steady.measured.copy()
    measured[round(9.0 / DT) :, 1] += 0.02
    slid = [replace(steady, measured=measured)]
    before = fit_from_scratch(STAGE, slid)
    mode = Effect("extra_flexible_mode", "stage1_arm", {"frequency": 6.0, "inertia": 0.05})
    after = fit_whole(STAGE.with_effects(mode), before.noise, slid, iterations=15)
    assert after.log_likelihood > before.log_likelihood + 20.0
    assert moment(before, after, slid) == pytest.approx(9.0, abs=0.5)
    named = Explanation(after, 50.0, 50.0, True, 0)
    why, condition = momentary(Choice(named, 1.0), before, slid, slid)
    assert float(re.search(r"happened at (\S+) s", why)[1]) == pytest.approx(9.0, abs=0.5)
    assert condition == "time"
    # A stop may be touched just once.
    stop = Effect("hard_stop", "stage1_arm", {"angle": 0.2, "stiffness": 50.0})
    assert momentary(Choice(replace(named, beside=stop), 1.0), before, slid, slid) is None


@pytest.mark.long
def test_a_slip_that_was_put_back_is_unknown_and_not_another_machine():
    sets = [dataset(1, slip=7.0), dataset(2)]
    _, verdict, _, content = diagnose(STAGE, sets[:1], sets[1:])
    assert verdict.kind == "unknown"
    assert verdict.where[0]["equation"] == "stage1_arm_encoder"
    assert verdict.where[0]["condition"] == "time"
    assert verdict.where[0]["intervals"] == [[pytest.approx(7.0), pytest.approx(7.0)]]
    assert "slipped or lost counts" in content["doubt"]
    assert min(content["fit"]["baseline"]["validation"].values()) > 90.0


def test_slips_of_several_recordings_are_counted():
    doubt = slipped([dataset(1), dataset(2, slip=3.0), dataset(3, slip=4.0)])
    assert "2 times in all" in doubt.why
    assert doubt.intervals == ()
    assert slipped([dataset(1)]) is None
