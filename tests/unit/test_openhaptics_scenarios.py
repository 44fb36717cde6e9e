"""Both scenarios from start to end with the Omni behind the HD library, by real ctypes, sample by sample.

The simulated Omni in its operator's hand moves the emulated library's device. A torque acts one period later
than through the emulated reports, because the servo thread takes it at its next turn.
"""

from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

import device_rigs
import numpy as np
import pytest
import test_emulated_scenario as scenario1
import test_emulated_scenario2 as scenario2
from openhaptics_rig import NEUTRAL, Emulation, HdRig

from haptic_teleop_2dsfj.settings import TABLE as SFJ_TABLE
from haptic_teleop_control.device import ReadResult
from haptic_teleop_control.node_tables import FORCE_CONTROLLER, SIGNAL_GENERATOR
from haptic_teleop_omni.settings import TABLE as OMNI_TABLE
from haptic_teleop_sim.emulation import omni_plant

COUNT, DOCKED = 4.1e-4, 500  # rad; samples for which the stylus rests in its inkwell
OWN = ("device", "transport", "openhaptics.library", "confirmations", "calibration.", "emulated.")


class OnTheLibrary:
    """What the scenarios use of a driver, with the plant moved before each state that is read."""

    def __init__(self, em: Emulation, folder: Any, values: Mapping[str, Any]) -> None:
        self.em, self.plant = em, omni_plant(values["emulated.file"], 1000.0)
        own = {k.replace(".", "__"): v for k, v in values.items() if not k.startswith(OWN)}
        em.place(self.plant.sense() + NEUTRAL)
        self.rig = HdRig(em, folder, **own)
        self.driver, self.reads = self.rig.driver, 0
        self.known = values.get("calibration.method") == "start"
        self.reporter, self.latch = self.rig.reporter, self.rig.latch
        self.position, self.velocity, self.effort = (
            self.driver.position, self.driver.velocity, self.driver.effort
        )  # fmt: skip
        self.write, self.close = self.driver.write, self.driver.close

    @property
    def transport(self) -> Any:
        return SimpleNamespace(torque=self.em.torque())

    def open(self) -> None:
        while self.known and not self.driver.calibration.done:
            self.em.c.em_tick()
            self.driver.read()

    def read(self) -> ReadResult:
        self.reads += 1
        if self.reads == DOCKED:
            self.em.c.em_inkwell(0, 0)
        if self.known or self.reads > DOCKED:
            self.plant.advance(self.em.torque())
        self.em.place(self.plant.sense() + NEUTRAL)
        self.em.c.em_tick()
        return self.driver.read()


@pytest.fixture
def on_the_library(em, tmp_path, monkeypatch):
    made: list[OnTheLibrary] = []

    def make(values: Mapping[str, Any], reporter: Any, clock: Any = None) -> OnTheLibrary:
        made.append(OnTheLibrary(em, tmp_path, values))
        return made[-1]

    monkeypatch.setattr(scenario1, "make_omni_driver", make)
    monkeypatch.setattr(device_rigs, "make_omni_driver", make)
    yield made
    for driver in made:
        driver.close()
    assert em.off()


def test_scenario_1_presses_and_lets_go_as_through_the_emulated_reports(on_the_library, em):
    """The file for the robots, with the pattern's 10 s in contact cut to 8; asked for are 0.6 and 0.4 N·m
    (docs/drivers.md)."""
    file = scenario1.FILE.with_name("scenario1_real.yaml")
    stated = {
        table.node_name: scenario2.section(file, table) for table in (FORCE_CONTROLLER, SIGNAL_GENERATOR)
    }
    for stage, end in (("stage1", 9.0), ("stage2", 8.7)):
        stated["signal_generator"][f"{stage}.steps.times"] = [0.0, 8.0, end]
    run = scenario1.through_the_drivers(None, 11.0, stated)
    (driver,) = on_the_library
    assert driver.latch.latched is None
    assert driver.driver.counter.lost == 0
    contact = slice(int(8.0 * 500), int(8.9 * 500))
    for arm, asked in ((1, 0.6), (3, 0.4)):
        assert run["effort"][contact, arm].mean() == pytest.approx(asked, abs=0.002)
        assert run["position"][-1, arm] < 0.9, "it lets go of the wall"
    # What the horizontal Omni is told against its own spring (thesis 2.3.2) holds Y where it was.
    assert np.abs(run["omni"][:, 1]).max() < 2 * COUNT
    assert run["torque"][-1, 1] == pytest.approx(-0.1173 * np.deg2rad(90.0 - 52.0), abs=1e-4)


def test_scenario_2_touches_and_presses_as_the_simulated_omni(on_the_library, em):
    """Docked, calibrated by the library, coupled by the operator at 0.8 s, to the end of the contact."""
    file, sim = scenario2.REAL, scenario2.SIM
    sfj, omni = (
        {**scenario2.section(file, table), "emulated.file": str(sim)} for table in (SFJ_TABLE, OMNI_TABLE)
    )
    run = scenario2.through_the_drivers(file, sfj, omni, 5.5, engage=0.8, start=0.8)
    (driver,) = on_the_library
    assert driver.latch.latched is None
    assert not run["omni asked"][:800].any()
    free = slice(2200, 2500)
    assert scenario2.free_speed(run, free) == pytest.approx(scenario2.DESIRED / 0.2, rel=0.04)
    held = slice(4700, 5500)
    assert run["omni asked"][held, 1:] == pytest.approx(scenario2.DESIRED, abs=5e-4)
    surface = scenario2.SURFACE + scenario2.DESIRED / scenario2.STIFFNESS
    assert run["omni angle"][held, 1:].mean(axis=0) == pytest.approx(surface, abs=COUNT)
    # What the library's device was told is what the driver says it was, to the unit of the report.
    told = [np.frombuffer(data[:12], "<i4") * 1e-6 for way, data in driver.rig.packets if way == "write"]
    assert run["omni torque"][-1] == pytest.approx(told[-2], abs=1e-9)
    peak = np.abs(run["omni torque"]).max()
    assert 0.1 < peak < 0.2
