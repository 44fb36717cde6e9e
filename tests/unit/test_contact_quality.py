"""Some cells of the contact study (tests/studies/contact_quality.py), so that the laws keep what its table
says, and that the study means the scenario it speaks of."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "studies"))

import contact_scenario2
from contact_quality import DT, LAMBDA, START, WALL, Case, Merit, Plant, merit, plants, run, simulate

from haptic_teleop_control.laws import LAWS
from haptic_teleop_control.robots import STAGES
from haptic_teleop_sim.lockstep import run_scenario
from haptic_teleop_sim.scenario_parameters import check_scenario


def of_both(case: Case, law: str) -> list[Merit]:
    return next(iter(run([case], law)))


@pytest.fixture(scope="module")
def hard() -> dict[str, list[Merit]]:
    """Both laws on the nominal plant at the stiffest wall, both stages."""
    return {law: of_both(Case(Plant("nominal"), 2000.0, 1.0), law) for law in LAWS}


def test_the_thesis_law_overshoots_with_the_heavy_arm_and_the_observer_does_not(hard):
    assert hard["augmented_error"][0].overshoot > 10.0
    assert hard["augmented_error"][0].bounces >= 5
    for one in hard["disturbance_observer"]:
        assert one.overshoot <= 5.0
        assert one.bounces <= 2
        assert one.settling < 2.0


def test_the_observer_moves_freely_as_fast_as_asked_where_the_thesis_law_lags(hard):
    assert all(abs(one.speed_error) <= 0.5 for one in hard["disturbance_observer"])
    assert hard["augmented_error"][0].speed_error < -2.0


@pytest.mark.parametrize("wall", [5.0, 100.0])
def test_soft_walls_are_met_without_overshoot_too(wall):
    for one in of_both(Case(Plant("nominal"), wall, 1.0), "disturbance_observer"):
        assert one.meets_aim, one


def test_a_plant_off_by_thirty_percent_everywhere_is_still_met_within_the_aim_or_settles():
    corner = plants()[8]  # all six factors high
    assert set(corner.factors) == {1.3}
    for one in of_both(Case(corner, 500.0, 1.0), "disturbance_observer"):
        assert one.overshoot <= 5.0 and one.settling < 2.5 and abs(one.speed_error) <= 2.0


def test_the_corners_change_each_factor_as_often_up_as_down_and_any_two_independently():
    signs = [[1 if factor > 1.0 else -1 for factor in one.factors] for one in plants()[1:9]]
    for i in range(6):
        assert sum(row[i] for row in signs) == 0
        for j in range(i):
            assert sum(row[i] * row[j] for row in signs) == 0


@pytest.mark.parametrize("law", LAWS)
def test_the_study_runs_what_lockstep_runs(law):
    case = Case(Plant("nominal"), 500.0, 1.0)
    own = of_both(case, law)
    wall = {"wall.angle": WALL, "wall.stiffness": 500.0, "wall.dissipation": 1.0, "initial_angle": START}
    step = {"enabled": True, "step.enabled": True, "step.amplitude": LAMBDA * case.speed / 10.0}
    nodes = {
        "sfj_sim": {f"{stage}.{key}": value for stage in STAGES for key, value in wall.items()},
        "omni_sim": {},
        "signal_generator": {f"{stage}.{key}": value for stage in STAGES for key, value in step.items()},
        "force_controller": {"law": law, "ramp_time": 0.0, "align.speed": 10.0},
    }
    time_, _ = simulate(case, LAWS[law].from_parameters({}, STAGES, DT))
    states = run_scenario(check_scenario(nodes), len(time_) * DT)["/sfj/joint_states"]
    shown = np.stack([states.position, states.velocity, states.effort], axis=1)
    for stage, one in zip(STAGES, own, strict=True):
        there = merit(case, stage, states.time(), shown)
        assert there.bounces == pytest.approx(one.bounces, abs=1)
        assert there.overshoot == pytest.approx(one.overshoot, abs=1.5)
        assert there.speed_error == pytest.approx(one.speed_error, abs=0.1)
        assert there.free_rms == pytest.approx(one.free_rms, abs=0.5)


def test_in_scenario_2_the_nominal_omni_presses_as_asked_and_another_as_its_torque_constant_says():
    nominal, weak = contact_scenario2.Device("nominal"), contact_scenario2.Device("weak", torque_constant=0.7)
    for axis, one in contact_scenario2.merits(100.0, 0.1, nominal).items():
        assert one is not None and one.settled == pytest.approx(0.1, abs=1e-3), axis
        assert abs(one.speed_error) <= 2.0 and one.bounces == 0 and one.settling < 1.0
        assert one.overshoot > 5.0 and not one.meets_aim  # the moving mass
    off = contact_scenario2.merits(100.0, 0.1, weak)["omni_z"]
    assert off is not None and off.settled == pytest.approx(0.07, abs=2e-3)


def test_the_corners_of_scenario_2_are_balanced_too():
    signs = np.array(
        [
            [one.inertia, one.damping, one.friction, one.spring, one.torque_constant]
            for one in contact_scenario2.devices()[1:9]
        ]
    )
    np.testing.assert_array_equal((signs > 1.0).sum(axis=0), 4)
    np.testing.assert_allclose(np.cov((signs - 1.0).T), np.eye(5) * 0.72 / 7.0, atol=1e-12)
