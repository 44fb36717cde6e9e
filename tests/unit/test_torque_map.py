"""A measured curve or surface of torque as an effect: its file, its shape, its motion."""

import math

import numpy as np
import pytest
import yaml
from plants import flexible, rigid
from scipy.integrate import solve_ivp
from scipy.interpolate import PchipInterpolator

from haptic_teleop_control.robots import SFJ_STAGES
from haptic_teleop_sim.effects.torque_map import QUANTITIES, TorqueMap
from haptic_teleop_sim.effects.torque_map_file import torque_map
from haptic_teleop_sim.export import mjcf_export, python_export, urdf_export
from haptic_teleop_sim.hardware import SfjRobot, SfjSettings, stage_hardware
from haptic_teleop_sim.kernel import pack, predict, simulate
from haptic_teleop_sim.model import Effect, load_model

DT = 2e-3
CURVE = {"variable": "angle", "knots": [-0.5, -0.1, 0.0, 0.2, 0.6], "torque": [0.3, 0.2, 0.0, -0.4, 0.1]}
SURFACE = {
    "variable": ["angle", "velocity"],
    "knots": [[-1.0, 0.0, 0.5], [-2.0, 2.0]],
    "torque": [[0.2, -0.2], [0.1, -0.1], [0.4, -0.4]],
    "torque_std": [[0.02, 0.02], [0.01, 0.01], [0.03, 0.03]],
}


def with_map(parameters, place="arm", **changes):
    return flexible(**changes).with_effects(
        Effect("torque_map", f"stage1_{place}", table=torque_map(parameters))
    )


def drive(n=1500):
    t = DT * np.arange(n)
    return 0.25 * np.sin(3.0 * t) + 0.1 * np.sin(11.0 * t + 1.0)


@pytest.mark.parametrize("parameters", [CURVE, SURFACE])
def test_a_map_survives_the_model_file(tmp_path, parameters):
    model = with_map(parameters)
    model.save(tmp_path / "m.yaml")
    assert load_model(tmp_path / "m.yaml").effects == model.effects
    written = yaml.safe_load((tmp_path / "m.yaml").read_text())["effects"][0]["parameters"]
    assert written == parameters
    assert "torque_map" not in " ".join(model.free_parameters())


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"knots": [0.0, 0.2, 0.1, 0.3, 0.4]}, "must ascend"),
        ({"knots": [0.0]}, "must ascend"),
        ({"torque": [0.0, 1.0]}, "has 2 numbers and the knots ask for 5"),
        ({"torque": [0.0, 1.0, math.nan, 0.0, 0.0]}, "finite numbers"),
        ({"torque": ["a", 1.0, 2.0, 0.0, 0.0]}, "finite numbers"),
        ({"torque": [[0.0, 1.0], [2.0]]}, "rows of one length"),
        ({"torque_std": [0.1, 0.1, -0.1, 0.1, 0.1]}, "below zero"),
        ({"variable": "speed"}, "one or two of angle"),
        ({"variable": ["angle", "velocity", "input"]}, "one quantity, or two"),
        ({"variable": ["angle", "angle"]}, "two different"),
        ({"variable": ["angle", "velocity"]}, "must be two lists"),
        ({"colour": 3}, "unknown parameter"),
        ({"knots": None}, "finite numbers"),
    ],
)
def test_a_wrong_map_is_refused_in_one_sentence(tmp_path, change, told):
    content = flexible().to_mapping()
    content["effects"] = [
        {"effect": "torque_map", "location": "stage1_arm", "parameters": {**CURVE, **change}}
    ]
    (tmp_path / "m.yaml").write_text(yaml.safe_dump(content))
    with pytest.raises(ValueError, match=told) as refused:
        load_model(tmp_path / "m.yaml")
    assert "m.yaml" in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_map_that_lacks_its_numbers_or_its_joint_is_refused():
    with pytest.raises(ValueError, match="add them"):
        flexible().with_effects(Effect("torque_map", "stage1_arm"))
    bent = torque_map({**CURVE, "variable": "deflection"})
    with pytest.raises(ValueError, match="does not have"):
        rigid().with_effects(Effect("torque_map", "j_motor", table=bent))
    other = torque_map({**CURVE, "variable": "other_angle"})
    with pytest.raises(ValueError, match="only the stages"):
        rigid().with_effects(Effect("torque_map", "j_motor", table=other))
    with pytest.raises(ValueError, match="one signal"):
        flexible(("inertial_coupling", "arm", {"coefficient": 0.1})).with_effects(
            Effect("torque_map", "stage1_arm", table=other)
        )


def test_the_curve_is_scipy_s_between_the_knots_and_held_beyond_them():
    own = torque_map(CURVE)
    x = np.linspace(-0.5, 0.6, 401)
    assert own.at(x) == pytest.approx(PchipInterpolator(CURVE["knots"], CURVE["torque"])(x), abs=1e-13)
    assert own.at(np.array([-9.0, 9.0])) == pytest.approx([0.3, 0.1], abs=0.0)
    assert np.max(np.abs(own.at(np.linspace(-2, 2, 2001)))) <= 0.4


def test_a_surface_goes_through_its_knots_smoothly():
    own = torque_map(SURFACE)
    assert own.at(*np.meshgrid(*map(np.array, own.knots), indexing="ij")) == pytest.approx(own.table())
    rng = np.random.default_rng(3)
    wavy = torque_map(
        {"variable": ["angle", "input"], "knots": [np.arange(4.0), np.arange(5.0)],
         "torque": rng.standard_normal((4, 5))}
    )  # fmt: skip
    for axis in (0, 1):  # no jump of the slope where pieces meet
        at = np.array([[1.0, 2.3], [2.4, 3.0]][axis])
        step = 1e-6 * np.eye(2)[axis]
        values = [float(wavy.at(*(at + k * step).reshape(2, 1))[0]) for k in (-2, -1, 0, 1, 2)]
        assert values[1] - values[0] == pytest.approx(values[4] - values[3], rel=1e-3)


@pytest.mark.parametrize(
    ("variable", "place", "named"),
    [
        ("angle", "arm", ("spring_to_ground", "arm", {"stiffness": 0.7})),
        ("deflection_rate", "joint", ("joint_damping", "joint", {"coefficient": 0.7})),
    ],
)
def test_a_straight_curve_is_the_effect_with_a_name(variable, place, named):
    sign = 1.0 if place == "joint" else -1.0
    straight = {"variable": variable, "knots": [-9.0, -1.0, 0.3, 9.0]}
    straight["torque"] = [0.7 * sign * k for k in straight["knots"]]
    models = (with_map(straight, place), flexible(named))
    ours, theirs = (simulate(m, drive(), DT).states[:, :4] for m in models)
    assert ours == pytest.approx(theirs, abs=1e-12)


def test_a_surface_moves_the_arm_as_a_general_solver_says():
    """f = -0.3 v (1 + q), which is linear along either axis and so exactly what the surface is."""
    q, v = np.linspace(-2.0, 2.0, 5), np.linspace(-6.0, 6.0, 4)
    model = with_map(
        {"variable": ["angle", "velocity"], "knots": [q, v],
         "torque": -0.3 * v[None, :] * (1.0 + q[:, None])}, motor_damping=0.3
    )  # fmt: skip
    b = dict(model.parameters)
    current = 0.2

    def rates(t, x):
        spring = b["stiffness"] * (x[0] - x[1])
        push = b["torque_constant"] * current - b["motor_damping"] * x[2] - spring
        pull = spring - b["arm_damping"] * x[3] - 0.3 * x[3] * (1.0 + x[1])
        return [x[2], x[3], push / b["motor_inertia"], pull / b["arm_inertia"]]

    start = np.array([-0.5, -0.6, 0.2, -0.3])
    states = simulate(model, np.full(400, current), DT, start).states
    times = DT * np.arange(400)
    exact = solve_ivp(rates, (0.0, times[-1]), start, "DOP853", times, rtol=1e-11, atol=1e-12)
    assert np.max(states[:, 1]) < 2.0
    assert states[:, :2] == pytest.approx(exact.y[:2].T, abs=1e-7)


def test_a_map_at_the_joint_follows_the_motor_s_angle_and_the_deflection():
    """A spring whose stiffness falls with the motor's angle, f = -2 d (1 + q), which acts on both sides."""
    q, d = np.linspace(-2.0, 2.0, 5), np.linspace(-1.0, 1.0, 5)
    model = with_map(
        {"variable": ["angle", "deflection"], "knots": [q, d],
         "torque": 2.0 * d[None, :] * (1.0 + q[:, None])}, "joint", motor_damping=0.3
    )  # fmt: skip
    b = dict(model.parameters)

    def rates(t, x):
        deflection = x[0] - x[1]
        spring = deflection * (b["stiffness"] + 2.0 * (1.0 + x[0]))
        push = b["torque_constant"] * 0.2 - b["motor_damping"] * x[2] - spring
        pull = spring - b["arm_damping"] * x[3]
        return [x[2], x[3], push / b["motor_inertia"], pull / b["arm_inertia"]]

    start = np.array([-0.5, -0.6, 0.2, -0.3])
    states = simulate(model, np.full(400, 0.2), DT, start).states
    times = DT * np.arange(400)
    exact = solve_ivp(rates, (0.0, times[-1]), start, "DOP853", times, rtol=1e-11, atol=1e-12)
    assert np.max(np.abs(states[:, 0])) < 2.0 and np.max(np.abs(states[:, 0] - states[:, 1])) < 1.0
    assert states[:, :2] == pytest.approx(exact.y[:2].T, abs=1e-7)
    space: dict = {}
    exec(compile(python_export(model).text, "exported", "exec"), space)
    theirs = space["simulate"](drive(300), DT)["states"]
    assert theirs == pytest.approx(simulate(model, drive(300), DT).states[:, :4], abs=1e-12)


@pytest.mark.parametrize("place", ["motor", "joint"])
@pytest.mark.parametrize("variable", QUANTITIES)
def test_the_structure_s_derivatives_are_exact_beside_a_map_of(variable, place):
    scale = 0.3 if variable in ("angle", "deflection") else 2.0
    knots = (scale * np.linspace(-1.0, 1.0, 7)).tolist()
    curve = {"variable": variable, "knots": knots, "torque": [0.2 * math.sin(2.0 * k / scale) for k in knots]}
    model = with_map(curve, place, motor_damping=0.5)
    other = np.cos(2.0 * DT * np.arange(1500))

    def run(changed, free=()):
        return predict(pack(changed), drive(), np.zeros((1500, 2)), DT, free, exogenous=other)

    free = model.free_parameters()
    exact = run(model, free).d_innovation
    for column, name in enumerate(free):
        value = model.parameter_values()[name]
        sides = [run(model.with_values({name: (1.0 + h) * value})).innovation for h in (1e-5, -1e-5)]
        slope = (sides[0] - sides[1]) / (2e-5 * value)
        assert np.linalg.norm(exact[:, :, column] - slope) < 2e-3 * np.linalg.norm(slope), name
    assert np.ptp(run(model).innovation - run(flexible(motor_damping=0.5)).innovation) > 1e-4


@pytest.mark.parametrize(("variable", "column"), [("other_angle", 1), ("other_velocity", 3)])
def test_a_stage_of_the_robot_is_pushed_by_what_the_other_one_does(variable, column):
    table = torque_map({"variable": variable, "knots": [-5.0, 5.0], "torque": [-2.5, 2.5]})
    follows = flexible().with_effects(Effect("torque_map", "stage1_arm", table=table))
    quiet = {"sense_noise": 0.0, "sense_offset": 0.0, "sense_resolution": 0.0, "command_resolution": 0.0}
    first = stage_hardware("stage1", model=follows, **quiet)
    second = stage_hardware("stage2", **quiet)
    robot = SfjRobot(SfjSettings(first, second), DT)
    moved = []
    for ampere in drive(400):
        robot.sense()
        moved.append([robot.plants.state(i)[:4].copy() for i in (0, 1)])
        robot.step([0.0, SFJ_STAGES["stage2"].torque_constant * ampere])
    ours, other = np.array(moved)[:, 0], np.array(moved)[:, 1]
    told = simulate(follows, np.zeros(400), DT, exogenous=other[:, column]).states[:, :4]
    pushed = simulate(flexible(), np.zeros(400), DT, external_torque=0.5 * other[:, column]).states[:, :4]
    assert np.ptp(ours[:, 1]) > 1e-3
    assert ours == pytest.approx(told, abs=1e-12)
    assert told == pytest.approx(pushed, abs=1e-12)


def test_the_python_file_has_the_map_and_the_others_say_that_they_have_not():
    for parameters in (CURVE, SURFACE):
        model = with_map(parameters)
        text = python_export(model).text
        space: dict = {}
        exec(compile(text, "exported", "exec"), space)
        theirs = space["simulate"](drive(300), DT)["states"]
        assert theirs == pytest.approx(simulate(model, drive(300), DT).states[:, :4], abs=1e-12)
        for exported in (mjcf_export(model, 1e-4), urdf_export(model)):
            assert exported.sayings[0].how == "left out"
            assert exported.sayings[0].note


def test_a_steep_map_is_given_the_steps_that_it_needs():
    steep = with_map({"variable": "angle", "knots": [-1.0, 1.0], "torque": [4e4, -4e4]})
    states = simulate(steep, np.zeros(400), DT, np.array([0.0, 0.01, 0.0, 0.0])).states
    assert np.max(np.abs(states[:, 1])) < 0.0101
    assert isinstance(steep.effects[0].table, TorqueMap)
