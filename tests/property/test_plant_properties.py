"""What must hold for every plant, not only for the ones that came to mind."""

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from haptic_teleop_sim.effects import EFFECTS
from haptic_teleop_sim.experiments import run_open_loop
from haptic_teleop_sim.hardware import SfjRobot, SfjSettings, stage_hardware
from haptic_teleop_sim.kernel import pack, simulate
from haptic_teleop_sim.model import Effect, Model, load_model

DT = 2e-3
N = 500


def numbers(low, high):
    return st.floats(math.log(low), math.log(high)).map(math.exp)


structures = st.fixed_dictionaries(
    {
        "torque_constant": numbers(0.1, 20.0),
        "stiffness": numbers(0.5, 20.0),
        "motor_inertia": numbers(5e-3, 0.5),
        "motor_damping": numbers(1e-3, 5.0),
        "arm_inertia": numbers(5e-3, 0.5),
        "arm_damping": numbers(1e-3, 1.0),
    }
)
starts = st.tuples(*[st.floats(-0.5, 0.5)] * 2, *[st.floats(-2.0, 2.0)] * 2)

#: Effects that can only take energy, or store what they give back in what `stored` knows.
DISSIPATIVE = {
    "coulomb_friction": ("motor", {"torque": numbers(0.01, 1.0)}),
    "stribeck_friction": (
        "arm",
        {"coulomb": numbers(0.01, 0.3), "breakaway": numbers(0.3, 1.0), "velocity": numbers(0.05, 1.0)},
    ),
    "asymmetric_friction": ("motor", {"positive": numbers(0.01, 1.0), "negative": numbers(0.01, 1.0)}),
    "quadratic_drag": ("arm", {"coefficient": numbers(0.01, 1.0)}),
    "load_dependent_friction": ("motor", {"coefficient": numbers(0.01, 0.3)}),
    "joint_damping": ("joint", {"coefficient": numbers(0.01, 1.0)}),
}


@st.composite
def dissipative_models(draw):
    model = Model("sfj", "stage1", "flexible_joint", draw(structures))
    for name in draw(st.lists(st.sampled_from(sorted(DISSIPATIVE)), max_size=3, unique=True)):
        place, values = DISSIPATIVE[name]
        drawn = {key: draw(value) for key, value in values.items()}
        model = model.with_effects(Effect(name, f"stage1_{place}", drawn))
    return model


def stored(model, states):
    m = model.parameters
    kinetic = 0.5 * m["motor_inertia"] * states[:, 2] ** 2 + 0.5 * m["arm_inertia"] * states[:, 3] ** 2
    return kinetic + 0.5 * m["stiffness"] * (states[:, 0] - states[:, 1]) ** 2


@given(dissipative_models(), starts)
def test_without_input_friction_and_damping_only_take_energy(model, start):
    energy = stored(model, simulate(model, np.zeros(N), DT, np.array(start)).states)
    assert np.all(np.isfinite(energy))
    # A sticking contact is a spring over 0.2 mrad: it gives back what little it stored.
    spring = sum(
        max(e.values.get(k, 0.0) for k in ("torque", "breakaway", "positive", "negative"))
        for e in model.effects
    )
    allowed = 1e-4 * energy[0] + 2e-4 * (spring + model.parameters["stiffness"]) + 1e-12
    assert np.all(energy <= np.minimum.accumulate(energy) + allowed)


@given(structures, starts, st.floats(-3.0, 3.0))
def test_the_plain_joint_is_linear(parameters, start, factor):
    model = Model("sfj", "stage1", "flexible_joint", parameters)
    current = 0.1 * np.sin(0.03 * np.arange(N))
    one = simulate(model, current, DT, np.array(start)).states
    other = simulate(model, factor * current, DT, factor * np.array(start)).states
    np.testing.assert_allclose(other, factor * one, atol=1e-9 * (1.0 + np.abs(one).max()))


@given(structures, starts, st.floats(-1.0, 1.0))
def test_the_plain_joint_does_not_care_where_its_angles_are_counted_from(parameters, start, shift):
    model = Model("sfj", "stage1", "flexible_joint", parameters)
    moved = np.add(start, [shift, shift, 0.0, 0.0])
    a = simulate(model, np.zeros(N), DT, np.array(start)).states
    b = simulate(model, np.zeros(N), DT, moved).states
    np.testing.assert_allclose(b[:, :2] - shift, a[:, :2], atol=1e-9)
    np.testing.assert_allclose(b[:, 2:4], a[:, 2:4], atol=1e-8)


def effect_values(draw, entry):
    values = {}
    for p in entry.parameters:
        if p.default is not None and draw(st.booleans()):
            continue
        low, high = max(p.minimum, -abs(3 * p.typical) - 1e-3), min(p.maximum, abs(3 * p.typical) + 1e-3)
        values[p.name] = draw(st.floats(low, high))
    return values


#: Maps have numbers of another kind: test_torque_map.py.
NAMED = sorted(name for name, entry in EFFECTS.items() if not entry.tabulated)


@st.composite
def any_models(draw):
    model = Model("sfj", "stage1", "flexible_joint", draw(structures))
    for name in draw(st.lists(st.sampled_from(NAMED), max_size=4, unique=True)):
        entry = EFFECTS[name]
        place = draw(st.sampled_from(entry.where))
        model = model.with_effects(Effect(name, f"stage1_{place}", effect_values(draw, entry)))
    return model


@given(model=any_models())
def test_every_model_is_read_back_as_it_was_written(model, tmp_path_factory):
    path = tmp_path_factory.mktemp("model") / "model.yaml"
    model.save(path)
    again = load_model(path)
    assert again.parameter_values() == model.parameter_values()
    assert again.free_parameters() == model.free_parameters()
    np.testing.assert_array_equal(pack(again).codes, pack(model).codes)


@settings(max_examples=25)
@given(
    st.lists(
        st.sampled_from([0.0, 1.0, -50.0, math.nan, math.inf, -math.inf, 1e308, 1e-308]),
        min_size=4,
        max_size=40,
    )
)
def test_no_command_whatever_gets_through_the_amplifier(commands):
    robot = SfjRobot(SfjSettings(stage_hardware("stage1"), stage_hardware("stage2")))
    efforts = np.array(commands[: len(commands) // 2 * 2]).reshape(-1, 2)
    for effort in efforts:
        position, velocity, measured = robot.sense()
        assert np.all(np.isfinite([position, velocity, measured]))
        robot.step(effort)
        assert np.all(np.abs(robot.flow) <= [0.94, 1.2])
    run_open_loop(robot, efforts)
    assert np.all(np.isfinite(robot.plants.states))
