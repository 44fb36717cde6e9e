"""Master and slave coupled, sample by sample: the same object behind the controller's node and in lockstep.

It is told when a sample of either robot, of the artificial command or of the link has arrived (`now`, ns of a
clock that never jumps), answers each robot's sample with efforts, and looks at both sides at each of them.
Where anything is wrong the answer is zero, or what fades to zero. It never reads a clock and never raises.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_control.laws.contract import ForceLaw
from haptic_teleop_control.quantities import from_parameters
from haptic_teleop_control.robots import OMNI_JOINTS, SFJ_JOINTS, SFJ_MOTOR_JOINTS, STAGES
from haptic_teleop_control.teleoperation.faults import NON_FINITE_STATE, ROBOT_FAULT, SLOW_LINK
from haptic_teleop_control.teleoperation.machine import State, TeleoperationMachine
from haptic_teleop_control.teleoperation.obstacles import (
    PATTERN_RUNS,
    in_faults,
    moving,
    not_heard,
    not_neutral,
    other_command,
    slow_link,
)
from haptic_teleop_control.teleoperation.passivity import PassivitySettings, PortEnergies
from haptic_teleop_control.teleoperation.settings import longest_round_trip
from haptic_teleop_control.teleoperation.sides import (
    MasterPort,
    OmniMaster,
    OmniSlave,
    SfjMaster,
    SfjSlave,
    SlavePort,
)
from haptic_teleop_control.teleoperation.streams import Streams

Array = NDArray[np.float64]

JOINTS = {"omni": len(OMNI_JOINTS), "sfj": len(SFJ_JOINTS)}
MOTORS = {"omni": len(OMNI_JOINTS), "sfj": len(SFJ_MOTOR_JOINTS)}


class Coupling:
    """values: parameters of the force controller. law: for the 2DSFJ as slave (ignored where it is master).
    report: called with name and detail of every fault. on_enter: called with every new state.

    reference (2,), master, slave: (position, velocity, effort) of the latest samples; to be filled in place
    before `on_...` is called, or replaced by views once. heard: (4, 2), what came over the link: desired
    torque and master velocity at the slave; environment torque and slave velocity at the master.
    robot_faults: node -> the sentence of its own fault, of the robots that have one now. pattern_runs: the
    artificial command is within its pattern.
    """

    def __init__(
        self,
        values: Mapping[str, Any],
        law: ForceLaw | None,
        report: Callable[[str, str], None],
        on_enter: Callable[[State], None] = lambda state: None,
    ) -> None:
        self.roles = (values["master"], values["slave"])
        master_dt, slave_dt = 1.0 / values["master_rate"], 1.0 / values["slave_rate"]
        self.master_port: MasterPort
        self.slave_port: SlavePort
        if self.roles[0] == "omni":
            assert law is not None
            self.master_port, self.slave_port = OmniMaster(values, master_dt, slave_dt), SfjSlave(law)
        else:
            self.master_port, self.slave_port = (
                SfjMaster(values, master_dt, slave_dt),
                OmniSlave(values, slave_dt),
            )
        self.energies = PortEnergies(len(STAGES), master_dt, slave_dt)
        self._report, self._on_enter = report, on_enter
        self.machine = TeleoperationMachine(values["auto_engage"], self._enter)
        self.from_reference = values["command_source"] == "reference"
        self.linked = bool(values["link"])
        timeout = round(values["timeout"] * 1e9)
        self.streams = Streams(*self.roles, self.from_reference, self.linked, timeout)

        self.reference: Array = np.zeros(2)
        self.master = tuple(np.zeros(JOINTS[self.roles[0]]) for _ in range(3))
        self.slave = tuple(np.zeros(JOINTS[self.roles[1]]) for _ in range(3))
        self.heard: Array = np.zeros((4, 2))
        self.robot_faults: dict[str, str] = {}
        self.pattern_runs = False
        self.desired: Array = np.zeros(2)
        self._zero_master, self._zero_slave = np.zeros(MOTORS[self.roles[0]]), np.zeros(MOTORS[self.roles[1]])
        self._last_master, self._last_slave = self._zero_master.copy(), self._zero_slave.copy()
        self._no_torque = np.zeros(2)
        self._now = 0
        self._engaged_at = self._master_begun = 0
        self._left_at: int | None = None  # when driving ended, while its last efforts fade
        self._fading: tuple[bool, bool] = (False, False)  # of master, of slave
        self.saturations = 0
        self._take(values)

    def _take(self, values: Mapping[str, Any]) -> None:
        self._ramp_time, self._fade_time = values["ramp_time"], values["ramp_out_time"]
        self._align_angle, self._align_speed = values["align.angle"], values["align.speed"]
        self._longest_round_trip = longest_round_trip(values["maximum_round_trip"], self.roles[1])
        self.passivity: PassivitySettings = from_parameters(PassivitySettings, values, "passivity.")
        self.machine.auto_engage = values["auto_engage"]

    def update(self, values: Mapping[str, Any]) -> None:
        """Take changed parameters while running. Raises ConfigurationError, and then has changed nothing of
        the side concerned."""
        self.slave_port.update(values)
        self.master_port.update(values)
        self._take(values)

    # Samples.

    def on_reference(self, now: int) -> None:
        """`reference` holds a new command."""
        self.streams.reference.at = now
        self.streams.reference.refused = ""

    def on_bad_reference(self, now: int, name: str, detail: str) -> None:
        """A command that cannot be taken: a fault where it commands. Where nothing is driven it is only not
        taken, because roles and command can only be changed one after the other."""
        self.streams.reference.refused = detail
        if self.from_reference and self.state in (State.ALIGNING, State.ENGAGED):
            self.fault(now, name, detail)

    def on_robot_fault(self, now: int, node: str, sentence: str | None) -> None:
        """A robot's own node says that it is in a fault, or (None) that it is in none: it does not follow
        what it is told, however fresh its states are."""
        if sentence is None:
            self.robot_faults.pop(node, None)
            return
        self.robot_faults[node] = sentence
        if self.state is State.ENGAGED:
            self.fault(now, ROBOT_FAULT, f"{node}: {sentence}")

    def on_master(self, now: int) -> Array:
        """`master` holds a new state; the efforts that answer it, N·m. A view, valid until the next call."""
        self._now = self.streams.master.at = now
        state = self._look(now)
        port, (position, velocity, effort) = self.master_port, self.master
        torque, speed = port.at_hand(velocity, effort, self._last_master)
        if self.linked:
            self._desire()
        if state is not State.ENGAGED and state is not State.ALIGNING:
            return self._fade(now, self._last_master, self._zero_master, self._fading[0])
        share = self._share(now, self._master_begun)
        coupled = self._share(now, self._engaged_at) if state is State.ENGAGED else 0.0
        feedback = self._no_torque
        damping = self._no_torque
        if state is State.ENGAGED:
            feedback = self.heard[2] if self.linked else self.slave_port.environment_torque
            self.energies.at_master(torque, speed, port.feedback_gains * feedback)
            damping = self.energies.damping(speed, self.passivity)
            if coupled < share:  # the master has been driven for longer than it has been coupled
                feedback = feedback * (coupled / share)
        np.multiply(port.torque(position, velocity, effort, feedback, damping), share, out=self._last_master)
        return self._last_master

    def on_slave(self, now: int) -> Array:
        """`slave` holds a new state; the efforts that answer it, as `on_master`."""
        self._now = self.streams.slave.at = now
        state = self._look(now)
        port, (position, velocity, effort) = self.slave_port, self.slave
        if state is not State.ENGAGED:
            port.observe(position, velocity, effort)
            return self._fade(now, self._last_slave, self._zero_slave, self._fading[1])
        if self.linked:
            desired, heard = self.heard[0], self.heard[1]
        else:
            desired = self._desire()
            heard = self._hand_velocity()
        driven = port.step(desired, position, velocity, effort)
        if port.refused:
            self.fault(
                now, NON_FINITE_STATE, f"{self.streams.slave.name}: the law's arithmetic overflowed", True
            )
            return self._zero_slave
        self.saturations += port.saturated
        felt = port.environment_torque
        self.energies.at_slave(felt, port.velocity(velocity), self.master_port.feedback_gains * felt, heard)
        np.multiply(driven, self._share(now, self._engaged_at), out=self._last_slave)
        return self._last_slave

    def on_forward(self, now: int, age: float) -> None:
        """`heard[0:2]` holds what the master sent, `age` s ago by its stamp."""
        self.streams.forward.hear(now, age)

    def on_backward(self, now: int, age: float) -> None:
        """`heard[2:4]` holds what the slave sent."""
        self.streams.backward.hear(now, age)

    # What the operator does.

    def engage(self, now: int) -> str | None:
        """Couple the two sides; None when done, else why not."""
        self._now = now
        if self.machine.state is State.FAULT:
            return "a fault is latched: reset it first"
        obstacle = self.obstacle(now)
        missing = self.streams.missing(now) is not None
        # Neither begins to align: a refusal moves nothing.
        if obstacle == PATTERN_RUNS or (self.robot_faults and not missing):
            return obstacle
        if self.machine.engage(not missing, obstacle is None):
            return None
        if missing or obstacle is None:
            return obstacle or "a side is missing"
        return f"{obstacle}; it is being aligned, engage again when it is there"

    def disengage(self, now: int) -> bool:
        """End the coupling; the efforts fade. False where there was none."""
        self._now = now
        return self.machine.disengage()

    def reset(self, now: int) -> None:
        """Leave a latched fault, through aligning; every stream counts as not heard of yet. Without a fault
        nothing changes: streams that were forgotten while driving could go silent unnoticed."""
        self._now = now
        if self.machine.reset():
            self.streams.forget()

    def fault(self, now: int, name: str, detail: str, at_once: bool = False) -> None:
        """Something is wrong: report it, and drive nothing until `reset`. at_once: no fading either,
        because what was wrong is the state that the efforts answer."""
        self._now = now
        self._report(name, detail)
        self.machine.fault()
        # The hand gets nothing within one sample; a motor in contact is let go in a short ramp.
        self._fading = (False, self._fading[1] and not at_once)

    # What is known.

    @property
    def to_slave(self) -> tuple[Array, Array]:
        """What goes over the link to the slave: Td, N·m, and the velocity of the hand, rad/s; (2,) each."""
        return self.desired, self._hand_velocity()

    @property
    def to_master(self) -> tuple[Array, Array]:
        """What goes over the link to the master: Te, N·m, and the slave's velocity, rad/s."""
        return self.slave_port.environment_torque, self.slave_port.velocity(self.slave[1])

    @property
    def state(self) -> State:
        return self.machine.state

    @property
    def round_trip(self) -> float:
        """See Streams.round_trip."""
        return self.streams.round_trip

    def obstacle(self, now: int) -> str | None:
        """Why the two sides cannot be coupled now, in words; None when they can."""
        missing = self.streams.missing(now)
        if missing is not None:
            told = not_heard(missing, now)
            bad_command = missing is self.streams.reference and missing.refused
            return f"{told}; {other_command(self.roles[0])}" if bad_command else told
        if self.robot_faults:
            return in_faults(self.robot_faults)
        if self.from_reference and self.pattern_runs and not self.machine.by_itself:
            return PATTERN_RUNS
        port = self.master_port
        if self.from_reference:
            offset, commander = port.offset_of(self.reference), "the artificial command"
        else:
            offset, commander = port.offset(self.master[0]), "the master"
        return (
            not_neutral(offset, self._align_angle, commander)
            or moving(self.slave_port.velocity(self.slave[1]), self._align_speed)
            or slow_link(self.round_trip, self._longest_round_trip)
        )

    # Within a sample.

    def _look(self, now: int) -> State:
        machine = self.machine
        state = machine.state
        if state is State.ENGAGED:
            missing = self.streams.silent(now)
            if missing is not None:
                silence = missing.silence(now)
                self.fault(now, missing.fault, f"{missing.name} is silent for {silence:.3f} s")
            elif self.linked and self.round_trip > self._longest_round_trip:
                self.fault(now, SLOW_LINK, f"{1e3 * self.round_trip:.1f} ms for the round trip")
            return machine.state
        if state is State.FAULT:
            return state
        missing = self.streams.missing(now)
        if missing is not None and state is State.ALIGNING:
            self.fault(now, missing.fault, f"{missing.name} went silent while aligning")
            return machine.state
        return machine.cycle(missing is None, missing is None and self.obstacle(now) is None)

    def _desire(self) -> Array:
        port = self.master_port
        self.desired = port.desired_by(self.reference) if self.from_reference else port.desired(*self.master)
        return self.desired

    def _hand_velocity(self) -> Array:
        return self.master_port.at_hand(self.master[1], self.master[2], self._last_master)[1]

    def _share(self, now: int, begun: int) -> float:
        """The ramp from 0 to 1 since `begun`."""
        elapsed = (now - begun) * 1e-9
        return 1.0 if elapsed >= self._ramp_time else elapsed / self._ramp_time

    def _fade(self, now: int, last: Array, zero: Array, fading: bool) -> Array:
        """What is left of the last efforts."""
        if not fading or self._left_at is None:
            return zero
        elapsed = (now - self._left_at) * 1e-9
        if elapsed >= self._fade_time:
            return zero
        return last * (1.0 - elapsed / self._fade_time)

    def _enter(self, state: State) -> None:
        now = self._now
        if state is State.ALIGNING:
            self.master_port.reset()
            self._last_master.fill(0.0)
            self._master_begun = now
        elif state is State.ENGAGED:
            self.slave_port.reset()
            self.energies.reset()
            self._last_slave.fill(0.0)
            self._engaged_at = now
        if state in (State.ALIGNING, State.ENGAGED):
            self._left_at, self._fading = None, (True, state is State.ENGAGED)
        elif self._left_at is None:
            self._left_at = now
        self._on_enter(state)
