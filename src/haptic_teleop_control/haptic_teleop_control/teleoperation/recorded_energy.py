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
    """ "master" -> what the hand has put in at the device, "slave" -> what arm and environment have got, as
    `passivity` defines them; a robot whose states the topics do not hold is left out.

    The efforts count from one sample to the next: of the Omni the torque applied last, of the 2DSFJ that of
    the joints, Te. For the Omni as slave that is the motor's torque, friction included, because the estimate
    is not recorded with its states. Values that are not finite count as zero.
    """
    found = {}
    for port, robot, sign in (("master", master, -1.0), ("slave", slave, 1.0)):
        series = topics.get(f"/{robot}/joint_states")
        if series is None or series.effort is None or series.velocity is None or len(series) == 0:
            continue
        time = series.time()
        step = np.diff(time, prepend=time[0] - np.median(np.diff(time)) if len(time) > 1 else 0.0)
        power = series.effort[:, TOUCHING[robot]] * series.velocity[:, TOUCHING[robot]]
        work = np.nan_to_num(power, nan=0.0, posinf=0.0, neginf=0.0) * step[:, np.newaxis]
        found[port] = PortEnergy(time, sign * np.cumsum(work, axis=0))
    return found
