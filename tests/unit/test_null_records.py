"""Encoders that are coarse for how little a joint moves colour the innovations of a true model, and what they
show is no physics."""

from dataclasses import replace

import numpy as np
from identification_plants import STAGE, stage_recording
from stepped_machines import RIGID, swing
from stepped_machines import record as stepped

from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.diagnosis.evidence.null_records import expected_colour, rounding_shows
from haptic_teleop_sysid.diagnosis.evidence.whiteness import colour
from haptic_teleop_sysid.diagnosis.hypotheses.explanation import Explanation
from haptic_teleop_sysid.estimation.records import record_from
from haptic_teleop_sysid.estimation.whole_fit import fit_from_scratch, fit_whole
from haptic_teleop_sysid.recordings.dataset import load_dataset

RIPPLE = Effect("torque_ripple", "stage1_motor", {"amplitude": 0.1, "order": 20.0, "phase": 0.0})
FRICTION = Effect("coulomb_friction", "stage1_motor", {"torque": 0.05})


def record(*effects, coarser=1.0):
    recording = stage_recording(STAGE.with_effects(*effects), seed=1, seconds=12.0, rms=0.05, band=(0.2, 4.0))
    made = record_from(load_dataset(recording, STAGE), commanded=True)
    steps = coarser * np.array(made.resolution)
    return replace(made, resolution=tuple(steps), measured=np.rint(made.measured / steps) * steps)


def test_coarse_encoders_colour_innovations_as_much_as_simulated_ones():
    coarse = [record(coarser=100.0)]
    fit = fit_from_scratch(STAGE, coarse)
    assert colour(fit, coarse) > 200.0
    assert colour(fit, coarse) < 2.0 * expected_colour(fit, coarse)


def test_what_is_missing_colours_more_than_the_encoders():
    rippled = [record(RIPPLE)]
    fit = fit_from_scratch(STAGE, rippled)
    assert colour(fit, rippled) > 2.0 * expected_colour(fit, rippled)


def test_what_is_there_does_not_show_where_it_is_not():
    rubbed = [record(FRICTION)]
    before = fit_from_scratch(STAGE, rubbed)
    after = fit_whole(STAGE.with_effects(FRICTION), before.noise, rubbed, iterations=20)
    gain = after.log_likelihood - before.log_likelihood
    assert gain > 100.0
    assert not rounding_shows(Explanation(after, gain, gain, True, 0), before, rubbed)
    # What gains no more than the simulated recordings do with it is the encoders'.
    assert rounding_shows(Explanation(after, -1e3, 0.0, True, 0), before, rubbed)


def test_noise_levels_are_no_merit_of_what_was_found():
    """A pendulum that swings out after a push, read coarsely: its gravity seemed to show on recordings
    without it, too, by noise levels that the model without it was not begun with."""
    push = np.zeros(7500)
    push[200:500] = -1.5
    swung = stepped(push, swing(push, 0.14, 0.02, 0.1, 4.0, 0.0, 0.0, 0.0)[:, None], 1e-5)
    swung = replace(swung, measured=0.003 * np.rint(swung.measured / 0.003), resolution=(0.003, 1.0))
    before = fit_from_scratch(RIGID, [swung])
    gravity = Effect("gravity", "j_motor", {"torque": 4.0, "phase": 0.0})
    after = fit_whole(before.model.with_effects(gravity), before.noise, [swung])
    gain = after.log_likelihood - before.log_likelihood
    assert gain > 100.0
    assert not rounding_shows(Explanation(after, gain, gain, True, 0), before, [swung])
