"""A model as the flat arrays that the compiled kernel reads."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..effects import EFFECTS
from ..effects.torque_map import TorqueMap
from ..model import STRUCTURES, Model, other_signals

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

BASE = ("stiffness", "motor_inertia", "motor_damping", "arm_inertia", "arm_damping")
#: Steps per sample at most: what is stiffer is not worth the time.
MOST_SUBSTEPS = 400
#: The same to which a steep law raises those of one sample (`integrator.MOST_STEPS`).
MOST_STEEP = 50
_DYNAMIC = ("torque", "friction", "friction_factor", "inertia", "relative_inertia")
_MEMORY = {"": 0, "direction": 1, "ratio": 2, "displacement": 3}
_KIND = {"torque": 0, "friction": 1, "friction_factor": 2, "inertia": 3, "relative_inertia": 4}
_FIRST = ("friction_factor", "inertia", "relative_inertia")
_LOCATION = {"motor": 0, "actuator": 0, "arm": 1, "joint": 2}
_CHANNEL = {"motor_encoder": 0, "arm_encoder": 1}
#: Code of an effect: its place among the effects of its group, as in ``codegen``.
_CODES = {
    name: i
    for group in (_DYNAMIC, ("output",), ("input",), ("skew",))
    for i, name in enumerate(n for n, e in EFFECTS.items() if e.kind in group)
}


@dataclass(frozen=True)
class Packed:
    """Flat arrays of one model (layouts in ``integrator.py``) and where each named number sits in them.

    ``index`` maps a full parameter name to ``("base", i)``, ``("p", i)`` or ``("torque_constant", 0)``.
    ``skew`` lists (channel: 0 motor encoder, 1 arm encoder, 2 actuator; offset of the delay in p; sign).
    """

    model: Model
    rigid: bool
    torque_constant: float
    base: FloatArray
    codes: IntArray
    p: FloatArray
    in_codes: IntArray
    out_codes: IntArray
    skew: tuple[tuple[int, int], ...]
    states: int
    memory: int
    index: dict[str, tuple[str, int]]
    velocity_states: tuple[int, ...]

    @cached_property
    def other(self) -> str:
        """What the effects follow of the robot's other joint (`model.other_signals`), "" for nothing."""
        return next(iter(other_signals(self.model)), "")

    @cached_property
    def linear(self) -> tuple[float, ...]:
        """What the linearisation about rest at angle zero is made of: ``base``, and the stiffness of motor
        and arm against the ground, N·m/rad."""
        ground = {"motor": 0.0, "arm": 0.0}
        for e in self.model.effects:
            if e.entry.spring is not None:
                ground[self.model.place(e.location)] += e.entry.spring(e.values)
        return (*(float(v) for v in self.base), *ground.values())

    @cached_property
    def encoder_slope(self) -> tuple[float, float]:
        """What the readings of motor and arm rise by with their angles, in the mean over a turn."""
        slope = [1.0, 1.0]
        for e in self.model.effects:
            if e.entry.slope is not None:
                slope[_CHANNEL[self.model.place(e.location)]] *= e.entry.slope(e.values)
        return slope[0], slope[1]

    @cached_property
    def fastest_rate(self) -> float:
        """Runge-Kutta steps per second that the stiffest part of the model needs, 1/s."""
        ks = float(self.base[0])
        stiffness = {"motor": ks, "arm": ks, "joint": 0.0}
        damping = {"motor": abs(float(self.base[2])), "arm": abs(float(self.base[4])), "joint": 0.0}
        least = {"motor": 1.0, "arm": 1.0}
        own = 0.0
        for e in self.model.effects:
            place = self.model.place(e.location)
            if e.entry.lightest is not None:
                least[place] *= e.entry.lightest(e.values)
            if place in stiffness:
                k, b, *rest = e.entry.rate(e.values, ks) if e.table is None else _rate_of(e.table)
                stiffness[place] += k
                damping[place] += b
                own = max(own, *rest) if rest else own
        worst = own / 1.5
        for place, inertia in (("motor", self.base[1]), ("arm", self.base[3])):
            if place == "arm" and self.rigid:
                continue
            k = (stiffness[place] + stiffness["joint"]) / (inertia * least[place])
            b = (damping[place] + damping["joint"]) / (inertia * least[place])
            worst = max(worst, b / 2.2 + math.sqrt(max(k, 0.0)) / 1.0)
        return float(worst)

    def substeps(self, dt: float) -> int:
        """Runge-Kutta steps per sample: stable and accurate for the stiffest part of the model."""
        worst = self.fastest_rate
        if not math.isfinite(worst):
            return 1
        return int(min(max(1, math.ceil(dt * worst)), MOST_SUBSTEPS))

    def delayed_encoder(self, name: str) -> int | None:
        """The encoder (0 motor, 1 arm) whose delay the parameter of that name is, or None."""
        group, place = self.index[name]
        return next((c for c, o in self.skew if group == "p" and o == place and c < 2), None)

    def encoder_shift(self, dt: float) -> tuple[IntArray, FloatArray]:
        """Whole samples (2,) by which the readings of motor and arm are moved ahead for their delay, and what
        is left of it, (2,) s, zero or less: the moved reading shows where its axis was ``-lead`` ago, within
        the sample before, whose torque is known by then.
        """
        whole, lead = np.zeros(2, dtype=np.int64), np.zeros(2)
        if not self.skew:
            return whole, lead
        for channel in (0, 1):
            delay = sum(float(self.p[o]) for c, o in self.skew if c == channel) / dt
            whole[channel] = math.floor(delay)
            lead[channel] = (whole[channel] - delay) * dt
        return whole, lead

    def initial_state(
        self,
        motor_position: float = 0.0,
        arm_position: float | None = None,
        motor_velocity: float = 0.0,
        arm_velocity: float | None = None,
    ) -> FloatArray:
        """State vector (states,) with the effects' own states at rest (moving along, where they are
        velocities).
        """
        x = np.zeros(self.states)
        x[0] = motor_position
        x[1] = motor_position if arm_position is None else arm_position
        x[2] = motor_velocity
        x[3] = motor_velocity if arm_velocity is None else arm_velocity
        for i in self.velocity_states:
            x[i] = x[3]
        return x


def _rate_of(table: TorqueMap) -> tuple[float, float]:
    """Stiffness and damping that a map adds at most."""
    return table.steepest(("angle", "deflection")), table.steepest(("velocity", "deflection_rate"))


def pack(model: Model) -> Packed:
    """Flat arrays of a model."""
    values = {n: float(model.parameters.get(n, 0.0)) for n in BASE}
    if model.rigid:
        values["arm_inertia"] = 1.0
    index: dict[str, tuple[str, int]] = {
        n: ("base", i) for i, n in enumerate(BASE) if n in STRUCTURES[model.structure]
    }
    index["torque_constant"] = ("torque_constant", 0)
    p: list[float] = []
    codes: list[tuple[int, ...]] = []
    in_codes: list[tuple[int, int, int, int]] = []
    out_codes: list[tuple[int, int, int, int]] = []
    skew: list[tuple[int, int]] = []
    velocity_states: list[int] = []
    state, memory = 4, 0
    # Factors and inertias first: the kernel needs them before the torques.
    order = sorted(model.effects, key=lambda e: e.entry.kind not in _FIRST)
    for e in order:
        entry = e.entry
        place = model.place(e.location)
        offset = len(p)
        for name, value in e.values.items():
            index[f"{e.location}.{e.effect}.{name}"] = ("p", len(p))
            p.append(value)
        if e.table is not None:
            offset = len(p)
            p += e.table.packed()
        code = _CODES[entry.name]
        if entry.kind in _DYNAMIC:
            memory_kind = _MEMORY[entry.memory]
            if memory_kind == 1 and e.values["smoothing"] > 0.0:
                memory_kind = 4
            codes.append(
                (
                    code,
                    _LOCATION[place],
                    _KIND[entry.kind],
                    offset,
                    state,
                    entry.states,
                    len(entry.parameters),
                    memory_kind,
                )
            )
            if entry.name == "extra_flexible_mode":
                velocity_states.append(state + 1)
            state += entry.states + (0 < memory_kind < 4)
        elif entry.kind == "input":
            in_codes.append((code, offset, memory, memory + entry.states - 1 if entry.spread else -1))
            memory += entry.states
        elif entry.kind == "output":
            out_codes.append((code, _CHANNEL[place], offset, len(entry.parameters)))
        else:
            skew.append((_CHANNEL.get(place, 2), offset))
    return Packed(
        model=model,
        rigid=model.rigid,
        torque_constant=float(model.parameters["torque_constant"]),
        base=np.array([values[n] for n in BASE]),
        codes=np.array(codes, dtype=np.int64).reshape(-1, 8),
        p=np.array(p if p else [0.0]),
        in_codes=np.array(in_codes, dtype=np.int64).reshape(-1, 4),
        out_codes=np.array(out_codes, dtype=np.int64).reshape(-1, 4),
        skew=tuple(skew),
        states=state + 2,
        memory=max(memory, 1),
        index=index,
        velocity_states=tuple(velocity_states),
    )
