"""By what time a recording was made: the wall's, simulated time, or no clock at all (lockstep).

In simulated time and in lockstep an answer takes no time, so that stamps tell nothing of the computer; how
fast simulated time went is what the coordinator said of itself.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from haptic_teleop_control.recording import Recording
from haptic_teleop_sysid.recordings.recorded_parameters import flattened

WALL, SIMULATED, LOCKSTEP = "wall", "simulated", "lockstep"
ACHIEVED, WANTED, REPEATS = "real-time factor", "real-time factor wanted", "ticks asked for again"
"""Names under which the coordinator's diagnostics tell them."""


@dataclass(frozen=True)
class Clock:
    """kind: WALL, SIMULATED or LOCKSTEP. Of simulated time, None where the recording does not say it:
    achieved: simulated seconds per second; wanted: at most, 0 for as fast as it goes; repeats: ticks that
    were asked for again, because a message or a process was late."""

    kind: str = WALL
    achieved: float | None = None
    wanted: float | None = None
    repeats: int | None = None

    @property
    def of_wall(self) -> bool:
        """Whether the stamps tell what the computer did."""
        return self.kind == WALL

    def as_json(self) -> dict[str, Any]:
        """As plain data."""
        return asdict(self)

    def pace(self) -> str:
        """How fast simulated time went, in words; empty where nothing tells."""
        if self.achieved is None:
            return ""
        text = f"real-time factor {self.achieved:.2f} achieved by the machine that ran it"
        return f"{text} ({self.asked()})" if self.asked() else text

    def asked(self) -> str:
        """How fast it should have gone, in words; empty where nothing tells."""
        if self.wanted is None:
            return ""
        return f"wanted: {'as fast as it goes' if self.wanted == 0.0 else format(self.wanted, 'g')}"


def read_clock(recording: Recording) -> Clock:
    """Return by what time the recording was made, from what it says of itself."""
    if recording.experiment.get("runner") == LOCKSTEP:
        return Clock(LOCKSTEP)
    if not any(_simulated(values) for values in recording.parameters.values()):
        return Clock()
    told = next((one.values for one in reversed(recording.diagnostics) if ACHIEVED in one.values), {})
    repeats = _number(told, REPEATS)
    return Clock(SIMULATED, _number(told, ACHIEVED), _number(told, WANTED), _whole(repeats))


def _simulated(values: Any) -> bool:
    return isinstance(values, Mapping) and dict(flattened(values)).get("use_sim_time") is True


def _number(told: Mapping[str, str], name: str) -> float | None:
    try:
        value = float(told[name])
    except (KeyError, ValueError):
        return None
    return value if math.isfinite(value) and value >= 0.0 else None


def _whole(value: float | None) -> int | None:
    return None if value is None else int(value)
