"""The executables of haptic_teleop_sim: name -> ("module:function", what it does in one line).

Read by setup.py (which makes the installed scripts of it), by the front door and by those who start nodes by
name. It imports nothing, so that it can be read before anything is installed.
"""

EXECUTABLES: dict[str, tuple[str, str]] = {
    "sfj_sim": (
        "haptic_teleop_sim.nodes.sfj_sim:main",
        "the simulated Quanser 2DSFJ, interchangeable with its driver",
    ),
    "mujoco_sim": (
        "haptic_teleop_sim.nodes.mujoco_sim:main",
        "the 2DSFJ simulated by MuJoCo, an engine that is not this project's, in place of sfj_sim",
    ),
    "omni_sim": (
        "haptic_teleop_sim.nodes.omni_sim:main",
        "the simulated Phantom Omni and its operator, interchangeable with its driver",
    ),
    "lockstep": (
        "haptic_teleop_sim.lockstep:main",
        "run a scenario without ROS or clock, deterministic by seed, into the same bags",
    ),
}
