"""Each effect against what it must do by closed form, in the whole simulation and not only as a formula."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
import sympy as sp
from plants import flexible, rigid
from scipy.linalg import expm
from scipy.optimize import brentq
from scipy.special import ellipk

from haptic_teleop_sim.effects import EFFECTS, effect_entry, locations
from haptic_teleop_sim.effects.on_arrays import NUMERIC
from haptic_teleop_sim.effects.symbols import SYMBOLIC
from haptic_teleop_sim.kernel import acting_torque, pack, simulate
from haptic_teleop_sim.model import Effect

DT = 1e-3

# The vocabulary.


def test_every_entry_says_what_it_is():
    for name, entry in EFFECTS.items():
        assert entry.name == name
        assert len(entry.sentence.split()) >= 4, name
        assert not entry.sentence.endswith("."), name
        assert entry.where, name
        assert len(set(entry.parameter_names)) == len(entry.parameters), name
        for parameter in entry.parameters:
            where = f"{name}.{parameter.name}"
            assert parameter.unit not in ("", "1"), where  # a ratio says what it is a share of
            assert parameter.meaning, where
            assert parameter.minimum < parameter.maximum, where
            assert parameter.typical != 0.0 or parameter.default is not None, where
            if parameter.default is not None:
                assert parameter.minimum <= parameter.default <= parameter.maximum, where


def test_helpers_mean_the_same_on_symbols_and_on_arrays():
    assert SYMBOLIC.keys() == NUMERIC.keys()
    x, width = sp.Symbol("x", real=True), 0.6
    for name, helper in SYMBOLIC.items():
        if name == "pi":
            continue
        more = (width,) if name == "dead_band" else ()
        for value in (-1.3, -0.2, 0.0, 0.2, 1.3):
            at = abs(value) if name == "sqrt" else value
            if name in ("side", "sech"):  # without a value of their own in sympy
                expected = {"side": 1.0 if at >= 0 else -1.0, "sech": 1.0 / math.cosh(at)}[name]
            else:
                expected = float(helper(x, *more).subs(x, at))
            assert float(NUMERIC[name](np.array(at), *more)) == pytest.approx(expected, abs=1e-12), name


def test_the_vocabulary_is_the_contract_s():
    names = """coulomb_friction stribeck_friction asymmetric_friction presliding_friction quadratic_drag
    position_dependent_friction friction_drift load_dependent_friction gravity spring_to_ground
    constant_torque torque_ripple backlash hardening_spring hysteresis joint_damping input_delay actuator_lag
    torque_saturation dead_zone gain_error gain_drift inertial_coupling extra_flexible_mode payload_change
    hard_stop encoder_eccentricity encoder_scale sensor_delay channel_skew angle_dependent_inertia
    torque_speed_limit torque_map"""
    assert set(names.split()) <= set(EFFECTS)


def test_a_rigid_body_has_only_motor_actuator_and_motor_encoder():
    for name in EFFECTS:
        assert set(locations(name, "rigid_body")) <= {"motor", "actuator", "motor_encoder"}
    assert locations("backlash", "rigid_body") == ()
    assert locations("gravity", "rigid_body") == ("motor",)
    assert locations("gravity", "flexible_joint") == ("arm",)


def test_an_unknown_effect_is_answered_with_the_nearest_one():
    with pytest.raises(ValueError, match="did you mean hysteresis"):
        effect_entry("hysteresys")


# Friction.


def run(model, duration, start=(0.0, 0.0, 0.0, 0.0), input_=0.0, dt=DT, **options):
    n = round(duration / dt)
    return simulate(
        model, np.broadcast_to(np.asarray(input_, dtype=float), (n,)), dt, np.array(start), **options
    )


def speeding(speed):
    return (0.0, 0.0, speed, 0.0)


@pytest.mark.parametrize("damping", [1e-9, 0.4])
def test_coulomb_friction_stops_a_body_after_the_time_and_way_of_the_closed_form(damping):
    inertia, friction, speed = 0.2, 0.3, 1.5
    model = rigid(("coulomb_friction", {"torque": friction}), inertia=inertia, damping=damping)
    states = run(model, 3.0, speeding(speed)).states
    stop = inertia / damping * math.log1p(damping * speed / friction)
    way = inertia / damping * (speed - friction * stop / inertia)
    stopped = DT * np.argmax(states[:, 2] < 0.01 * speed)
    assert stopped == pytest.approx(stop, abs=0.015)
    assert states[-1, 0] == pytest.approx(way, rel=5e-3)
    assert abs(states[-1, 2]) < 1e-3


def test_coulomb_friction_holds_against_a_smaller_torque_and_yields_to_a_larger_one():
    model = rigid(("coulomb_friction", {"torque": 0.3}))
    held = run(model, 5.0, input_=0.25).states
    assert abs(held[-1, 0]) < 0.05
    moved = run(model, 5.0, input_=0.35).states
    assert moved[-1, 2] == pytest.approx((0.35 - 0.3) / 0.2 * 5.0, rel=0.02)


def test_stribeck_friction_gives_the_speed_that_equation_22_balances():
    curve = {"coulomb": 0.2, "breakaway": 0.3, "velocity": 0.3, "smoothing": 0.02}
    model = rigid(("stribeck_friction", curve), damping=0.5)

    def balance(v):
        return 0.5 * v + (0.2 + 0.1 / math.cosh(v / 0.3)) * math.tanh(v / 0.02) - 0.6

    speed = run(model, 10.0, input_=0.6).states[-1, 2]
    assert speed == pytest.approx(brentq(balance, 0.3, 2.0), rel=1e-6)


def test_asymmetric_friction_differs_between_the_directions():
    model = rigid(("asymmetric_friction", {"positive": 0.1, "negative": 0.4}), damping=0.5)
    assert run(model, 10.0, input_=0.6).states[-1, 2] == pytest.approx(1.0, rel=1e-4)
    assert run(model, 10.0, input_=-0.6).states[-1, 2] == pytest.approx(-0.4, rel=1e-4)


def test_quadratic_drag_approaches_its_terminal_speed_as_a_hyperbolic_tangent():
    inertia, drag, torque = 0.2, 0.3, 0.5
    model = rigid(("quadratic_drag", {"coefficient": drag}), inertia=inertia)
    result = run(model, 3.0, input_=torque)
    terminal = math.sqrt(torque / drag)
    expected = terminal * np.tanh(math.sqrt(torque * drag) / inertia * result.time)
    np.testing.assert_allclose(result.states[:, 2], expected, atol=1e-6)


def loop_area(sliding, stiffness, amplitude):
    """Area of the steady Dahl loop between -amplitude and amplitude, from its exponential branches."""
    decay = stiffness / sliding
    corner = sliding * math.tanh(decay * amplitude)
    tail = (1.0 - math.exp(-2.0 * decay * amplitude)) / decay
    return 2.0 * (2.0 * amplitude * sliding - (sliding + corner) * tail)


def test_presliding_friction_takes_the_energy_of_the_dahl_loop():
    # A body so heavy that friction hardly changes the swing: the loop is that of a given amplitude.
    inertia, stiffness, sliding, contact = 2000.0, 2000.0 * 9.0, 1.0, 8.0
    model = rigid(
        ("presliding_friction", {"torque": sliding, "stiffness": contact}),
        ("spring_to_ground", {"stiffness": stiffness, "rest": 0.0}),
        inertia=inertia,
    )
    states = run(model, 8 * math.pi / 3.0, (0.3, 0.0, 0.0, 0.0)).states
    energy = 0.5 * inertia * states[:, 2] ** 2 + 0.5 * stiffness * states[:, 0] ** 2
    period = round(2 * math.pi / 3.0 / DT)
    lost = energy[period] - energy[3 * period]
    assert lost / 2.0 == pytest.approx(loop_area(sliding, contact, 0.3), rel=0.02)


def test_hysteresis_of_the_joint_takes_the_energy_of_its_loop():
    # The arm stands like a rock and the heavy motor swings on the joint's spring.
    torque, displacement, inertia, amplitude = 0.5, 0.06, 1000.0, 0.25
    model = flexible(
        ("hysteresis", "joint", {"torque": torque, "displacement": displacement}),
        motor_inertia=inertia, motor_damping=0.0, arm_inertia=1e12, arm_damping=0.0, stiffness=9.0 * inertia,
    )  # fmt: skip
    states = run(model, 8 * math.pi / 3.0, (amplitude, 0.0, 0.0, 0.0)).states
    energy = 0.5 * inertia * (states[:, 2] ** 2 + 9.0 * states[:, 0] ** 2)
    period = round(2 * math.pi / 3.0 / DT)
    lost = energy[period] - energy[3 * period]
    assert lost / 2.0 == pytest.approx(loop_area(torque, torque / displacement, amplitude), rel=0.02)


def test_position_dependent_friction_takes_its_integral_over_the_way():
    inertia, mean, amplitude, order, phase = 5.0, 0.3, 0.2, 3.0, 0.4
    values = {"torque": mean, "amplitude": amplitude, "order": order, "phase": phase}
    model = rigid(("position_dependent_friction", values), inertia=inertia)
    states = run(model, 2.0, speeding(2.0)).states[10:]  # by then the contact slides
    work = mean * states[:, 0] - amplitude / order * np.cos(order * states[:, 0] + phase)
    lost = -0.5 * inertia * states[:, 2] ** 2
    np.testing.assert_allclose(np.ptp(lost), np.ptp(work), rtol=1e-6)
    np.testing.assert_allclose(lost - lost[0], work - work[0], atol=1e-6)


def test_friction_drift_changes_all_friction_of_its_place_over_its_time():
    inertia, friction, change, time_constant = 2.0, 0.2, 0.5, 0.7
    model = rigid(
        ("coulomb_friction", {"torque": friction}),
        ("friction_drift", {"change": change, "time_constant": time_constant}),
        inertia=inertia,
    )
    result = run(model, 3.0, speeding(2.0))
    t = result.time
    impulse = friction * (t + change * (t - time_constant * (1.0 - np.exp(-t / time_constant))))
    speed = result.states[:, 2] + impulse / inertia
    np.testing.assert_allclose(speed[10:], speed[10], atol=1e-6)  # from where the contact slides
    assert speed[10] == pytest.approx(2.0, abs=1e-4)


def test_load_dependent_friction_is_its_share_of_the_carried_torque():
    load, share, damping = 0.8, 0.25, 2.6
    model = flexible(
        ("load_dependent_friction", "motor", {"coefficient": share}),
        ("constant_torque", "arm", {"torque": -load}),
        ("joint_damping", "joint", {"coefficient": 0.5}),
        arm_damping=0.0,
    )
    speed = 0.4
    current = (load + share * load + damping * speed) / 8.925
    assert run(model, 20.0, input_=current).states[-1, 2] == pytest.approx(speed, rel=1e-4)


# Torques that depend on the angle.


@pytest.mark.parametrize("amplitude", [0.1, 1.0, 2.5])
def test_a_pendulum_swings_with_the_period_of_the_elliptic_integral(amplitude):
    inertia, torque, phase = 0.2, 0.5, 0.3
    model = rigid(("gravity", {"torque": torque, "phase": phase}), inertia=inertia)
    result = run(model, 12.0, (amplitude - phase, 0.0, 0.0, 0.0))
    angle = result.states[:, 0] + phase
    falling = np.flatnonzero((angle[:-1] > 0.0) & (angle[1:] <= 0.0))
    crossings = result.time[falling] + DT * angle[falling] / (angle[falling] - angle[falling + 1])
    period = 4.0 * math.sqrt(inertia / torque) * ellipk(math.sin(amplitude / 2.0) ** 2)
    assert np.mean(np.diff(crossings)) == pytest.approx(period, rel=1e-5)


def test_a_spring_to_ground_swings_about_its_rest():
    model = rigid(("spring_to_ground", {"stiffness": 3.2, "rest": 0.4}), inertia=0.2)
    result = run(model, 5.0)
    np.testing.assert_allclose(result.states[:, 0], 0.4 * (1.0 - np.cos(4.0 * result.time)), atol=1e-8)


def test_a_constant_torque_accelerates():
    result = run(rigid(("constant_torque", {"torque": 0.3}), inertia=0.2), 2.0)
    np.testing.assert_allclose(result.states[:, 0], 0.75 * result.time**2, atol=1e-9)


def test_torque_ripple_is_a_potential_along_the_angle():
    inertia, amplitude, order, phase = 0.2, 0.3, 5.0, 0.7
    model = rigid(
        ("torque_ripple", {"amplitude": amplitude, "order": order, "phase": phase}), inertia=inertia
    )
    states = run(model, 5.0, speeding(1.0)).states
    energy = 0.5 * inertia * states[:, 2] ** 2 + amplitude / order * np.cos(order * states[:, 0] + phase)
    np.testing.assert_allclose(energy, energy[0], rtol=1e-6)
    assert np.ptp(states[:, 2]) > 0.1


# Stops.


def test_an_elastic_stop_throws_back_with_the_speed_of_the_impact():
    model = rigid(("hard_stop", {"angle": 0.5, "stiffness": 500.0}), inertia=0.2)
    result = run(model, 1.5, speeding(1.0))
    assert result.states[-1, 2] == pytest.approx(-1.0, rel=2e-3)
    assert result.states[:, 0].max() == pytest.approx(0.5 + math.sqrt(0.2 / 500.0), rel=1e-4)


def test_a_stop_that_dissipates_throws_back_with_the_speed_of_the_first_integral():
    d, speed = 0.6, 1.2
    model = rigid(("hard_stop", {"angle": -0.3, "stiffness": 500.0, "dissipation": d}), inertia=0.2)
    after = run(model, 1.5, speeding(-speed)).states[-1, 2]

    def integral(v):  # of  J v dv/dx = -k x (1 + d v), the same before and after the contact
        return v / d - math.log1p(d * v) / d**2

    rebound = -brentq(lambda v: integral(v) - integral(speed), -0.999 / d, -1e-6)
    assert after == pytest.approx(rebound, rel=2e-3)


def test_a_stop_on_both_sides_keeps_the_motion_between_them():
    values = {"angle": 0.2, "stiffness": 5000.0, "dissipation": 1.0, "both_sides": 1.0}
    states = run(rigid(("hard_stop", values), inertia=0.2), 5.0, speeding(1.0)).states
    assert states[:, 0].max() == pytest.approx(0.2, abs=0.01)
    assert states[:, 0].min() == pytest.approx(-0.2, abs=0.01)


def test_a_body_that_leaves_the_wall_is_free_again():
    """Unlike a saturated output: nothing of the wall is left once contact is lost."""
    wall = {"angle": 0.1, "stiffness": 2000.0}
    current = np.where(np.arange(3000) < 1500, 0.12, -0.12)
    with_wall = simulate(flexible(("hard_stop", "arm", wall)), current, DT).states
    left = int(np.flatnonzero(with_wall[:, 1] > 0.1)[-1]) + 1
    assert 1500 < left < 2500
    alone = simulate(flexible(), current[left:], DT, with_wall[left]).states
    np.testing.assert_allclose(with_wall[left:], alone, atol=1e-12)


# The joint.


def loaded(effect, values, load):
    """Deflection at rest of a joint that carries `load` N·m: the motor is held by a stiff spring."""
    model = flexible(
        (effect, "joint", values),
        ("constant_torque", "arm", {"torque": -load}),
        ("spring_to_ground", "motor", {"stiffness": 50.0, "rest": 0.0}),
        motor_damping=3.0, arm_damping=1.0,
    )  # fmt: skip
    states = run(model, 30.0).states[-1]
    return states[0] - states[1]


@pytest.mark.parametrize("load", [-0.7, 0.2, 0.9])
def test_backlash_adds_half_its_gap_to_the_deflection(load):
    expected = load / 3.971 + math.copysign(0.5 * 0.06, load)
    assert loaded("backlash", {"width": 0.06}, load) == pytest.approx(expected, rel=1e-6)


def test_the_coupling_carries_nothing_within_the_gap():
    model = flexible(("backlash", "joint", {"width": 0.2}), motor_damping=0.0, arm_damping=0.0)
    result = run(model, 0.5, (0.0, 0.0, 0.1, 0.0))
    np.testing.assert_allclose(result.states[:, 0], 0.1 * result.time, atol=1e-12)


@pytest.mark.parametrize("cubic", [40.0, -3.0])
def test_a_hardening_spring_deflects_as_its_cubic_says(cubic):
    expected = brentq(lambda d: 3.971 * d + cubic * d**3 - 0.9, 0.0, 0.6)
    assert loaded("hardening_spring", {"cubic": cubic}, 0.9) == pytest.approx(expected, rel=1e-6)


def linear_matrix(m, joint_damping=0.0):
    ks, jm, bm = m["stiffness"], m["motor_inertia"], m["motor_damping"]
    ja, ba = m["arm_inertia"], m["arm_damping"]
    c = joint_damping
    return np.array([
        [0, 0, 1, 0], [0, 0, 0, 1],
        [-ks / jm, ks / jm, -(bm + c) / jm, c / jm], [ks / ja, -ks / ja, c / ja, -(ba + c) / ja],
    ])  # fmt: skip


def test_joint_damping_is_that_of_the_matrix_exponential():
    model = flexible(("joint_damping", "joint", {"coefficient": 0.3}))
    start = np.array([0.1, -0.2, 0.5, 1.0])
    result = run(model, 1.0, start, dt=1e-4)
    expected = expm(linear_matrix(model.parameters, 0.3) * result.time[-1]) @ start
    np.testing.assert_allclose(result.states[-1, :4], expected, rtol=1e-9, atol=1e-12)


def test_inertial_coupling_pulls_against_the_other_arm_s_acceleration():
    model = flexible(("inertial_coupling", "arm", {"coefficient": 0.05}), motor_damping=0.0, arm_damping=0.0)
    n = 1000
    result = simulate(model, np.zeros(n), DT, exogenous=np.full(n, 2.0))
    momentum = 0.0635 * result.states[:, 2] + 0.17 * result.states[:, 3]
    np.testing.assert_allclose(momentum, -0.05 * 2.0 * result.time, atol=1e-9)


def test_a_changed_payload_changes_the_acceleration_from_its_time_on():
    model = rigid(("payload_change", {"time": 1.0, "inertia": 0.3}), inertia=0.2)
    speed = run(model, 2.0, input_=0.5).states[:, 2]
    assert (speed[800] - speed[100]) / 0.7 == pytest.approx(2.5, rel=1e-6)
    assert (speed[1900] - speed[1200]) / 0.7 == pytest.approx(1.0, rel=1e-6)


def test_an_extra_flexible_mode_is_a_third_inertia_on_a_spring():
    frequency, inertia, ratio = 3.0, 0.06, 0.1
    model = flexible(
        ("extra_flexible_mode", "arm", {"frequency": frequency, "inertia": inertia, "damping_ratio": ratio})
    )
    rate = 2 * math.pi * frequency
    k, c = inertia * rate**2, 2 * ratio * rate * inertia
    p = model.parameters
    # Angles, then velocities, of motor, arm and the added part.
    mass = np.diag([p["motor_inertia"], p["arm_inertia"], inertia])
    stiffness = np.array([[3.971, -3.971, 0], [-3.971, 3.971 + k, -k], [0, -k, k]])
    damping = np.array([[2.6, 0, 0], [0, 0.02 + c, -c], [0, -c, c]])
    a = np.block([
        [np.zeros((3, 3)), np.eye(3)], [-np.linalg.solve(mass, stiffness), -np.linalg.solve(mass, damping)],
    ])  # fmt: skip
    start = np.array([0.1, 0.3, 0.3, 0.0, -1.0, -1.0])  # the added part moves along with the arm
    result = run(model, 1.5, (0.1, 0.3, 0.0, -1.0), dt=1e-4)
    expected = expm(a * result.time[-1]) @ start
    np.testing.assert_allclose(result.states[-1, [0, 1, 2, 3]], expected[[0, 1, 3, 4]], rtol=1e-8)
    modes = np.sort(np.abs(np.linalg.eigvals(a)))
    assert modes[-1] > 1.2 * rate  # the mode is inside what was compared, not beyond it


# The actuator.


def torque_of(effect, values, commanded, dt=DT):
    model = rigid((f"{effect}@actuator", values))
    return acting_torque(pack(model), commanded, dt)


RAMP = np.linspace(-1.5, 1.5, 301)
TIME = DT * np.arange(301)


@pytest.mark.parametrize(
    ("effect", "values", "expected"),
    [
        ("gain_error", {"gain": 1.2}, 1.2 * RAMP),
        (
            "gain_drift",
            {"change": -0.3, "time_constant": 0.1},
            RAMP * (1.0 - 0.3 * (1.0 - np.exp(-TIME / 0.1))),
        ),
        ("torque_saturation", {"limit": 0.8}, np.clip(RAMP, -0.8, 0.8)),
        ("dead_zone", {"width": 0.2}, np.sign(RAMP) * np.maximum(np.abs(RAMP) - 0.2, 0.0)),
        ("input_delay", {"delay": 0.02}, np.concatenate([np.zeros(20), RAMP[:-20]])),
        ("input_delay", {"delay": 0.0}, RAMP),
    ],
)
def test_the_acting_torque_is_that_of_the_formula(effect, values, expected):
    np.testing.assert_allclose(torque_of(effect, values, RAMP), expected, atol=1e-12)


def test_a_delay_of_a_fraction_of_a_sample_keeps_the_impulse_and_its_time():
    pulse = np.zeros(50)
    pulse[10] = 1.0
    acting = torque_of("input_delay", {"delay": 0.0123}, pulse)
    assert acting.sum() == pytest.approx(1.0)
    assert (acting * np.arange(50)).sum() == pytest.approx(10 + 12.3)


def test_the_lag_is_that_of_a_first_order_system_in_the_mean_over_each_sample():
    tau = 0.03
    acting = torque_of("actuator_lag", {"time_constant": tau}, np.ones(300))
    edges = DT * np.arange(301)
    impulse = edges + tau * np.expm1(-edges / tau)  # integral of 1 - exp(-t / tau)
    np.testing.assert_allclose(acting, np.diff(impulse) / DT, atol=1e-12)


# The sensors.


def swing(*effects):
    """A body that swings with 0.4 sin(5 t)."""
    return run(
        rigid(("spring_to_ground", {"stiffness": 5.0}), *effects, inertia=0.2), 4.0, (0.0, 0.0, 2.0, 0.0)
    )


def test_an_encoder_of_another_scale_reports_in_proportion():
    read = swing(("encoder_scale@motor_encoder", {"scale": 1.05}))
    np.testing.assert_allclose(read.motor_position, 1.05 * read.states[:, 0], atol=1e-15)
    np.testing.assert_allclose(read.motor_velocity, 1.05 * read.states[:, 2], atol=1e-15)


def test_an_eccentric_encoder_errs_periodically_and_not_at_zero():
    read = swing(("encoder_eccentricity@motor_encoder", {"amplitude": 0.02, "order": 4.0, "phase": 0.5}))
    angle, speed = read.states[:, 0], read.states[:, 2]
    error = 0.02 * (np.sin(4.0 * angle + 0.5) - math.sin(0.5))
    np.testing.assert_allclose(read.motor_position, angle + error, atol=1e-14)
    np.testing.assert_allclose(
        read.motor_velocity, speed * (1.0 + 0.08 * np.cos(4.0 * angle + 0.5)), atol=1e-14
    )
    assert read.motor_position[0] == 0.0


@pytest.mark.parametrize("effect", ["sensor_delay", "channel_skew"])
def test_a_late_encoder_shows_where_the_axis_was(effect):
    read = swing((f"{effect}@motor_encoder", {"delay": 0.0234}))
    late = read.time > 0.03
    expected = 0.4 * np.sin(5.0 * (read.time[late] - 0.0234))
    np.testing.assert_allclose(read.motor_position[late], expected, atol=1e-8)


def test_a_command_stamped_late_acted_earlier_than_the_record_says():
    command = np.where(np.arange(200) >= 100, 1.0, 0.0)
    acting = acting_torque(pack(rigid(("channel_skew@actuator", {"delay": 0.03}))), command, DT)
    np.testing.assert_allclose(acting, np.where(np.arange(200) >= 70, 1.0, 0.0))


def test_an_effect_left_out_and_one_at_its_neutral_value_are_the_same():
    """The neutral value is what diagnosis and estimation take for "not there"."""
    current = 0.15 * np.sin(3.0 * DT * np.arange(1500))
    for name, entry in EFFECTS.items():
        if entry.kind == "friction_factor":
            continue
        values = {}
        for p in entry.parameters:
            neutral = p.typical if p.neutral is None else p.neutral
            values[p.name] = min(max(neutral, p.minimum), p.maximum)
        if any(math.isinf(v) for v in values.values()):
            values = {n: 1e6 if math.isinf(v) else v for n, v in values.items()}
        if not any(p.neutral is not None for p in entry.parameters):
            continue
        model = flexible()
        with_it = model.with_effects(Effect(name, f"stage1_{entry.where[0]}", values))
        a, b = simulate(model, current, DT), simulate(with_it, current, DT)
        np.testing.assert_allclose(b.arm_position, a.arm_position, atol=1e-6, err_msg=name)
        np.testing.assert_allclose(b.motor_position, a.motor_position, atol=1e-6, err_msg=name)


def test_a_load_is_attached_over_as_much_time_as_its_entry_says():
    entry = effect_entry("payload_change")
    time = np.linspace(-1.0, 1.0, 200_001)
    on = SimpleNamespace(time=time, tanh=np.tanh)
    attached = entry.equation(on, SimpleNamespace(time=0.0, inertia=1.0))
    rate = np.gradient(attached, time)
    width = math.sqrt(np.sum(time**2 * rate) / np.sum(rate))
    assert entry.parameter("time").smeared == pytest.approx(width, rel=1e-3)
