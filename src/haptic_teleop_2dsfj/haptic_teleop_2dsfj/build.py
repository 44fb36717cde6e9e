"""From parameters to a driver with its board: the real one, an emulated one, or a captured session."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from haptic_teleop_2dsfj.board import Board
from haptic_teleop_2dsfj.driver import BoardLike, SfjDriver
from haptic_teleop_2dsfj.emulated_hil import EmulatedHil
from haptic_teleop_2dsfj.hil import Hil, quanser_hil
from haptic_teleop_2dsfj.replay_board import ReplayBoard
from haptic_teleop_2dsfj.settings import TABLE, SfjDriverSettings
from haptic_teleop_control.clocks import Clock, SteadyClock, VirtualClock
from haptic_teleop_control.device import Reporter
from haptic_teleop_control.plugins import load_object
from haptic_teleop_control.raw_capture import READ, WRITE, Capture
from haptic_teleop_control.replay import ReplayedStates, Session, replay


def make_driver(
    values: Mapping[str, Any],
    reporter: Reporter,
    on_packet: Callable[[str, bytes], None] | None = None,
    session: Session | None = None,
    clock: Clock | None = None,
    source: str = "parameters",
) -> SfjDriver:
    """The driver that `values` describe (see `settings.TABLE`), not yet open.

    on_packet: takes channel and bytes of every raw packet. session: what `device: replay` replays.
    Raises ConfigurationError.
    """
    checked = TABLE.check(values, source)
    settings = SfjDriverSettings.from_parameters(checked, source)
    clock = clock or SteadyClock()
    board: BoardLike
    if checked["device"] == "replay":
        assert session is not None
        board = ReplayBoard(settings.board, session, clock)
    else:
        make_hil: Callable[[], Hil] = quanser_hil
        if checked["device"] == "emulated":
            hil = emulated_hil(checked, settings, clock)
            make_hil = lambda: hil  # noqa: E731 - the same board again after a reset
        taps = (None, None)
        if on_packet is not None:
            taps = (lambda data: on_packet(READ, data), lambda data: on_packet(WRITE, data))
        board = Board(settings.board, make_hil, *taps, clock=clock)
    return SfjDriver(settings, board, reporter)


def emulated_hil(values: Mapping[str, Any], settings: SfjDriverSettings, clock: Clock) -> EmulatedHil:
    """The emulated board with the plant that the parameters `emulated.*` name."""
    factory = load_object(values["emulated.plant"], "emulated.plant")
    plant = factory(values["emulated.file"], settings.board.rate)
    return EmulatedHil(plant, settings.board, clock, values["emulated.switch_angle"])


def replay_capture(capture: Capture, parameters: Mapping[str, Any]) -> ReplayedStates:
    """The joint states of a captured session, with the parameters that it was captured with."""
    own = {key: value for key, value in parameters.items() if key in TABLE}
    session = Session(capture)
    reporter, latch = Reporter.to_latch(all_faults())
    driver = make_driver({**own, "device": "replay"}, reporter, session=session, clock=VirtualClock())
    return replay(session, driver, latch)


def all_faults() -> dict[str, str]:
    """Every fault that the driver or its node may report, with its sentence."""
    from haptic_teleop_2dsfj.supervisor import FAULTS
    from haptic_teleop_control.faults import COMMAND_FAULTS

    return {**COMMAND_FAULTS, **FAULTS}
