"""The executables of haptic_teleop_omni: name -> ("module:function", what it does in one line).

Read by setup.py (which makes the installed scripts of it), by the front door and by those who start nodes by
name. It imports nothing, so that it can be read before anything is installed.
"""

EXECUTABLES: dict[str, tuple[str, str]] = {
    "omni_driver": (
        "haptic_teleop_omni.nodes.omni_driver:main",
        "drive the Omni: OpenHaptics, hidapi, emulated device or captured session",
    ),
    "omni_replay": (
        "haptic_teleop_omni.replay_session:main",
        "send captured raw reports of the Omni through its driver once more",
    ),
}
