"""A coarse converter gives another torque at each value of the input: no law and no map follows it."""

import numpy as np
import pytest
from disturbed_stage import CONSTANT, DT, RMS, TIME, dataset, fitted
from identification_plants import STAGE, multisine
from stepped_machines import RIGID, record, swing

from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.diagnosis.evidence.fine_curve import _fine, _input, follows_input_finely
from haptic_teleop_sysid.diagnosis.evidence.held_out import with_both_kinds
from haptic_teleop_sysid.diagnosis.run import diagnose
from haptic_teleop_sysid.estimation.whole_fit import fit_whole, noise_starts


def coarse(seed, step):
    """Torque (n,) that a converter with steps of `step` A adds to the command, and its rms."""
    current = multisine(len(TIME), DT, RMS, (0.2, 10.0), seed)
    added = CONSTANT * (step * np.round(current / step) - current)
    return added, float(np.std(added))


@pytest.mark.parametrize("step", [0.02, 0.06])
def test_the_torque_of_a_coarse_converter_follows_the_input_in_detail(step):
    sets = [dataset(seed, coarse(seed, step)[0]) for seed in (1, 2)]
    size = np.mean([coarse(seed, step)[1] for seed in (1, 2)])
    assert follows_input_finely(fitted(*sets)) == pytest.approx(size, rel=0.35)


def test_random_torque_as_large_and_a_bent_characteristic_do_not():
    assert follows_input_finely(fitted(*(dataset(seed) for seed in (1, 2)))) == 0.0
    noise = [0.02 * CONSTANT * np.random.default_rng(s).standard_normal(len(TIME)) for s in (5, 6)]
    assert follows_input_finely(fitted(*(dataset(s, n) for s, n in zip((1, 2), noise, strict=True)))) == 0.0
    bent = []
    for seed in (1, 2):
        current = multisine(len(TIME), DT, RMS, (0.2, 10.0), seed)
        bent.append(dataset(seed, CONSTANT * 0.1 * np.abs(current)))
    assert follows_input_finely(fitted(*bent)) < 0.01 * CONSTANT * RMS


def test_it_is_unknown_at_the_actuator_and_says_what_to_look_at():
    sets = [dataset(seed, coarse(seed, 0.02)[0]) for seed in (1, 2)]
    _, verdict, _, content = diagnose(STAGE, sets[:1], sets[1:])
    assert verdict.kind == "unknown"
    (where,) = verdict.where
    assert (where["equation"], where["condition"]) == ("stage1_actuator", "input torque")
    assert "how coarse the converter is" in content["doubt"]


def test_beside_friction_it_is_told_as_what_is_left():
    """It passed for random beside friction, and the answer was `identified`."""
    truth = STAGE.with_effects(Effect("coulomb_friction", "stage1_motor", {"torque": 0.25}))
    sets = [dataset(seed, coarse(seed, 0.03)[0], truth=truth) for seed in (1, 2)]
    _, verdict, _, _ = diagnose(STAGE, sets[:1], sets[1:])
    assert verdict.kind == "unknown"
    (where,) = verdict.where
    assert where["equation"] == "stage1_actuator"
    assert where["condition"].startswith("input torque")
    (friction,) = verdict.findings
    assert (friction["effect"], friction["location"]) == ("coulomb_friction", "stage1_motor")
    assert friction["parameters"]["torque"]["value"] == pytest.approx(0.25, rel=0.1)


def test_in_a_motion_that_repeats_itself_a_friction_is_not_the_input_s():
    """Over one sine the input has the detail of the velocity."""
    torque = 2.0 * np.sin(2.0 * np.pi * 1.3 * 0.002 * np.arange(10_000))
    records = []
    for seed in (0, 1):
        luck = 0.02 * np.random.default_rng(seed).standard_normal(len(torque))
        angle = swing(torque + luck, 0.02, 0.3, 0.4, 0.0, 0.0, 0.0, 0.0)
        records.append(record(torque, angle[:, None], 1e-5))
    bare = RIGID.with_values({"motor_inertia": 0.02, "motor_damping": 0.3})
    fit = fit_whole(bare, noise_starts(bare, records[:1])[1], records[:1], iterations=8)
    both = with_both_kinds(fit, records[:1], records[1:])
    assert _fine(both, _input) is not None
    assert follows_input_finely(both) == 0.0
