"""How the HD library's servo thread is best met, on the emulated library: a compiled callback, the same one
asked for synchronously, and a callback in Python, each alone and beside a Python thread of the same process
that computes. Behind the third there is no driver, so that its states per second are no comparison.

Promise: the compiled callback holds the servo thread for less than 0.2 ms in 99 of 100 periods, also beside
that thread; whoever holds it for a period makes the library go on with the last torque.
"""

import ctypes
import queue
import sys
import tempfile
import threading
import time
from ctypes import c_double, c_int, c_ubyte
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "unit"))
from openhaptics_rig import NEUTRAL, Emulation, HdRig, compile_library

from haptic_teleop_omni.transports import hd_library as hd

SECONDS, PROMISE = 5.0, 200.0  # s; us
SWITCH_INTERVAL = 5e-4
"""s, as the nodes set it."""

PUSH = np.array([0.0, 0.05, 0.0])


class PythonCallback:
    """The frame of hd_frame.py in Python, as a thread-safe queue of states."""

    def __init__(self, em: Emulation) -> None:
        self.library = library = hd.load_library(str(em.path))
        self.states: queue.SimpleQueue = queue.SimpleQueue()
        self.torque = (c_double * 3)()
        self.handle = library.hdInitDevice(b"Default Device")
        angles, gimbal, buttons, well = (c_double * 3)(), (c_double * 3)(), c_int(), c_ubyte()
        places = [ctypes.byref(place) for place in (angles, gimbal, buttons, well)]

        def frame(_: object) -> int:
            library.hdMakeCurrentDevice(self.handle)
            library.hdBeginFrame(self.handle)
            library.hdGetDoublev(hd.JOINT_ANGLES, places[0])
            library.hdGetDoublev(hd.GIMBAL_ANGLES, places[1])
            library.hdGetIntegerv(hd.CURRENT_BUTTONS, places[2])
            library.hdGetBooleanv(hd.INKWELL_SWITCH, places[3])
            library.hdCheckCalibration()
            library.hdSetDoublev(hd.JOINT_TORQUE, self.torque)
            library.hdEndFrame(self.handle)
            library.hdGetError()
            self.states.put(angles[:])
            return 1

        self.callback = hd.CALLBACK(frame)
        library.hdStartScheduler()
        self.schedule = library.hdScheduleAsynchronous(self.callback, None, 1000)

    def cycle(self) -> None:
        self.states.get(timeout=1.0)
        while not self.states.empty():
            self.states.get()
        self.torque[1] = 0.05

    def close(self) -> None:
        self.library.hdUnschedule(self.schedule)
        self.library.hdStopScheduler()
        self.library.hdDisableDevice(self.handle)


class Driver:
    """The driver as it is, with one way of pacing."""

    def __init__(self, em: Emulation, folder: Path, pacing: str) -> None:
        # On a busy machine nothing of what is measured here may end in a fault.
        self.rig = HdRig(em, folder, openhaptics__pacing=pacing, openhaptics__watchdog=0.2, silence=0.2)
        while not self.rig.driver.calibration.done:
            self.rig.driver.read()

    def cycle(self) -> None:
        self.rig.driver.read()
        self.rig.driver.write(PUSH)

    def close(self) -> None:
        self.rig.driver.close()


def compute(stop: threading.Event) -> None:
    """What holds the interpreter's lock whenever it can."""
    while not stop.is_set():
        sum(range(1000))


def measure(em: Emulation, loop, busy: bool) -> tuple[float, np.ndarray, np.ndarray]:
    """States per second; us for which the servo thread was held; us from a period's begin to its state."""
    stop = threading.Event()
    other = threading.Thread(target=compute, args=(stop,))
    for _ in range(200):
        loop.cycle()
    if busy:
        other.start()
    ticks, ages = em.c.em_ticks(), []
    end = time.monotonic() + SECONDS
    while time.monotonic() < end:
        loop.cycle()
        ages.append((time.monotonic_ns() - em.c.em_begun()) * 1e-3)
    ticks = em.c.em_ticks() - ticks
    stop.set()
    if busy:
        other.join()
    held = (c_double * ticks)()
    em.c.em_held(held, ticks)
    return len(ages) / SECONDS, np.array(held), np.array(ages)


def main() -> int:
    sys.setswitchinterval(SWITCH_INTERVAL)
    kept = True
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        em = Emulation(compile_library(folder))
        em.c.em_begun.restype = em.c.em_ticks.restype = ctypes.c_long
        em.stepped(False)
        em.place(NEUTRAL)
        ways = {
            "callback, compiled": lambda: Driver(em, folder, "callback"),
            "synchronous, compiled": lambda: Driver(em, folder, "synchronous"),
            "callback in Python": lambda: PythonCallback(em),
        }
        print("servo thread held (us), and age of the state when it is read (us), medians, 99 %, most")
        for busy in (False, True):
            for name, make in ways.items():
                loop = make()
                rate, held, ages = measure(em, loop, busy)
                loop.close()
                figures = [np.percentile(values, (50, 99, 100)) for values in (held, ages)]
                text = "   ".join(" ".join(f"{value:8.0f}" for value in row) for row in figures)
                print(f"  {name:22}{'beside a thread' if busy else 'alone':16}{rate:6.0f} states/s  {text}")
                if name == "callback, compiled":
                    kept = kept and figures[0][1] < PROMISE
    return 0 if kept else 1


if __name__ == "__main__":
    sys.exit(main())
