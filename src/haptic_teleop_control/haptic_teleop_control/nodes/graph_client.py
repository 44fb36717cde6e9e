"""The node of a command that comes, asks and goes: context, executor, and names as people write them."""

from __future__ import annotations

import difflib
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager

import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

SILENT = 1.5
"""s of waiting without a word: a node that runs is found by its own announcement, which Fast DDS sends every
3 s. More often is no remedy: an announcement that falls into the goodbye of another node's publisher stops
both for good (two locks taken in opposite order, Fast DDS 3.2)."""


class GraphClient:
    """node and executor of a command; `until` lets messages in."""

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

    def close(self) -> None:
        """Leaves the graph."""
        self.executor.shutdown()
        self.node.destroy_node()
        rclpy.try_shutdown(context=self.context)


@contextmanager
def graph_client(name: str) -> Iterator[GraphClient]:
    """A client that leaves the graph at the end, however that comes."""
    client = GraphClient(name)
    try:
        yield client
    finally:
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
