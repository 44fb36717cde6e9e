"""A captured session once more through codec and driver, to the same joint states."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_control.command_line import ArgumentParser
from haptic_teleop_control.device import Driver, EndOfSession, ReadResult
from haptic_teleop_control.faults import FaultLatch
from haptic_teleop_control.raw_capture import COMMAND, READ, RESET, Capture, read_capture
from haptic_teleop_control.recording import JointStateSeries, write_recording

Array = NDArray[np.float64]


class Session:
    """Walks through a capture as the driver did when it was made."""

    def __init__(self, capture: Capture) -> None:
        self.capture = capture
        self._packets = [packet for packet in capture.packets if packet.channel in (READ, COMMAND, RESET)]
        self._next = 0
        self.last_stamp = 0

    @property
    def first_stamp(self) -> int:
        """ns, of the first packet; 0 when there is none."""
        return self._packets[0].stamp if self._packets else 0

    def next_read(self) -> bytes | None:
        """The packet that came next from the device; None when a command came before it. Raises
        EndOfSession."""
        if self._next >= len(self._packets):
            raise EndOfSession
        packet = self._packets[self._next]
        if packet.channel != READ:
            return None
        self._next += 1
        self.last_stamp = packet.stamp
        return packet.data

    def next_command(self) -> tuple[int, Array | None]:
        """Stamp (ns) of the state and the command that the driver was given for it."""
        while self._next < len(self._packets):
            packet = self._packets[self._next]
            if packet.channel == RESET:
                break
            self._next += 1
            if packet.channel == COMMAND:
                return packet.stamp, np.frombuffer(packet.data, dtype="<f8") if packet.data else None
        return self.last_stamp, None

    def take_reset(self) -> bool | None:
        """Whether a reset comes next, and then whether it opened the device again; otherwise None."""
        if self._next < len(self._packets) and self._packets[self._next].channel == RESET:
            self._next += 1
            return self._packets[self._next - 1].data == b"\x01"
        return None


@dataclass(frozen=True)
class ReplayedStates:
    """stamp (n,) ns; position, velocity, effort (n, joints); faults: those that the driver reported."""

    stamp: NDArray[np.int64]
    position: Array
    velocity: Array
    effort: Array
    faults: Mapping[str, int]

    def series(self, joints: Sequence[str]) -> JointStateSeries:
        """As a recorded topic."""
        return JointStateSeries(
            self.stamp, self.stamp.copy(), tuple(joints), self.position, self.velocity, self.effort
        )


def replay(session: Session, driver: Driver, latch: FaultLatch) -> ReplayedStates:
    """Runs the whole session through `driver`, whose faults go to `latch`."""
    stamps: list[int] = []
    states: list[tuple[Array, Array, Array]] = []
    driver.open()
    while True:
        reopened = session.take_reset()
        if reopened is not None:
            latch.reset()
            if reopened:
                driver.close()
            driver.reset()
        result = driver.read()
        if result is ReadResult.END:
            break
        stamp, command = session.next_command()
        if result is ReadResult.STATE:
            stamps.append(stamp)
            states.append((driver.position.copy(), driver.velocity.copy(), driver.effort.copy()))
        driver.write(command)
    driver.close()
    joints = len(driver.position)
    position, velocity, effort = np.array(states).reshape(-1, 3, joints).transpose(1, 0, 2).copy()
    return ReplayedStates(np.array(stamps, dtype=np.int64), position, velocity, effort, latch.counts)


def replay_command(
    arguments: list[str],
    program: str,
    robot: str,
    topic: str,
    joints: Sequence[str],
    run: Callable[[Capture, Mapping[str, Any]], ReplayedStates],
) -> int:
    """The body of a replay executable: capture in, recording out, a summary on standard output."""
    parser = ArgumentParser(
        prog=f"haptic-teleop {program}",
        description="Send a captured session's raw packets through its driver once more.",
    )
    parser.add_argument("capture", help="file that the driver's parameter `capture` named")
    parser.add_argument("--output", metavar="DIR", help="recording of the joint states; must not exist")
    options = parser.parse_args(arguments)
    capture = read_capture(Path(options.capture), robot)
    states = run(capture, capture.parameters)
    if not capture.complete:
        why = f" ({capture.problem})" if capture.problem else ""
        print(f"{options.capture}: its end is missing or damaged{why}; this is what is whole before it")
    seconds = (states.stamp[-1] - states.stamp[0]) * 1e-9 if len(states.stamp) else 0.0
    print(f"{len(states.stamp)} joint states, {seconds:.3f} s, from {len(capture.packets)} packets")
    for name, count in states.faults.items():
        if count:
            print(f"fault {name}: {count}")
    if options.output:
        write_recording(
            options.output, {topic: states.series(joints)}, {}, {"kind": "replay", "note": options.capture}
        )
        print(options.output)
    return 0
