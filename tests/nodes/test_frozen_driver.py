"""A driver that stands still while its board goes on."""

import signal
import subprocess
import sys
import time

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from ros_graph import Sink, Source, stamp_of

from haptic_teleop_control.robots import SFJ_MOTOR_JOINTS

FRONT_DOOR = (sys.executable, "-m", "haptic_teleop_control.front_door")


@pytest.mark.wall_time
def test_a_frozen_driver_finds_its_board_at_zero_when_it_wakes_and_stays_stopped(graph):
    states, heard = Sink(graph, "/sfj/joint_states"), []
    graph.probe.create_subscription(DiagnosticArray, "/diagnostics", heard.append, 10)

    def fault() -> str:
        """Of the driver, as it says itself."""
        status = heard[-1].status[0] if heard else None
        return status.message.split(":")[0] if status is not None and status.level == b"\x02" else ""

    def expiries() -> int:
        values = {entry.key: entry.value for entry in heard[-1].status[0].values}
        return int(values["watchdog expiries"])

    command = Source(graph, "/sfj/effort_command", SFJ_MOTOR_JOINTS)
    process = subprocess.Popen([*FRONT_DOOR, "sfj_driver", "--ros-args", "-p", "device:=emulated"])
    try:
        graph.until(lambda: command.connected() and states.messages, what="discovery")
        answered = [0]

        def drive() -> None:
            """Answers each new state."""
            if len(states.messages) > answered[0]:
                answered[0] = len(states.messages)
                command.send(stamp=stamp_of(states.last), effort=[2.0, 0.4])

        def driven() -> bool:
            """Whether the driver's current has come; a fault before that, where the machine stood still, is
            reset as an operator does."""
            if fault():
                graph.call("/sfj/sfj_driver/reset")
                heard.clear()
            drive()
            return states.last.effort[0] > 1.0

        graph.until(driven, 20.0, what="a current")
        process.send_signal(signal.SIGSTOP)
        time.sleep(0.5)
        process.send_signal(signal.SIGCONT)
        graph.until(lambda: heard.clear() or True)
        graph.until(lambda: (drive(), fault() and expiries())[1], what="the board has expired")
        count = len(states.messages)
        graph.until(lambda: (drive(), len(states.messages) > count + 100)[1])
        assert abs(states.last.effort[0]) < 0.5, "what is left is the offset and noise of the current's sense"
        # Whichever it notices first: that its last command is old, or that the board went to 0 V.
        assert fault() in ("watchdog_expired", "stale_command")
    finally:
        process.send_signal(signal.SIGINT)
        assert process.wait(20) == 0
