"""The node of a command that comes, asks and goes: context, executor, an end that does not hang, and names as
people write them."""

from __future__ import annotations

import difflib
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Any

import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future

from haptic_teleop_control.command_line import INTERRUPTED, tell
from haptic_teleop_control.errors import HapticTeleopError
from haptic_teleop_control.forced_exit import ends_within

SILENT = 1.5
"""s of waiting without a word: a node that runs is found by its own announcement, which Fast DDS sends every
3 s. More often is no remedy: an announcement that falls into the goodbye of another node's publisher stops
both for good (two locks taken in opposite order, Fast DDS 3.2)."""


KEPT_LOOKS = 20
"""Looks for further messages that are kept for late comers, of 10 ms each; counted, so that a machine that
stands still meanwhile misses none that has arrived."""

ASK_AGAIN = 0.5
"""s after which a question is asked anew."""

LEAVING = 5.0
"""s that the middleware is given to leave the graph; what the command has to say is said by then."""


class GraphClient:
    """node and executor of a command; `until` lets messages in. status: the command's exit status so far."""

    status = 1

    def __init__(self, name: str) -> None:
        self.context = Context()
        # Ctrl-C stays Python's: it leaves the command at once, through the `finally` below.
        rclpy.init(args=[], context=self.context, signal_handler_options=SignalHandlerOptions.NO)
        self.node = Node(name, context=self.context, start_parameter_services=False, enable_rosout=False)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)

    def until(self, happened: Callable[[], bool], wait: float, what: str = "") -> bool:
        """Runs callbacks until `happened`, at most for `wait` s; whether it did. Says to standard error that
        it waits for `what` when that takes longer than SILENT s."""
        began = time.monotonic()
        told = not what or wait <= SILENT
        while not happened() and time.monotonic() < began + wait:
            self.executor.spin_once(timeout_sec=0.05)
            if not told and time.monotonic() > began + SILENT:
                print(f"waiting for {what}, at most {wait:g} s ...", file=sys.stderr, flush=True)
                told = True
        return happened()

    def hear_kept(self) -> None:
        """Runs callbacks until all messages that are kept for late comers have come, once the first has."""
        for _ in range(KEPT_LOOKS):
            self.executor.spin_once(timeout_sec=0.01)

    def ask(self, question: Callable[[], Future], until: float) -> Any:
        """The answer to a service call that may be made several times, made until it is answered; None at
        `until` (s of the steady clock). A node that has not found the client's reader yet gives an answer
        up."""
        asked: list[Future] = []
        while True:
            asked.append(question())
            self.until(lambda: any(f.done() for f in asked), min(ASK_AGAIN, until - time.monotonic()))
            for future in asked:
                if future.done():
                    return future.result()
            if time.monotonic() >= until:
                return None

    def close(self) -> None:
        """Leaves the graph."""
        self.executor.shutdown()
        self.node.destroy_node()
        rclpy.try_shutdown(context=self.context)


@contextmanager
def graph_client(name: str) -> Iterator[GraphClient]:
    """A client that leaves the graph at the end, however that comes, and ends the process with its `status`
    where the middleware hangs over that. So the body prints what it has to say and sets `status`; its
    HapticTeleopError is printed here and becomes SystemExit."""
    client = GraphClient(name)
    try:
        yield client
    except HapticTeleopError as error:
        client.status = tell(error)
        raise SystemExit(client.status) from None
    except KeyboardInterrupt:
        client.status = INTERRUPTED
        raise
    finally:
        with ends_within(LEAVING, client.status):
            client.close()


def known(names: Iterable[str], wanted: str) -> str:
    """What to say of a name that is not there: the nearest ones that are, or all."""
    there = sorted(set(names))
    near = difflib.get_close_matches(wanted, there, n=2, cutoff=0.6)
    if near:
        return f"did you mean {' or '.join(near)}?"
    return (
        f"there are {', '.join(there)}."
        if there
        else "nothing runs here: start a scenario with the same ROS_DOMAIN_ID."
    )
