"""The driver of the Omni through real ctypes on the emulated HD library (tests/openhaptics/emulated_hd.c)."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from ctypes import c_double
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from device_rigs import Rig

from haptic_teleop_control.device import Reporter
from haptic_teleop_omni.axis_map import AxisMap
from haptic_teleop_omni.build import ALL_FAULTS, make_driver
from haptic_teleop_omni.confirmation import confirm
from haptic_teleop_omni.driver import OmniDriver
from haptic_teleop_omni.transports import openhaptics
from haptic_teleop_omni.transports.hd_library import load_library

SOURCE = Path(__file__).resolve().parents[1] / "openhaptics" / "emulated_hd.c"
NEUTRAL = np.array(AxisMap().zero)
"""Angles of the library at which every axis of the default map is neutral, rad."""


def compile_library(folder: Path, name: str = "libHD.so", *options: str) -> Path:
    """The emulated library, compiled into `folder`; the test is skipped where there is no compiler."""
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("no C compiler (cc), with which the emulated HD library is made")
    target = folder / name
    made = ["-shared", "-fPIC", "-O2", "-pthread", "-o", str(target), str(SOURCE), "-lm"]
    subprocess.run([compiler, *options, *made], check=True)
    return target


class Emulation:
    """The emulation's own side of the library. stepped: time goes on by `tick` alone."""

    def __init__(self, path: Path) -> None:
        self.path = path
        library = load_library(str(path))
        for device in list(library.opened):  # what a failed test has left
            device.close()
        self.clock = library.library.em_clock_gettime
        self.c = ctypes.CDLL(str(path))
        self.c.em_temperature.argtypes = [ctypes.c_int, c_double]
        self.c.em_stall.argtypes = [c_double]
        self.c.em_reset()
        self.stepped(True)

    def stepped(self, on: bool) -> None:
        self.c.em_stepped(int(on))

    def place(self, angles: Any, device: int = 0) -> None:
        """Puts the device there; rad, as the library counts."""
        self.c.em_angles(device, (c_double * 3)(*(float(angle) for angle in angles)))

    def torque(self, device: int = 0) -> np.ndarray:
        """What acts on the device's axes now, N·m."""
        acting = (c_double * 3)()
        self.c.em_torque(device, acting)
        return np.array(acting)

    def off(self, device: int = 0) -> bool:
        """Whether neither a torque acts nor force is enabled."""
        return not self.torque(device).any() and not self.c.em_force(device)


class HdRig(Rig):
    """parameters: of `omni_driver`, with __ for dots. confirmed: as `doctor --omni` would have written it.

    plant: moves the device, as in `device_rigs.StillOmni`; None: it stands where the test puts it.
    """

    def __init__(
        self, em: Emulation, folder: Path, confirmed: bool = True, plant: Any = None, **parameters: Any
    ) -> None:
        self.em, self.plant = em, plant
        values = {
            "device": "hardware",
            "transport": "openhaptics",
            "openhaptics.library": str(em.path),
            "confirmations": str(folder / "confirmed.yaml"),
            "torque.ramp_time": 0.0,
            **{name.replace("__", "."): value for name, value in parameters.items()},
        }
        self.values = values
        self.reporter, self.latch = Reporter.to_latch(ALL_FAULTS)
        self.packets: list[tuple[str, bytes]] = []
        self.driver: OmniDriver = make_driver(values, self.reporter, lambda *p: self.packets.append(p))
        self.transport = self.driver.transport
        assert isinstance(self.transport, openhaptics.OpenHapticsTransport)
        if confirmed:
            self.driver.open()
            words, identity = self.driver.confirmation, self.transport.identity
            self.driver.close()
            confirm(folder / "confirmed.yaml", identity, words, {})
        self.em.place(NEUTRAL)
        self.driver.open()

    def move(self, angles: Any) -> None:
        """There within 50 periods, about neutral, so that nobody takes it for a jump of the encoders."""
        start = self.driver.position.copy()
        for share in np.linspace(0.0, 1.0, 50):
            self.em.place(NEUTRAL + start + share * (np.array(angles) - start))
            self.cycle()

    def tick(self) -> None:
        """One period: what acts moves the plant, then the servo thread has its turn."""
        if self.plant is not None:
            self.plant.advance(self.em.torque())
            self.em.place(self.plant.sense() + NEUTRAL)
        if self.driver.transport.settings.pacing == "callback":
            self.em.c.em_tick()

    def cycle(self, effort: Any = None) -> Any:
        self.tick()
        return super().cycle(effort)

    def settle(self, effort: Any = None) -> None:
        """Past the calibration, which the library does in its own time."""
        self.run(80, effort)
        assert self.driver.calibration.done
