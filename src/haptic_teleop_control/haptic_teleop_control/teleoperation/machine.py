"""The states of the teleoperation and what leads from one to another; no clock, no robot, no formula.

    off            a side is missing: nobody publishes, or its samples are too old
    devices_ready  both sides are there; nothing is driven
    aligning       the master goes to its neutral position; the slave is not driven
    engaged        master and slave are coupled
    fault          something went wrong; nothing is driven until `reset`

Every cycle says whether both sides are there and whether they are aligned, and a state that they no longer
allow is left at once. Engaging needs alignment and, unless `auto_engage`, an act of the operator at a moment
when they are aligned: an act is never kept for later. While the artificial command runs its pattern the act
is refused (`Coupling.engage`): the robot would move at once. A fault is left only by `reset`, and then
through aligning.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum


class State(Enum):
    """See the module."""

    OFF = "off"
    DEVICES_READY = "devices_ready"
    ALIGNING = "aligning"
    ENGAGED = "engaged"
    FAULT = "fault"


class TeleoperationMachine:
    """auto_engage: engage as soon as both sides are there and aligned, for simulation and demonstration; not
    after the operator has disengaged, until he engages or resets.
    on_enter: called with every new state, after it has become `state`.
    """

    def __init__(
        self, auto_engage: bool = False, on_enter: Callable[[State], None] = lambda state: None
    ) -> None:
        self.auto_engage = auto_engage
        self.state = State.OFF
        self._on_enter = on_enter
        self._aligning_wanted = False
        self._suspended = False  # the operator has disengaged: nothing goes on by itself

    def cycle(self, present: bool, aligned: bool) -> State:
        """One look at both sides; the state that holds from now on.

        A side that goes missing while something is driven is a fault; `fault` should then be called with its
        reason before, else it is entered here.
        """
        state = self.state
        if state is State.ENGAGED or state is State.FAULT:
            if not present and state is State.ENGAGED:
                self._enter(State.FAULT)
            return self.state
        if not present:
            if state is State.ALIGNING:
                self._enter(State.FAULT)
            elif state is State.DEVICES_READY:
                self._enter(State.OFF)
            return self.state
        if state is State.OFF:
            self._enter(State.DEVICES_READY)
        auto = self.by_itself
        if self.state is State.DEVICES_READY and (auto or self._aligning_wanted):
            self._enter(State.ALIGNING)
        if self.state is State.ALIGNING and auto and aligned:
            self._enter(State.ENGAGED)
        return self.state

    def engage(self, present: bool, aligned: bool) -> bool:
        """The operator's act. True when the two sides are coupled now.

        Where they are not aligned, aligning begins, and the act has to come again when that is done.
        """
        self._suspended = False
        if self.state is State.ENGAGED:
            return True
        if self.state is State.FAULT or not present:
            return False
        self._aligning_wanted = True
        self.cycle(present, aligned)
        if self.state is State.ALIGNING and aligned:
            self._enter(State.ENGAGED)
        return self.state is State.ENGAGED

    def disengage(self) -> bool:
        """Back to `devices_ready`, from engaged or aligning. False where neither was."""
        self._suspended = True
        self._aligning_wanted = False
        if self.state not in (State.ENGAGED, State.ALIGNING):
            return False
        self._enter(State.DEVICES_READY)
        return True

    def fault(self) -> None:
        """Something went wrong; stays until `reset`."""
        if self.state is not State.FAULT:
            self._enter(State.FAULT)

    def reset(self) -> bool:
        """Leave a fault: to `off`, from where aligning begins by itself as soon as both sides are there.
        Without a fault it changes nothing, and False is returned."""
        if self.state is not State.FAULT:
            return False
        self._aligning_wanted = True
        self._suspended = False
        self._enter(State.OFF)
        return True

    @property
    def by_itself(self) -> bool:
        """Whether it engages without an act of the operator, as soon as both sides are aligned."""
        return self.auto_engage and not self._suspended

    @property
    def may_change_roles(self) -> bool:
        """Whether nothing is driven and nothing waits for a reset."""
        return self.state in (State.OFF, State.DEVICES_READY)

    def _enter(self, state: State) -> None:
        if state is State.ENGAGED:
            self._aligning_wanted = False
        self.state = state
        self._on_enter(state)
