"""Scenario 1 through the drivers on emulated devices, sample by sample, against the simulated plants."""

from pathlib import Path

import numpy as np
import pytest
from board_wire import Wire
from device_rigs import UNSHAPED

from haptic_teleop_2dsfj.local_board import emulated_hil
from haptic_teleop_2dsfj.settings import TABLE as SFJ_TABLE
from haptic_teleop_control.clocks import VirtualClock
from haptic_teleop_control.device import ReadResult, Reporter
from haptic_teleop_control.laws import LAWS, MasterSide
from haptic_teleop_control.node_tables import AXES, FORCE_CONTROLLER, SIGNAL_GENERATOR
from haptic_teleop_control.parameter_files import load_parameter_file, parameters_for
from haptic_teleop_control.robots import STAGES
from haptic_teleop_control.signals import SignalGenerator
from haptic_teleop_omni.build import ALL_FAULTS
from haptic_teleop_omni.build import make_driver as make_omni_driver
from haptic_teleop_sim.emulation import sfj_plant
from haptic_teleop_sim.lockstep import run_scenario
from haptic_teleop_sim.scenario_parameters import load_scenario

pytestmark = pytest.mark.long  # whole scenarios, sample by sample

FILE = Path(__file__).parents[2] / "config" / "scenario1_sim.yaml"
DURATION = 18.0
TABLE_DEFAULTS = SFJ_TABLE.defaults()


class Slave:
    """The 2DSFJ's driver on its emulated board, with the plant of the simulated scenario behind it. remote:
    the board is a board server's."""

    def __init__(self, changes: dict, remote: bool = False) -> None:
        from haptic_teleop_2dsfj.board import Board
        from haptic_teleop_2dsfj.build import all_faults
        from haptic_teleop_2dsfj.driver import SfjDriver
        from haptic_teleop_2dsfj.settings import SfjDriverSettings

        values = SFJ_TABLE.check({"device": "emulated", "emulated.file": str(FILE), **UNSHAPED, **changes})
        settings = SfjDriverSettings.from_parameters(values)
        if remote:
            wire = Wire(sfj_plant(str(FILE), settings.board.rate), **_spelt(UNSHAPED | changes))
            self.hil, self.driver, self.latch = wire.hil, wire.driver, wire.latch
            self.driver.open()
            return
        clock = VirtualClock()
        self.hil = emulated_hil(values, settings.board, clock)
        reporter, self.latch = Reporter.to_latch(all_faults())
        self.driver = SfjDriver(settings, Board(settings.board, lambda: self.hil, clock=clock), reporter)
        self.driver.open()


def _spelt(parameters: dict) -> dict:
    return {name.replace(".", "__"): value for name, value in parameters.items()}


def through_the_drivers(
    changes: dict | None = None,
    duration: float = DURATION,
    stated: dict[str, dict] | None = None,
    remote: bool = False,
) -> dict[str, np.ndarray]:
    """stated: parameters of controller and signal generator, of the simulated scenario where it is None.

    Position, velocity, effort of the 2DSFJ (n, 4), its commands and the currents that flowed in the period
    before (n, 2), angles and torques of the Omni (m, 3)."""
    scenario = load_scenario(FILE)
    nodes = scenario.nodes if stated is None else stated
    control, signal = nodes["force_controller"], nodes["signal_generator"]
    generator = {k: v for k, v in signal.items() if k in ("kind", "rate") or k.split(".")[0] in STAGES}
    slave = Slave(changes or {}, remote)
    reporter, omni_latch = Reporter.to_latch(ALL_FAULTS)
    # What the simulated Omni does of its own, its driver does behind the emulated one.
    device = scenario.nodes["omni_sim"]
    compensation = {key: value for key, value in device.items() if key.startswith("compensation.")}
    master = make_omni_driver(
        {**compensation, "device": "emulated", "calibration.method": "start", "emulated.docked_time": 0.0,
         "torque.ramp_time": 0.0, "emulated.file": str(FILE)},
        reporter, clock=VirtualClock(),
    )  # fmt: skip
    master.open()
    law = LAWS["augmented_error"].from_parameters(control, STAGES, 0.002)
    wanted = MasterSide.from_parameters(control, AXES, 0.002)
    felt = MasterSide.from_parameters(control, AXES, 0.001)
    times = np.arange(round(duration * 500)) / 500
    reference = SignalGenerator.from_parameters(generator, STAGES).series(times)
    logs: dict[str, list] = {
        name: [] for name in ("position", "velocity", "effort", "command", "flow", "omni", "torque")
    }
    arm_torque, engaged = np.zeros(2), False
    for k, t in enumerate(times):
        for _ in range(2):  # the master's state is the older one where times coincide
            assert master.read() is ReadResult.STATE
            logs["omni"].append(master.position.copy())
            torque = np.zeros(3)
            if engaged:
                torque[1:] = felt.step(master.position[1:], arm_torque)[1] * min(1.0, t / 0.2)
            master.write(torque)
            logs["torque"].append(master.transport.torque.copy())
        assert slave.driver.read() is ReadResult.STATE
        engaged = True
        position, velocity, effort = slave.driver.position, slave.driver.velocity, slave.driver.effort
        arm_torque = effort[1::2].copy()
        desired, _ = wanted.step(reference[k], arm_torque)
        current = law.step(desired, position[0::2].copy(), position[1::2].copy(), velocity[0::2].copy())
        command = current * np.array([8.925, 1.392]) * min(1.0, t / 0.2)
        for name, values in (
            ("position", position),
            ("velocity", velocity),
            ("effort", effort),
            ("command", command),
            ("flow", slave.hil.current),
        ):
            logs[name].append(values.copy())
        slave.driver.write(command)
    assert slave.latch.latched is None, slave.latch.sentence
    assert omni_latch.latched is None, omni_latch.sentence
    return {name: np.array(values) for name, values in logs.items()}


@pytest.fixture(scope="module")
def simulated() -> dict:
    sections = load_parameter_file(FILE)
    return run_scenario({name: dict(parameters_for(sections, name)) for name in (
        "sfj_sim", "omni_sim", "force_controller", "signal_generator")}, DURATION)  # fmt: skip


@pytest.fixture(scope="module")
def emulated() -> dict:
    return through_the_drivers()


def test_the_2dsfj_moves_as_the_simulated_one_does(simulated, emulated):
    states = simulated["/sfj/joint_states"]
    apart = np.abs(emulated["position"] - states.position)
    difference = apart.max(axis=0)
    # The converters and counters of the board are those of the simulated plant: stage 1 moves just as there.
    assert difference[:2].max() < 1e-12
    # Stage 2 is at its limit of 1.2 A for a moment, which lies between two steps of the output: the board
    # gives the lower one, the simulated amplifier the limit itself.
    assert apart[: 14 * 500, 2:].max() < 3 * 2.462e-4
    # When it comes off the wall, friction that sticks keeps a trace of that half step.
    assert difference[2:].max() < 10 * 2.462e-4
    assert np.abs(emulated["velocity"] - states.velocity).max() < 0.06


def test_the_figures_of_contact_are_the_same_within_the_quantisation(simulated, emulated):
    states = simulated["/sfj/joint_states"]
    contact = slice(int(12.0 * 500), int(13.9 * 500))
    for arm, asked, stiffness in ((1, 0.6, 3.971), (3, 0.8, 3.891)):
        step = stiffness * 2.462e-4  # torque of one count of the joint's encoder
        pressed = emulated["effort"][contact, arm].mean()
        assert pressed == pytest.approx(states.effort[contact, arm].mean(), abs=step)
        assert pressed == pytest.approx(asked, abs=2 * step)
        peaks = emulated["effort"][:, arm].max(), states.effort[:, arm].max()
        assert peaks[0] == pytest.approx(peaks[1], abs=5 * step)


def test_the_limits_are_the_same_within_a_step_of_the_output(simulated, emulated):
    step = 20.0 / 4096 * 0.5  # A
    for motor, (limit, constant) in enumerate(((0.94, 8.925), (1.2, 1.392))):
        asked = np.abs(simulated["/sfj/effort_command"].effort[:, motor]).max()
        assert asked == pytest.approx(limit * constant, rel=1e-9), "the simulated one reaches its limit"
        assert limit - step < np.abs(emulated["flow"][:, motor]).max() <= limit


def test_what_flows_is_what_was_asked_for_one_period_later_and_never_more(emulated):
    asked = emulated["command"][:-1] / np.array([8.925, 1.392])
    flowed = emulated["flow"][1:]
    half_a_step = 20.0 / 4096 * 0.5 / 2
    at_the_limit = np.abs(asked) > np.array([0.94, 1.2]) - half_a_step
    assert np.abs(flowed - asked)[~at_the_limit].max() <= half_a_step + 1e-9
    assert np.all(np.abs(flowed) <= np.array([0.94, 1.2]))
    assert np.abs(emulated["torque"]).max() <= 0.446


def test_the_omni_moves_as_the_simulated_one_does_within_its_torque_steps(simulated, emulated):
    states = simulated["/omni/joint_states"]
    assert np.abs(emulated["omni"] - states.position).max() < 5e-3


def test_over_a_board_server_not_one_sample_is_another(emulated):
    run = through_the_drivers(duration=12.4, remote=True)
    for name, values in run.items():
        assert np.array_equal(values, emulated[name][: len(values)]), name
    assert run["effort"][-1, 1] == pytest.approx(0.6, abs=0.01), "it presses"


def test_the_file_for_the_robots_presses_as_it_asks_within_the_recommended_current():
    """With its own limits, slew and ramp; the thesis' 0.8 N·m of stage 2 is more than 0.5 A can do."""
    file = FILE.with_name("scenario1_real.yaml")
    sections = load_parameter_file(file)
    stated = {}
    for table in (FORCE_CONTROLLER, SIGNAL_GENERATOR):
        own = parameters_for(sections, table.node_name)
        stated[table.node_name] = table.check({key: value for key, value in own.items() if key in table})
    own = {k: v for k, v in parameters_for(sections, "sfj_driver").items() if "current" in k}
    shaped = {key: TABLE_DEFAULTS[key] for key in UNSHAPED}
    run = through_the_drivers({**shaped, **own}, 14.0, stated)
    assert np.abs(run["flow"]).max() <= 0.5
    contact = slice(int(9.0 * 500), int(10.9 * 500))
    for arm, asked in ((1, 0.6), (3, 0.4)):
        assert run["effort"][contact, arm].mean() == pytest.approx(asked, abs=0.002)
        assert run["effort"][:, arm].max() < 1.15 * asked
        assert run["position"][-1, arm] < 0.9, "it lets go of the wall"
    # Nothing of it is what a limit makes of it: the currents that it needs are below.
    assert np.abs(run["flow"][contact]).max() < 0.3


def test_the_ramp_and_the_slew_limit_as_shipped_do_not_change_the_contact(emulated):
    shaped = {key: TABLE_DEFAULTS[key] for key in UNSHAPED if "limit" not in key}
    run = through_the_drivers(shaped, 14.0)
    contact = slice(int(12.0 * 500), int(13.9 * 500))
    for arm, stiffness in ((1, 3.971), (3, 3.891)):
        count = stiffness * 2.462e-4  # N·m
        pressed, before = (r["effort"][contact, arm].mean() for r in (run, emulated))
        assert pressed == pytest.approx(before, abs=count)
        assert run["effort"][:, arm].max() == pytest.approx(emulated["effort"][:, arm].max(), abs=count)
        touch, touched = (np.argmax(r["position"][:, arm] >= 1.0) / 500 for r in (run, emulated))
        assert touched < touch < touched + 0.011


def test_the_drift_correction_shifts_the_current_and_the_force_loop_takes_it_up_again(emulated):
    shifted = through_the_drivers({"stage1.drift_correction": 0.05}, 13.0)
    moving, contact = slice(int(5.0 * 500), int(5.2 * 500)), slice(int(12.0 * 500), int(12.9 * 500))
    assert shifted["effort"][contact, 1].mean() == pytest.approx(0.6, abs=0.003)
    # What the law asks for is less by just the current that the driver adds.
    for part in (moving, contact):
        less = emulated["command"][part, 0].mean() - shifted["command"][part, 0].mean()
        assert less / 8.925 == pytest.approx(0.05, abs=0.0012)
        assert shifted["flow"][part, 0].mean() == pytest.approx(emulated["flow"][part, 0].mean(), abs=0.0012)


def test_an_uncorrected_bias_of_the_drive_drifts_and_the_correction_stops_it():
    def drift(correction: float) -> float:
        plant_bias = 1.1  # N·m on stage 1's motor, just above its Coulomb friction of 0.6 N·m
        slave = Slave({"stage1.drift_correction": correction})
        robot = slave.hil._plant.robot
        advance = robot.step
        robot.step = lambda effort: advance(np.asarray(effort) + np.array([plant_bias, 0.0]))
        for _ in range(1500):
            slave.driver.read()
            slave.driver.write(np.zeros(2))
        return float(slave.driver.position[0])

    assert drift(0.0) > 0.1
    assert abs(drift(-1.1 / 8.925)) < 1e-3
