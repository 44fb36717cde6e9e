"""Model files: what is read is what was written, and bad ones are refused in one sentence with a remedy."""

import copy
import math
from dataclasses import replace
from pathlib import Path

import pytest
import yaml

from haptic_teleop_control.errors import ModelError
from haptic_teleop_sim.default_models import omni_axis_model, sfj_stage_model
from haptic_teleop_sim.effects import EFFECTS
from haptic_teleop_sim.model import Effect, Model, load_model, model_from_mapping

GOOD = {
    "haptic_teleop_model": 1,
    "robot": "sfj",
    "joint": "stage1",
    "structure": "flexible_joint",
    "parameters": {
        "torque_constant": 8.925,
        "stiffness": 3.971,
        "motor_inertia": 0.0635,
        "motor_damping": 2.6,
        "arm_inertia": 0.17,
        "arm_damping": 0.02,
    },
    "fixed": ["stiffness"],
    "effects": [{"effect": "coulomb_friction", "location": "stage1_motor", "parameters": {"torque": 0.4}}],
}


def changed(path, value):
    """GOOD with the entry at `path` replaced, or removed when `value` is None."""
    content = copy.deepcopy(GOOD)
    place = content
    for key in path[:-1]:
        place = place[key]
    if value is None:
        del place[path[-1]]
    else:
        place[path[-1]] = value
    return content


COULOMB = GOOD["effects"][0]
BAD = {
    "no model file": (changed(["haptic_teleop_model"], None), "haptic_teleop_model: 1"),
    "other version": (changed(["haptic_teleop_model"], 2), "haptic_teleop_model: 1"),
    "unknown key": (changed(["efects"], []), "did you mean 'effects'"),
    "joint missing": (changed(["joint"], None), "'joint' is missing"),
    "wrong joint": (changed(["joint"], "stage3"), "stage1, stage2"),
    "joint of the other robot": (changed(["joint"], "omni_y"), "stage1, stage2"),
    "wrong robot": (changed(["robot"], "sfi"), "sfj, omni or generic"),
    "a joint that is a path": (changed(["joint"], "../elsewhere"), "give the joint's name"),
    "a joint without a name": (changed(["joint"], ".."), "give the joint's name"),
    "wrong structure": (changed(["structure"], "rigid"), "flexible_joint or rigid_body"),
    "unknown parameter": (changed(["parameters", "stifness"], 1.0), "did you mean 'stiffness'"),
    "missing parameter": (changed(["parameters", "arm_inertia"], None), "'arm_inertia' is missing"),
    "not a number": (changed(["parameters", "arm_inertia"], "0.17 kg"), "arm_inertia is '0.17 kg'"),
    "true is no number": (changed(["parameters", "arm_inertia"], True), "arm_inertia is True"),
    "not finite": (changed(["parameters", "arm_inertia"], math.nan), "arm_inertia is nan"),
    "infinite": (changed(["parameters", "stiffness"], math.inf), "stiffness is inf"),
    "inertia of zero": (changed(["parameters", "motor_inertia"], 0.0), "greater than zero"),
    "parameters are a list": (changed(["parameters"], [1.0]), "'parameters' must map"),
    "effects are a mapping": (changed(["effects"], {"effect": "gravity"}), "must be lists"),
    "fixed names nothing": (changed(["fixed"], ["stifness"]), "did you mean 'stiffness'"),
    "unknown effect": (changed(["effects", 0, "effect"], "colomb_friction"), "did you mean coulomb_friction"),
    "effect without location": (changed(["effects", 0, "location"], None), "location"),
    "effect of another joint": (changed(["effects", 0, "location"], "stage2_motor"), "possible: stage1_m"),
    "effect at a joint": (changed(["effects", 0, "location"], "stage1_joint"), "stage1_motor, stage1_arm"),
    "effect with an unknown parameter": (
        changed(["effects", 0, "parameters", "torqe"], 1.0), "did you mean 'torque'",
    ),
    "effect without its parameter": (changed(["effects", 0, "parameters"], {}), "torque is missing"),
    "effect beyond its bounds": (changed(["effects", 0, "parameters", "torque"], -1.0), "must lie between 0"),
    "effect not finite": (changed(["effects", 0, "parameters", "torque"], math.inf), "torque is inf"),
    "effect twice": (changed(["effects"], [COULOMB, COULOMB]), "stands there twice"),
    "a list": ([1, 2], "haptic_teleop_model: 1"),
}  # fmt: skip


@pytest.mark.parametrize(("content", "hint"), BAD.values(), ids=BAD.keys())
def test_a_bad_model_file_is_refused_in_one_sentence_with_file_and_remedy(tmp_path, content, hint):
    path = tmp_path / "bad.yaml"
    path.write_text(yaml.safe_dump(content), encoding="utf-8")
    with pytest.raises(ModelError) as refusal:
        load_model(path)
    sentence = str(refusal.value)
    assert str(path) in sentence
    assert hint in sentence
    assert "\n" not in sentence


@pytest.mark.parametrize("text", [b"robot: [sfj", b"\xff\xfe\x00", b""], ids=["broken", "binary", "empty"])
def test_what_is_no_yaml_is_refused_with_the_name_of_the_file(tmp_path, text):
    path = tmp_path / "broken.yaml"
    path.write_bytes(text)
    with pytest.raises(ModelError, match=r"broken\.yaml"):
        load_model(path)


def test_a_missing_file_is_refused(tmp_path):
    with pytest.raises(ModelError, match="no such file"):
        load_model(tmp_path / "none.yaml")


def test_effects_of_a_flexible_joint_are_refused_in_a_rigid_body():
    rigid = {**GOOD, "structure": "rigid_body", "fixed": [], "effects": [
        {"effect": "backlash", "location": "stage1_joint", "parameters": {"width": 0.01}}]}  # fmt: skip
    rigid["parameters"] = {
        k: GOOD["parameters"][k] for k in ("torque_constant", "motor_inertia", "motor_damping")
    }
    with pytest.raises(ModelError, match="rigid_body has no place for it"):
        model_from_mapping(rigid)


def test_a_written_model_reads_back_the_same(tmp_path):
    model = model_from_mapping(GOOD)
    model = model.with_effects(Effect("gravity", "stage1_arm", {"torque": 0.1 + 0.2}))
    model.save(tmp_path / "model.yaml")
    again = load_model(tmp_path / "model.yaml")
    assert again.to_mapping() == model.to_mapping()
    assert again.parameter_values()["stage1_arm.gravity.torque"] == 0.1 + 0.2


def test_every_effect_survives_being_written(tmp_path):
    for name, entry in EFFECTS.items():
        if entry.tabulated:  # test_torque_map.py
            continue
        values = {p.name: min(max(p.typical, p.minimum), p.maximum) for p in entry.parameters}
        model = Model("sfj", "stage1", "flexible_joint", GOOD["parameters"]).with_effects(
            Effect(name, f"stage1_{entry.where[0]}", values)
        )
        model.save(tmp_path / f"{name}.yaml")
        assert load_model(tmp_path / f"{name}.yaml").effects == model.effects


def test_free_parameters_are_what_is_not_fixed_and_for_optional_ones_written_out():
    model = model_from_mapping(GOOD)
    assert "stiffness" not in model.free_parameters()
    assert "stage1_motor.coulomb_friction.torque" in model.free_parameters()
    assert "stage1_motor.coulomb_friction.smoothing" not in model.free_parameters()
    stated = changed(["effects", 0, "parameters", "smoothing"], 0.01)
    assert "stage1_motor.coulomb_friction.smoothing" in model_from_mapping(stated).free_parameters()
    fixed = changed(["fixed"], ["stage1_motor.coulomb_friction.torque"])
    assert "stage1_motor.coulomb_friction.torque" not in model_from_mapping(fixed).free_parameters()


def test_values_are_replaced_by_their_full_names():
    model = model_from_mapping(GOOD).with_values(
        {"stiffness": 5.0, "stage1_motor.coulomb_friction.torque": 0.1}
    )
    assert model.parameters["stiffness"] == 5.0
    assert model.effects[0].parameters["torque"] == 0.1
    with pytest.raises(KeyError):
        model.with_values({"stage1_arm.coulomb_friction.torque": 0.1})


@pytest.mark.parametrize("joint", ["stage1", "stage2", "omni_x", "omni_y", "omni_z"])
def test_the_model_files_that_are_shipped_are_the_built_in_models(repository, joint):
    built_in = sfj_stage_model(joint) if joint.startswith("stage") else omni_axis_model(joint)
    folder = Path(repository) / "config" / "models"
    (path,) = folder.glob(f"*{joint}.yaml")
    assert load_model(path).to_mapping() == built_in.to_mapping()


def test_a_model_without_an_effect_has_none_of_its_parameters_left():
    model = Model(
        "sfj", "stage1", "flexible_joint",
        {"torque_constant": 8.9, "stiffness": 4.0, "motor_inertia": 0.06, "motor_damping": 2.0,
         "arm_inertia": 0.17, "arm_damping": 0.02},
        fixed=("stiffness",),
    )  # fmt: skip
    gravity = Effect("gravity", "stage1_arm", {"torque": 0.1, "phase": 0.0})
    friction = Effect("coulomb_friction", "stage1_motor", {"torque": 0.1})
    both = replace(model.with_effects(gravity, friction), fixed=("stiffness", "stage1_arm.gravity.phase"))
    assert both.without("gravity", "stage1_arm") == model.with_effects(friction)
    assert both.without("gravity", "stage1_motor") == both
