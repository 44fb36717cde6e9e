"""The observer, and recordings simulated with nothing hidden, know the springs and the gravity of the given
model."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_rigs import MODEL, RIGID
from scipy.linalg import expm
from simulated_recordings import DT, recorded

from haptic_teleop_sim.kernel import pack, simulate
from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.diagnosis.evidence.null_records import null_record
from haptic_teleop_sysid.estimation.likelihood import innovations
from haptic_teleop_sysid.estimation.noise import NoiseModel, linearised
from haptic_teleop_sysid.estimation.whole_fit import _at, _equations, fit_from_scratch

HELD = replace(
    RIGID,
    parameters={"torque_constant": 1.0, "motor_inertia": 0.01, "motor_damping": 0.01},
    effects=(Effect("spring_to_ground", "j_motor", {"stiffness": 40.0}),),
)
#: Disturbances that the observer takes a long time to follow, as the search by simulation has them.
SLOW = NoiseModel(0.01, 0.01, 1e-4, 1e-4, 0.5, 0.5)


def test_the_observer_of_an_arm_on_a_spring_does_not_overflow():
    """Of an arm that nobody reads: an observer that thinks it free feeds its oscillation."""
    held = MODEL.with_effects(Effect("spring_to_ground", "stage1_arm", {"stiffness": 200.0}))
    record = recorded(held, seconds=120.0, dt=0.01)
    noise = NoiseModel(1e-4, 1e-2, 1e-4, 1e-4, 0.5, 0.5)
    found = innovations(pack(held), noise, record)
    assert np.max(np.abs(found.innovation)) < 0.05 * np.nanmax(np.abs(record.measured))
    free = replace(noise, reference=(*pack(held).linear[:5], 0.0, 0.0))
    assert not np.max(np.abs(innovations(pack(held), free, record).innovation)) < 1e3


@pytest.mark.parametrize(
    ("effect", "side", "parameters", "stiffness"),
    [
        ("spring_to_ground", "motor", {"stiffness": 2.0, "rest": 0.3}, 2.0),
        ("spring_to_ground", "arm", {"stiffness": 2.0, "rest": 0.3}, 2.0),
        ("gravity", "arm", {"torque": 3.0, "phase": 0.4}, 3.0 * np.cos(0.4)),
        ("gravity", "arm", {"torque": 3.0, "phase": np.pi}, -3.0),
        ("constant_torque", "motor", {"torque": 3.0}, 0.0),
    ],
)
def test_the_linearisation_has_the_stiffness_against_the_ground(effect, side, parameters, stiffness):
    plain, _ = linearised(pack(MODEL))
    sprung, _ = linearised(pack(MODEL.with_effects(Effect(effect, f"stage1_{side}", parameters))))
    place, inertia = {"motor": ((2, 0), "motor_inertia"), "arm": ((3, 1), "arm_inertia")}[side]
    assert plain[place] - sprung[place] == pytest.approx(stiffness / MODEL.parameters[inertia])
    changed = np.argwhere(plain != sprung)
    assert all(tuple(c) == place for c in changed)


def test_the_linearisation_is_the_motion_of_the_model():
    a, _ = linearised(pack(HELD))
    start = np.array([1e-3, 0.0, 2e-3, 0.0])
    path = simulate(HELD, np.zeros(200), DT, start)
    keep = [0, 2]
    expected = expm(199 * DT * a[np.ix_(keep, keep)]) @ start[keep]
    np.testing.assert_allclose(path.states[-1, keep], expected, rtol=1e-3, atol=5e-6)


def test_a_simulated_null_stays_where_the_recording_is():
    """Without the spring the disturbances carried it away."""
    record = recorded(HELD)
    fit = fit_from_scratch(HELD, [record])
    noise = replace(fit.noise, motor_torque=0.05, motor_time=5.0)
    null = null_record(fit, noise, record, np.random.default_rng(2))
    away = null.measured[:, 0] - record.measured[:, 0]
    # A torque of 0.05 N·m that lasts holds a spring of 40 N·m/rad 1.25 mrad away.
    assert np.std(away) < 4.0 * 0.05 / 40.0
    assert np.std(null.measured[:, 0]) == pytest.approx(np.std(record.measured[:, 0]), rel=0.1)


def test_the_gradient_by_the_spring_knows_that_the_gain_depends_on_it():
    record = recorded(HELD, seconds=4.0)
    name = "j_motor.spring_to_ground.stiffness"
    names, noise = (name,), replace(SLOW, motor_torque=0.05)

    def point(value):
        return _at(HELD, noise, names, [], np.array([value]), [record])

    here, step = 38.0, 0.02
    _, gradient = _equations(point(here), names, [], 1, [record])
    difference = (point(here + step).value - point(here - step).value) / (2.0 * step)
    assert -gradient[0] == pytest.approx(difference, rel=0.02)
