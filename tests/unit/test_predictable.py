"""Free runs of an unstable joint: a pendulum held upright by a controller, integrated here step by step."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from numba import njit
from scipy.optimize import brentq
from stepped_machines import DT, FINE, RIGID, drive

from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.diagnosis.evidence.horizons import free_errors
from haptic_teleop_sysid.diagnosis.evidence.predictable import (
    predictable,
    while_followed,
    while_predictable,
)
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
    expected = brentq(lambda t: math.sinh(rate * t) / rate * math.exp(-half * t) - 5.0 * t, 0.05, 5.0)
    assert predictable(course, UPRIGHT) == pytest.approx(expected, rel=0.15)
    cut_shorter = while_predictable(course, UPRIGHT)
    assert cut_shorter.windows[0].seconds == pytest.approx(expected, rel=0.25)
    assert "grow 5 times" in cut_shorter.windows[0].why


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


@njit
def dragged(wanted, luck, coulomb, weight):
    """Angles and torques (n,) of a slow axis that a controller, once a sample, moves against dry friction and
    a weight."""
    q, v, h = wanted[0], 0.0, DT / FINE
    angle, torque, sum_ = np.empty(len(wanted)), np.empty(len(wanted)), 0.0
    for k in range(len(wanted)):
        off = q - wanted[k]
        sum_ += off * DT
        angle[k], torque[k] = q, -60.0 * off - 60.0 * sum_ - 2.0 * v
        for _ in range(FINE):
            push = torque[k] + luck[k] - weight * math.sin(q) - 0.03 * v
            if v == 0.0 and abs(push) <= coulomb:
                continue
            side = v if v != 0.0 else push
            before = v
            v += h * (push - math.copysign(coulomb, side)) / 0.02
            if before * v < 0.0:
                v = 0.0
            q += h * v
    return angle, torque


def slow(seed: int, faster: float) -> DataSet:
    """20 s of triangles, with a torque that wanders by some percent of the friction."""
    n = 10_000
    time, random = DT * np.arange(n), np.random.default_rng(seed)
    wanted = 1.2 * (2.0 * np.abs((0.15 * faster * time + 0.25) % 1.0 * 2.0 - 1.0) - 1.0)
    luck = np.cumsum(random.standard_normal(n)) * 0.004
    luck = 0.05 * (luck - np.convolve(luck, np.ones(2001) / 2001, "same")) / 0.1
    angle, torque = dragged(wanted, luck, 1.1, 0.4)
    angle = 1e-4 * np.round(angle / 1e-4)
    parts = {"experiment": {"kind": "position loop"}, "valid": np.ones(n, dtype=bool)}
    speed = np.gradient(angle, DT)
    return DataSet(f"slow {seed}", "generic", "j", DT, torque, "N*m", "measured", angle, speed, **parts)


def carried(friction):
    """What torques say of it, off by some percent: its parameters, weight and ``friction``, N·m."""
    model = RIGID.with_values({"motor_inertia": 0.02, "motor_damping": 0.03})
    effects = (
        Effect("gravity", "j_motor", {"torque": 0.4}),
        Effect("coulomb_friction", "j_motor", {"torque": friction}),
    )
    return SimpleNamespace(model=model.with_effects(*effects), explained=0.97)


def test_where_friction_and_weight_carry_nearly_all_windows_are_short_enough_to_follow():
    """Free runs over seconds end anywhere, by a few percent of the friction."""
    data = slow(0, 0.6), slow(1, 0.5)
    course = Course(data, tuple(cut(d, 10.0, "") for d in data))
    said = carried(1.0)
    assert max(free_errors(course, 1, said.model)) > 1.0
    shorter = while_followed(course, 1, said, 1.0)
    assert "decides where the joint goes" in shorter.windows[0].why
    assert max(free_errors(shorter, 1, said.model)) < 0.5
    assert 0.25 <= shorter.windows[0].seconds < 5.0


def test_windows_stay_where_runs_follow_or_torques_do_not_say_all():
    data = slow(0, 0.6), slow(1, 0.5)
    course = Course(data, tuple(cut(d, 10.0, "") for d in data))
    less = SimpleNamespace(model=carried(1.0).model, explained=0.9)
    assert while_followed(course, 1, less, 1.0) is course
    short = Course(data, tuple(cut(d, 0.5, "") for d in data))
    assert while_followed(short, 1, carried(1.0), 1.0) is short
    nowhere = SimpleNamespace(model=RIGID.with_values({"motor_damping": 0.05}), explained=0.97)
    assert while_followed(course, 1, nowhere, 1.0) is course, "no window says anything"
