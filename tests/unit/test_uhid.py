"""Real hidapi through a virtual HID device of the kernel: skipped, visibly, where there is no /dev/uhid."""

import os
import select
import struct
import threading
import time

import numpy as np
import pytest
from device_rigs import StillOmni

from haptic_teleop_control.clocks import SteadyClock
from haptic_teleop_control.device import ReadResult, Reporter
from haptic_teleop_omni.build import ALL_FAULTS
from haptic_teleop_omni.driver import OmniDriver
from haptic_teleop_omni.layout import load_layout
from haptic_teleop_omni.settings import OmniDriverSettings
from haptic_teleop_omni.transports.emulated import EmulatedOmni
from haptic_teleop_omni.transports.hidapi import HidapiTransport

UHID = "/dev/uhid"
# Linux, Documentation/hid/uhid.rst.
DESTROY, OUTPUT, CREATE2, INPUT2 = 1, 6, 11, 12
VENDOR, PRODUCT = 0x2988, 0x0304
# Vendor-defined page: one input report of 44 bytes, one output report of 16.
DESCRIPTOR = bytes.fromhex("0600ff 0901 a101 1500 26ff00 7508 952c 0901 8102 9510 0901 9102 c0")

pytestmark = pytest.mark.skipif(
    not os.access(UHID, os.R_OK | os.W_OK),
    reason=f"{UHID} is not there or not writable: real hidapi is not exercised (modprobe uhid, run as root)",
)


class VirtualDevice:
    """The emulated Omni as a HID device of the kernel."""

    def __init__(self, device: EmulatedOmni) -> None:
        self.device = device
        self._file = os.open(UHID, os.O_RDWR)
        body = struct.pack(
            "<128s64s64sHHIIII", b"emulated omni", b"", b"", len(DESCRIPTOR), 3, VENDOR, PRODUCT, 0, 0
        )
        os.write(self._file, struct.pack("<I", CREATE2) + body + DESCRIPTOR.ljust(4096, b"\0"))
        self._stop = threading.Event()
        device.open()
        self._threads = [threading.Thread(target=work, daemon=True) for work in (self._send, self._receive)]
        for thread in self._threads:
            thread.start()

    def _send(self) -> None:
        while not self._stop.is_set():
            report = self.device.read(0.01)
            if report is not None:
                os.write(self._file, struct.pack("<IH", INPUT2, len(report)) + report)

    def _receive(self) -> None:
        while not self._stop.is_set():
            if not select.select([self._file], [], [], 0.05)[0]:
                continue
            event = os.read(self._file, 4380)
            if struct.unpack_from("<I", event)[0] == OUTPUT:
                size = struct.unpack_from("<H", event, 4 + 4096)[0]
                data = event[4 : 4 + size]
                self.device.write(data[1:] if size == 17 else data)

    def close(self) -> None:
        self._stop.set()
        for thread in self._threads:
            thread.join()
        os.write(self._file, struct.pack("<I", DESTROY))
        os.close(self._file)


@pytest.fixture
def virtual():
    plant = StillOmni()
    device = VirtualDevice(EmulatedOmni(plant, load_layout("emulator"), SteadyClock(), 1000.0, 0.0))
    yield device
    device.close()


def test_the_driver_reads_angles_and_sends_torques_through_the_kernel(virtual):
    layout = load_layout("emulator")
    reporter, latch = Reporter.to_latch(ALL_FAULTS)
    transport = HidapiTransport(VENDOR, PRODUCT)
    deadline = time.monotonic() + 5.0
    while True:
        try:
            transport.open()
            break
        except Exception:
            assert time.monotonic() < deadline
            time.sleep(0.05)
    transport.close()
    settings = OmniDriverSettings.from_parameters(
        {
            "calibration.method": "start",
            "silence": 0.2,
            "torque.ramp_time": 0.0,
            "layout_confirmed_for": layout.confirmation(transport.identity),
        }
    )
    driver = OmniDriver(settings, layout, transport, reporter)
    driver.open()
    states = 0
    for _ in range(200):
        states += driver.read() is ReadResult.STATE
        driver.write(np.array([0.0, 0.1, -0.1]))
    assert latch.latched is None, latch.sentence
    assert states > 150
    assert virtual.device.torque == pytest.approx([0.0, 0.1, -0.1], abs=2.5e-4)
    driver.close()
    time.sleep(0.1)
    assert not virtual.device.motors_on
