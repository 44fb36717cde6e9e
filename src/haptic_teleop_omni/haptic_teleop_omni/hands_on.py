"""`doctor --omni`: layout and axis map of a real Omni, verified by hand, axis by axis, with the force off.

The driver that is used here never gets a torque. Where every axis answers as the thesis defines it (2.3.1:
left, up and out are positive), that is written down for this very device, and from then on its driver may
drive.
"""

from __future__ import annotations

import datetime
import os
import select
import sys
from collections.abc import Callable
from typing import Any

from haptic_teleop_control.device import DeviceError, Reporter
from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.parameter_files import load_parameter_file, parameters_for
from haptic_teleop_omni.axis_verification import AxisVerification
from haptic_teleop_omni.build import ALL_FAULTS, make_driver
from haptic_teleop_omni.confirmation import confirm, confirmation_file
from haptic_teleop_omni.settings import TABLE

PATIENCE = 0.2
"""s without a report that end it, more than while it drives."""


def verify_by_hand(file: str = "", pressed: Callable[[], bool] | None = None) -> int:
    """The command. file: whose section omni_driver says how the device is reached; "": the defaults. Returns
    0 once it is confirmed and written down, 1 where something is not as it should be. Raises
    ConfigurationError."""
    values = {**_stated(file), "device": "hardware", "layout_confirmed_for": "", "silence": PATIENCE}
    reporter, latch = Reporter.to_latch(ALL_FAULTS)
    driver = make_driver(values, reporter, source=file or "parameters")
    try:
        try:
            driver.open()
        except DeviceError as refusal:
            text = f"the Omni cannot be opened: {refusal}; see docs/drivers.md."
            raise ConfigurationError(text) from refusal
        if not driver.transport.identity:
            raise ConfigurationError(
                "the device tells neither model nor serial number, so nothing can be confirmed for it; "
                "run the vendor's set-up tool, which stores them."
            )
        if driver.layout.input.absolute and not driver.transport.serial:
            raise ConfigurationError(
                f"{driver.transport.identity} tells no serial number, and nothing tells it from another of "
                "its model: run the vendor's set-up tool, which stores one, or write layout_confirmed_for: "
                f'"{driver.confirmation}" once you have verified the axes otherwise.'
            )
        if latch.latched == "layout_not_confirmed":  # that is what is to be put right here
            latch.reset()
        hands = AxisVerification(driver, pressed or _Enter(), print, lambda: latch.sentence or "")
        if not hands.verify():
            print("NOT confirmed: the force stays off. Put right what is said above, then begin again.")
            return 1
        path = confirmation_file(driver.settings.confirmations)
        details = {"on": datetime.date.today().isoformat(), "device": driver.transport.describe()}
        confirm(path, driver.transport.identity, driver.confirmation, {**details, "moved": hands.moved})
        print(f"Confirmed for {driver.transport.identity}, written to {path}: its driver may drive now.")
        return 0
    finally:
        driver.close()


def _stated(file: str) -> dict[str, Any]:
    """What `file` says to the driver. Its own section is checked; a wildcard may speak to other nodes."""
    if not file:
        return {}
    sections = load_parameter_file(file)
    named = {name: values for name, values in sections.items() if "*" not in name}
    TABLE.check(parameters_for(named, TABLE.node_name, TABLE), file)
    said = parameters_for(sections, TABLE.node_name, TABLE)
    if not any(key in TABLE for key in said):
        raise ConfigurationError(f"{file} says nothing to {TABLE.node_name}: name the driver's own file.")
    return {key: value for key, value in said.items() if key in TABLE}


class _Enter:
    """Whether a further line has come on standard input."""

    def __init__(self) -> None:
        self._lines, self._ended = 0, False

    def __call__(self) -> bool:
        if not self._ended and select.select([sys.stdin], [], [], 0.0)[0]:
            data = os.read(sys.stdin.fileno(), 4096)
            self._ended = not data
            self._lines += data.count(b"\n")
        if self._lines == 0:
            if self._ended:
                raise ConfigurationError("standard input has ended; run `doctor --omni` in a terminal.")
            return False
        self._lines -= 1
        return True
