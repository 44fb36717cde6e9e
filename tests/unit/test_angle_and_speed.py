"""An inertia that depends on the angle, and a torque limit that depends on the speed, against mechanics."""

import math

import numpy as np
import pytest
from plants import flexible, rigid
from scipy.integrate import quad, solve_ivp

from haptic_teleop_sim.kernel import pack, predict, simulate
from haptic_teleop_sim.model import Effect

DT = 1e-3
VARYING = {"amplitude": 0.6, "order": 2.0, "phase": 0.7}


def free(model, duration, start, input_=0.0, **options):
    n = round(duration / DT)
    return simulate(model, np.broadcast_to(np.asarray(input_, float), (n,)), DT, np.array(start), **options)


def inertia(q, mean, a=0.6, order=2.0, phase=0.7):
    return mean * (1.0 + a * np.cos(order * q + phase))


def test_a_body_of_varying_inertia_keeps_its_energy():
    states = free(rigid(("angle_dependent_inertia", VARYING)), 20.0, (0.0, 0.0, 3.0, 0.0)).states
    energy = 0.5 * inertia(states[:, 0], 0.2) * states[:, 2] ** 2
    assert np.ptp(states[:, 2]) > 1.5  # it does swing between two speeds
    assert np.ptp(energy) < 1e-6 * energy[0]


def test_a_scotch_yoke_turns_by_the_time_that_its_energy_allows():
    """A wheel J0 that moves a mass m by x = r cos q: J = J0 + m r^2 sin^2 q, and t = int sqrt(J / 2E) dq."""
    wheel, mass, radius = 0.1, 2.0, 0.2
    half = mass * radius**2 / 2.0
    yoke = {"amplitude": half / (wheel + half), "order": 2.0, "phase": math.pi}
    states = free(
        rigid(("angle_dependent_inertia", yoke), inertia=wheel + half), 3.0, (0.0, 0.0, 2.0, 0.0)
    ).states
    energy = 0.5 * wheel * 2.0**2
    for sample in (700, 1900, 2999):
        angle = states[sample, 0]
        time = quad(
            lambda q: math.sqrt((wheel + mass * (radius * math.sin(q)) ** 2) / (2 * energy)),
            0.0, angle, limit=200,
        )[0]  # fmt: skip
        assert time == pytest.approx(sample * DT, rel=1e-7)


def test_an_arm_of_varying_inertia_on_its_spring_moves_as_hamilton_s_equations_say():
    """By momenta p = J(q) dq: dp = J'(q) dq^2 / 2 + torques, an equation without an acceleration."""
    model = flexible(("angle_dependent_inertia", "arm", VARYING), arm_damping=0.3, motor_damping=0.2)
    b = dict(model.parameters)

    def rates(t, x):
        q, a, p, r = x
        u = p / b["motor_inertia"]
        v = r / inertia(a, b["arm_inertia"])
        bend = -b["arm_inertia"] * 0.6 * 2.0 * math.sin(2.0 * a + 0.7)
        spring = b["stiffness"] * (q - a)
        push = b["torque_constant"] * 0.1
        return [
            u, v, push - b["motor_damping"] * u - spring, bend * v**2 / 2 + spring - b["arm_damping"] * v
        ]  # fmt: skip

    start = np.array([0.3, -0.2, 0.5, -1.0])
    states = free(model, 4.0, start, 0.1).states
    times = DT * np.arange(len(states))
    momenta = [b["motor_inertia"] * start[2], inertia(start[1], b["arm_inertia"]) * start[3]]
    exact = solve_ivp(
        rates, (0.0, times[-1]), [*start[:2], *momenta], "DOP853", times, rtol=1e-11, atol=1e-12
    )
    assert np.ptp(exact.y[1]) > 2.0
    assert states[:, :2] == pytest.approx(exact.y[:2].T, abs=1e-8)


LIMIT = {"limit": 1.2, "slope": 0.3}


def test_a_drive_at_its_speed_limit_approaches_no_load_speed_exponentially():
    """Above what is left, J dv = limit - slope v: v = limit / slope (1 - exp(-slope t / J))."""
    model = rigid(("torque_speed_limit@actuator", LIMIT))
    states = free(model, 3.0, (0.0, 0.0, 0.0, 0.0), 5.0).states
    time = DT * np.arange(len(states))
    assert states[:, 2] == pytest.approx(4.0 * (1.0 - np.exp(-0.3 * time / 0.2)), abs=1e-6)


def test_braking_has_the_whole_limit_and_driving_beyond_the_last_torque_has_none():
    model = rigid(("torque_speed_limit@actuator", LIMIT))
    brake = free(model, 0.5, (0.0, 0.0, 10.0, 0.0), -5.0).states
    assert brake[-1, 2] == pytest.approx(10.0 - 1.2 / 0.2 * 0.499, rel=1e-9)
    assert np.ptp(free(model, 0.5, (0.0, 0.0, 10.0, 0.0), 5.0).states[:, 2]) < 1e-12
    small = free(model, 0.5, (0.0, 0.0, -1.0, 0.0), 0.7).states  # within what is left: all of it acts
    assert small[-1, 2] == pytest.approx(-1.0 + 0.7 / 0.2 * 0.499, rel=1e-9)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_limited_drive_with_a_joint_moves_as_a_general_solver_says(sign):
    model = flexible(("torque_speed_limit", "actuator", LIMIT), motor_damping=0.1)
    b = dict(model.parameters)

    def command(t):
        return sign * (3.0 if t < 1.0 else -3.0)

    def rates(t, x):
        q, a, u, v = x
        wanted = command(t)
        left = max(1.2 - 0.3 * abs(u), 0.0) if wanted * u > 0.0 else 1.2
        torque = math.copysign(min(abs(wanted), left), wanted)
        spring = b["stiffness"] * (q - a)
        return [
            u, v,
            (torque - b["motor_damping"] * u - spring) / b["motor_inertia"],
            (spring - b["arm_damping"] * v) / b["arm_inertia"],
        ]  # fmt: skip

    times = DT * np.arange(2000)
    amperes = np.array([command(t) for t in times]) / b["torque_constant"]
    states = simulate(model, amperes, DT).states
    exact = solve_ivp(
        rates, (0.0, times[-1]), np.zeros(4), "DOP853", times, rtol=1e-9, atol=1e-10, max_step=2e-3
    )
    assert states[:, :2] == pytest.approx(exact.y[:2].T, abs=2e-5)


def test_the_environment_s_torque_on_a_rigid_body_is_not_the_drive_s():
    model = rigid(("torque_speed_limit@actuator", LIMIT))
    pushed = free(model, 0.5, (0.0, 0.0, 0.0, 0.0), external_torque=np.full(500, 6.0)).states
    assert pushed[-1, 2] == pytest.approx(6.0 / 0.2 * 0.499, rel=1e-9)


def test_both_beside_what_else_scales_have_exact_sensitivities():
    """Inertias of both kinds, a factor on friction, a gain before the limit: every derivative of the sums."""
    model = flexible(
        ("angle_dependent_inertia", "arm", {"amplitude": 0.4, "order": 3.0, "phase": 0.2}),
        ("payload_change", "arm", {"time": 0.7, "inertia": 0.05}),
        ("coulomb_friction", "arm", {"torque": 0.2, "smoothing": 0.1}),
        ("friction_drift", "arm", {"change": 0.5, "time_constant": 1.0}),
        ("gain_error", "actuator", {"gain": 1.1}),
        ("torque_speed_limit", "actuator", {"limit": 6.0, "slope": 1.5}),
        motor_damping=0.3,
    )
    amperes = np.sin(4.0 * DT * np.arange(1500) + 0.2)
    free_ones = tuple(
        n for n in model.parameter_values() if not n.endswith(("smoothing", "contact_angle"))
    )

    def angles(values):
        changed = pack(model.with_values(values))
        return predict(changed, amperes, np.zeros((1500, 2)), DT, keep_states=True).innovation

    exact = predict(pack(model), amperes, np.zeros((1500, 2)), DT, free_ones).d_innovation
    for column, name in enumerate(free_ones):
        value = model.parameter_values()[name]
        step = 1e-5 * abs(value)
        slope = (angles({name: value + step}) - angles({name: value - step})) / (2.0 * step)
        size = np.sqrt(np.mean(slope**2))
        assert size > 1e-4, name
        assert np.sqrt(np.mean((exact[:, :, column] - slope) ** 2)) < 3e-3 * size, name


def test_a_light_phase_of_the_inertia_is_given_the_steps_that_it_needs():
    stiff = flexible(
        ("angle_dependent_inertia", "arm", {"amplitude": 0.94, "order": 1.0}),
        ("spring_to_ground", "arm", {"stiffness": 4e4}),
    )
    states = simulate(stiff, np.zeros(400), 2e-3, np.array([0.0, 0.01, 0.0, 0.0])).states
    assert np.max(np.abs(states[:, 1])) < 0.0101


def test_neither_reaches_where_it_cannot_sit():
    with pytest.raises(ValueError, match="cannot sit"):
        rigid(("torque_speed_limit", LIMIT))
    with pytest.raises(ValueError, match=r"amplitude is 1\.2"):
        flexible().with_effects(
            Effect("angle_dependent_inertia", "stage1_arm", {"amplitude": 1.2, "order": 2.0})
        )
