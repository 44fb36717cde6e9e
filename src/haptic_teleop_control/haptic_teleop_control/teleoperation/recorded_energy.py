"""The energies at the ports of master and slave, from a recording: what the controller counts as it runs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_control.recording import JointStateSeries
from haptic_teleop_control.teleoperation.sides import ARM_SLICE, AXIS_SLICE

Array = NDArray[np.float64]

TOUCHING = {"omni": AXIS_SLICE, "sfj": ARM_SLICE}
"""By robot: the joints that the hand holds or that touch the environment."""


@dataclass(frozen=True)
class PortEnergy:
    """time: (n,) s since the topic's first sample. energy: (n, 2) J, of both stages."""

    time: Array
    energy: Array

    @property
    def lowest(self) -> Array:
        """(2,) J, the lowest value of each stage; 0 where it never fell below."""
        return np.minimum(self.energy.min(axis=0, initial=0.0), 0.0)


def port_energies(topics: Mapping[str, JointStateSeries], master: str, slave: str) -> dict[str, PortEnergy]:
    """By port: "master", what the hand has put in at the device, and "slave", what arm and environment have
    got, as `passivity` defines them; a robot whose states the topics do not hold is left out.

    The 2DSFJ gives the torque of its joints, Te. Of the Omni it is the command, because the torque applied
    also holds what compensates the device itself; as slave that is the motor's torque, friction included,
    because the estimate is not recorded. Torques count from one sample to the next. Values that are not
    finite count as zero.
    """
    found = {}
    for port, robot, sign in (("master", master, -1.0), ("slave", slave, 1.0)):
        series = topics.get(f"/{robot}/joint_states")
        if series is None or series.effort is None or series.velocity is None or len(series) == 0:
            continue
        time = series.time()
        step = np.diff(time, prepend=time[0] - np.median(np.diff(time)) if len(time) > 1 else 0.0)
        torque = series.effort if robot == "sfj" else _acting(series, topics.get(f"/{robot}/effort_command"))
        power = torque[:, TOUCHING[robot]] * series.velocity[:, TOUCHING[robot]]
        work = np.nan_to_num(power, nan=0.0, posinf=0.0, neginf=0.0) * step[:, np.newaxis]
        found[port] = PortEnergy(time, sign * np.cumsum(work, axis=0))
    return found


def _acting(states: JointStateSeries, commands: JointStateSeries | None) -> Array:
    """(n, joints) the command that acted until each state: the answer to the one before; the effort of the
    states where no command is recorded."""
    assert states.effort is not None
    if commands is None or commands.effort is None or not len(commands):
        return states.effort
    last = np.searchsorted(commands.stamp, states.stamp, side="left") - 1
    return np.where((last >= 0)[:, np.newaxis], commands.effort[np.maximum(last, 0)], 0.0)
