"""Energy at the ports of the teleoperation, and a controller that keeps the operator's port passive.

A port is a torque with the velocity of the joint on which it acts. Counted are, per stage, in J:

    E_master = -integral T_device phi'  dt      what the hand has put in at the device, against its torque
    E_slave  =  integral Te       theta' dt     what the arm and its environment have got
    E_link   =  integral (F_m v_m - F_s v_s) dt what the link has taken in and not given back

(Hannaford and Ryu, IEEE Trans. Robotics and Automation 18, 2002, for one port; Artigas, Ryu and Preusche,
IROS 2010, for a link.) F_m is the feedback as felt, with v_m the master's velocity; F_s the feedback as the
slave sent it, with v_s the master's velocity as the slave received it. Without delay the link gives back what
it takes, E_link = 0; a delay can make it give more, and then it is what feeds an oscillation.

What is *not* passive is the pair of master and slave ports taken together, delay or not: in rate control the
slave's motors do work as long as the master is held off its neutral position, and the hand does none. So the
two ports are stated one by one, and passive means E_master >= -epsilon and E_link >= -epsilon.

The controller adds damping at the master's port when E_master or E_link has fallen below zero: just as much
as would bring it back within one sample, T = -alpha v with alpha = -E / (v² dt), within `maximum_damping`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from haptic_teleop_control.compiled import njit
from haptic_teleop_control.laws.contract import Array
from haptic_teleop_control.quantities import check_quantities, quantity


@dataclass(frozen=True)
class PassivitySettings:
    """Raises ConfigurationError naming the field for a value outside its range."""

    controller: bool = quantity(False, "", "damp the master where its port or the link has given energy away")
    maximum_damping: float = quantity(
        0.1, "N·m·s/rad", "largest damping that is added, on a joint of the master", minimum=0.0, maximum=5.0
    )
    epsilon: float = quantity(
        0.1, "J", "energy that a port may give away before the controller's node warns", minimum=0.0
    )
    slowest: float = quantity(
        0.05, "rad/s", "speed below which no damping is added: the measured velocity is noise", above=0.0
    )

    def __post_init__(self) -> None:
        check_quantities(self)


class PortEnergies:
    """The three energies of n stages, counted sample by sample; torques held from one sample to the next.

    master, slave, link: (n,), J, since `reset`. lowest_master, lowest_link: (n,), J, their lowest values.
    Samples that are not finite are left out.
    """

    def __init__(self, n: int, master_dt: float, slave_dt: float) -> None:
        self.n, self.master_dt, self.slave_dt = n, float(master_dt), float(slave_dt)
        self._energy = np.zeros((3, n))
        self._lowest = np.zeros((2, n))
        self._damping = np.zeros(n)
        self._inputs = np.zeros((4, n))  # copied to, so that one compiled version serves all layouts
        port_master_step(self._inputs, self.master_dt, self._energy, self._lowest)
        port_slave_step(self._inputs, self.slave_dt, self._energy, self._lowest)
        damping_step(self._inputs[0], self._energy, self.master_dt, 0.0, 1.0, self._damping)

    @property
    def master(self) -> Array:
        return self._energy[0]

    @property
    def slave(self) -> Array:
        return self._energy[1]

    @property
    def link(self) -> Array:
        return self._energy[2]

    @property
    def lowest_master(self) -> Array:
        return self._lowest[0]

    @property
    def lowest_link(self) -> Array:
        return self._lowest[1]

    def reset(self) -> None:
        """Count from zero."""
        self._energy[:] = 0.0
        self._lowest[:] = 0.0

    def at_master(self, device_torque: Array, velocity: Array, feedback_torque: Array) -> None:
        """One sample of the master: torque that acted on it since the last sample, its velocity, and the
        feedback that it was given (positive resists); (n,) each, N·m and rad/s."""
        inputs = self._inputs
        inputs[0] = device_torque
        inputs[1] = velocity
        inputs[2] = feedback_torque
        port_master_step(inputs, self.master_dt, self._energy, self._lowest)

    def at_slave(
        self, environment_torque: Array, velocity: Array, sent_torque: Array, heard_velocity: Array
    ) -> None:
        """One sample of the slave: Te and the velocity of its arm; the feedback that it sent, and the
        master's velocity as it heard it; (n,) each."""
        inputs = self._inputs
        inputs[0] = environment_torque
        inputs[1] = velocity
        inputs[2] = sent_torque
        inputs[3] = heard_velocity
        port_slave_step(inputs, self.slave_dt, self._energy, self._lowest)

    def damping(self, velocity: Array, settings: PassivitySettings) -> Array:
        """(n,) N·m, the torque to add on the device; zero unless the controller is on. A view."""
        if not settings.controller:
            self._damping.fill(0.0)
            return self._damping
        self._inputs[0] = velocity
        damping_step(
            self._inputs[0],
            self._energy,
            self.master_dt,
            settings.maximum_damping,
            settings.slowest,
            self._damping,
        )
        return self._damping


@njit(cache=True)
def port_master_step(inputs, dt, energy, lowest):  # type: ignore[no-untyped-def]
    """See `PortEnergies.at_master`; inputs (4, n), the last row unused. Changes energy (3, n) and lowest
    (2, n) in place."""
    for i in range(inputs.shape[1]):
        work = inputs[0, i] * inputs[1, i] * dt
        taken = inputs[2, i] * inputs[1, i] * dt
        if np.isfinite(work) and np.isfinite(taken):
            energy[0, i] -= work
            energy[2, i] += taken
            lowest[0, i] = min(lowest[0, i], energy[0, i])
            lowest[1, i] = min(lowest[1, i], energy[2, i])


@njit(cache=True)
def port_slave_step(inputs, dt, energy, lowest):  # type: ignore[no-untyped-def]
    """See `PortEnergies.at_slave`."""
    for i in range(inputs.shape[1]):
        work = inputs[0, i] * inputs[1, i] * dt
        given = inputs[2, i] * inputs[3, i] * dt
        if np.isfinite(work) and np.isfinite(given):
            energy[1, i] += work
            energy[2, i] -= given
            lowest[1, i] = min(lowest[1, i], energy[2, i])


@njit(cache=True)
def damping_step(velocity, energy, dt, largest, slowest, out):  # type: ignore[no-untyped-def]
    """Fills `out` (n,) with the damping torques, N·m."""
    for i in range(out.shape[0]):
        missing = -min(energy[0, i], energy[2, i])
        speed = velocity[i]
        out[i] = 0.0
        if missing > 0.0 and abs(speed) >= slowest and np.isfinite(speed):
            out[i] = -min(missing / (speed * speed * dt), largest) * speed
