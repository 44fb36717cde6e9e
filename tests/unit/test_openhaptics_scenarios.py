"""Both scenarios from start to end with the Omni behind the HD library, by real ctypes, sample by sample.

The files for the robots as they stand: the stylus rests in its inkwell, the library calibrates, the operator
couples and starts, the whole pattern runs and the rest after it, the operator uncouples, the drivers end. The
simulated Omni moves the emulated library's device. A torque acts one period later than through the emulated
reports, because the servo thread takes it at its next turn. Time is the library's own, stepped.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from device_rigs import COUNT, section
from openhaptics_rig import Emulation, HdRig

from haptic_teleop_2dsfj.board import Board
from haptic_teleop_2dsfj.build import all_faults
from haptic_teleop_2dsfj.driver import SfjDriver
from haptic_teleop_2dsfj.local_board import emulated_hil
from haptic_teleop_2dsfj.settings import TABLE as SFJ_TABLE
from haptic_teleop_2dsfj.settings import SfjDriverSettings
from haptic_teleop_control.clocks import VirtualClock
from haptic_teleop_control.device import ReadResult, Reporter
from haptic_teleop_control.laws import LAWS
from haptic_teleop_control.node_tables import FORCE_CONTROLLER, SIGNAL_GENERATOR
from haptic_teleop_control.robots import STAGES
from haptic_teleop_control.signals import SignalGenerator
from haptic_teleop_control.teleoperation.coupling import Coupling
from haptic_teleop_control.teleoperation.machine import State
from haptic_teleop_omni.settings import TABLE as OMNI_TABLE
from haptic_teleop_sim.emulation import omni_plant
from haptic_teleop_sim.scenario_parameters import load_scenario

CONFIG = Path(__file__).parents[2] / "config"
DOCKED, START, UNCOUPLED = 500, 800, 500
"""ms in the inkwell; after which the operator couples and starts; from the uncoupling to the end."""
OWN = ("device", "transport", "openhaptics.library", "confirmations", "calibration.", "emulated.")


class WholeRun:
    """`scenarioN_real.yaml` with the robots of `scenarioN_sim.yaml`, which also says how long it rests after
    the pattern.

    logs: angle, speed, torque, what was asked and what flows in the motors (A, N·m), of sfj at 500 Hz and
    omni at 1 kHz. over: ms at which the operator uncouples.
    """

    def __init__(self, em: Emulation, folder: Path, scenario: int) -> None:
        self.em = em
        self.file, sim = (CONFIG / f"scenario{scenario}_{kind}.yaml" for kind in ("real", "sim"))
        self.control = section(self.file, FORCE_CONTROLLER)
        signal, simulated = section(self.file, SIGNAL_GENERATOR), section(sim, SIGNAL_GENERATOR)
        later = simulated["stage1.delay"] - signal["stage1.delay"]
        self.over = START + round(1e3 * (load_scenario(sim).duration - later))
        own = {k: v for k, v in signal.items() if k in ("kind", "rate") or k.split(".")[0] in STAGES}
        self.signal = SignalGenerator.from_parameters(own, STAGES)
        self.faults: list[str] = []
        self.logs: dict[str, Any] = {}
        self._sfj(sim)
        self._omni(sim, folder)

    def _sfj(self, sim: Path) -> None:
        values = SFJ_TABLE.check({**section(self.file, SFJ_TABLE), "emulated.file": str(sim)})
        settings, clock = SfjDriverSettings.from_parameters(values), VirtualClock()
        self.hil = emulated_hil(values, settings.board, clock)
        reporter, self.sfj_latch = Reporter.to_latch(all_faults())
        self.sfj = SfjDriver(settings, Board(settings.board, lambda: self.hil, clock=clock), reporter)
        self.sfj.open()

    def _omni(self, sim: Path, folder: Path) -> None:
        values = {k: v for k, v in section(self.file, OMNI_TABLE).items() if not k.startswith(OWN)}
        plant = omni_plant(str(sim), 1000.0)
        self.rig = HdRig(self.em, folder, plant=plant, **{k.replace(".", "__"): v for k, v in values.items()})
        self.omni = self.rig.driver

    def run(self) -> None:
        values = self.control
        law = LAWS[values["law"]].from_parameters(values, STAGES, 0.002) if values["slave"] == "sfj" else None
        coupling = Coupling(values, law, lambda name, detail: self.faults.append(f"{name}: {detail}"))
        master_first = ("omni", "sfj") if values["master"] == "omni" else ("sfj", "omni")
        reference = self.signal.series(np.arange((self.over - START) // 2 + 1) / 500)
        for k in range(self.over + UNCOUPLED):
            now = 1_000_000_000 + 1_000_000 * k
            if k == DOCKED:
                self.em.c.em_inkwell(0, 0)
            if k % 2 == 0:
                begun = (k - START) // 2
                coupling.reference = reference[begun] if 0 <= begun < len(reference) else np.zeros(2)
                coupling.on_reference(now)
            for robot in master_first:
                if robot == "omni":
                    (self.em.c.em_tick if k < DOCKED else self.rig.tick)()
                if robot == "omni" or k % 2 == 0:
                    self._sample(robot, coupling, now)
            if k == START:
                assert coupling.engage(now) is None
            if k == self.over:
                assert coupling.state is State.ENGAGED
                assert coupling.disengage(now)

    def _sample(self, robot: str, coupling: Coupling, now: int) -> None:
        driver = self.sfj if robot == "sfj" else self.omni
        answer, known = None, driver.read() is ReadResult.STATE
        if known:
            state = (driver.position, driver.velocity, driver.effort)
            if self.control["master"] == robot:
                coupling.master = state
                answer = coupling.on_master(now)
            else:
                coupling.slave = state
                answer = coupling.on_slave(now)
        asked = np.zeros(2 if robot == "sfj" else 3) if answer is None else answer
        flows = self.hil.current if robot == "sfj" else self.em.torque()
        names = ("angle", "speed", "torque", "asked", "flows")
        values = (driver.position, driver.velocity, driver.effort, asked, flows)
        for name, value in zip(names, values, strict=True):
            self.logs.setdefault(f"{robot} {name}", []).append(value.copy())
        driver.write(answer)

    def close(self) -> None:
        self.omni.close()
        self.sfj.close()


@pytest.fixture
def whole(em, tmp_path) -> Iterator[Any]:
    """Runs a scenario to the end of its drivers; what flows afterwards is nothing, in either robot."""
    made: list[WholeRun] = []

    def play(scenario: int) -> WholeRun:
        made.append(WholeRun(em, tmp_path, scenario))
        made[0].run()
        made[0].logs = {name: np.array(values) for name, values in made[0].logs.items()}
        assert em.c.em_force(0), "its own spring is compensated to the end"
        made[0].close()
        assert em.off()
        assert (em.c.em_scheduled(), em.c.em_running(), em.c.em_is_open(0)) == (0, 0, 0)
        assert not np.any(made[0].hil.volts)
        assert made[0].hil.amplifier_on == (False, False)
        return made[0]

    yield play
    for run in made:
        run.close()


def without_a_fault(run: WholeRun) -> None:
    assert run.faults == []
    assert (run.sfj_latch.latched, run.rig.latch.latched) == (None, None)
    assert run.omni.counter.lost == 0


def moves_freely_presses_and_lets_go(
    angle: np.ndarray, torque: np.ndarray, rate: float, surface: float, deep: float, law: tuple[float, float]
) -> None:
    """angle, torque: of one joint at `rate`. law: desired torque, N·m, and lambda (thesis, equation 24)."""
    desired, lambda_ = law
    ms = rate / 1000.0
    touched = int(np.argmax(angle >= surface))
    assert touched > (START + 1000) * ms, "the pattern begins after its delay"
    before = angle[int(touched - 60 * ms)], angle[int(touched - 20 * ms)]
    assert (before[1] - before[0]) / 0.04 == pytest.approx(desired / lambda_, rel=0.15)
    assert surface < angle.max() < surface + deep
    contact = slice(int((START + 9000) * ms), int((START + 10900) * ms))
    assert torque[contact].mean() == pytest.approx(desired, abs=0.005 * desired + 5e-4)
    assert angle[contact].min() > surface - 1e-3, "it stays there"
    rest = angle[-int(1000 * ms) :]
    assert rest.max() < surface - 0.05, "it lets go"
    assert np.ptp(rest) < 2e-3, "and rests"


@pytest.mark.long
def test_scenario_1_from_the_inkwell_to_the_end_of_the_drivers(whole):
    run = whole(1)
    without_a_fault(run)
    logs = run.logs
    assert len(logs["sfj angle"]) == (run.over + UNCOUPLED) / 2 == 9150
    for arm, desired in ((1, 10.0 * 0.06), (3, 10.0 * 0.04)):
        values = (logs["sfj angle"][:, arm], logs["sfj torque"][:, arm], 500.0)
        moves_freely_presses_and_lets_go(*values, 1.0, 0.01, (desired, 0.5))
    assert np.abs(logs["sfj flows"]).max() <= 0.5
    assert not logs["sfj asked"][: START // 2].any()
    # What the horizontal Omni is told against its own spring (thesis 2.3.2) holds Y where it was.
    assert np.abs(logs["omni angle"][:, 1]).max() < 2 * COUNT
    spring = -0.1173 * np.deg2rad(90.0 - 52.0)
    assert logs["omni flows"][-1] == pytest.approx([0.0, spring, 0.0], abs=2e-4)
    assert not logs["sfj asked"][-1].any(), "uncoupled"


@pytest.mark.long
def test_scenario_2_from_the_inkwell_to_the_end_of_the_drivers(whole):
    run = whole(2)
    without_a_fault(run)
    logs = run.logs
    assert len(logs["omni angle"]) == run.over + UNCOUPLED == 18300
    desired = 0.2 * (0.52 - 0.02)
    for axis in (1, 2):
        values = (logs["omni angle"][:, axis], logs["omni asked"][:, axis], 1000.0)
        moves_freely_presses_and_lets_go(*values, 0.4, 0.005, (desired, 0.2))
    assert not logs["omni asked"][:START].any()
    assert not logs["sfj angle"].any(), "nobody moves the master in reference mode"
    # At the surface the hand's torque acts beside what compensates the device's own spring.
    contact = slice(START + 9000, START + 10900)
    beside = (logs["omni flows"] - logs["omni asked"])[contact, 1:].mean(axis=0)
    spring = 0.1173 * (0.4 + desired / 200.0 - np.deg2rad(90.0 - 52.0))
    assert beside == pytest.approx([spring, 0.0], abs=5e-4)
    # What the library's device was told is what the driver says it was, to the unit of the report.
    told = [np.frombuffer(data[:12], "<i4") * 1e-6 for way, data in run.rig.packets if way == "write"]
    assert logs["omni torque"][-1] == pytest.approx(told[-2], abs=1e-9)
    assert 0.1 < np.abs(logs["omni flows"]).max() < 0.2
    assert not logs["omni asked"][-1].any(), "uncoupled"
