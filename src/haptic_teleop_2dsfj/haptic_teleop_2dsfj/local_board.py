"""The board of this computer, real or emulated; what stands behind an emulated one, as parameters."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from haptic_teleop_2dsfj.board import Board
from haptic_teleop_2dsfj.board_settings import BoardSettings
from haptic_teleop_2dsfj.emulated_hil import EmulatedHil
from haptic_teleop_2dsfj.hil import quanser_hil
from haptic_teleop_control.clocks import Clock
from haptic_teleop_control.parameters import Parameter
from haptic_teleop_control.plugins import load_object

EMULATED = (
    Parameter(
        "emulated.plant",
        "haptic_teleop_sim.emulation:sfj_plant",
        meaning="factory of the plant behind the emulated board: module:object",
    ),
    Parameter(
        "emulated.file",
        "",
        meaning="parameter file whose section sfj_sim describes that plant; empty: its defaults",
    ),
    Parameter(
        "emulated.switch_angle",
        1.45,
        "rad",
        above=0.0,
        maximum=3.0,
        meaning="arm angle either side at which the emulated limit switches are pressed",
    ),
)


Tap = Callable[[bytes], None] | None
"""Takes the bytes of each packet of one direction, for captures."""


def local_board(
    values: Mapping[str, Any],
    board: BoardSettings,
    clock: Clock,
    on_read: Tap = None,
    on_write: Tap = None,
) -> Board:
    """The board that `device` and `emulated.*` of `values` say, not yet open. Raises ConfigurationError."""
    if values["device"] != "emulated":
        return Board(board, quanser_hil, on_read, on_write, clock)
    hil = emulated_hil(values, board, clock)  # the same one again after a reset
    return Board(board, lambda: hil, on_read, on_write, clock, "emulated HIL")


def emulated_hil(values: Mapping[str, Any], board: BoardSettings, clock: Clock) -> EmulatedHil:
    """The emulated board with the plant that the parameters `emulated.*` name. Raises ConfigurationError."""
    factory = load_object(values["emulated.plant"], "emulated.plant")
    plant = factory(values["emulated.file"], board.rate)
    return EmulatedHil(plant, board, clock, values["emulated.switch_angle"])
