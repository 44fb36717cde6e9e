"""The command `omni_replay`."""

from __future__ import annotations

from haptic_teleop_control.command_line import run_command
from haptic_teleop_control.replay import replay_command
from haptic_teleop_control.robots import OMNI_JOINTS
from haptic_teleop_omni.build import replay_capture


def main(argv: list[str] | None = None) -> int:
    return run_command(
        lambda arguments: replay_command(
            arguments, "omni_replay", "omni", "/omni/joint_states", OMNI_JOINTS, replay_capture
        ),
        argv,
    )
