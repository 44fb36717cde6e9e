"""Where only a measured input was recorded, its noise is nothing unknown; a fast input is no noise."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_rigs import DRAG, borne_out, unimpressed
from identification_plants import STAGE, stage_recording

from haptic_teleop_sysid.diagnosis.decision.name_tests.doubt import doubted
from haptic_teleop_sysid.diagnosis.decision.search.rounds import SearchResult
from haptic_teleop_sysid.diagnosis.hypotheses.explanation import Explanation
from haptic_teleop_sysid.diagnosis.inputs.scales import recording_scales
from haptic_teleop_sysid.estimation.records import record_from
from haptic_teleop_sysid.estimation.whole_fit import fit_from_scratch
from haptic_teleop_sysid.recordings.dataset import load_dataset


def recorded(seed, highest, truth=STAGE):
    """A data set whose command is all that is known of its input; nothing random acts."""
    band = (0.2, highest)
    recording = stage_recording(truth, seed=seed, seconds=10.0, rms=0.15, band=band, disturbance=0.0)
    data = load_dataset(recording, STAGE)
    return replace(data, input=data.commanded_input, commanded_input=None)


@pytest.fixture(scope="module")
def tried():
    """An effect that gains much where it was fitted, and does not hold elsewhere."""
    dragged = STAGE.with_effects(DRAG)
    fit = fit_from_scratch(dragged, [record_from(recorded(1, 4.0, dragged))])
    return Explanation(fit, 45.0, -50.0, True, 0)


def doubt_of(kinds, tried):
    baseline = fit_from_scratch(STAGE, kinds[0])
    result = SearchResult(baseline, baseline, (), (tried,), recording_scales(STAGE, kinds[0]))
    return doubted(result, *kinds, unimpressed, borne_out)[1]


def with_hidden(data, share):
    """The record of a data set in which a slow torque acts that its input lacks, as a share of that (rms)."""
    record = record_from(data)
    hidden = share * np.std(record.input) * np.sin(6.0 * record.dt * np.arange(len(record)))
    return replace(record, input=record.input - hidden)


@pytest.mark.parametrize(("share", "unknown"), [(0.0, False), (0.3, True)])
def test_what_noise_of_a_measured_current_makes_an_effect_gain_is_nothing_unknown(tried, share, unknown):
    """Without a command effects follow the noise of the current: that was an alarm on clean joints."""
    kinds = []
    for seed in (7, 8):
        data = recorded(seed, 4.0)
        noise = 0.05 * float(np.sqrt(np.mean(data.input**2)))
        sensed = data.input + noise * np.random.default_rng(seed).standard_normal(len(data))
        record = with_hidden(replace(data, input=sensed), share)
        assert record.input_noise == pytest.approx(noise, rel=0.1)
        kinds.append([record])
    assert (doubt_of(kinds, tried) is not None) == unknown


def test_a_fast_input_without_noise_is_not_taken_for_noise(tried):
    """A log's input may be the command itself, with frequencies up to a fifth of its rate."""
    kinds = [[with_hidden(recorded(seed, 100.0), 0.03)] for seed in (7, 8)]
    assert kinds[0][0].input_noise > 0.1 * np.std(kinds[0][0].input)
    assert doubt_of(kinds, tried) is not None
