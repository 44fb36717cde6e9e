"""From parameters to a driver with its transport: the vendor's library, hidapi, an emulated Omni, or a
captured session."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from haptic_teleop_control.clocks import Clock, SteadyClock, VirtualClock
from haptic_teleop_control.device import Reporter
from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.faults import COMMAND_FAULTS
from haptic_teleop_control.plugins import load_object
from haptic_teleop_control.quantities import from_parameters
from haptic_teleop_control.raw_capture import Capture
from haptic_teleop_control.replay import ReplayedStates, Session, replay
from haptic_teleop_control.robots import OMNI_RATE_HZ
from haptic_teleop_omni.axis_map import PREFIX
from haptic_teleop_omni.driver import OmniDriver
from haptic_teleop_omni.layout import load_layout
from haptic_teleop_omni.settings import FAULTS, TABLE, OmniDriverSettings
from haptic_teleop_omni.transports.emulated import EmulatedOmni
from haptic_teleop_omni.transports.hidapi import HidapiTransport
from haptic_teleop_omni.transports.interface import OmniTransport
from haptic_teleop_omni.transports.openhaptics import OpenHapticsSettings, OpenHapticsTransport
from haptic_teleop_omni.transports.replay import ReplayTransport

ALL_FAULTS = {**COMMAND_FAULTS, **FAULTS}
"""Every fault that the driver or its node may report, with its sentence."""


def make_driver(
    values: Mapping[str, Any],
    reporter: Reporter,
    on_packet: Callable[[str, bytes], None] | None = None,
    session: Session | None = None,
    clock: Clock | None = None,
    source: str = "parameters",
) -> OmniDriver:
    """The driver that `values` describe (see `settings.TABLE`), not yet open.

    on_packet: takes channel and bytes of every report. session: what `device: replay` replays.
    Raises ConfigurationError.
    """
    checked = TABLE.check(values, source)
    settings = OmniDriverSettings.from_parameters(checked, source)
    device = checked["device"]
    recorded = session.capture.parameters if session is not None else checked
    layout = load_layout(checked["layout"] or recorded.get("layout") or _layout_of(recorded))
    clock = clock or SteadyClock()
    transport: OmniTransport
    if device == "replay":
        assert session is not None
        transport = ReplayTransport(session, clock)
    elif device == "emulated":
        make = partial(
            load_object(checked["emulated.plant"], "emulated.plant"), checked["emulated.file"], settings.rate
        )
        transport = EmulatedOmni(
            make(), layout, clock, settings.rate, checked["emulated.docked_time"], renew=make
        )
    elif checked["transport"] == "openhaptics":
        transport = _openhaptics(checked, source)
    else:
        numbered = layout.output.report_id is not None
        transport = HidapiTransport(
            checked["hid.vendor"], checked["hid.product"], checked["hid.serial"], numbered
        )
    return OmniDriver(settings, layout, transport, reporter, on_packet)


def replay_capture(capture: Capture, parameters: Mapping[str, Any]) -> ReplayedStates:
    """The joint states of a captured session, with the parameters that it was captured with."""
    own = {key: value for key, value in parameters.items() if key in TABLE}
    if not own.get("layout"):
        own["layout"] = _layout_of(own)
    session = Session(capture)
    reporter, latch = Reporter.to_latch(ALL_FAULTS)
    driver = make_driver({**own, "device": "replay"}, reporter, session=session, clock=VirtualClock())
    return replay(session, driver, latch)


def _layout_of(values: Mapping[str, Any]) -> str:
    """The layout of device and transport; a capture of older times names no transport, it was hidapi."""
    if values.get("device") != "hardware":
        return "emulator"
    return "openhaptics" if values.get("transport") == "openhaptics" else "touch_hid"


def _openhaptics(checked: Mapping[str, Any], source: str) -> OpenHapticsTransport:
    if checked["layout"] not in ("", "openhaptics"):
        raise ConfigurationError(
            f"{source}: layout is {checked['layout']!r}, but transport openhaptics has its own; leave it "
            "empty, or set transport: hid."
        )
    if checked["rate"] != OMNI_RATE_HZ:
        raise ConfigurationError(
            f"{source}: rate is {checked['rate']:g} Hz, but the HD library's servo thread has "
            f"{OMNI_RATE_HZ:g}; set rate: {OMNI_RATE_HZ}, or leave it out."
        )
    try:
        return OpenHapticsTransport(from_parameters(OpenHapticsSettings, checked, PREFIX))
    except ConfigurationError as error:
        raise ConfigurationError(f"{source}: {error}") from error
