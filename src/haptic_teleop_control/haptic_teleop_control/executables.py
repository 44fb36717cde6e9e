"""The executables of haptic_teleop_control: name -> ("module:function", what it does in one line).

Read by setup.py (which makes the installed scripts of it), by the front door and by those who start nodes by
name. It imports nothing, so that it can be read before anything is installed.
"""

EXECUTABLES: dict[str, tuple[str, str]] = {
    "signal_generator": (
        "haptic_teleop_control.nodes.signal_generator:main",
        "publish an artificial command: steps, sweeps, multisine, slow triangle",
    ),
    "force_controller": (
        "haptic_teleop_control.nodes.force_controller:main",
        "couple master and slave by force control; which robot is which are parameters",
    ),
    "link": (
        "haptic_teleop_control.nodes.link:main",
        "the network between master and slave: seeded delay, jitter, loss, reordering",
    ),
    "time_coordinator": (
        "haptic_teleop_control.nodes.time_coordinator:main",
        "grant simulated time: the next tick when everybody has answered the last one",
    ),
    "operate": (
        "haptic_teleop_control.operate:main",
        "engage, disengage, swap, reset a running teleoperation; pause simulated time; print the state",
    ),
    "preview": (
        "haptic_teleop_control.preview_signal:main",
        "draw what a scenario or an acquisition commands, before anything moves",
    ),
    "set": (
        "haptic_teleop_control.set_parameter:main",
        "change a parameter of a running node",
    ),
    "echo": (
        "haptic_teleop_control.echo_topic:main",
        "print the messages of a topic",
    ),
    "acquisition": (
        "haptic_teleop_control.nodes.acquisition:main",
        "identification experiment on one stage or axis: a node of `haptic-teleop acquire`",
    ),
    "recorder": (
        "haptic_teleop_control.nodes.recorder:main",
        "records topics to an MCAP bag that describes itself",
    ),
    "recover": (
        "haptic_teleop_control.recording.recover:main",
        "copy what is intact in a recording whose writer was killed",
    ),
    "composed": (
        "haptic_teleop_control.nodes.composed:main",
        "run several nodes in one process, as 1 kHz on one machine needs it",
    ),
    "scenario": (
        "haptic_teleop_control.nodes.scenario:main",
        "start the nodes of a scenario file, watch them and stop them",
    ),
    "doctor": (
        "haptic_teleop_control.doctor:main",
        "say what is there and what is missing: environment, ROS 2, scheduling, devices",
    ),
}
