"""The Omni over hidapi, with a module in its place that answers as the library's documentation says."""

import sys

import numpy as np
import pytest
from device_rigs import OmniRig

from haptic_teleop_control.device import DeviceError, ReadResult
from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_omni.driver import OmniDriver
from haptic_teleop_omni.layout import load_layout
from haptic_teleop_omni.transports.hidapi import HidapiTransport

PUSH = (0.0, 0.1, -0.05)  # N·m
STEP = 2.5e-4  # N·m


def idle(rig: OmniRig) -> bool:
    return not rig.device.torque.any() and not rig.device.motors_on


class FakeHid:
    """The one device of a stand-in for hidapi's module."""

    def __init__(self) -> None:
        self.reports: list[bytes] = []
        self.written: list[bytes] = []
        self.gone = False
        self.nonblocking = 0

    def device(self):
        return self

    def open(self, vendor: int, product: int, serial: str | None) -> None:
        if self.gone:
            raise OSError("open failed")

    def set_nonblocking(self, on: int) -> None:
        self.nonblocking = on

    def read(self, size: int, timeout_ms: int = 0) -> list[int]:
        if self.gone:
            raise OSError("read error")
        assert timeout_ms or self.nonblocking, "this call would wait for ever"
        return list(self.reports.pop(0)) if self.reports else []

    def write(self, data: bytes) -> int:
        self.written.append(bytes(data))
        return -1 if self.gone else len(data)

    def error(self) -> str:
        return "no such device"

    def close(self) -> None: ...

    serial: str | None = "T1"
    product: str | None = "Touch"

    def get_serial_number_string(self) -> str | None:
        if self.serial == "refused":
            raise OSError("no such string")
        return self.serial

    def get_product_string(self) -> str | None:
        return self.product


@pytest.fixture
def fake(monkeypatch):
    fake = FakeHid()
    monkeypatch.setitem(sys.modules, "hidraw", fake)
    return fake


def test_hidapi_is_read_and_written_in_whole_reports(fake):
    for numbered, sent in ((False, b"\x00abc"), (True, b"abc")):
        transport = HidapiTransport(1, 2, "", numbered)
        transport.open()
        fake.reports = [b"first", b"second"]
        assert [transport.read(0.01), transport.read(0.0), transport.read(0.0)] == [b"first", b"second", None]
        transport.write(b"abc")
        assert fake.written[-1] == sent


def test_a_hid_device_that_goes_away_is_a_device_error_in_every_call(fake):
    transport = HidapiTransport(1, 2)
    transport.open()
    fake.gone = True
    for call in (lambda: transport.read(0.01), lambda: transport.write(b"a"), transport.open):
        with pytest.raises(DeviceError):
            call()
    transport.close()
    with pytest.raises(DeviceError, match="not open"):
        transport.read(0.01)


class HidOmni(FakeHid):
    """The stand-in with the emulated Omni at its other end, as a device of the kernel would be."""

    def __init__(self, device) -> None:
        super().__init__()
        self.omni = device
        device.open()

    def read(self, size: int, timeout_ms: int = 0) -> list[int]:
        return list(self.omni.read(timeout_ms * 1e-3) or b"")

    def write(self, data: bytes) -> int:
        assert data[0] == 0, "no report number"
        self.omni.write(data[1:])
        return len(data)


@pytest.mark.parametrize(("serial", "product", "identity"), [
    ("T1", "Touch", "2988:0304:T1"), (None, "Touch", "2988:0304:Touch"), ("", None, "2988:0304"),
    ("refused", " Touch  X ", "2988:0304:Touch X"),
])  # fmt: skip
def test_a_device_is_known_by_its_serial_number_or_its_product_s_name(fake, serial, product, identity):
    fake.serial, fake.product = serial, product
    transport = HidapiTransport(0x2988, 0x0304)
    transport.open()
    assert transport.identity == identity


@pytest.mark.parametrize("confirmed", [True, False])
def test_a_real_device_gets_torques_if_and_only_if_its_layout_is_confirmed_for_it(monkeypatch, confirmed):
    layout = load_layout("emulator")
    words = layout.confirmation("2988:0304:T1") if confirmed else ""
    rig = OmniRig(layout_confirmed_for=words)
    monkeypatch.setitem(sys.modules, "hidraw", HidOmni(rig.device))
    driver = OmniDriver(rig.settings, layout, HidapiTransport(0x2988, 0x0304), rig.reporter)
    driver.open()
    states = 0
    for _ in range(20):
        states += driver.read() is ReadResult.STATE
        driver.write(np.array(PUSH))
    assert states == 20
    assert rig.latch.latched is None
    assert rig.device.torque == pytest.approx(PUSH if confirmed else (0.0, 0.0, 0.0), abs=STEP / 2)
    assert driver.effort == pytest.approx(PUSH if confirmed else (0.0, 0.0, 0.0), abs=STEP / 2)
    driver.close()
    assert idle(rig)


def test_without_hidapi_one_sentence_says_what_to_install(monkeypatch):
    for name in ("hid", "hidraw"):
        monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(ConfigurationError, match="pip install hidapi"):
        HidapiTransport(1, 2).open()
