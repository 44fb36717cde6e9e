"""Drivers on emulated devices with a clock that only moves when somebody waits: for tests without ROS."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from haptic_teleop_2dsfj.board import Board
from haptic_teleop_2dsfj.build import all_faults
from haptic_teleop_2dsfj.build import make_driver as make_sfj_driver
from haptic_teleop_2dsfj.driver import SfjDriver
from haptic_teleop_2dsfj.emulated_electronics import Electronics
from haptic_teleop_2dsfj.emulated_hil import EmulatedHil
from haptic_teleop_2dsfj.settings import SfjDriverSettings
from haptic_teleop_control.clocks import VirtualClock
from haptic_teleop_control.device import Reporter
from haptic_teleop_control.faults import FaultLatch
from haptic_teleop_control.parameter_files import load_parameter_file, parameters_for
from haptic_teleop_control.parameters import ParameterTable
from haptic_teleop_omni.build import ALL_FAULTS
from haptic_teleop_omni.build import make_driver as make_omni_driver
from haptic_teleop_omni.driver import OmniDriver
from haptic_teleop_omni.layout import load_layout
from haptic_teleop_omni.settings import OmniDriverSettings
from haptic_teleop_omni.transports.emulated import EmulatedOmni

COUNT, TORQUE_STEP = 4.1e-4, 2.5e-4  # rad, N·m: of the emulator's layout, docs/drivers.md

UNSHAPED = {
    "ramp_time": 0.0,
    "stage1.current_slew": math.inf,
    "stage2.current_slew": math.inf,
    "stage1.current_limit": 0.94,
    "stage2.current_limit": 1.2,
}
"""Parameters of `sfj_driver` with which a command flows at once, up to the motors' maximum, as in the
simulated plant: for tests of something else."""


def section(file: Path, table: ParameterTable) -> dict:
    """All parameters of a node, of what the file says to it or to all."""
    stated = parameters_for(load_parameter_file(file), table.node_name)
    return table.check({key: value for key, value in stated.items() if key in table}, str(file))


@dataclass
class StillRobot:
    """A 2DSFJ that stands where the test puts it and remembers what current it was given."""

    angles: np.ndarray = field(default_factory=lambda: np.zeros(4))
    given: list[tuple[float, float]] = field(default_factory=list)
    sensed: np.ndarray | None = None

    def sense(self) -> tuple[np.ndarray, np.ndarray]:
        flowing = np.array(self.given[-1]) if self.given else np.zeros(2)
        return self.angles, flowing if self.sensed is None else self.sensed

    def advance(self, current: np.ndarray) -> None:
        self.given.append((float(current[0]), float(current[1])))


@dataclass
class StillOmni:
    """An Omni that stands where the test puts it and remembers the torques that it was given."""

    angles: np.ndarray = field(default_factory=lambda: np.zeros(3))
    given: list[np.ndarray] = field(default_factory=list)

    def sense(self) -> np.ndarray:
        return self.angles

    def advance(self, command: np.ndarray) -> None:
        self.given.append(command.copy())


class Rig:
    """A `driver` with the `latch` of its faults, whose loop the test turns by hand."""

    driver: SfjDriver | OmniDriver
    latch: FaultLatch

    def cycle(self, effort: Any = None) -> Any:
        result = self.driver.read()
        self.driver.write(None if effort is None else np.array(effort, dtype=float))
        return result

    def run(self, samples: int, effort: Any = None) -> None:
        for _ in range(samples):
            self.cycle(effort)

    def reset(self) -> None:
        """What the node's `reset` does."""
        self.latch.reset()
        self.driver.reset()


class SfjRig(Rig):
    """parameters: of `sfj_driver`, with __ for dots, UNSHAPED where they say nothing else. plant: what is
    behind the board. electronics: its converters and scales, those of the robot where it is None."""

    def __init__(self, plant: Any = None, electronics: Electronics | None = None, **parameters: Any) -> None:
        values = UNSHAPED | {name.replace("__", "."): value for name, value in parameters.items()}
        self.settings = SfjDriverSettings.from_parameters(values)
        self.clock = VirtualClock()
        self.plant = StillRobot() if plant is None else plant
        self.hil = EmulatedHil(self.plant, self.settings.board, self.clock, electronics=electronics)
        self.reporter, self.latch = Reporter.to_latch(all_faults())
        self.driver = SfjDriver(self.settings, self.board(), self.reporter)
        self.driver.open()

    def board(self, hil: Any = None) -> Board:
        """A new one around `hil`, or around the rig's."""
        return Board(self.settings.board, lambda: hil or self.hil, clock=self.clock)

    def current(self) -> tuple[float, float]:
        """A, that flow in the motors after one more sample without touching the board's outputs."""
        self.driver.read()
        return float(self.hil.current[0]), float(self.hil.current[1])


class OmniRig(Rig):
    """As SfjRig, for `omni_driver`; calibrated at the first report unless the parameters say otherwise."""

    def __init__(
        self, plant: Any = None, layout: str = "emulator", docked: float = 0.0, **parameters: Any
    ) -> None:
        values = {"calibration.method": "start", "torque.ramp_time": 0.0}
        values |= {name.replace("__", "."): value for name, value in parameters.items()}
        self.settings = OmniDriverSettings.from_parameters(values)
        self.clock = VirtualClock()
        self.plant = StillOmni() if plant is None else plant
        self.layout = load_layout(layout)
        self.device = EmulatedOmni(self.plant, self.layout, self.clock, self.settings.rate, docked)
        self.reporter, self.latch = Reporter.to_latch(ALL_FAULTS)
        self.driver = OmniDriver(self.settings, self.layout, self.device, self.reporter)
        self.driver.open()


class EmulatedPair:
    """Both drivers on emulated devices, each with a virtual clock; open.

    sfj, omni: their parameters; `device: emulated` and UNSHAPED unless they say otherwise.
    """

    def __init__(self, sfj: Mapping[str, Any], omni: Mapping[str, Any]) -> None:
        sfj_reporter, self.sfj_latch = Reporter.to_latch(all_faults())
        omni_reporter, self.omni_latch = Reporter.to_latch(ALL_FAULTS)
        emulated = {"device": "emulated"}
        self.sfj = make_sfj_driver({**emulated, **UNSHAPED, **sfj}, sfj_reporter, clock=VirtualClock())
        self.omni = make_omni_driver({**emulated, **omni}, omni_reporter, clock=VirtualClock())
        self.sfj.open()
        self.omni.open()

    @property
    def faults(self) -> list[str]:
        """Sentences of what latched, in either driver."""
        return [latch.sentence for latch in (self.sfj_latch, self.omni_latch) if latch.latched]
