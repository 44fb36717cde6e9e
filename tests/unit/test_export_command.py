"""`haptic-teleop export`: what it writes, what it measures, what it refuses."""

import json
import sys

import numpy as np
import pytest
from joint_recordings import TRUTH, excitation, joint_recording, response
from scipy.signal import cont2discrete, dlsim

from haptic_teleop_control.recording import write_recording
from haptic_teleop_control.signals.generator import SignalGenerator
from haptic_teleop_sim import mujoco_robot
from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sysid.commands.export import main

MUJOCO = pytest.mark.skipif(not mujoco_robot.mujoco_installed(), reason="MuJoCo is not installed")
RIPPLE = Effect("torque_ripple", "stage1_motor", {"amplitude": 0.4, "order": 8.0})
LAG = Effect("actuator_lag", "stage1_actuator", {"time_constant": 0.05})


@pytest.fixture
def export(tmp_path):
    """Saves a model, exports it, returns exit status and the JSON beside the file (None without)."""

    def run(target, *arguments, effects=(), structure="flexible_joint", parameters=TRUTH):
        model = Model("sfj", "stage1", structure, parameters, effects=tuple(effects))
        model.save(tmp_path / "m.yaml")
        output = tmp_path / "out" / f"m.{target}"
        model_file = str(tmp_path / "m.yaml")
        status = main(["--model", model_file, "--to", target, "--output", str(output), *arguments])
        beside = output.with_name(output.name + ".json")
        return status, json.loads(beside.read_text()) if beside.exists() else None

    return run


def test_what_a_urdf_leaves_out_costs_what_theory_says(export):
    inertia, damping, stiffness = 0.05, 0.4, 2.0
    rigid = {"torque_constant": 1.0, "motor_inertia": inertia, "motor_damping": damping}
    spring = Effect("spring_to_ground", "stage1_motor", {"stiffness": stiffness})
    described = {"effects": [spring], "structure": "rigid_body", "parameters": rigid}
    status, found = export("urdf", "--seconds", "10", **described)
    assert status == 0
    on = found["measured_on"]
    assert (on["kind"], on["samples"], on["dt_s"], on["unit"]) == ("multisine", 5000, 0.002, "A")

    wave = {"enabled": True, "rms": on["rms"], "period": on["period_s"], "f_min": on["f_min_hz"],
            "f_max": on["f_max_hz"], "seed": on["seed"]}  # fmt: skip
    parameters = {f"stage1.multisine.{k}": v for k, v in wave.items()}
    parameters |= {"kind": "effort", "stage1.enabled": True}
    generator = SignalGenerator.from_parameters(parameters, ("stage1",))
    u = generator.series(0.002 * np.arange(5000))[:, 0]
    assert np.abs(u).max() <= 0.94  # what the stage's amplifier gives

    def speed(k):
        a, b = np.array([[0, 1], [-k / inertia, -damping / inertia]]), np.array([[0], [1 / inertia]])
        system = cont2discrete((a, b, np.array([[0, 1]]), np.zeros((1, 1))), 0.002)
        return dlsim(system, u)[1].ravel()

    truth, without = speed(stiffness), speed(0.0)
    cost = 100.0 * np.linalg.norm(truth - without) / np.linalg.norm(truth - truth.mean())
    assert found["effects"][0]["cost"]["stage1_motor.velocity"] == pytest.approx(cost, rel=1e-3)
    assert found["fit"]["model"]["stage1_motor.velocity"] == 100.0


def test_on_a_recording_the_cost_is_what_the_fit_to_it_loses(export, tmp_path):
    current = 1.5 * excitation(3000)
    lag = np.exp(-0.002 / 0.05)
    late = np.zeros_like(current)
    for i in range(1, len(current)):
        late[i] = lag * late[i - 1] + (1 - lag) * current[i - 1]
    recording = joint_recording(current, response(late))
    bag = write_recording(tmp_path / "bag", recording.topics, {}, recording.experiment)
    status, found = export("urdf", "--bag", str(bag), effects=[LAG])
    assert status == 0
    assert found["measured_on"]["bag"] == str(bag)
    assert found["fit"]["model"]["stage1_motor.velocity"] > 97.0
    lost = {row["effect"]: row["cost"]["stage1_motor.velocity"] for row in found["effects"]}
    assert 10.0 < lost["actuator_lag"] < 97.0
    assert found["structure"]["cost"]["stage1_arm.velocity"] > 10.0


@MUJOCO
def test_mujoco_itself_simulates_what_was_written(export, capsys):
    status, found = export("mujoco", "--seconds", "5", effects=[RIPPLE, LAG])
    assert status == 0
    assert [row["how"] for row in found["effects"]] == ["left out", "expressed"]
    ripple = found["effects"][0]["cost"]
    assert found["fit"]["as_exported"] == {k: 100.0 - v for k, v in ripple.items()}
    there = found["there"]
    assert there["engine"].startswith("MuJoCo")
    assert min(there["as_exported"]["fit"].values()) > 99.8
    assert there["model"]["fit"]["stage1_motor.position"] == pytest.approx(
        100.0 - ripple["stage1_motor.position"], abs=0.5
    )
    said = capsys.readouterr().out
    assert "multisine of" in said
    assert "actuator_lag" not in said


def test_without_mujoco_the_file_is_written_and_the_reason_told(export, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    status, found = export("mujoco", "--seconds", "2")
    assert status == 0
    assert "pip install mujoco" in found["there"]["why_not"]
    assert "everything in the model is in the file" in capsys.readouterr().out


def test_an_effect_that_follows_another_joint_has_no_cost_where_that_is_unknown(export):
    pull = Effect("inertial_coupling", "stage1_arm", {"coefficient": 0.02})
    _, found = export("mujoco", "--seconds", "2", effects=[pull])
    assert found["effects"][0]["cost"] is None
    assert "--bag" in found["effects"][0]["why_no_cost"]


def test_the_python_file_says_everything_and_computes_the_same(export, tmp_path):
    status, found = export("python", "--seconds", "2", effects=[RIPPLE, LAG])
    assert status == 0
    assert {row["how"] for row in found["effects"]} == {"expressed"}
    assert min(found["there"]["model"]["fit"].values()) > 99.9999
    space = {}
    exec((tmp_path / "out/m.python").read_text(), space)
    assert space["simulate"](np.ones(3), 0.002)["torque"].shape == (3,)


def test_an_earlier_file_is_kept_unless_told_otherwise(export, tmp_path, capsys):
    assert export("urdf", "--seconds", "1")[0] == 0
    (tmp_path / "out/m.urdf").write_text("mine")
    assert export("urdf", "--seconds", "1")[0] == 2
    assert "--overwrite" in capsys.readouterr().err
    assert (tmp_path / "out/m.urdf").read_text() == "mine"
    assert export("urdf", "--seconds", "1", "--overwrite")[0] == 0
    assert (tmp_path / "out/m.urdf").read_text() != "mine"


BAD = [("--to", "sdf"), ("--rms", "-1"), ("--rms", "nan"), ("--seconds", "1e9"), ("--timestep", "1"),
       ("--bag", "nowhere"), ("--output", ".")]  # fmt: skip


@pytest.mark.parametrize("bad", BAD, ids=" ".join)
def test_what_makes_no_sense_is_refused_and_nothing_written(export, tmp_path, bad, capsys):
    assert export("urdf", *bad)[0] == 2
    assert bad[0] in capsys.readouterr().err or bad[0] == "--bag"
    assert not list((tmp_path / "out").glob("*")) if (tmp_path / "out").exists() else True
