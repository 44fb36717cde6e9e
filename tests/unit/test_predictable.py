"""Free runs of an unstable joint: a pendulum held upright by a controller, integrated here step by step."""

import math

import numpy as np
import pytest
from numba import njit
from scipy.optimize import brentq
from stepped_machines import DT, FINE, RIGID, drive

from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.diagnosis.evidence.predictable import GROWN, predictable, while_predictable
from haptic_teleop_sysid.diagnosis.evidence.proof import Course
from haptic_teleop_sysid.diagnosis.run import diagnose
from haptic_teleop_sysid.recordings.dataset import DataSet
from haptic_teleop_sysid.simulation.windows import cut

INERTIA, DAMPING, WEIGHT = 0.14, 0.35, 4.0
NOTHING = RIGID.with_values({"motor_inertia": INERTIA, "motor_damping": DAMPING})
UPRIGHT = NOTHING.with_effects(Effect("gravity", "j_motor", {"torque": WEIGHT, "phase": math.pi}))
HANGING = NOTHING.with_effects(Effect("gravity", "j_motor", {"torque": WEIGHT}))


@njit
def balance(wanted, luck):
    """Angles and torques (n,) of an upright pendulum that a controller, once a sample, holds at an angle."""
    q, v, h = wanted[0], 0.0, DT / FINE
    angle, torque = np.empty(len(wanted)), np.empty(len(wanted))
    for k in range(len(wanted)):
        angle[k], torque[k] = q, -20.0 * (q - wanted[k]) - 1.5 * v
        for _ in range(FINE):
            v += h * (torque[k] + luck[k] + WEIGHT * math.sin(q) - DAMPING * v) / INERTIA
            q += h * v
    return angle, torque


def balanced(seed: int) -> DataSet:
    """20 s of it, with a random torque of 2 % of the weight."""
    wanted = drive(seed, 0.4)
    luck = 0.02 * WEIGHT * np.random.default_rng(seed).standard_normal(len(wanted))
    angle, torque = balance(wanted, luck)
    angle = 1e-4 * np.round(angle / 1e-4)
    parts = {"experiment": {"kind": "position loop"}, "valid": np.ones(len(torque), dtype=bool)}
    name = f"upright {seed}"
    return DataSet(
        name, "generic", "j", DT, torque, "N*m", "measured", angle, np.gradient(angle, DT), **parts
    )


@pytest.fixture(scope="module")
def course() -> Course:
    data = (balanced(0), balanced(1))
    return Course(data, tuple(cut(d, 4.0, "") for d in data))


def test_an_error_grows_as_theory_says(course):
    # x'' + b/J x' - w/J x = 0 from x = 0: x = v sinh(r t) exp(-b t / 2J) / r; the mean of w cos q counts.
    half = 0.5 * DAMPING / INERTIA
    size = WEIGHT * float(np.mean(np.cos(course.data[0].motor_position)))
    rate = math.sqrt(half**2 + size / INERTIA)
    expected = brentq(lambda t: math.sinh(rate * t) / rate * math.exp(-half * t) - GROWN * t, 0.05, 5.0)
    assert predictable(course, UPRIGHT) == pytest.approx(expected, rel=0.15)
    cut_shorter = while_predictable(course, UPRIGHT)
    assert cut_shorter.windows[0].seconds == pytest.approx(expected, rel=0.25)
    assert "unstable" in cut_shorter.windows[0].why


def test_windows_of_a_stable_joint_stay(course):
    for model in (NOTHING, HANGING):
        assert math.isinf(predictable(course, model))
        assert while_predictable(course, model) is course


def test_what_only_shows_is_simulated_over_windows_as_short(course):
    whole = cut(course.data[0], None, "")
    shorter = while_predictable(course, UPRIGHT).shortened(course.data[0], whole)
    assert shorter.seconds == pytest.approx(while_predictable(course, UPRIGHT).windows[0].seconds)
    assert course.shortened(course.data[0], whole) is whole


def test_windows_are_not_cut_below_what_says_anything(course):
    heavy = NOTHING.with_effects(Effect("gravity", "j_motor", {"torque": 4e4, "phase": math.pi}))
    assert min(b - a for a, b in while_predictable(course, heavy).windows[0].spans) >= 20


def test_gravity_that_makes_a_joint_unstable_is_named():
    """Free runs over 4 s run away with it, and not without it."""
    _, verdict, _, content = diagnose(RIGID, [balanced(0)], [balanced(1)])
    (finding,) = verdict.findings
    assert verdict.kind == "identified"
    assert finding["effect"] in ("gravity", "spring_to_ground")
    assert finding["confidence"] > 0.7
    assert content["fit"]["augmented"]["validation"]["j_motor.position"] > 90.0
    assert "unstable" in content["fit"]["windows"]
    torque = finding["parameters"]["torque"]
    assert torque["value"] == pytest.approx(WEIGHT, rel=0.05)
    assert abs(abs(finding["parameters"]["phase"]["value"]) - math.pi) < 0.1
