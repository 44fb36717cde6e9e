"""The loop of a scenario, in Python over compiled steps, and compiled as a whole for the thesis' case.

Both give the same numbers, bit by bit. The compiled one serves the plain case: the Omni as master, the
thesis' law, no link, no passivity controller, aligned from the first sample on.
"""

from __future__ import annotations

import heapq
from collections import Counter
from collections.abc import Mapping
from dataclasses import astuple, dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_control.laws import AugmentedErrorLaw, ForceLaw, LawResult, MasterSide
from haptic_teleop_control.quantities import from_parameters
from haptic_teleop_control.recording import JointStateSeries
from haptic_teleop_control.robots import OMNI_PEAK_TORQUE, STAGES
from haptic_teleop_control.simulated_time.stamps import ORIGIN
from haptic_teleop_control.teleoperation.coupling import Coupling
from haptic_teleop_control.teleoperation.link_model import LinkChannel, LinkSettings
from haptic_teleop_control.teleoperation.machine import State
from haptic_teleop_control.teleoperation.sides import AXES, AXIS_SLICE

from .experiments import SteppedRobot
from .hardware import OmniRobot, SfjRobot, StepResult
from .kernel import stepping
from .stamps import stamps

Array = NDArray[np.float64]
MASTER, SLAVE = 0, 1
_ROW = {"sfj": 0, "omni": 3}
_SATURATED = 6


@dataclass(frozen=True)
class ScenarioResult:
    """topics: topic -> series, as a recording of the graph would hold them. counts: what happened, by name,
    in samples of the robot concerned, and faults; only what did happen. states: (time s, state) of the
    teleoperation, as they were entered. energies: (2,) J of both stages, since the coupling: "master",
    "slave", "lowest master", and with a link "link" and "lowest link" (see `teleoperation.passivity`).
    obstacle: why master and slave were not coupled at the end, in words; empty when they were.
    """

    topics: dict[str, JointStateSeries]
    counts: dict[str, int]
    states: tuple[tuple[float, str], ...] = ()
    energies: Mapping[str, Array] = field(default_factory=dict)
    obstacle: str = ""


@dataclass(frozen=True)
class Outputs:
    """Of one robot: states (n, 3, joints), the commands that answer them (n, motors)."""

    states: Array
    commands: Array


@dataclass(frozen=True)
class Prepared:
    """Everything before the first sample. kinds, stamps, latest: of every sample of either robot in order of
    time: MASTER or SLAVE, ns, and the row of `reference` (n, 2) that is the newest then."""

    robots: Mapping[str, SteppedRobot]
    control: Mapping[str, Any]
    link: Mapping[str, Any]
    law: ForceLaw | None
    may_compile: bool
    times: Mapping[str, Array]
    kinds: NDArray[np.int64]
    stamps: NDArray[np.int64]
    reference_times: Array
    reference: Array
    published: Array
    latest: NDArray[np.int64]
    joints: tuple[str, ...]


@dataclass
class Loop:
    """What a loop leaves behind beside the outputs. counts: (7,), the codes of the steps of the 2DSFJ and of
    the Omni, and saturated samples of the slave's law."""

    counts: NDArray[np.int64] = field(default_factory=lambda: np.zeros(7, dtype=np.int64))
    faults: Counter[str] = field(default_factory=Counter)
    states: list[tuple[float, str]] = field(default_factory=list)
    channels: dict[str, JointStateSeries] = field(default_factory=dict)
    energies: dict[str, Array] = field(default_factory=dict)
    obstacle: str = ""


def run_loop(run: Prepared, outputs: Mapping[str, Outputs]) -> Loop:
    """Run the scenario; fills `outputs` ("sfj", "omni") and returns what happened besides.

    Compiled as a whole where the case is plain, else in Python; the numbers are equal, bit by bit.
    """
    return compiled_loop(run, outputs) if _plain(run) else python_loop(run, outputs)


def _plain(run: Prepared) -> bool:
    """Whether `compiled_loop` serves the case: see the module."""
    control = run.control
    if not (run.may_compile and type(run.law) is AugmentedErrorLaw and control["auto_engage"]):
        return False
    if control["master"] != "omni" or control["link"] or control["passivity.controller"]:
        return False
    periods = [1.0 / control["master_rate"], 1.0 / control["slave_rate"], *np.diff(run.reference_times[:2])]
    begin = run.reference[0]
    if control["command_source"] == "device":
        omni = run.robots["omni"]
        assert isinstance(omni, OmniRobot)
        begin = np.array([joint.initial_angle for joint in omni.joints])[AXIS_SLICE]
    neutral = np.array([control[f"{axis}.neutral"] for axis in AXES])
    aligned = bool(np.all(np.abs(begin - neutral) <= control["align.angle"] - 1e-3))
    return aligned and max(periods) < control["timeout"]


def compiled_loop(run: Prepared, outputs: Mapping[str, Outputs]) -> Loop:
    """Run a plain case in one compiled call; fills `outputs`.

    Returns the counts and the states, entered at once at the first sample of the slave; no faults, energies
    or link. Only where `run_loop` would choose it: it checks nothing.
    """
    law, control = run.law, run.control
    slave, master = run.robots["sfj"], run.robots["omni"]
    assert isinstance(law, AugmentedErrorLaw)
    assert isinstance(slave, SfjRobot) and isinstance(master, OmniRobot)
    loop = Loop()
    compensation = master.compensation
    compensating = (
        (False, np.zeros(9), np.zeros(2), master.dt)
        if compensation is None
        else (True, compensation.numbers, compensation.state, master.dt)
    )
    wanted = MasterSide.from_parameters(control, AXES, 1.0 / control["slave_rate"])
    felt = MasterSide.from_parameters(control, AXES, 1.0 / control["master_rate"])
    slave_out, master_out = outputs["sfj"], outputs["omni"]
    stepping().scenario_loop(
        run.kinds, run.stamps, run.reference, run.latest, control["command_source"] == "device",
        slave.bank, slave.device, slave.take_noise(len(run.times["sfj"])),
        slave.operator.torques(run.times["sfj"]), master.bank, master.device,
        master.take_noise(len(run.times["omni"])), master.operator.torques(run.times["omni"]), compensating,
        wanted._matrix, wanted.state, felt._matrix, felt.state,
        np.array([astuple(gain) for gain in law.gains]), law.state, law.dt, control["ramp_time"],
        OMNI_PEAK_TORQUE, slave_out.states, slave_out.commands, master_out.states, master_out.commands,
        loop.counts,
    )  # fmt: skip
    first = run.stamps[int(np.argmax(run.kinds == SLAVE))]
    for state in (State.DEVICES_READY, State.ALIGNING, State.ENGAGED):
        loop.states.append(((int(first) - ORIGIN) * 1e-9, state.value))
    return loop


class _Way:
    """One direction of the link, and what was sent into it: velocity and effort of both stages."""

    def __init__(self, settings: LinkSettings, number: int, samples: int) -> None:
        self.channel = LinkChannel(settings, number)
        self.number = number
        self.sent = np.zeros((samples, 2, 2))
        self.sent_at = np.zeros(samples, dtype=np.int64)
        self.count = 0
        self.newest = 0


def python_loop(run: Prepared, outputs: Mapping[str, Outputs]) -> Loop:
    """Run any case sample by sample with the `Coupling` that the node has; fills `outputs`.

    Returns all of `Loop`; `channels` holds what was sent into the link, by topic, where there is one.
    """
    loop = Loop()
    roles = (run.control["master"], run.control["slave"])
    now = int(run.stamps[0])

    def report(name: str, detail: str) -> None:
        loop.faults[name] += 1

    def entered(state: State) -> None:
        loop.states.append(((now - ORIGIN) * 1e-9, state.value))

    coupling = Coupling(run.control, run.law, report, entered)
    settings = from_parameters(LinkSettings, run.link)
    ways = [_Way(settings, kind, len(run.times[role])) for kind, role in enumerate(roles)]
    under_way: list[tuple[int, int, int]] = []  # arrival ns, way, number of its message
    robots, samples = [run.robots[role] for role in roles], [0, 0]
    outs, rows = [outputs[role] for role in roles], [_ROW[role] for role in roles]
    reference_stamps = stamps(run.reference_times).tolist()
    last = -1
    for kind, now, latest in zip(run.kinds.tolist(), run.stamps.tolist(), run.latest.tolist(), strict=True):
        while under_way and under_way[0][0] <= now:
            arrival, number, message = heapq.heappop(under_way)
            _deliver(coupling, ways[number], message, arrival)
        if latest != last:
            coupling.reference = run.reference[latest]
            coupling.on_reference(reference_stamps[latest])
            last = latest
        robot, out, k = robots[kind], outs[kind], samples[kind]
        state = out.states[k]
        for row, signal in enumerate(robot.sense()):
            state[row] = signal
        views = (state[0], state[1], state[2])
        if kind == MASTER:
            coupling.master = views
            out.commands[k] = coupling.on_master(now)
        else:
            coupling.slave = views
            out.commands[k] = coupling.on_slave(now)
        if coupling.linked:
            way = ways[kind]
            torque, velocity = coupling.to_slave if kind == MASTER else coupling.to_master
            way.sent[k, 0], way.sent[k, 1], way.sent_at[k] = velocity, torque, now
            for arrival in way.channel.transmit((now - ORIGIN) * 1e-9):
                heapq.heappush(under_way, (ORIGIN + round(arrival * 1e9), kind, k))
        _count(loop.counts[rows[kind] : rows[kind] + 3], robot.step(out.commands[k]))
        samples[kind] += 1
    loop.counts[_SATURATED] = coupling.saturations
    if coupling.state is not State.ENGAGED:
        why = "" if coupling.state is State.FAULT else coupling.obstacle(now)
        loop.obstacle = f"{coupling.state.value}: {why}" if why else coupling.state.value
    counted = coupling.energies
    loop.energies = {"master": counted.master, "slave": counted.slave, "lowest master": counted.lowest_master}
    if coupling.linked:
        loop.energies |= {"link": counted.link, "lowest link": counted.lowest_link}
        for way, name in zip(ways, ("master", "slave"), strict=True):
            loop.channels[f"/teleoperation/{name}"] = JointStateSeries(
                way.sent_at, way.sent_at.copy(), STAGES, None, way.sent[:, 0].copy(), way.sent[:, 1].copy()
            )
    return loop


def _deliver(coupling: Coupling, way: _Way, message: int, arrival: int) -> None:
    sent_at = int(way.sent_at[message])
    if sent_at <= way.newest:  # overtaken, or a second time
        return
    way.newest = sent_at
    first = 2 * way.number
    coupling.heard[first], coupling.heard[first + 1] = way.sent[message, 1], way.sent[message, 0]
    (coupling.on_backward if way.number else coupling.on_forward)(arrival, (arrival - sent_at) * 1e-9)


def _count(counts: NDArray[np.int64], result: StepResult) -> None:
    for bit in range(3):
        counts[bit] += (result >> bit) & 1


assert LawResult.SATURATED == 1  # as the compiled loop has it
