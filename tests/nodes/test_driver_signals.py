"""However a driver's process is asked to end, the last that its device hears is zero and off."""

import signal
import subprocess
import sys

import pytest
from ros_graph import Graph, Sink, Source, stamp_of

from haptic_teleop_2dsfj.board import WRITE_FORMAT
from haptic_teleop_control.raw_capture import WRITE, read_capture
from haptic_teleop_control.robots import OMNI_JOINTS, SFJ_MOTOR_JOINTS
from haptic_teleop_omni.codec import ReportCodec
from haptic_teleop_omni.layout import load_layout

FRONT_DOOR = (sys.executable, "-m", "haptic_teleop_control.front_door")
ROBOTS = {
    "sfj": (SFJ_MOTOR_JOINTS, [2.0, 0.4], ()),
    "omni": (OMNI_JOINTS, [0.0, 0.0, 0.1], ("calibration.method:=start",)),
}
REPORT = load_layout("emulator").output


def is_off(robot: str, packet: bytes) -> bool:
    """Zero volts and disabling levels (1, 1, 0); idle torques and motors off."""
    if robot == "sfj":
        return WRITE_FORMAT.unpack(packet) == (0.0, 0.0, 1, 1, 0)
    values = ReportCodec(REPORT).decode(packet)
    assert values is not None
    return all(values[name] == REPORT.fields[name].idle for name in values)


def heed_signals() -> None:
    """What runs this test may ignore some of them (`nohup`, a job in the background), and children would."""
    for number in (signal.SIGINT, signal.SIGHUP, signal.SIGQUIT):
        signal.signal(number, signal.SIG_DFL)


@pytest.mark.wall_time
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT])
@pytest.mark.parametrize("robot", ROBOTS)
def test_a_signal_ends_a_driver_with_zero_and_off_as_its_last_packet(
    graph: Graph, robot, number, tmp_path, stalls
):
    motors, effort, stated = ROBOTS[robot]
    file = tmp_path / "session.mcap"
    states = Sink(graph, f"/{robot}/joint_states")
    command = Source(graph, f"/{robot}/effort_command", motors)
    rules = ("device:=emulated", f"capture:={file}", *stated)
    process = subprocess.Popen(
        [*FRONT_DOOR, f"{robot}_driver", "--ros-args", *(part for rule in rules for part in ("-p", rule))],
        preexec_fn=heed_signals,
    )
    try:
        graph.until(lambda: command.connected() and states.messages, what="discovery")
        answered = 0
        while answered < 60:
            seen = len(states.messages)
            graph.until(lambda seen=seen: len(states.messages) > seen)
            command.send(stamp=stamp_of(states.last), effort=effort)
            answered += 1
        process.send_signal(number)
        assert process.wait(20) == 0
    finally:
        process.kill()
        process.wait()
    capture = read_capture(file, robot)
    written = [packet.data for packet in capture.packets if packet.channel == WRITE]
    assert capture.complete
    assert is_off(robot, written[-1])
    driven = not all(is_off(robot, packet) for packet in written)
    assert driven or stalls.excuse(0.05)
