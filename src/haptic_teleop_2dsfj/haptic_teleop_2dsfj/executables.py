"""The executables of haptic_teleop_2dsfj: name -> ("module:function", what it does in one line).

Read by setup.py (which makes the installed scripts of it), by the front door and by those who start nodes by
name. It imports nothing, so that it can be read before anything is installed.
"""

EXECUTABLES: dict[str, tuple[str, str]] = {
    "sfj_driver": (
        "haptic_teleop_2dsfj.nodes.sfj_driver:main",
        "drive the Quanser 2DSFJ: HIL board, emulated board or captured session",
    ),
    "sfj_board_server": (
        "haptic_teleop_2dsfj.remote.serve:main",
        "hand the 2DSFJ's board to a driver in another computer; needs no ROS",
    ),
    "sfj_replay": (
        "haptic_teleop_2dsfj.replay_session:main",
        "send captured raw samples of the 2DSFJ through its driver once more",
    ),
}
