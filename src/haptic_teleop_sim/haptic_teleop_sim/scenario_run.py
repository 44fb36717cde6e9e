"""A teleoperation scenario without ROS or clock: the nodes' plants, signals and laws, sample by sample in
order of time.

What the graph does, this does: each robot's state is answered by the same `Coupling` as in the controller's
node, and the answer to a state acts until the next state of that robot. Where samples coincide the reference
comes first, then the master, then the slave. Nothing is ever late, lost or out of order, except by the link
that the parameters ask for.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.laws import ForceLaw, find_law
from haptic_teleop_control.node_tables import without_node_parameters
from haptic_teleop_control.recording import JointStateSeries
from haptic_teleop_control.robots import OMNI_JOINTS, SFJ_JOINTS, SFJ_MOTOR_JOINTS, STAGES
from haptic_teleop_control.signals import SignalGenerator
from haptic_teleop_control.teleoperation.agreement import check_agreement
from haptic_teleop_control.teleoperation.recorded_energy import port_energies
from haptic_teleop_control.teleoperation.sides import REFERENCES

from .experiments import SteppedRobot
from .hardware import OmniRobot, SfjRobot, StepResult
from .scenario_loops import MASTER, SLAVE, Outputs, Prepared, ScenarioResult, run_loop
from .scenario_parameters import ScenarioParameters
from .stamps import sample_times, series, stamps

__all__ = ["ScenarioResult", "simulate_scenario"]

Array = NDArray[np.float64]
AT_LIMIT = "force law at the current limit"
"""Name of the count of samples at which the force law was."""
NODES = {"sfj": "sfj_sim", "omni": "omni_sim"}
JOINTS = {"sfj": (SFJ_JOINTS, SFJ_MOTOR_JOINTS), "omni": (OMNI_JOINTS, OMNI_JOINTS)}


def simulate_scenario(
    parameters: ScenarioParameters,
    duration: float,
    seed: int | None = None,
    law: ForceLaw | None = None,
    slave: SteppedRobot | None = None,
) -> ScenarioResult:
    """Run a scenario for `duration` s, both robots from rest.

    seed: of both robots, instead of those in the parameters. law: one of your own for the two stages of the
    2DSFJ, instead of the one that `law` names; it is stepped at the 2DSFJ's rate. slave: a robot of your own
    in place of the one that `sfj_sim` describes, such as `MujocoRobot`, sampled at its rate. Raises
    ConfigurationError or ModelError for parameters that do not make a scenario.
    """
    run = _prepare(parameters, duration, seed, law, slave)
    outputs = {
        robot: Outputs(
            np.empty((len(run.times[robot]), 3, len(JOINTS[robot][0]))),
            np.zeros((len(run.times[robot]), len(JOINTS[robot][1]))),
        )
        for robot in NODES
    }
    result = run_loop(run, outputs)
    topics: dict[str, JointStateSeries] = {}
    for robot, (joints, motors) in JOINTS.items():
        times, out = run.times[robot], outputs[robot]
        topics[f"/{robot}/joint_states"] = series(times, joints, states=out.states)
        topics[f"/{robot}/effort_command"] = series(times, motors, effort=out.commands)
    kind = parameters.nodes["signal_generator"]["kind"]
    topics["/reference"] = series(run.reference_times, run.joints, **{kind: run.published})
    topics.update(result.channels)
    codes = [code.name.lower() for code in StepResult if code.name]
    names = [f"{robot} {name}" for robot in NODES for name in codes] + [AT_LIMIT]
    counts = {name: int(n) for name, n in zip(names, result.counts, strict=True) if n}
    counts |= {f"fault {name}": n for name, n in result.faults.items()}
    energies = result.energies or _energies(topics)
    return ScenarioResult(topics, counts, tuple(result.states), energies, result.obstacle)


def _energies(topics: Mapping[str, JointStateSeries]) -> dict[str, Array]:
    """Of the compiled loop, which does not count them: it is coupled from the first sample on."""
    ports = port_energies(topics, "omni", "sfj")
    return {
        "master": ports["master"].energy[-1],
        "slave": ports["slave"].energy[-1],
        "lowest master": ports["master"].lowest,
    }


def _prepare(
    parameters: ScenarioParameters,
    duration: float,
    seed: int | None,
    law: ForceLaw | None,
    sfj: SteppedRobot | None,
) -> Prepared:
    nodes, source = parameters.nodes, parameters.source
    control, signal = nodes["force_controller"], nodes["signal_generator"]
    roles = (control["master"], control["slave"])
    _check(control, nodes, source)
    by_stage, published, reference_times, joints = _reference(control, signal, duration, source)
    times = {robot: sample_times(nodes[node]["rate"], duration) for robot, node in NODES.items()}
    # Stable, and the master first: where times coincide its state is the older one.
    both = np.concatenate([times[roles[MASTER]], times[roles[SLAVE]]])
    kinds = np.concatenate([np.full(len(times[role]), kind) for kind, role in enumerate(roles)])
    order = np.argsort(stamps(both), kind="stable")
    at = stamps(both)[order]
    found: dict[str, Any] = {"folder": parameters.folder, "source": source, "models": parameters.models}
    omni = OmniRobot.from_parameters(_own(nodes["omni_sim"], seed), **found)
    own_law = law
    if roles[SLAVE] == "sfj" and law is None:
        law = find_law(control["law"]).from_parameters(control, STAGES, 1.0 / control["slave_rate"])
    return Prepared(
        robots={
            "sfj": sfj or SfjRobot.from_parameters(_own(nodes["sfj_sim"], seed), **found),
            "omni": omni,
        },
        control=control,
        link=nodes["link"],
        law=law,
        may_compile=own_law is None and sfj is None,
        times=times,
        kinds=kinds[order],
        stamps=at,
        reference_times=reference_times,
        reference=by_stage,
        published=published,
        latest=np.maximum(np.searchsorted(stamps(reference_times), at, side="right") - 1, 0),
        joints=joints,
    )


def _check(control: Mapping[str, Any], nodes: Mapping[str, Mapping[str, Any]], source: str) -> None:
    # Without nodes there is no time of theirs on which they could disagree.
    check_agreement({name: without_node_parameters(values) for name, values in nodes.items()}, source)
    if not control["auto_engage"]:
        raise ConfigurationError(
            f"{source}: force_controller: auto_engage is false, and without nodes nobody can call ~/engage; "
            "set it to true for lockstep."
        )


def _reference(
    control: Mapping[str, Any], signal: Mapping[str, Any], duration: float, source: str
) -> tuple[Array, Array, Array, tuple[str, ...]]:
    """The artificial command by stage (n, 2), as published (n, 2), its times (n,), and its joints."""
    joints = REFERENCES[control["master"]][0]
    stated = tuple(signal["joints"])
    own = {k: v for k, v in signal.items() if k in ("kind", "rate") or k.split(".")[0] in STAGES}
    generator = SignalGenerator.from_parameters(own, STAGES, source)
    times = sample_times(signal["rate"], duration)
    values = generator.series(times) if signal["autostart"] else np.zeros((len(times), 2))
    columns = [stated.index(joint) for joint in joints] if set(stated) == set(joints) else [0, 1]
    return np.ascontiguousarray(values[:, columns]), values, times, stated


def _own(values: Mapping[str, Any], seed: int | None) -> dict[str, Any]:
    """A plant's parameters from those of its node."""
    own = without_node_parameters(values)
    return own if seed is None else {**own, "seed": seed}
