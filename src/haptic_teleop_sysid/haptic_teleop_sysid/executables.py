"""The executables of haptic_teleop_sysid: name -> ("module:function", what it does in one line).

Read by setup.py (which makes the installed scripts of it), by the front door and by those who start nodes by
name. It imports nothing, so that it can be read before anything is installed.
"""

EXECUTABLES: dict[str, tuple[str, str]] = {
    "compare": (
        "haptic_teleop_sysid.commands.compare:main",
        "simulate models on the input of recordings and report the fit in percent",
    ),
    "diagnose": (
        "haptic_teleop_sysid.commands.diagnose:main",
        "say why simulation and recording differ, model it, and show the fit improve",
    ),
    "import": (
        "haptic_teleop_sysid.commands.import_log:main",
        "turn a log (CSV, MATLAB, npz, Parquet, bags of ROS 1 or 2) into a recording",
    ),
    "model": (
        "haptic_teleop_sysid.commands.model_from_log:main",
        "a model file to start from, out of a recording or a log",
    ),
    "acquire": (
        "haptic_teleop_sysid.commands.acquire:main",
        "run an identification experiment on one stage or axis, into a bag",
    ),
    "dataset": (
        "haptic_teleop_sysid.commands.dataset_report:main",
        "look at recordings before anything is estimated: gaps, jitter, excitation",
    ),
    "stiffness": (
        "haptic_teleop_sysid.commands.stiffness:main",
        "joint stiffness from a table of hung weights, with its uncertainty",
    ),
    "encoders": (
        "haptic_teleop_sysid.commands.encoders:main",
        "drive against joint encoder over the range: gearing and largest error",
    ),
    "estimate": (
        "haptic_teleop_sysid.commands.estimate:main",
        "estimate a model's parameters from recordings, with standard errors",
    ),
    "trend": (
        "haptic_teleop_sysid.commands.trend:main",
        "what changed since the robot was new: many recordings in time, with control limits",
    ),
    "export": (
        "haptic_teleop_sysid.commands.export:main",
        "write a model as MJCF, URDF or one Python function, and say what is lost in fit",
    ),
    "verify": (
        "haptic_teleop_sysid.commands.verify:main",
        "check a recording of a scenario and write its report",
    ),
    "demo": (
        "haptic_teleop_sysid.commands.demo:main",
        "run scenario 1 in simulation as real nodes, record it, verify it",
    ),
    "discover": (
        "haptic_teleop_sysid.discovery.command:main",
        "the whole chain on a robot with concealed physics: record, diagnose, open, simulate again",
    ),
    "blind": (
        "haptic_teleop_sysid.blind.command:main",
        "benchmark diagnose on concealed effects drawn by seed: seal, diagnose, open, score",
    ),
}
