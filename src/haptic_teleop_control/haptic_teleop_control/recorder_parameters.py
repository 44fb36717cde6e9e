"""What the recorder can be told: its parameters, the topics it knows, the description of the experiment."""

from __future__ import annotations

import json
from typing import Any

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.node_tables import USE_SIM_TIME
from haptic_teleop_control.parameters import Parameter, ParameterTable

JOINT_STATE, DIAGNOSTICS = "sensor_msgs/msg/JointState", "diagnostic_msgs/msg/DiagnosticArray"
KNOWN_TYPES = {
    "/sfj/joint_states": JOINT_STATE,
    "/sfj/effort_command": JOINT_STATE,
    "/omni/joint_states": JOINT_STATE,
    "/omni/effort_command": JOINT_STATE,
    "/reference": JOINT_STATE,
    "/diagnostics": DIAGNOSTICS,
}
TABLE = ParameterTable(
    "recorder",
    [
        Parameter("topics", list(KNOWN_TYPES), meaning="topics to record"),
        Parameter("output", "", meaning="new directory; empty for recordings/<date and time>"),
        Parameter(
            "existing",
            "refuse",
            choices=("refuse", "number"),
            meaning="what to do when the output exists: refuse, or append a number to its name",
        ),
        Parameter(
            "experiment",
            "",
            meaning="kind of the experiment, or a JSON object that describes it; stored with it",
        ),
        Parameter("note", "", meaning="a sentence stored with the recording"),
        Parameter(
            "duration",
            0.0,
            "s",
            minimum=0.0,
            meaning="time after which it stops; 0 for when it is told to",
        ),
        Parameter("compression", "none", choices=("none", "zstd"), meaning="compression of the chunks"),
        Parameter(
            "minimum_free_space",
            500_000_000,
            "B",
            minimum=0,
            meaning="free space below which it stops cleanly",
        ),
        Parameter(
            "parameter_wait",
            1.0,
            "s",
            minimum=0.0,
            maximum=5.0,
            meaning="longest time it asks for the parameters of the other nodes when it stops",
        ),
        USE_SIM_TIME,
        Parameter("depth", 5000, minimum=10, maximum=1_000_000, meaning="messages kept for it on each topic"),
    ],
)


def experiment_description(text: str, note: str) -> dict[str, Any]:
    """The description of the experiment; ConfigurationError when it looks like JSON and is not an object."""
    content: dict[str, Any] = {"kind": text} if text else {}
    if text.lstrip().startswith(("{", "[")):
        try:
            content = json.loads(text)
        except json.JSONDecodeError as error:
            raise ConfigurationError(
                f"parameter experiment is no JSON ({error.msg} at {error.pos}): correct it, or name a kind"
            ) from None
        if not isinstance(content, dict):
            raise ConfigurationError(
                'parameter experiment is no JSON object: write {"kind": ...}, or name a kind'
            )
    return {**content, "note": note} if note else content
