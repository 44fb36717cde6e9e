"""A Ctrl-C that comes where Python can raise nothing ends a command all the same."""

import ctypes
import signal
import sys
import time

import pytest

from haptic_teleop_control.command_line import INTERRUPTED, run_command


@pytest.fixture(autouse=True)
def heard():
    """A background job of a shell begins deaf to interrupts."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


CALLED_BACK = ctypes.CFUNCTYPE(None)


def in_a_callback():
    """As numba's compiler calls Python back for each function that it compiles."""
    CALLED_BACK(lambda: signal.raise_signal(signal.SIGINT))()


def in_a_destructor():
    class Ends:
        def __del__(self):
            signal.raise_signal(signal.SIGINT)

    Ends()


def go_on():
    """The rest of a run, to which an interrupt has to put an end."""
    for _ in range(300):
        time.sleep(0.01)


@pytest.mark.parametrize("where", [in_a_callback, in_a_destructor])
def test_an_interrupt_that_python_ignores_comes_again(where):
    def main(argv):
        where()
        go_on()
        return 0

    assert run_command(main, []) == INTERRUPTED


def test_another_error_in_a_callback_is_told_as_before(monkeypatch):
    told = []
    monkeypatch.setattr(sys, "unraisablehook", lambda ignored: told.append(ignored.exc_type))

    def main(argv):
        CALLED_BACK(lambda: 1 // 0)()
        return 0

    assert run_command(main, []) == 0
    assert told == [ZeroDivisionError]


def test_the_compiler_of_numba_swallows_no_interrupt():
    llvm = pytest.importorskip("llvmlite.binding")

    def main(argv):
        module = llvm.parse_assembly("define i32 @f() { ret i32 7 }")
        llvm.initialize_native_target()
        llvm.initialize_native_asmprinter()
        target = llvm.Target.from_default_triple().create_target_machine()
        compiler = llvm.create_mcjit_compiler(module, target)
        compiler.set_object_cache(lambda module, buffer: signal.raise_signal(signal.SIGINT), lambda _: None)
        compiler.finalize_object()
        go_on()
        return 0

    assert run_command(main, []) == INTERRUPTED
