"""The command `sfj_replay`."""

from __future__ import annotations

from haptic_teleop_2dsfj.build import replay_capture
from haptic_teleop_control.command_line import run_command
from haptic_teleop_control.replay import replay_command
from haptic_teleop_control.robots import SFJ_JOINTS


def main(argv: list[str] | None = None) -> int:
    return run_command(
        lambda arguments: replay_command(
            arguments, "sfj_replay", "sfj", "/sfj/joint_states", SFJ_JOINTS, replay_capture
        ),
        argv,
    )
