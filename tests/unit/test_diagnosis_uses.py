"""Which recordings fit, which choose and which only show; and that nothing else is done with the last."""

from dataclasses import replace

import numpy as np
import pytest
from identification_plants import STAGE, off, stage_recording

from haptic_teleop_control.errors import RecordingError
from haptic_teleop_sysid.diagnosis import explain as explaining
from haptic_teleop_sysid.diagnosis import run as diagnosis
from haptic_teleop_sysid.diagnosis.decision.search.rounds import SearchResult
from haptic_teleop_sysid.diagnosis.inputs.plausible import refuse_constant_input, refuse_copies
from haptic_teleop_sysid.diagnosis.inputs.scales import recording_scales
from haptic_teleop_sysid.diagnosis.inputs.uses import shared_band, three_uses
from haptic_teleop_sysid.recordings.dataset import DataSet, load_dataset
from haptic_teleop_sysid.recordings.slips import Slip

DT = 0.01


def recording(name, seconds, seed=1, frequencies=(0.3, 0.7, 1.9), amplitude=1.0):
    """A data set whose input is sines of random phase, or what `frequencies` makes of the time."""
    time = DT * np.arange(round(seconds / DT))
    rng = np.random.default_rng(seed)
    if callable(frequencies):
        command = frequencies(time)
    else:
        command = sum(np.sin(2 * np.pi * (f * time + rng.uniform())) for f in frequencies)
    angle = np.cumsum(np.cumsum(command)) * DT**2
    return DataSet(
        name, "generic", "j", DT, amplitude * command, "N*m", "measured effort", angle,
        np.gradient(angle, DT), valid=np.ones(len(time), dtype=bool),
    )  # fmt: skip


def names(data):
    return [d.name for d in data]


def test_test_recordings_show_and_validation_stays_whole():
    one, two, three = (recording(n, 70.0, seed) for seed, n in enumerate("abc"))
    uses = three_uses([one], [two], [three])
    assert (names(uses.fit), names(uses.choose), names(uses.show.recordings)) == (["a"], ["b"], ["c"])
    assert "neither fitted to nor used to choose" in uses.told


def test_below_a_minute_nothing_is_kept_and_it_says_so():
    uses = three_uses([recording("a", 90.0)], [recording("b", 40.0, 2), recording("c", 19.0, 3)])
    assert names(uses.choose) == ["b", "c"]
    assert uses.show.recordings == ()
    assert "also used to choose" in uses.told


def test_the_last_third_of_a_minute_shows_and_no_sample_is_lost_or_shared():
    slips = Slip(100, 0.1, "j", 1.0), Slip(5000, 0.2, "j", 50.0)
    whole = replace(recording("b", 60.0, 2), slips=slips, problems=("old",))
    uses = three_uses([recording("a", 20.0)], [whole])
    (rest,), (kept,) = uses.choose, uses.show.recordings
    assert len(kept) == pytest.approx(2000, abs=1)
    np.testing.assert_array_equal(np.concatenate([rest.input, kept.input]), whole.input)
    np.testing.assert_allclose(np.concatenate([rest.time, kept.time]), whole.time)
    assert [s.size for s in rest.slips] == [0.1]
    assert [s.size for s in kept.slips] == [0.2]
    assert uses.problems == {"a": [], "b": ["old"]}
    assert "40.00 s" in kept.name and kept.name in uses.told


def test_whole_recordings_are_kept_where_they_make_a_third():
    three = [recording(name, 20.0, seed) for seed, name in enumerate("bcd")]
    uses = three_uses([recording("a", 20.0, 9)], three)
    assert names(uses.choose) == ["b", "c"]
    assert names(uses.show.recordings) == ["d"]


def test_a_recording_full_of_holes_is_not_cut_into_pieces_that_nothing_can_use():
    whole = recording("b", 66.0, 2)
    valid = whole.valid.copy()
    valid[4000::240] = False
    uses = three_uses([recording("a", 20.0)], [replace(whole, valid=valid)])
    assert names(uses.choose) == ["b"]
    assert uses.show.recordings == ()


def sweep(lowest, highest, seconds, logarithmic):
    def command(time):
        if logarithmic:
            rate = np.log(highest / lowest) / seconds
            return np.sin(2 * np.pi * lowest * np.expm1(rate * time) / rate)
        return np.sin(2 * np.pi * (lowest * time + (highest - lowest) * time**2 / (2 * seconds)))

    return command


@pytest.mark.parametrize("highest", [2.0, 3.0, 4.1, 5.0, 8.0])
@pytest.mark.parametrize("logarithmic", [True, False])
def test_the_end_of_a_sweep_is_not_kept_because_the_rest_lacks_its_band(highest, logarithmic):
    whole = recording("b", 90.0, 2, sweep(0.1, highest, 90.0, logarithmic))
    uses = three_uses([recording("a", 20.0)], [whole])
    assert names(uses.choose) == ["b"]
    assert "another band" in uses.told
    assert "also used to choose" in uses.told


@pytest.mark.parametrize("seed", range(5))
def test_noise_of_one_band_keeps_its_band_whatever_its_amplitude(seed):
    noise = np.random.default_rng(seed).standard_normal(6000)
    smooth = np.convolve(noise, np.ones(15) / 15.0, "same")
    part = [recording("b", 60.0, 1, lambda time: smooth)]
    rest, kept = part[0].between(0.0, 40.0), part[0].between(40.0, 60.0)
    assert shared_band([rest], [replace(kept, input=7.0 * kept.input)]) > 0.7


@pytest.mark.parametrize(
    ("first", "last"), [((0, 3000), (2000, 6000)), ((0, 6000), (3500, 4500)), ((1000, 2500), (0, 6000))]
)
def test_a_stretch_of_another_recording_is_one_that_repeats_it(first, last):
    whole = recording("whole", 60.0, 2)

    def part(name, span):
        cut = slice(*span)
        return replace(
            whole, name=name, input=whole.input[cut], motor_position=whole.motor_position[cut],
            motor_velocity=whole.motor_velocity[cut], valid=whole.valid[cut],
        )  # fmt: skip

    with pytest.raises(RecordingError, match="last holds the readings of first"):
        refuse_copies([part("first", first), part("last", last)])
    # Rest is alike in all recordings, and no copy.
    still = replace(whole, motor_position=np.zeros(len(whole)))
    refuse_copies([still, replace(still, input=still.input + 1.0)])
    # So is one speed, to which the speed of a log is rounded before the motion begins.
    after = np.sin(0.01 * np.maximum(np.arange(len(whole)) - 3000, 0))
    ramp = np.cumsum(np.full(len(whole), 0.1))
    begin = [replace(still, motor_position=ramp + k * after) for k in (1.0, -2.0)]
    refuse_copies(begin)
    with pytest.raises(RecordingError, match="once more"):
        refuse_copies([begin[0], replace(begin[0], input=np.append(begin[0].input[:-1], 1.0))])
    # And so is a second of rest that two simulations with one seed begin by.
    wander = np.cumsum(1e-5 * np.random.default_rng(1).standard_normal(len(whole)))
    refuse_copies([replace(still, motor_position=wander + k * after) for k in (1.0, -2.0)])


def test_an_input_of_one_value_is_refused_and_steps_of_several_are_not():
    one = recording("one", 20.0, 1)
    rises = np.maximum(np.arange(len(one)) - 1000.0, 0.0)  # it rests before the step
    first, second = (
        replace(one, input=size * (rises > 0.0), motor_position=rises, motor_velocity=1.0 * (rises > 0.0))
        for size in (2.4, 1.2)
    )
    rippled = replace(first, input=first.input + 1e-3 * np.sin(np.arange(len(one))))
    for steps in ([first], [rippled, first]):
        with pytest.raises(RecordingError, match=r"hardly varies \(2.* to 2.*input that changes"):
            refuse_constant_input(steps)
    refuse_constant_input([first, second])
    refuse_constant_input([one])
    refuse_constant_input([replace(one, input=20.0 + 0.01 * one.input)])  # a load is held; it turns


@pytest.fixture
def asked(monkeypatch):
    """What the search was given; it finds nothing."""
    seen = []

    def found(model, fit, learn, judge, **_):
        seen.append([(r.name, len(r)) for r in (*learn, *judge)])
        return SearchResult(fit, fit, (), (), recording_scales(model, learn))

    monkeypatch.setattr(explaining, "search", found)
    monkeypatch.setattr(explaining, "search_by_simulation", found)
    return seen


def stage_data(seed, name, disturbance=0.01):
    return replace(
        load_dataset(stage_recording(seed=seed, seconds=6.0, disturbance=disturbance), STAGE), name=name
    )


@pytest.mark.long
def test_test_recordings_change_nothing_but_what_is_shown(asked):
    estimation, validation = [stage_data(1, "e")], [stage_data(2, "v")]
    results = [
        diagnosis.diagnose(off(STAGE, 1), estimation, validation, test=test)[3]
        for test in ([], [stage_data(3, "t")], [stage_data(4, "noisy", 0.5)])
    ]
    assert all({name for name, _ in one} == {"e", "v"} for one in asked)
    for content in results:
        for model in ("given", "baseline", "augmented"):
            assert content["fit"][model]["estimation"] == results[0]["fit"][model]["estimation"]
            assert content["fit"][model]["validation"] == results[0]["fit"][model]["validation"]
        for key in ("verdict", "where", "findings", "models", "innovations", "augmented_model"):
            assert content[key] == results[0][key]
    assert results[0]["fit"]["given"]["test"] == {}
    assert results[0]["uses"]["test"] == []
    assert results[1]["fit"]["baseline"]["test"].keys() == results[1]["fit"]["baseline"]["validation"].keys()
    assert min(results[1]["fit"]["baseline"]["test"].values()) > 80.0
    assert results[2]["fit"]["baseline"]["test"] != results[1]["fit"]["baseline"]["test"]


@pytest.mark.parametrize("test", ["v", "e"])
def test_a_test_recording_that_repeats_another_one_is_refused(asked, test):
    data = {"e": stage_data(1, "e"), "v": stage_data(2, "v")}
    again = replace(data[test], name="again")
    with pytest.raises(RecordingError, match=f"again holds the readings of {test}"):
        diagnosis.diagnose(STAGE, [data["e"]], [data["v"]], test=[again])
