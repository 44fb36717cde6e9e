"""How fast a control step is against the period that it has, and recordings are written and read against the
time that they last.

Each figure is the best of several repetitions: what else the machine does can only make them longer.
"""

import sys
import tempfile
import time
import timeit
from pathlib import Path

import numpy as np
from _promises import Promises

from haptic_teleop_control.filters import VelocityFilter
from haptic_teleop_control.laws import AugmentedErrorGains, AugmentedErrorLaw, MasterSettings, MasterSide
from haptic_teleop_control.recording import JointStateSeries, read_recording, write_recording
from haptic_teleop_control.signals import (
    AmplitudeSweep,
    FrequencySweep,
    Multisine,
    SignalGenerator,
    SignalSettings,
)

PERIOD, SECONDS = 0.002, 60


def law():
    stages = [AugmentedErrorGains.for_stage(stage) for stage in ("stage1", "stage2")]
    one, x = AugmentedErrorLaw(stages, PERIOD), np.array([0.1, 0.2])
    return lambda: one.step(x, x, x, x)


def velocity_filter():
    one, position = VelocityFilter(4, PERIOD), np.array([0.1, 0.2, 0.3, 0.4])
    return lambda: one.step(position)


def master_side():
    one, x = MasterSide([MasterSettings()] * 2, PERIOD), np.array([0.1, 0.2])
    return lambda: one.step(x, x)


def signal_value():
    sweeps = {"frequency_sweep": FrequencySweep(True), "amplitude_sweep": AmplitudeSweep(True)}
    stages = {
        "stage1": SignalSettings(enabled=True, multisine=Multisine(True)),
        "stage2": SignalSettings(enabled=True, **sweeps),
    }
    one = SignalGenerator(stages)
    return lambda: one.value(1.234)


def main() -> int:
    promise = Promises()
    for make in (law, velocity_filter, master_side, signal_value):
        taken = min(timeit.repeat(make(), number=2000, repeat=10)) / 2000
        print(f"a step of the {make.__name__.replace('_', ' ')}: {1e6 * taken:.2f} microseconds")
        promise(200.0 * taken < PERIOD, f"{PERIOD / taken:.0f} times in its period of 2 ms, at least 200")

    stamp = 1_000_000_000 + np.arange(1000 * SECONDS) * 1_000_000
    values = np.random.default_rng(0).normal(size=(len(stamp), 4))
    one = JointStateSeries(stamp, stamp + 40_000, ("a", "b", "c", "d"), values, values, values)
    data = {"/sfj/joint_states": one, "/omni/joint_states": one, "/sfj/effort_command": one}
    written, read = [], []
    with tempfile.TemporaryDirectory() as folder:
        for attempt in range(3):
            start = time.perf_counter()
            path = write_recording(Path(folder) / f"a{attempt}", data)
            written.append(time.perf_counter() - start)
            start = time.perf_counter()
            found = read_recording(path)
            read.append(time.perf_counter() - start)
            assert sum(map(len, found.topics.values())) == 3 * len(stamp)
    print(f"{SECONDS} s at 1 kHz on three topics: written in {min(written):.2f} s, read in {min(read):.2f} s")
    promise(60.0 * min(written) < SECONDS, f"written {SECONDS / min(written):.0f} times as fast as it lasts")
    promise(120.0 * min(read) < SECONDS, f"read {SECONDS / min(read):.0f} times as fast as it lasts")
    return promise.status


if __name__ == "__main__":
    sys.exit(main())
