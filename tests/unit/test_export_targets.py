"""An exported model moves elsewhere as it does here: the Python file to rounding, MJCF and URDF in MuJoCo."""

import ast
import re
import sys
import xml.etree.ElementTree as ElementTree
from dataclasses import replace

import numpy as np
import pytest
from joint_recordings import TRUTH, excitation, response

from haptic_teleop_control.errors import ModelError
from haptic_teleop_sim import mujoco_robot
from haptic_teleop_sim.effects import EFFECTS, locations
from haptic_teleop_sim.effects.torque_map_file import torque_map
from haptic_teleop_sim.export import mjcf_export, python_export, urdf_export
from haptic_teleop_sim.export.mujoco_run import run_in_mujoco
from haptic_teleop_sim.kernel import simulate
from haptic_teleop_sim.model import Effect, Model

MUJOCO = pytest.mark.skipif(not mujoco_robot.mujoco_installed(), reason="MuJoCo is not installed")
DT = 0.002
RIGID = {name: TRUTH[name] for name in ("torque_constant", "motor_inertia", "motor_damping")}
INPUT = 1.7 * excitation(1000)
SIZES = {
    "coulomb_friction": {"torque": 0.3},
    "hard_stop": {"angle": 0.2, "stiffness": 100.0},
    "torque_saturation": {"limit": 0.9},
    "payload_change": {"time": 1.0, "inertia": 0.1},
    "input_delay": {"delay": 0.0331},
    "sensor_delay": {"delay": 0.0213},
    "backlash": {"width": 0.1},
    "hardening_spring": {"cubic": 40.0},
    "gravity": {"torque": 0.5, "phase": 0.6},
    "detent": {"torque": 0.2, "angle": 0.05},
    "hysteresis": {"torque": 0.1, "displacement": 1e-4},
    "gain_error": {"gain": 1.3},
}
"""Parameters whose typical size does not show in this motion; the others have that size."""


def effect(name, location):
    if EFFECTS[name].tabulated:
        curve = {"variable": "velocity", "knots": [-1.0, 0.0, 2.0], "torque": [0.3, 0.0, -0.4]}
        return Effect(name, location, table=torque_map(curve))
    typical = {p.name: p.default if p.default is not None else max(p.typical, p.minimum)
               for p in EFFECTS[name].parameters}  # fmt: skip
    return Effect(name, location, {**typical, **SIZES.get(name, {})})


def model(*effects, structure="flexible_joint", robot="sfj", joint="stage1"):
    parameters = TRUTH if structure == "flexible_joint" else RIGID
    return Model(robot, joint, structure, parameters, effects=effects)


def loaded(text):
    space = {}
    exec(compile(text, "exported", "exec"), space)
    return space["simulate"]


def off(ours, theirs):
    """Largest rms difference of a signal, relative to its spread here."""
    pairs = [(getattr(ours, signal), y) for signal, y in theirs.items()]
    return max(np.sqrt(np.mean((x - y) ** 2)) / np.std(x) for x, y in pairs)


PLACES = [(name, structure, place) for name in EFFECTS for structure in ("flexible_joint", "rigid_body")
          for place in locations(name, structure)]  # fmt: skip


@pytest.mark.parametrize("name", EFFECTS)
def test_the_python_file_computes_every_effect_at_every_place_as_the_simulation_does(name):
    short, other = INPUT[:300], 5.0 * np.cos(7.0 * DT * np.arange(300))
    start, push = (0.05, 0.02, 0.1, -0.1), 0.05 * np.sin(9.0 * DT * np.arange(300))
    moved = 0.0
    for _, structure, place in (p for p in PLACES if p[0] == name):
        with_it = model(effect(name, f"stage1_{place}"), structure=structure)
        theirs = loaded(python_export(with_it).text)(short, DT, start, push, other, 0.9)
        ours, without = (
            simulate(m, short, DT, start, external_torque=push, exogenous=other, t0=0.9)
            for m in (with_it, model(structure=structure))
        )
        for key in ("time", "torque", "motor_position", "motor_velocity", "arm_position", "arm_velocity"):
            expected = getattr(ours, key)
            size = 1.0 + np.abs(expected).max()
            np.testing.assert_allclose(theirs[key], expected, rtol=0, atol=1e-11 * size)
        moved = max(moved, np.abs(ours.motor_velocity - without.motor_velocity).max())
        moved = max(moved, np.abs(ours.arm_velocity - without.arm_velocity).max())
    assert moved > 1e-6  # else the comparison says nothing of the effect


def test_the_python_file_with_many_effects_computes_what_the_simulation_does():
    many = [("input_delay", "actuator"), ("torque_saturation", "actuator"), ("actuator_lag", "actuator"),
            ("stribeck_friction", "motor"), ("coulomb_friction", "arm"), ("friction_drift", "motor"),
            ("payload_change", "arm"), ("extra_flexible_mode", "arm"), ("hysteresis", "joint"),
            ("creep", "joint"),
            ("encoder_scale", "arm_encoder"), ("encoder_eccentricity", "arm_encoder"),
            ("sensor_delay", "arm_encoder"), ("channel_skew", "actuator")]  # fmt: skip
    whole = model(*(effect(name, f"stage1_{place}") for name, place in many))
    theirs = loaded(python_export(whole).text)(INPUT[:400], 0.001)
    ours = simulate(whole, INPUT[:400], 0.001)
    np.testing.assert_allclose(theirs["arm_velocity"], ours.arm_velocity, rtol=0, atol=1e-9)


@pytest.mark.parametrize("structure", ["flexible_joint", "rigid_body"])
def test_the_python_file_takes_the_steps_that_a_steep_law_needs(structure):
    drag = Effect("quadratic_drag", "stage1_motor", {"coefficient": 90.0})
    effects = [drag, Effect("hardening_spring", "stage1_joint", {"cubic": 4e4})]
    whole = model(*effects[: 2 if structure == "flexible_joint" else 1], structure=structure)
    theirs = loaded(python_export(whole).text)(INPUT[:400], 0.004)
    ours = simulate(whole, INPUT[:400], 0.004)
    assert np.all(np.isfinite(ours.states))
    np.testing.assert_allclose(theirs["motor_velocity"], ours.motor_velocity, rtol=1e-9, atol=1e-12)


def test_the_python_file_without_effects_follows_the_matrix_exponential():
    theirs = loaded(python_export(model()).text)(INPUT, DT)
    exact = response(INPUT)
    np.testing.assert_allclose(theirs["states"], exact, rtol=0, atol=1e-5 * np.abs(exact).max())


def test_the_python_file_imports_numpy_alone_and_holds_one_function():
    tree = ast.parse(python_export(model(effect("actuator_lag", "stage1_actuator"))).text)
    imports = [node for node in ast.walk(tree) if isinstance(node, ast.Import | ast.ImportFrom)]
    assert [ast.unparse(node) for node in imports] == ["import numpy as np"]
    assert [node.name for node in tree.body if isinstance(node, ast.FunctionDef)] == ["simulate"]


HOSTILE = '"""+__import__("os").abort()+"""\n---><x>&\\'


def test_a_hostile_name_stays_a_name():
    evil = effect("coulomb_friction", f"{HOSTILE}_motor")
    named = model(evil, robot="generic", joint=HOSTILE)
    ours = simulate(named, INPUT[:20], DT)
    np.testing.assert_array_equal(loaded(python_export(named).text)(INPUT[:20], DT)["torque"], ours.torque)
    for export in (lambda m: mjcf_export(m, 1e-4), urdf_export):
        with pytest.raises(ModelError, match="printable letters"):
            export(named)
        printable = HOSTILE.replace("\n", "")
        tame = replace(named, joint=printable, effects=(effect("coulomb_friction", f"{printable}_motor"),))
        root = ElementTree.fromstring(export(tame).text)
        assert printable in {e.get("name", "") for e in root.iter()} | {root.get("model", "")}
        assert not list(root.iter("x"))


def how(name, structure, place):
    whole = model(effect(name, f"stage1_{place}"), structure=structure)
    return mjcf_export(whole, 1e-4).sayings[0].how


MJCF = [place for place in PLACES if how(*place) == "expressed"]


@MUJOCO
@pytest.mark.parametrize(("name", "structure", "place"), MJCF)
def test_mujoco_moves_the_exported_mjcf_as_the_simulation_does(name, structure, place):
    whole = model(effect(name, f"stage1_{place}"), structure=structure)
    exported = mjcf_export(whole, 1e-4)
    theirs = run_in_mujoco(exported.text, "stage1", INPUT, DT)
    assert len(theirs) == (2 if structure == "rigid_body" else 4)
    error = off(simulate(whole, INPUT, DT), theirs)
    # Dry friction and impacts are other ideas there, which shows in the velocities.
    rough = name in ("coulomb_friction", "hysteresis", "hard_stop")
    assert error < (0.02 if rough else 0.002)
    assert error < 0.2 * off(simulate(model(structure=structure), INPUT, DT), theirs)


CHAIN = ("torque_saturation", "actuator_lag")


@MUJOCO
@pytest.mark.parametrize("order", [CHAIN, CHAIN[::-1]], ids=" then ".join)
def test_a_saturation_acts_before_or_behind_a_lag_as_in_the_model(order):
    chain = [effect(name, "stage1_actuator") for name in (order[0], "gain_error", order[1])]
    slow = {"time_constant": 0.1}
    chain = [replace(e, parameters=slow) if e.effect == "actuator_lag" else e for e in chain]
    limited, turned = model(*chain), model(*reversed(chain))
    theirs = run_in_mujoco(mjcf_export(limited, 1e-4).text, "stage1", INPUT, DT)
    assert off(simulate(limited, INPUT, DT), theirs) < 0.002
    assert off(simulate(turned, INPUT, DT), theirs) > 0.02


@MUJOCO
@pytest.mark.parametrize("name", ["stribeck_friction", "asymmetric_friction", "position_dependent_friction"])
def test_mujoco_moves_what_stands_for_an_effect_as_that_does_here(name):
    both = model(effect("coulomb_friction", "stage1_motor"), effect(name, "stage1_motor"))
    exported = mjcf_export(both, 1e-4)
    assert [s.how for s in exported.sayings] == ["expressed", "approximated"]
    theirs = run_in_mujoco(exported.text, "stage1", INPUT, DT)
    assert off(simulate(exported.carried, INPUT, DT), theirs) < 0.02
    assert not exported.structure


def test_mjcf_leaves_out_what_it_has_no_words_for_and_says_so_in_the_file():
    lost = effect("torque_ripple", "stage1_motor")
    exported = mjcf_export(model(lost), 1e-4)
    assert exported.sayings[0].how == "left out"
    assert exported.carried.effects == ()
    assert "torque_ripple at stage1_motor left out" in exported.text


@MUJOCO
def test_mujoco_moves_the_urdf_of_a_rigid_body_as_the_simulation_does():
    whole = model(effect("gravity", "stage1_motor"), effect("torque_saturation", "stage1_actuator"),
                  effect("gain_error", "stage1_actuator"), structure="rigid_body")  # fmt: skip
    exported = urdf_export(whole)
    theirs = run_in_mujoco(exported.text, "stage1", INPUT, DT, 1.3 * TRUTH["torque_constant"])
    assert off(simulate(whole, INPUT, DT), theirs) < 0.002
    assert exported.carried == replace(whole, fixed=())


@MUJOCO
def test_mujoco_moves_the_urdf_of_a_flexible_joint_as_one_whose_spring_is_rigid():
    exported = urdf_export(model())
    theirs = run_in_mujoco(exported.text, "stage1", INPUT, DT, TRUTH["torque_constant"])
    assert exported.structure
    assert off(simulate(exported.carried, INPUT, DT), theirs) < 0.005
    assert off(simulate(model(), INPUT, DT), theirs) > 0.1


def test_the_urdf_states_dynamics_and_limits_of_both_parts():
    stop = Effect("hard_stop", "stage1_arm", {"angle": -0.4, "stiffness": 50.0, "both_sides": 1.0})
    rubs = [effect("coulomb_friction", f"stage1_{place}") for place in ("motor", "arm")]
    joint = ElementTree.fromstring(urdf_export(model(stop, *rubs)).text).find("joint")
    dynamics = joint.find("dynamics").attrib
    assert (float(dynamics["damping"]), float(dynamics["friction"])) == pytest.approx((2.62, 0.6))
    limit = {name: float(value) for name, value in joint.find("limit").attrib.items()}
    assert (limit["lower"], limit["upper"]) == (-0.4, 0.4)
    assert limit["effort"] == pytest.approx(0.94 * 8.925)


def test_the_page_says_of_each_effect_what_the_files_do(repository):
    page = (repository / "docs/export.md").read_text()
    lines = re.findall(r"^\| (`\w+`(?:, `\w+`)*) \| ([a-z ]+) \| ([a-z ]+) \|$", page, re.MULTILINE)
    rows = [(name, *said) for names, *said in lines for name in re.findall(r"\w+", names)]
    assert len(rows) == len({name for name, *_ in rows})
    assert {name for name, *_ in rows} == {name for name, entry in EFFECTS.items() if not entry.unnamed}
    for name, *said in rows:
        for place in locations(name, "flexible_joint"):
            own = effect(name, f"stage1_{place}")
            wide = {"displacement": 0.05} if name == "hysteresis" else {}
            one = model(replace(own, parameters={**own.parameters, **wide}))
            assert [e.sayings[0].how for e in (mjcf_export(one, 1e-4), urdf_export(one))] == said, name


@pytest.mark.parametrize(
    ("robot", "joint", "said"),
    [
        ("sfj", "stage1", "current, A"),
        ("omni", "omni_y", "torque, N*m"),
        ("generic", "j2", "input, in the unit of the recording"),
    ],
)
def test_a_file_says_its_input_in_the_unit_that_the_model_takes(robot, joint, said):
    rigid = model(structure="rigid_body", robot=robot, joint=joint)
    assert f"control: {said};" in mjcf_export(rigid, 1e-4).text
    assert f"input_ (n,): {said};" in python_export(rigid).text


@MUJOCO
def test_the_snippets_of_the_page_run(repository, tmp_path, monkeypatch):
    (tmp_path / "stage1.xml").write_text(mjcf_export(model(), 1e-4).text)
    (tmp_path / "stage1.py").write_text(python_export(model()).text)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setitem(sys.modules, "stage1", None)
    del sys.modules["stage1"]  # and once more when the test is over
    angles = []
    for snippet in re.findall(r"```python\n(.*?)```", (repository / "docs/export.md").read_text(), re.DOTALL):
        space = {}
        exec(snippet, space)
        angles.append(space["angle"])
    assert angles[0] > 0.0
    assert angles[1].shape == (500,)
