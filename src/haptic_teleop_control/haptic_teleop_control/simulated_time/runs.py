"""The id of one run of `scenario`, which it hands to the processes that it starts.

Two runs of one file in one ROS domain have nodes of the same names, and each hears the other's announcements
of simulated time until one of them is refused. By this id each process knows its own coordinator.
"""

from __future__ import annotations

import os
import secrets

VARIABLE = "HAPTIC_TELEOP_RUN"
"""The environment variable that carries it."""


def new_run() -> str:
    """An id that no other run has."""
    return secrets.token_hex(8)


def own_run() -> str:
    """That of the run which has started this process; empty where the node was started by hand."""
    return os.environ.get(VARIABLE, "")
