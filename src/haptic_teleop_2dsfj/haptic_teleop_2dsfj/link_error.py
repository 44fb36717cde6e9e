"""What a board that is reached over a network can fail with, beside what a board can."""

from __future__ import annotations

from haptic_teleop_control.device import DeviceError


class LinkError(DeviceError):
    """The way to the board server, not the board, is at fault: silence, or datagrams that must not be."""
