"""The calls of Quanser's SDK: their types, what is missing from it, and how that is said."""

import sys

import numpy as np
import pytest
from device_rigs import SfjRig

from haptic_teleop_2dsfj.board import Board
from haptic_teleop_2dsfj.board_settings import BoardSettings
from haptic_teleop_2dsfj.build import make_driver
from haptic_teleop_2dsfj.emulated_hil import EmulatedError
from haptic_teleop_control.device import DeviceError, Reporter
from haptic_teleop_control.errors import ConfigurationError

PUSH = (2.0, 0.4)  # N·m


# What each argument is in the SDK's C prototypes: handle, text, double, (u)int32, and arrays of these.
PROTOTYPES = {
    "open": "tt", "close": "", "set_digital_directions": "UuUu", "set_analog_input_ranges": "UuDD",
    "set_analog_output_ranges": "UuDD", "set_encoder_quadrature_mode": "UuI", "set_encoder_counts": "UuI",
    "write_analog": "UuD", "write_digital": "UuB", "read_digital": "UuB",
    "task_create_reader": "uUuUuUuUu", "task_set_buffer_overflow_mode": "hi",
    "task_get_buffer_overflows": "h",
    "task_start": "hidu", "task_read": "huDIBD", "task_stop": "h", "task_delete": "h",
    "watchdog_set_analog_expiration_state": "UuD", "watchdog_set_digital_expiration_state": "UuI",
    "watchdog_start": "d", "watchdog_stop": "", "watchdog_reload": "", "watchdog_is_expired": "",
    "watchdog_clear": "",
}  # fmt: skip
ARRAYS = {"U": np.uint32, "I": np.int32, "D": np.float64, "B": np.int8}


class StrictHil:
    """Passes every call on to `hil`, if a C compiler would have taken its arguments."""

    def __init__(self, hil) -> None:
        self._hil = hil
        self.called: set[str] = set()

    def __getattr__(self, name):
        call, kinds = getattr(self._hil, name), PROTOTYPES[name]

        def checked(*arguments):
            assert len(arguments) == len(kinds)
            for kind, value in zip(kinds, arguments, strict=True):
                if kind in ARRAYS:
                    assert value is None or (value.dtype == ARRAYS[kind] and value.flags.c_contiguous), name
                elif kind == "u":
                    assert isinstance(value, int) and 0 <= value < 2**32, name
                elif kind == "i":
                    assert isinstance(value, int) and -(2**31) <= value < 2**31, name
                elif kind != "h":
                    assert isinstance(value, {"d": float, "t": str}[kind]), name
            self.called.add(name)
            return call(*arguments)

        return checked


def test_every_call_of_a_session_fits_the_prototypes_of_the_sdk():
    rig = SfjRig()
    rig.driver.close()
    strict = StrictHil(rig.hil)
    rig.driver.board = rig.board(strict)
    rig.driver.open()
    rig.run(3, PUSH)
    rig.clock.advance(0.1)
    rig.cycle(PUSH)
    rig.driver.reset()
    rig.driver.read()
    rig.clock.advance(0.1)
    rig.driver.write(np.array(PUSH))
    rig.latch.reset()
    rig.driver.write(np.array(PUSH))
    rig.driver.close()
    assert strict.called == set(PROTOTYPES)
    assert rig.latch.counts["board_error"] == 0


def test_every_buffer_has_the_type_that_its_call_needs():
    rig = SfjRig()  # the emulated board refuses any other type, for every call of a session
    rig.run(3, PUSH)
    rig.driver.close()
    assert rig.latch.counts["board_error"] == 0
    with pytest.raises(EmulatedError, match="int32"):
        rig.driver.open()
        rig.hil.task_read(
            {"analog": [0, 1], "encoder": [0, 1, 2, 3], "digital": [0, 1, 2, 3]}, 1,
            np.zeros(2), np.zeros(4), np.zeros(4, dtype=np.int8), None,
        )  # fmt: skip


def test_without_the_sdk_one_sentence_says_what_to_install():
    reporter, _ = Reporter.to_latch({})
    driver = make_driver({"device": "hardware"}, reporter)
    with pytest.raises(ConfigurationError, match=r"quanser\.hardware is not installed; install .*emulated"):
        driver.open()


def test_an_sdk_that_lacks_a_call_is_told_to_be_too_old():
    class Old:
        def __getattr__(self, name):
            if name == "task_set_buffer_overflow_mode":
                raise AttributeError(name)
            return lambda *_: None

    board = Board(BoardSettings(), Old)
    with pytest.raises(DeviceError, match=r"task_set_buffer_overflow_mode: .*too old.*newer"):
        board.open()


def test_a_module_that_the_sdk_needs_is_named(monkeypatch, tmp_path):
    package = tmp_path / "quanser" / "hardware"
    package.mkdir(parents=True)
    (tmp_path / "quanser" / "__init__.py").touch()
    (package / "__init__.py").write_text("import a_module_that_nobody_has\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    with pytest.raises(ConfigurationError, match="needs the Python module a_module_that_nobody_has"):
        make_driver({"device": "hardware"}, Reporter.to_latch({})[0]).open()
    for name in ("quanser", "quanser.hardware"):
        sys.modules.pop(name, None)
