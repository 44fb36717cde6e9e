"""The compiled core against other ways to solve the same equations."""

import math
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from plants import FLEXIBLE, flexible, rigid
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from haptic_teleop_sim.effects import EFFECTS
from haptic_teleop_sim.effects.on_arrays import NUMERIC
from haptic_teleop_sim.kernel import cache_directory, kernel, pack, simulate
from haptic_teleop_sim.kernel.pack import MOST_STEEP


def test_the_linear_joint_is_the_matrix_exponential_s_under_a_held_input():
    dt, n = 1e-4, 20000
    m = FLEXIBLE
    a = np.zeros((5, 5))  # the fifth state is the held current
    a[0, 2] = a[1, 3] = 1.0
    a[2] = np.array([-m["stiffness"], m["stiffness"], -m["motor_damping"], 0, m["torque_constant"]])
    a[2] /= m["motor_inertia"]
    a[3] = np.array([m["stiffness"], -m["stiffness"], 0, -m["arm_damping"], 0]) / m["arm_inertia"]
    step = expm(a * dt)
    current = 0.2 * np.random.default_rng(1).standard_normal(n)
    expected = np.empty((n, 4))
    x = np.array([0.1, -0.1, 0.3, 0.5])
    start = x.copy()
    for k in range(n):
        expected[k] = x
        x = step[:4, :4] @ x + step[:4, 4] * current[k]
    got = simulate(flexible(), current, dt, start).states[:, :4]
    scale = np.abs(expected).max(axis=0)
    assert np.max(np.abs(got - expected) / scale) <= 1e-9


def energy(states, effects_energy=0.0):
    m = FLEXIBLE
    kinetic = 0.5 * m["motor_inertia"] * states[:, 2] ** 2 + 0.5 * m["arm_inertia"] * states[:, 3] ** 2
    return kinetic + 0.5 * m["stiffness"] * (states[:, 0] - states[:, 1]) ** 2 + effects_energy


def test_a_lossless_joint_keeps_its_energy_for_a_minute():
    model = flexible(motor_damping=0.0, arm_damping=0.0)
    states = simulate(model, np.zeros(60_000), 1e-3, np.array([0.2, -0.1, 0.3, 0.0])).states
    np.testing.assert_allclose(energy(states), energy(states[:1])[0], rtol=1e-7)


def test_a_lossless_joint_with_gravity_hardening_and_ripple_keeps_its_energy():
    model = flexible(
        ("gravity", "arm", {"torque": 0.5, "phase": 0.2}),
        ("hardening_spring", "joint", {"cubic": 8.0}),
        ("torque_ripple", "motor", {"amplitude": 0.1, "order": 6.0, "phase": 0.3}),
        motor_damping=0.0, arm_damping=0.0,
    )  # fmt: skip
    states = simulate(model, np.zeros(20_000), 1e-3, np.array([0.4, -0.2, 0.3, 0.0])).states
    d = states[:, 0] - states[:, 1]
    stored = -0.5 * np.cos(states[:, 1] + 0.2) + 2.0 * d**4 + 0.1 / 6.0 * np.cos(6.0 * states[:, 0] + 0.3)
    total = energy(states, stored)
    np.testing.assert_allclose(total, total[0], atol=1e-6 * np.ptp(stored))


def test_what_the_dampers_take_is_what_the_energy_loses():
    m = FLEXIBLE
    states = simulate(flexible(), np.zeros(5000), 1e-3, np.array([0.5, -0.5, 2.0, 3.0])).states
    power = m["motor_damping"] * states[:, 2] ** 2 + m["arm_damping"] * states[:, 3] ** 2
    lost = np.concatenate([[0.0], np.cumsum(0.5e-3 * (power[1:] + power[:-1]))])
    np.testing.assert_allclose(energy(states) + lost, energy(states)[0], rtol=1e-4)


def smooth_model():
    return flexible(
        ("gravity", "arm", {"torque": 0.5, "phase": 0.2}),
        ("hardening_spring", "joint", {"cubic": 8.0}),
        ("stribeck_friction", "motor", {"coulomb": 0.1, "breakaway": 0.2, "velocity": 0.4, "smoothing": 0.2}),
        ("quadratic_drag", "arm", {"coefficient": 0.1}),
    )


def smooth_rates(t, x, torque):
    """The same joint, written down a second time."""
    qm, qa, vm, va = x
    d = qm - qa
    coupling = 3.971 * d + 8.0 * d**3
    friction = (0.1 + 0.1 / math.cosh(vm / 0.4)) * math.tanh(vm / 0.2)
    motor = torque - 2.6 * vm - friction - coupling
    arm = coupling - 0.02 * va - 0.5 * math.sin(qa + 0.2) - 0.1 * va * abs(va)
    return [vm, va, motor / 0.0635, arm / 0.17]


START = np.array([0.3, 0.1, -0.5, 0.2])


def solved(duration):
    exact = {"rtol": 1e-12, "atol": 1e-13, "method": "DOP853"}
    return solve_ivp(smooth_rates, (0.0, duration), START, args=(0.9,), **exact).y[:, -1]


def error_at(dt, duration):
    current = np.full(round(duration / dt) + 1, 0.9 / 8.925)
    return np.abs(simulate(smooth_model(), current, dt, START).states[-1, :4] - solved(duration)).max()


def test_a_nonlinear_joint_is_that_of_a_general_solver():
    assert error_at(1e-3, 3.0) < 1e-7


def test_the_integrator_is_of_fourth_order():
    errors = [error_at(dt, 1.0) for dt in (8e-3, 4e-3, 2e-3)]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(orders > 3.7), errors
    assert np.all(orders < 4.5), errors


def test_stiff_parts_are_given_the_steps_that_they_need():
    """A wall and a friction far too stiff for one step of 2 ms."""
    wall = ("hard_stop", "arm", {"angle": 0.05, "stiffness": 20_000.0})
    friction = ("coulomb_friction", "motor", {"torque": 0.6, "smoothing": 1e-3})
    light = {"motor_inertia": 0.007, "arm_inertia": 0.0064, "arm_damping": 0.5}
    model = flexible(wall, friction, **light)
    assert pack(model).substeps(2e-3) > 1
    states = simulate(model, np.full(2000, 0.2), 2e-3).states
    assert np.all(np.isfinite(states))
    # At rest at the wall the deflections are those of the statics.
    torque = states[-1, 0] - states[-1, 1]
    assert states[-1, 1] - 0.05 == pytest.approx(3.971 * torque / 20_000.0, rel=1e-3)


@pytest.mark.parametrize("dt", [2e-3, 4e-3, 1e-2])
def test_a_law_without_a_bound_is_given_the_steps_that_it_needs_where_it_is_steep(dt):
    """Stiffness and damping of a drag and of a hardening spring grow with the motion: with one step per
    sample this joint ran away at 4 ms, and a right drag was judged by that."""
    drag, cubic = 90.0, 4e4
    model = flexible(
        ("quadratic_drag", "motor", {"coefficient": drag}), ("hardening_spring", "joint", {"cubic": cubic})
    )

    def rates(t, x, torque):
        qm, qa, vm, va = x
        coupling = 3.971 * (qm - qa) + cubic * (qm - qa) ** 3
        motor = torque - 2.6 * vm - drag * vm * abs(vm) - coupling
        return [vm, va, motor / 0.0635, (coupling - 0.02 * va) / 0.17]

    torque = 6.0 * np.sin(2 * np.pi * 0.7 * np.arange(round(2.0 / 0.02)) * 0.02)
    x = np.zeros(4)
    for held in torque:
        x = solve_ivp(rates, (0.0, 0.02), x, args=(held,), rtol=1e-9, atol=1e-12, method="DOP853").y[:, -1]
    current = np.append(np.repeat(torque, round(0.02 / dt)), 0.0) / 8.925
    found = simulate(model, current, dt, np.zeros(4))
    np.testing.assert_allclose(found.states[-1, :4], x, atol=2e-3 * np.abs(found.states[:, :4]).max())


def test_a_drag_as_steep_as_the_damping_is_given_steps_for_both():
    """A step covers 0.95 of what either needs: each rounded by itself gave one for both, and it ran away."""
    inertia, damping, speed, dt = 0.0635, 33.0, 10.0, 4e-3
    drag = 0.5 * damping / speed
    model = rigid(("quadratic_drag", {"coefficient": drag}), inertia=inertia, damping=damping)
    exact = solve_ivp(lambda t, v: -(damping * v + drag * v * abs(v)) / inertia, (0.0, 0.02), [speed],
                      rtol=1e-9, atol=1e-12, t_eval=dt * np.arange(6)).y[0]  # fmt: skip
    found = simulate(model, np.zeros(6), dt, np.array([0.0, 0.0, speed, 0.0])).motor_velocity
    np.testing.assert_allclose(found, exact, atol=0.03 * speed)


@pytest.mark.parametrize("dt", [4e-3, 1e-2])
def test_a_hard_spring_that_is_crossed_fast_is_given_the_steps_of_its_far_end(dt):
    cubic = 4e4
    model = flexible(("hardening_spring", "joint", {"cubic": cubic}))

    def rates(t, x):
        coupling = 3.971 * (x[0] - x[1]) + cubic * (x[0] - x[1]) ** 3
        return [x[2], x[3], (-2.6 * x[2] - coupling) / 0.0635, (coupling - 0.02 * x[3]) / 0.17]

    start = np.array([0.0, 0.0, 4.0, 0.0])
    times = dt * np.arange(round(0.4 / dt))
    exact = solve_ivp(rates, (0.0, 0.4), start, rtol=1e-10, atol=1e-12, t_eval=times).y
    found = simulate(model, np.zeros(len(times)), dt, start).states[:, :4].T
    assert np.abs(found - exact).max() < 0.02 * np.abs(exact).max()


def test_the_most_steps_of_a_steep_law_are_those_of_an_exported_file():
    assert kernel().MOST_STEPS == MOST_STEEP


def test_every_drag_that_grows_without_a_bound_says_how_steep_it_is():
    """Otherwise it has one step a sample, and runs away."""
    for entry in EFFECTS.values():
        if entry.kind != "friction" or entry.equation is None or entry.memory:
            continue
        parameters = SimpleNamespace(**{p.name: max(p.typical, p.minimum) for p in entry.parameters})
        one, far = (
            abs(entry.equation(SimpleNamespace(**NUMERIC, position=0.3, velocity=v), parameters))
            for v in (1.0, 100.0)
        )
        assert far <= 100.1 * one or entry.steepness is not None, entry.name


def test_an_environment_s_torque_acts_on_the_arm_and_on_a_rigid_body():
    push = np.full(1000, 0.3)
    arm = simulate(flexible(motor_damping=0.0, arm_damping=0.0), np.zeros(1000), 1e-3, external_torque=push)
    momentum = 0.0635 * arm.states[:, 2] + 0.17 * arm.states[:, 3]
    np.testing.assert_allclose(momentum, 0.3 * arm.time, atol=1e-10)
    body = simulate(rigid(inertia=0.2), np.zeros(1000), 1e-3, external_torque=push)
    np.testing.assert_allclose(body.states[:, 2], 1.5 * body.time, atol=1e-10)


MUJOCO = """
<mujoco>
  <option timestep="0.0002" gravity="0 0 0" integrator="implicitfast"/>
  <worldbody>
    <body><joint name="motor" axis="0 0 1" damping="2.6" frictionloss="0.6"/>
      <inertial pos="0 0 0" mass="1" diaginertia="0.0635 0.0635 0.0635"/></body>
    <body><joint name="arm" axis="0 0 1" damping="0.02"/>
      <inertial pos="0 0 0" mass="1" diaginertia="0.17 0.17 0.17"/></body>
  </worldbody>
  <tendon><fixed name="spring" stiffness="3.971" springlength="0">
    <joint joint="motor" coef="1"/><joint joint="arm" coef="-1"/></fixed></tendon>
</mujoco>
"""


def test_a_joint_with_friction_moves_as_in_mujoco():
    """An independent simulator with friction of its own: a solver's constraint instead of a curve."""
    mujoco = pytest.importorskip("mujoco")
    dt, ratio, n = 2e-3, 10, 2000
    current = 0.25 * np.sin(2 * np.pi * 0.5 * dt * np.arange(n))
    model = mujoco.MjModel.from_xml_string(MUJOCO)
    data = mujoco.MjData(model)
    theirs = np.empty((n, 2))
    for k in range(n):
        theirs[k] = data.qpos
        data.qfrc_applied[0] = 8.925 * current[k]
        for _ in range(ratio):
            mujoco.mj_step(model, data)
    ours = simulate(flexible(("coulomb_friction", "motor", {"torque": 0.6})), current, dt).states[:, :2]
    assert np.ptp(theirs, axis=0).min() > 0.2
    error = np.sqrt(np.mean((ours - theirs) ** 2, axis=0)) / np.std(theirs, axis=0)
    assert np.all(error < 0.01), error


def test_the_compiled_code_is_kept_and_found_again(tmp_path, monkeypatch):
    assert cache_directory().is_dir()
    assert str(cache_directory()) in str(kernel().__file__)
    monkeypatch.setenv("HAPTIC_TELEOP_CACHE", str(tmp_path))
    assert cache_directory() == tmp_path


def test_a_simulation_needs_neither_sympy_nor_ros_once_it_is_compiled():
    """They would take longer to import than many a simulation takes."""
    code = """
import sys
from haptic_teleop_sim.default_models import sfj_stage_model
from haptic_teleop_sim.kernel import simulate
simulate(sfj_stage_model("stage1"), [0.0] * 10, 1e-3)
print(sorted({"sympy", "rclpy", "matplotlib"} & set(sys.modules)))
"""
    simulate(flexible(), np.zeros(10), 1e-3)
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.strip().splitlines()[-1] in ("[]", "['sympy']")
