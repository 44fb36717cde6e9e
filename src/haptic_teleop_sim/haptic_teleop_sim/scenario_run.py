"""Scenario 1 without ROS or clock: the nodes' plants, signals and laws, sample by sample in order of time.

What the graph does, this does: the master's state is answered with the torque of the spring and of the
feedback, the slave's with the law's current; the answer to a state acts until the next state of that robot.
Where samples coincide the reference comes first, then the master, then the slave. Nothing is ever late, lost
or out of order.

The whole loop is compiled for the thesis' law; another law runs in a loop in Python over the same compiled
steps. Both give the same numbers, bit by bit.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import astuple, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.laws import LAWS, AugmentedErrorLaw, ForceLaw, LawResult, MasterSide
from haptic_teleop_control.node_tables import AXES
from haptic_teleop_control.recording import JointStateSeries
from haptic_teleop_control.robots import OMNI_JOINTS, OMNI_PEAK_TORQUE, SFJ_JOINTS, SFJ_MOTOR_JOINTS, STAGES
from haptic_teleop_control.signals import SignalGenerator

from .experiments import SteppedRobot
from .hardware import OmniRobot, SfjRobot, StepResult
from .kernel import stepping
from .scenario_parameters import ScenarioParameters
from .stamps import sample_times, series, stamps

Array = NDArray[np.float64]
MASTER, SLAVE = 0, 1


@dataclass(frozen=True)
class ScenarioResult:
    """topics: topic -> series, as a recording of the graph would hold them. counts: what happened, by name,
    in samples of the robot concerned; only what did happen.
    """

    topics: dict[str, JointStateSeries]
    counts: dict[str, int]


@dataclass(frozen=True)
class _Prepared:
    """Everything before the first sample."""

    slave: SteppedRobot
    master: OmniRobot
    law: ForceLaw
    wanted: MasterSide
    felt: MasterSide
    times: tuple[Array, Array]
    kinds: NDArray[np.int64]
    event_times: Array
    reference_times: Array
    reference: Array
    commanded: Array
    device_commands: bool
    ramp_time: float
    joints: tuple[str, ...]


def simulate_scenario(
    parameters: ScenarioParameters,
    duration: float,
    seed: int | None = None,
    law: ForceLaw | None = None,
    slave: SteppedRobot | None = None,
) -> ScenarioResult:
    """Run a scenario for `duration` s, both robots from rest.

    seed: of both robots, instead of those in the parameters. law: one of your own for the two stages, instead
    of the one that `law` names; it is stepped at `slave_rate`. slave: a robot of your own in place of the one
    that `sfj_sim` describes, such as `MujocoRobot`, sampled at its rate. Raises ConfigurationError or
    ModelError for parameters that do not make a scenario.
    """
    run = _prepare(parameters, duration, seed, law, slave)
    outputs = (
        np.empty((len(run.times[SLAVE]), 3, 4)),
        np.empty((len(run.times[SLAVE]), 2)),
        np.empty((len(run.times[MASTER]), 3, 3)),
        np.zeros((len(run.times[MASTER]), 3)),
    )
    counts = np.zeros(7, dtype=np.int64)
    compiled = law is None and slave is None and type(run.law) is AugmentedErrorLaw
    loop = _compiled_loop if compiled else _python_loop
    loop(run, outputs, counts)
    slave_out, slave_command, master_out, master_command = outputs
    topics = {
        "/sfj/joint_states": series(run.times[SLAVE], SFJ_JOINTS, states=slave_out),
        "/sfj/effort_command": series(run.times[SLAVE], SFJ_MOTOR_JOINTS, effort=slave_command),
        "/omni/joint_states": series(run.times[MASTER], OMNI_JOINTS, states=master_out),
        "/omni/effort_command": series(run.times[MASTER], OMNI_JOINTS, effort=master_command),
        "/reference": series(run.reference_times, run.joints, **_field(parameters, run.reference)),
    }
    codes = [code.name.lower() for code in StepResult if code.name]
    names = [f"{robot} {name}" for robot in ("sfj", "omni") for name in codes] + ["law saturated"]
    return ScenarioResult(topics, {name: int(n) for name, n in zip(names, counts, strict=True) if n})


def _field(parameters: ScenarioParameters, reference: Array) -> dict[str, Array]:
    return {parameters.nodes["signal_generator"]["kind"]: reference}


def _prepare(
    parameters: ScenarioParameters,
    duration: float,
    seed: int | None,
    law: ForceLaw | None,
    slave: SteppedRobot | None,
) -> _Prepared:
    nodes, source = parameters.nodes, parameters.source
    control, signal = nodes["force_controller"], nodes["signal_generator"]
    if (control["master"], control["slave"]) != ("omni", "sfj"):
        raise ConfigurationError(
            f"{source}: force_controller: set master: omni and slave: sfj; others come later."
        )
    for key, node in (("slave_rate", "sfj_sim"), ("master_rate", "omni_sim")):
        if control[key] != nodes[node]["rate"]:
            raise ConfigurationError(
                f"{source}: force_controller: {key} is {control[key]:g} Hz, but {node} has a rate of "
                f"{nodes[node]['rate']:g} Hz; make them equal."
            )
    device = control["command_source"] == "device"
    if signal["kind"] != "position" and not device:
        raise ConfigurationError(f"{source}: signal_generator: kind is {signal['kind']}; set kind: position.")
    generator = SignalGenerator.from_parameters(_signal_values(signal), STAGES, source)
    slave_times, master_times = (sample_times(nodes[n]["rate"], duration) for n in ("sfj_sim", "omni_sim"))
    reference_times = sample_times(signal["rate"], duration)
    values = generator.series(reference_times) if signal["autostart"] else np.zeros((len(reference_times), 2))
    joints = tuple(signal["joints"])
    if set(joints) != set(AXES) and not device:
        raise ConfigurationError(
            f"{source}: signal_generator: joints are {list(joints)}; set joints: {list(AXES)}."
        )
    columns = [joints.index(axis) for axis in AXES] if set(joints) == set(AXES) else [0, 1]
    by_axis = values[:, columns]
    # Stable, and the master first: where times coincide its state is the older one.
    both = np.concatenate([master_times, slave_times])
    kinds = np.concatenate([np.full(len(master_times), MASTER), np.full(len(slave_times), SLAVE)])
    order = np.argsort(stamps(both), kind="stable")
    return _Prepared(
        slave=slave
        or SfjRobot.from_parameters(_own(nodes["sfj_sim"], seed), folder=parameters.folder, source=source),
        master=OmniRobot.from_parameters(
            _own(nodes["omni_sim"], seed), folder=parameters.folder, source=source
        ),
        law=law or LAWS[control["law"]].from_parameters(control, STAGES, 1.0 / control["slave_rate"]),
        wanted=MasterSide.from_parameters(control, AXES, 1.0 / control["slave_rate"]),
        felt=MasterSide.from_parameters(control, AXES, 1.0 / control["master_rate"]),
        times=(master_times, slave_times),
        kinds=kinds[order],
        event_times=both[order],
        reference_times=reference_times,
        reference=values,
        commanded=by_axis[_latest(reference_times, slave_times)],
        device_commands=device,
        ramp_time=control["ramp_time"],
        joints=joints,
    )


def _signal_values(signal: Mapping[str, Any]) -> dict[str, Any]:
    return {
        key: value for key, value in signal.items() if key in ("kind", "rate") or key.split(".")[0] in STAGES
    }


def _own(values: Mapping[str, Any], seed: int | None) -> dict[str, Any]:
    """A plant's parameters from those of its node."""
    own = {key: value for key, value in values.items() if key != "realtime_priority"}
    return own if seed is None else {**own, "seed": seed}


def _latest(times: Array, moments: Array) -> NDArray[np.int64]:
    """Index of the last of `times` that is not after each of `moments`."""
    return np.maximum(np.searchsorted(stamps(times), stamps(moments), side="right") - 1, 0)


def _compiled_loop(run: _Prepared, outputs: tuple[Array, ...], counts: NDArray[np.int64]) -> None:
    law = run.law
    assert isinstance(law, AugmentedErrorLaw) and isinstance(run.slave, SfjRobot)
    slave, master = run.slave, run.master
    n_slave, n_master = len(run.times[SLAVE]), len(run.times[MASTER])
    hand = master.operator.torques(run.times[MASTER])
    gains = np.array([astuple(gain) for gain in law.gains])
    stepping().scenario_loop(
        run.kinds, run.event_times, run.commanded, run.device_commands, slave.bank, slave.device,
        slave.take_noise(n_slave), master.bank, master.device, master.take_noise(n_master), hand,
        run.wanted._matrix, run.wanted.state, run.felt._matrix, run.felt.state, gains, law.state, law.dt,
        run.ramp_time, OMNI_PEAK_TORQUE, *outputs, counts,
    )  # fmt: skip


def _python_loop(run: _Prepared, outputs: tuple[Array, ...], counts: NDArray[np.int64]) -> None:
    slave_out, slave_command, master_out, master_command = outputs
    slave, master, law = run.slave, run.master, run.law
    limit, saturated = OMNI_PEAK_TORQUE, int(LawResult.SATURATED)
    axis, arm_torque = np.zeros(2), np.zeros(2)
    engaged: float | None = None
    j = k = 0
    for kind, now in zip(run.kinds.tolist(), run.event_times.tolist(), strict=True):
        if kind == MASTER:
            for row, signal in enumerate(master.sense()):
                master_out[j, row] = signal
            axis = master_out[j, 0, 1:3]
            if engaged is not None:
                _, felt = run.felt.step(axis, arm_torque)
                torque = felt * _ramp(now - engaged, run.ramp_time)
                master_command[j, 1:3] = np.minimum(np.maximum(torque, -limit), limit)
            _count(counts[3:6], master.step(master_command[j]))
            j += 1
        else:
            for row, signal in enumerate(slave.sense()):
                slave_out[k, row] = signal
            engaged = now if engaged is None else engaged
            position, velocity, effort = slave_out[k]
            arm_torque = effort[1::2]
            desired, _ = run.wanted.step(axis if run.device_commands else run.commanded[k], arm_torque)
            current = law.step(desired, position[0::2], position[1::2], velocity[0::2])
            counts[6] += saturated in law.results.tolist()
            slave_command[k] = current * (law.torque_constant * _ramp(now - engaged, run.ramp_time))
            _count(counts[:3], slave.step(slave_command[k]))
            k += 1


def _ramp(elapsed: float, ramp_time: float) -> float:
    return 1.0 if elapsed >= ramp_time else elapsed / ramp_time


def _count(counts: NDArray[np.int64], result: StepResult) -> None:
    for bit in range(3):
        counts[bit] += (result >> bit) & 1
