"""The driver's node on a board server in another process, over UDP and by the machine's clock."""

import re
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from ros_graph import Graph, Sink, Source, stamp_of
from stalls import Stalls

from haptic_teleop_2dsfj.build import replay_capture
from haptic_teleop_2dsfj.nodes.sfj_driver import SfjDriverNode
from haptic_teleop_2dsfj.remote.key_file import make_key
from haptic_teleop_control.nodes.timing.time_base import WallTime
from haptic_teleop_control.raw_capture import read_capture
from haptic_teleop_control.robots import SFJ_MOTOR_JOINTS

FRONT_DOOR = (sys.executable, "-m", "haptic_teleop_control.front_door")


class Server:
    """`sfj_board_server` with an emulated board, as a process of its own."""

    def __init__(self, key: Path, port: int = 0) -> None:
        rules = ("device:=emulated", f"port:={port}", "watchdog:=0.2", "board.watchdog:=0.2")
        given = (part for rule in (*rules, f'key.file:="{key}"') for part in ("-p", rule))
        self.process = subprocess.Popen(
            [*FRONT_DOOR, "sfj_board_server", *given], stdout=subprocess.PIPE, text=True
        )
        assert self.process.stdout is not None
        found = None
        while found is None:
            line = self.process.stdout.readline()
            assert line, "it ended"
            found = re.search(r"127\.0\.0\.1:(\d+) for", line)
        self.port = int(found[1])


@pytest.mark.long
@pytest.mark.wall_time
def test_a_driver_moves_a_robot_behind_a_board_server_loses_it_and_finds_it_again(
    graph: Graph, tmp_path: Path, stalls: Stalls
):
    key, file = tmp_path / "board.key", tmp_path / "session.mcap"
    make_key(key)
    server = Server(key)
    states = Sink(graph, "/sfj/joint_states")
    command = Source(graph, "/sfj/effort_command", SFJ_MOTOR_JOINTS)
    remote = {"remote__port": server.port, "remote__key__file": str(key), "remote__silence": 0.4}
    # What a stall of any length does is tested on a virtual clock (tests/unit/test_board_server.py). Here it
    # would end the drive of some 0.3 s, and what is asked is whether sockets and processes find each other.
    watchdogs = {"board__watchdog": 0.2, "timeout": 0.2}
    node = graph.start(
        SfjDriverNode, wall=WallTime(), device="emulated", board__type="remote", capture=str(file),
        **remote, **watchdogs,
    )  # fmt: skip

    def drive(answers: int) -> None:
        for _ in range(answers):
            seen = len(states.messages)
            graph.until(lambda seen=seen: len(states.messages) > seen, what="a state")
            command.send(stamp=stamp_of(states.last), effort=[3.0, 0.5])

    try:
        graph.until(lambda: command.connected() and states.messages, what="discovery")
        drive(150)
        if node.faults.latched and stalls.excuse(0.2):
            return
        assert node.faults.latched is None, node.faults.sentence
        assert states.last.position[0] > 0.01, "the emulated robot has moved"
        asked = subprocess.Popen([*FRONT_DOOR, "operate", "devices"], stdout=subprocess.PIPE, text=True)
        graph.until(lambda: asked.poll() is not None, 30.0, what="the devices")
        assert f"transport board server 127.0.0.1:{server.port}" in asked.communicate()[0]
        server.process.kill()
        graph.until(lambda: node.faults.counts["board_link"], what="the fault")
        server.process.wait()
        server = Server(key, server.port)
        count = len(states.messages)
        assert graph.call("/sfj/sfj_driver/reset").success
        graph.until(lambda: len(states.messages) > count + 20, what="states again")
        assert node.faults.latched is None
        server.process.send_signal(signal.SIGINT)
        assert server.process.wait(20) == 0
        graph.until(lambda: node.faults.latched == "board_link", what="the fault")
        assert "the board server has ended" in node.faults.sentence
        node.shutdown_safely()
        graph.until(lambda: len(states.messages) == node.states.sent)
    finally:
        server.process.kill()
        server.process.wait()
    capture = read_capture(file, "sfj")
    replayed = replay_capture(capture, capture.parameters)
    rows = {stamp: row for row, stamp in enumerate(replayed.stamp.tolist())}
    assert len(states.messages) > 150
    for message in states.messages:
        row = rows[stamp_of(message)]
        assert bytes(message.position) == replayed.position[row].tobytes()
        assert bytes(message.effort) == replayed.effort[row].tobytes()
    assert np.abs(replayed.effort).max() > 0.0
