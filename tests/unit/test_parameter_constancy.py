"""Recordings of two machines are told from those of one whose parameters are merely off."""

from dataclasses import replace

import pytest
from identification_plants import STAGE, off, stage_recording

from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.diagnosis.decision.name_tests.parameter_constancy import apart, inconstant
from haptic_teleop_sysid.diagnosis.run import diagnose
from haptic_teleop_sysid.diagnosis.usable import records_of
from haptic_teleop_sysid.estimation.whole_fit import fit_from_scratch
from haptic_teleop_sysid.recordings.dataset import load_dataset

#: The same stage with a third more inertia at the motor.
OTHER = STAGE.with_values({"motor_inertia": 1.33 * STAGE.parameters["motor_inertia"]})


def recorded(truth, seed, disturbance=0.01):
    return load_dataset(stage_recording(truth, seed=seed, seconds=8.0, disturbance=disturbance), STAGE)


@pytest.mark.parametrize(("truth", "disturbance"), [(STAGE, 0.01), (STAGE, 0.05), (OTHER, 0.01)])
def test_recordings_of_one_machine_agree_whatever_it_is(truth, disturbance):
    learn, judge = (records_of([recorded(truth, seed, disturbance)]) for seed in (1, 2))
    assert inconstant(fit_from_scratch(off(STAGE, 1), learn), judge) is None


@pytest.mark.long
def test_those_of_two_machines_are_unknown_and_the_parameter_is_named():
    _, verdict, _, content = diagnose(STAGE, [recorded(STAGE, 1)], [recorded(OTHER, 2)])
    assert verdict.kind == "unknown"
    assert "recordings disagree about the parameters" in content["doubt"]
    assert "motor inertia" in content["doubt"]
    assert content["parameters_moved"] == []


def records(truth, seed, name):
    found = records_of([recorded(truth, seed)])
    return [replace(record, name=name) for record in found]


def test_two_machines_among_the_estimation_recordings_are_named():
    learn = [*records(STAGE, 1, "first"), *records(OTHER, 2, "second")]
    doubt = apart(fit_from_scratch(off(STAGE, 1), learn), learn)
    assert doubt is not None and doubt.place is None
    assert "motor inertia" in doubt.why and "first and second" in doubt.why
    # Whichever is given first.
    turned = [*learn[::-1]]
    assert apart(fit_from_scratch(off(STAGE, 1), turned), turned) is not None


def test_estimation_recordings_of_one_machine_agree():
    learn = [*records(OTHER, 1, "first"), *records(OTHER, 2, "second")]
    baseline = fit_from_scratch(off(STAGE, 1), learn)
    assert apart(baseline, learn) is None
    assert apart(baseline, learn[:1]) is None, "one recording cannot disagree with itself"


def test_physics_that_is_missing_in_both_is_no_other_machine():
    """Strong dry friction looks like another damping at each speed."""
    rubbing = OTHER.with_effects(Effect("coulomb_friction", STAGE.location("motor"), {"torque": 0.5}))
    learn = [*records(rubbing, 1, "first"), *records(rubbing, 2, "second")]
    assert apart(fit_from_scratch(off(STAGE, 1), learn), learn) is None
