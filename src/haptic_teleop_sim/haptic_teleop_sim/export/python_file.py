"""A model as one Python file: a function of NumPy alone, written from the equations that the compiled kernel
is made of.
"""

from __future__ import annotations

import inspect
import math
import re
from typing import Any

from haptic_teleop_control.errors import ModelError

from ..effects import EffectEntry
from ..kernel.codegen import DERIVATIVE_ORDER, effect_source, rate_source, slope_source, steepness_sources
from ..kernel.pack import MOST_STEEP, MOST_SUBSTEPS, pack
from ..model import Effect, Model
from .python_text import END, HELPERS, HERE, LATE, LOOP, SIGNATURE, STEPS_HERE, indented
from .target import Exported, input_words, said

_INERTIAS = ("inertia", "relative_inertia")
_FACTORS = ("friction_factor", *_INERTIAS)
_WAY = {
    "direction": "direction_of(moved_{0}, {1}, z[{2}], max({3}, 1e-12))",
    "ratio": "direction_of(moved_{0}, {1}, z[{2}], max({3}, 1e-12) / {4})",
    "displacement": "direction_of(moved_{0}, {1}, z[{2}], {4})",
}


def python_export(model: Model) -> Exported:
    """The model as the text of a module with the function ``simulate``, which says every effect.

    The same equations, integrator and steps as `kernel.simulate`, so the same numbers but for rounding;
    slower, since nothing is compiled. Raises ModelError for an effect of a kind that it does not know.
    """
    sayings = tuple(said(effect) for effect in model.effects)
    return Exported(_Writer(model).text(), sayings, model)


class _Writer:
    """One file in the making: functions of effects, and the lines that call them."""

    def __init__(self, model: Model) -> None:
        self.model, self.packed = model, pack(model)
        self.functions: dict[str, str] = {}
        self.states = 0
        kinds = ("rates", "memory", "input", "reading", "start", "steep")
        self.lines: dict[str, list[str]] = {k: [] for k in kinds}
        self.late: dict[str, list[str]] = {"motor": [], "arm": [], "input": []}
        self.names: dict[str, str] = {}

    def text(self) -> str:
        """The file's content."""
        parameters = {n: float(self.model.parameters.get(n, 1.0)) for n in ("torque_constant", "stiffness",
                      "motor_inertia", "motor_damping", "arm_inertia", "arm_damping")}  # fmt: skip
        if self.model.rigid:
            parameters |= {"stiffness": 0.0, "arm_inertia": 1.0, "arm_damping": 0.0}
        # As in the kernel: factors and inertias are needed before the torques.
        effects = sorted(self.model.effects, key=lambda e: e.entry.kind not in _FACTORS)
        blocks = []
        for number, effect in enumerate(effects):
            blocks.append(self._effect(number, effect))
        head = SIGNATURE.format(
            title=_word(f"{self.model.robot} {self.model.joint}, {self.model.structure}"),
            unit=input_words(self.model),
            effects=_word(", ".join(f"{e.effect} at {e.location}" for e in effects) or "none"),
        )
        constants = "".join(f"{n} = {v!r}\n" for n, v in parameters.items()) + "".join(blocks)
        rate = self.packed.fastest_rate
        steps = "1"
        if math.isfinite(rate):
            steps = f"min(max(1, int(np.ceil(dt * {rate!r}))), {MOST_SUBSTEPS})"
        loop = LOOP.format(
            rates=indented(self.lines["rates"], 4),
            memory=indented(self.lines["memory"], 8),
            start="\n".join([*self.lines["start"], *self._input()]),
            states=self.states,
            steps=steps,
            arm_rate="0.0" if self.model.rigid else "va",
            result=_RIGID if self.model.rigid else _FLEXIBLE,
            outer="torque = torque + outer" if self.model.rigid else "",
            driving=" - torque_arm" if self.model.rigid else "",
            here=HERE if self.lines["steep"] else "",
        )
        steep = STEPS_HERE.format(steep=indented(self.lines["steep"], 4), most=MOST_STEEP)
        end = END.format(reading="\n".join(self._readings()))
        functions = "\n".join(self.functions.values())
        body = [
            constants,
            HELPERS,
            LATE if any(self.late.values()) else "",
            functions.replace("math.", "np."),
            steep if self.lines["steep"] else "",
            loop,
            end,
        ]
        return head + indented("\n".join(b for b in body if b).splitlines(), 4)

    def _effect(self, number: int, effect: Effect) -> str:
        entry, place = effect.entry, self.model.place(effect.location)
        values = f"p{number}"
        numbers = list(effect.values.values()) if effect.table is None else effect.table.packed()
        block = (
            f"{values} = {[float(v) for v in numbers]!r}  # {entry.name} at {_word(effect.location)}: "
            f"{', '.join(entry.parameter_names)}\n"
        )
        if entry.kind in ("torque", "friction", *_FACTORS):
            self._dynamic(values, entry, place, effect)
        elif entry.kind == "input":
            self._actuator(values, entry)
        elif entry.kind == "output":
            self.functions[entry.name] = effect_source(entry, derivatives=True).removeprefix("@inner\n")
            zeros = ", ".join(["0.0"] * 10)
            self.lines["reading"].append(
                f"if channel == {0 if place == 'motor_encoder' else 1}:\n"
                f"    y = {entry.name}_value_derivatives(y, {zeros}, {values}, 0, g)\n"
                "    w *= g[0]"
            )
        elif entry.kind == "skew":
            self.late[place.removesuffix("_encoder").replace("actuator", "input")].append(f"{values}[0]")
        else:
            raise ModelError(
                f"{self.model.source}: the Python file knows no effect of kind {entry.kind} ({entry.name}); "
                "take the effect out of the model."
            )
        return block

    def _dynamic(self, values: str, entry: EffectEntry, place: str, effect: Effect) -> None:
        # A map at the joint follows the motor, or the deflection as such.
        angle, speed = _SEEN["motor" if entry.tabulated and place == "joint" else place]
        place = "motor" if place == "actuator" else place
        function = f"{entry.name}_value"
        if entry.compiled is not None:
            function = entry.compiled[0].__name__
            self.functions[entry.name] = _source_of(entry.compiled[0])
        else:
            self.functions[entry.name] = effect_source(entry).removeprefix("@inner\n")
        own = [f"z[{self.states + i}]" for i in range(entry.states)]
        memory, way = self.states + entry.states, "0.0"
        count = len(entry.parameters)
        if entry.memory == "direction" and effect.values["smoothing"] > 0.0:
            way = f"tanh({speed} / {values}[{count - 1}])"
        elif entry.memory:
            first = f"{values}[{count - 2}]" if entry.memory == "direction" else f"{values}[0]"
            way = _WAY[entry.memory].format(place, speed, memory, first, f"{values}[1]")
            self.lines["memory"].append(f"z[{memory}] = " + way.replace(speed, f"end_{place}", 1))
        arguments = f"{angle}, {speed}, d, stiffness, t, other, driving, dv"
        states = ", ".join([*own, *["0.0"] * (2 - len(own))])
        call = f"{function}({arguments}, {states}, {way}, {values}, 0)"
        self.lines["rates"].append(_TARGETS[entry.kind].format(place=place, call=call))
        if entry.kind in _INERTIAS and (slope := slope_source(entry)):
            self.functions[f"{entry.name}_slope"] = slope.removeprefix("@inner\n")
            bend = f"{entry.name}_slope({arguments}, {states}, 0.0, {values}, 0)"
            scale = f"{place}_inertia * " if entry.kind == "relative_inertia" else ""
            self.lines["rates"].append(f"{place}_torque -= 0.5 * {scale}{bend} * {speed} * {speed}")
        for name, source in steepness_sources(entry).items():
            self.functions[name] = source.removeprefix("@inner\n")
            letter = "k" if name.endswith("stiffness_here") else "b"
            reached = "joint" if angle == "d" else angle
            there = f"{reached}, {speed}, d, stiffness, t, other, driving, dv"
            call = f"{name}({there}, 0.0, 0.0, 0.0, {values}, 0)"
            at = ("motor", "arm") if place == "joint" else (place,)
            self.lines["steep"] += [f"{letter}_{one} += {call}" for one in at]
        for i in range(entry.states):
            name = f"{entry.name}_state_rate{i}"
            self.functions[name] = rate_source(entry, i).removeprefix("@inner\n")
            rate = f"dz[{self.states + i}] = {name}({arguments}, {states}, 0.0, {values}, 0)"
            self.lines["rates"].append(rate)
        if entry.name == "extra_flexible_mode":
            self.lines["start"].append(f"z[{self.states + 1}] = y[3]")
        self.states += entry.states + (1 if entry.memory and "z[" in way else 0)

    def _actuator(self, values: str, entry: EffectEntry) -> None:
        step = entry.step
        assert step is not None
        self.functions[entry.name] = _source_of(step)
        store = f"m{values}"
        behind = f"moment[i] += {store}[{entry.states - 1}]" if entry.spread else _SCALED
        self.lines["start"].append(f"{store} = [0.0] * {max(entry.states, 1)}")
        self.lines["input"].append(
            f"before = torque[i]\n"
            f"torque[i] = {step.__name__}(before, t0 + i * dt, dt, {values}, 0, {store}, 0)\n{behind}"
        )

    def _input(self) -> list[str]:
        lines = [f"torque, moment = stamped_late(torque, {late} / dt, dt)" for late in self.late["input"]]
        if self.lines["input"]:
            lines.append("for i in range(n):\n" + indented(self.lines["input"], 4))
        return lines

    def _readings(self) -> list[str]:
        lines = []
        for channel, place in enumerate(("motor", "arm")):
            lines.append(f"q, v = states[:, {channel}].copy(), states[:, {2 + channel}].copy()")
            if self.late[place]:
                lines.append(f"q, v = seen_late(time, q, v, {' + '.join(self.late[place])})")
            if self.lines["reading"]:
                inner = "\n".join(self.lines["reading"])
                lines.append(f"channel, g = {channel}, [0.0] * 24\nfor i in range(n):\n    y, w = q[i], v[i]")
                lines.append(indented(inner.splitlines(), 4) + "\n    q[i], v[i] = y, w")
            lines.append(f'result["{place}_position"], result["{place}_velocity"] = q, v')
        return lines


_SEEN = {"motor": ("qm", "vm"), "actuator": ("qm", "vm"), "arm": ("qa", "va"), "joint": ("d", "dv")}
_SCALED = "moment[i] *= torque[i] / before if before != 0.0 else 1.0"
_TARGETS = {
    "torque": "{place}_torque += {call}",
    "friction": "{place}_friction += {call}",
    "friction_factor": "{place}_factor *= {call}",
    "inertia": "{place}_mass += {call}",
    "relative_inertia": "{place}_mass += {place}_inertia * {call}",
}
_FLEXIBLE = (
    "(motor_torque + motor_friction * motor_factor - joint_torque) / motor_mass, "
    "(arm_torque + arm_friction * arm_factor + joint_torque) / arm_mass"
)
_RIGID = "(motor_torque + motor_friction * motor_factor) / motor_mass, 0.0"
assert DERIVATIVE_ORDER[0] == "position"  # g[0] below is the slope of a reading


def _word(text: str) -> str:
    """A text that ends neither a comment nor a docstring."""
    return "".join(c if c.isprintable() and c not in '"\\' else "_" for c in text)


def _source_of(step: Any) -> str:
    """Source of a compiled function of one torque, with the constants of its module written out."""
    function = getattr(step, "py_func", step)
    lines = inspect.getsource(function).splitlines()
    text = "\n".join(line for line in lines if not line.startswith("@")) + "\n"
    for name in function.__code__.co_names:
        value = function.__globals__.get(name)
        if isinstance(value, int | float):
            text = re.sub(rf"\b{name}\b", repr(value), text)
    return text
