"""From parameters to a driver with its board: the real one, an emulated one, or a captured session."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from haptic_teleop_2dsfj.driver import BoardLike, SfjDriver
from haptic_teleop_2dsfj.local_board import Tap, local_board
from haptic_teleop_2dsfj.remote.board import RemoteBoard
from haptic_teleop_2dsfj.remote.key_file import read_key
from haptic_teleop_2dsfj.remote.link import UdpClient
from haptic_teleop_2dsfj.remote.settings import REMOTE, RemoteSettings
from haptic_teleop_2dsfj.replay_board import ReplayBoard
from haptic_teleop_2dsfj.settings import TABLE, SfjDriverSettings
from haptic_teleop_control.clocks import Clock, SteadyClock, VirtualClock
from haptic_teleop_control.device import Reporter
from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.quantities import from_parameters
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
        taps: tuple[Tap, Tap] = (None, None)
        if on_packet is not None:
            taps = (lambda data: on_packet(READ, data), lambda data: on_packet(WRITE, data))
        if settings.board.card_type == REMOTE:
            board = _remote_board(checked, settings, clock, *taps)
        else:
            board = local_board(checked, settings.board, clock, *taps)
    return SfjDriver(settings, board, reporter)


def _remote_board(
    values: Mapping[str, Any], settings: SfjDriverSettings, clock: Clock, on_read: Tap, on_write: Tap
) -> RemoteBoard:
    if isinstance(clock, VirtualClock):
        raise ConfigurationError(
            "use_sim_time is true, but the board is another computer's (board.type: remote), whose time "
            "nobody can hold; set use_sim_time: false, or board.type to that of a board here."
        )
    remote = from_parameters(RemoteSettings, values, "remote.")
    link, key = UdpClient(remote.host, remote.port, clock), read_key(remote.key_file)
    return RemoteBoard(
        settings.board, remote, link, key, clock, values["device"] == "emulated", on_read, on_write
    )


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
