"""The project's scenario 1 with the model of a diagnosis in its simulated robot, ready to run."""

from __future__ import annotations

from pathlib import Path

from haptic_teleop_control.errors import ConfigurationError, ModelError
from haptic_teleop_control.strict_yaml import dump_yaml, parse_yaml
from haptic_teleop_sim.model import Model
from haptic_teleop_sim.model_choice import check_joint
from haptic_teleop_sysid.shipped_files import SCENARIO, find_scenario

#: The file, beside diagnosis.json.
FILE = "scenario.yaml"


def write_scenario(folder: Path, model: Model, model_file: str) -> Path | None:
    """Write scenario 1 whose simulated robot has ``model``, saved as ``model_file`` in the same ``folder``.

    None, and no earlier file is left, for a robot that the project does not simulate, where its scenario is
    not installed, or of a model with wrong stamps, which no running robot has. A model that has a stop at the
    arm itself gets no wall beside it.
    """
    path, node = folder / FILE, f"{model.robot}_sim"
    path.unlink(missing_ok=True)
    try:
        content = parse_yaml(find_scenario(SCENARIO).read_text(encoding="utf-8"))
    except ConfigurationError:
        return None
    if node not in content:
        return None
    try:
        check_joint(model, model.joint)
    except ModelError:
        return None
    own = content[node]["ros__parameters"]
    joint = {**own.get(model.joint, {}), "model": model_file}
    if any((e.effect, e.location) == ("hard_stop", model.location("arm")) for e in model.effects):
        joint.pop("wall", None)
    own[model.joint] = joint
    path.write_text(
        f"# Scenario 1 with {model_file} for {model.joint}.\n"
        f"#   haptic-teleop lockstep {FILE} --record RECORDING   without ROS, as fast as it goes\n"
        f"#   haptic-teleop scenario {FILE} --record RECORDING   as ROS 2 nodes\n" + dump_yaml(content),
        encoding="utf-8",
    )
    return path
