"""A controller that is told to end leaves zero behind."""

import os
import signal
import subprocess
import sys
import time

import pytest
from ros_graph import Sink, Source
from std_msgs.msg import String

from haptic_teleop_control.robots import SFJ_JOINTS


def start(*arguments: str) -> subprocess.Popen:
    return subprocess.Popen(
        [sys.executable, "-m", "haptic_teleop_control.front_door", *arguments],
        env=dict(os.environ),
        stderr=subprocess.PIPE,
        text=True,
    )


@pytest.mark.wall_time
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_controller_that_is_told_to_end_sends_zero_first_and_exits_with_0(graph, number, stalls):
    process = start("force_controller", "--ros-args", "-p", "ramp_time:=0.0")
    try:
        slave = Source(graph, "/sfj/joint_states", SFJ_JOINTS)
        reference = Source(graph, "/reference", ["omni_y", "omni_z"])
        effort = Sink(graph, "/sfj/effort_command")
        states: list[str] = []
        graph.probe.create_subscription(
            String, "/force_controller/state", lambda message: states.append(message.data), 10
        )
        graph.until(lambda: slave.connected() and reference.connected() and effort.connected(), 30.0)

        def driven() -> bool:
            reference.send(position=[0.006, 0.008])
            slave.send(position=[0.0] * 4, velocity=[0.0] * 4, effort=[0.0] * 4)
            return "fault" in states or (bool(effort.messages) and min(effort.last.effort) > 0.0)

        graph.until(driven, what="a torque")
        assert "fault" not in states or stalls.excuse(0.05)
        process.send_signal(number)
        asked = time.monotonic()
        graph.until(lambda: not any(effort.last.effort), what="zero")
        taken = time.monotonic() - asked
        graph.until(lambda: process.poll() is not None, what="the end of the process")
        graph.listen()
        assert list(effort.last.effort) == [0.0, 0.0]
        assert process.returncode == 0
        assert taken < 0.2 or stalls.excuse(0.2)
    finally:
        process.kill()
        process.wait()
