"""What is done in every period of the HD library's servo thread, compiled, so that it waits for no
interpreter.

Python code in that thread would have to take the interpreter's lock a thousand times a second, and while
somebody else holds it the library would go on with the last torque. This code shares a block of memory with
the transport instead: a few control words, and a ring of the last reports. It takes the torque away by
itself when no new one has come for `WATCHDOG_FRAMES` periods, at any error, and when it is told to stop.

Each word is written by one side. A torque may be read while it changes; each of its axes is then the old or
the new one. The ring's head is moved after its report is complete.
"""

from __future__ import annotations

import ctypes
from ctypes import c_int, c_size_t, c_ssize_t, c_uint64, c_void_p
from typing import Any

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_control.compiled import load_numba
from haptic_teleop_omni.device_errors import WATCHDOG
from haptic_teleop_omni.transports.hd_library import (
    CALIBRATION_NEEDS_UPDATE,
    CALIBRATION_OK,
    CURRENT_BUTTONS,
    FORCE_OUTPUT,
    GIMBAL_ANGLES,
    INKWELL,
    INKWELL_SWITCH,
    JOINT_ANGLES,
    JOINT_TORQUE,
    MOTOR_TEMPERATURE,
    HdLibrary,
)

(HANDLE, STYLE, IN_WELL, WATCHDOG_FRAMES, EVENT, CLOSING, SINGLE, PAUSED) = range(8)
"""Control words that the transport writes before the scheduler runs; CLOSING also to end the callback, PAUSED
to take the torque away before the scheduler is stopped for another device."""
OUTPUT, ANSWER = 8, 12
"""The output report (x, y, z in µN·m, motors), then a number that every new one raises."""
(HEAD, SEEN, UNANSWERED, TRIPPED, ENABLED, CLEAN, FORGIVEN, CALLS, CLOSED, PERIODS, WARMTH, PROBED) = range(
    16, 28
)
"""Words that the callback writes: reports so far, its view of the answers, its state. CLEAN and FORGIVEN are
set to zero whenever the scheduler starts. PROBED: whether the device tells its motors' temperature, 0
unknown, 1 yes, 2 no: not every one does, and a refusal in every period would be an error in every period."""
DUE = 14
"""As a word of 8 bytes: when the next period is expected, ns."""

CONTROL, REPORT, RING, SCRATCH = 32, 16, 64, 32
"""Words of 4 bytes; RING in reports."""
WORDS = CONTROL + REPORT * RING + SCRATCH
NUMBERS = (CONTROL + REPORT * RING) // 2
"""Where the scratch begins, in words of 8 bytes."""

PERIOD = 1_000_000
"""ns, of the servo thread."""

SETTLED = 3
UNSETTLED_CALLS = 1000
"""Good frames in a row that are asked for after a start, and how many calls are forgiven until then: users
report that the first frames after hdStartScheduler are errors or hold no angles yet."""
TEMPERATURE_PERIODS = 128
CALIBRATION_PERIODS = 64


def block() -> NDArray[np.int32]:
    """The shared memory, zero; (WORDS,), aligned to 8 bytes."""
    return np.zeros(WORDS // 2, dtype=np.int64).view(np.int32)


def frame_of(hd: HdLibrary, clock_gettime: Any = None) -> Any:
    """The callback for `hd`, with its `address`; it takes the address of a `block`. Compiled once a process.

    clock_gettime: of ctypes, (clock, timespec *); None: the system's.
    """
    clock = None if clock_gettime is None else ctypes.cast(clock_gettime, c_void_p).value
    if (hd.path, clock) not in _compiled:
        _compiled[hd.path, clock] = _compile(hd, clock_gettime)
    return _compiled[hd.path, clock]


_compiled: dict[tuple[str, int | None], Any] = {}


def _compile(hd: HdLibrary, clock_gettime: Any) -> Any:
    load_numba()  # here, because only a device needs it
    from numba import cfunc, types
    from numba.np.numpy_support import carray

    system = ctypes.CDLL(None)
    clock = _typed(clock_gettime or system.clock_gettime, c_int, [c_int, c_void_p])
    write = _typed(system.write, c_ssize_t, [c_int, c_void_p, c_size_t])
    library = hd.library
    begin, end, make_current = library.hdBeginFrame, library.hdEndFrame, library.hdMakeCurrentDevice
    enable, disable = library.hdEnable, library.hdDisable
    get_doubles, get_integers = library.hdGetDoublev, library.hdGetIntegerv
    get_booleans, set_doubles = library.hdGetBooleanv, library.hdSetDoublev
    check_calibration, update_calibration = library.hdCheckCalibration, library.hdUpdateCalibration
    # A structure of 12 bytes comes back in two registers (System V, x86-64 and AArch64): its code in the
    # lower half of the first one, the further code in the upper half.
    get_error = ctypes.CFUNCTYPE(c_uint64)(ctypes.cast(library.hdGetError, c_void_p).value or 0)

    @cfunc(types.uint32(types.voidptr), error_model="numpy")
    def frame(data: Any) -> Any:
        words = carray(data, (WORDS,), np.int32)
        long_words = carray(data, (WORDS // 2,), np.int64)
        numbers = carray(data, (WORDS // 2,), np.float64)
        scratch = numbers[NUMBERS:]
        handle = np.uint32(words[HANDLE])
        words[CALLS] += 1

        # How many periods have gone by since the last call.
        clock(1, long_words[NUMBERS + 12 :].ctypes)
        now = long_words[NUMBERS + 12] * 1_000_000_000 + long_words[NUMBERS + 13]
        late = 0
        if words[CALLS] == 1:
            long_words[DUE] = now
        elif now - long_words[DUE] > PERIOD + PERIOD // 2:
            late = np.int32((now - long_words[DUE]) // PERIOD)
        elif long_words[DUE] - now > PERIOD:
            long_words[DUE] = now
        long_words[DUE] += (late + 1) * PERIOD
        words[PERIODS] += late + 1

        # Whether there may be a torque in this period.
        if words[SEEN] != words[ANSWER]:
            words[SEEN] = words[ANSWER]
            words[UNANSWERED] = 0
            if words[OUTPUT + 3] & 1 == 0:
                words[TRIPPED] = 0
        else:
            words[UNANSWERED] += late + 1
        wanted = words[OUTPUT + 3] & 1 != 0 and words[CLOSING] == 0 and words[PAUSED] == 0
        expired = 0
        if wanted and words[TRIPPED] == 0 and words[UNANSWERED] >= words[WATCHDOG_FRAMES]:
            expired = 1
            words[TRIPPED] = 1
        on = wanted and words[TRIPPED] == 0 and words[CLEAN] >= SETTLED

        make_current(handle)
        if on and words[ENABLED] == 0:
            enable(FORCE_OUTPUT)
            words[ENABLED] = 1
        begin(handle)
        get_doubles(JOINT_ANGLES, scratch.ctypes)
        get_doubles(GIMBAL_ANGLES, scratch[3:].ctypes)
        words[WORDS - 2] = 0
        get_integers(CURRENT_BUTTONS, words[WORDS - 2 :].ctypes)
        buttons = words[WORDS - 2]
        words[WORDS - 2] = 0
        get_booleans(INKWELL_SWITCH, words[WORDS - 2 :].ctypes)
        docked = (words[WORDS - 2] & 1) == words[IN_WELL]
        calibration = check_calibration()
        probing = words[PROBED] == 0 and words[CLEAN] >= SETTLED and words[CALLS] % TEMPERATURE_PERIODS == 0
        if probing or (words[PROBED] == 1 and words[CALLS] % TEMPERATURE_PERIODS == 0):
            scratch[6] = scratch[7] = scratch[8] = 0.0
            get_doubles(MOTOR_TEMPERATURE, scratch[6:].ctypes)
            warmest = max(scratch[6], scratch[7], scratch[8])
            words[WARMTH] = np.int32(1000.0 * min(max(warmest, 0.0), 1000.0)) if warmest == warmest else 0
        for axis in range(3):
            scratch[9 + axis] = 1e-3 * words[OUTPUT + axis] if on else 0.0  # mN·m
        if words[ENABLED] != 0:
            set_doubles(JOINT_TORQUE, scratch[9:].ctypes)
        end(handle)
        if not on and words[ENABLED] != 0:
            disable(FORCE_OUTPUT)
            words[ENABLED] = 0
        if (
            calibration == CALIBRATION_NEEDS_UPDATE
            and not on
            and words[CALLS] % CALIBRATION_PERIODS == 0
            and (docked or words[STYLE] != INKWELL)
        ):
            update_calibration(np.uint32(words[STYLE]))

        code, internal = 0, 0
        for _ in range(64):
            found = get_error()
            if np.uint32(found) == 0:
                break
            if np.int64(np.uint32(found)) >= code:
                code, internal = np.int64(np.uint32(found)), np.int64(found) >> 32
        if probing:
            words[PROBED] = 1 if code == 0 else 2
            code = 0 if code >> 8 == 1 else code
        # What is no number, or beyond any angle, must not become one: it is an error of the library.
        for angle in range(6):
            if words[CLEAN] >= SETTLED and not abs(scratch[angle]) < 1000.0:
                code = max(code, 0x0101)
        if words[CLEAN] < SETTLED and words[FORGIVEN] < UNSETTLED_CALLS and (code == 0 or code >> 8 == 4):
            words[FORGIVEN] += 1
            words[CLEAN] = words[CLEAN] + 1 if code == 0 else 0
        else:
            words[CLEAN] = SETTLED
            if code != 0:
                words[TRIPPED] = 1  # the next frame takes the torque away
                words[UNANSWERED] = 0
            head = words[HEAD]
            at = CONTROL + REPORT * (head % RING)
            words[at] = words[PERIODS]
            for angle in range(6):
                value = scratch[angle]
                if not abs(value) < 1000.0:
                    code, value = max(code, 0x0101), 0.0
                words[at + 1 + angle] = np.int32(np.round(1e6 * value))
            words[at + 7] = buttons & 3
            words[at + 8] = 1 if docked else 0
            words[at + 9] = 1 if calibration == CALIBRATION_OK else 0
            words[at + 10] = np.int32(WATCHDOG if code == 0 and expired else code)
            words[at + 11] = np.int32(internal)
            words[at + 12] = words[WARMTH]
            clock(1, long_words[NUMBERS + 12 :].ctypes)  # a call that the compiler cannot move stores across
            words[HEAD] = head + 1
        long_words[NUMBERS + 14] = 1
        write(words[EVENT], long_words[NUMBERS + 14 :].ctypes, 8)
        if words[CLOSING] != 0:
            words[CLOSED] = 1
            return 0
        return 0 if words[SINGLE] != 0 else 1

    return frame


def _typed(call: Any, result: Any, arguments: list[Any]) -> Any:
    call.restype, call.argtypes = result, arguments
    return call
