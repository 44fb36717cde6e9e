"""Units of a model's parameters on the machine at hand: turning or linear, driven by N·m, N, A, V or pu."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from haptic_teleop_sim.model import PARAMETER_UNITS, Model
from haptic_teleop_sysid.recordings.dataset import DataSet

_WRITTEN = (
    *("N*m*s^3/rad^3", "N*m*s^2/rad^2", "N*m*s/rad", "N*m/rad^3", "N*m/rad", "N*m"),
    *("kg*m^2", "rad/s", "s/rad", "rad"),
)
#: Behind a suggested law: units of its torque, angles and rates.
_OF_A_LAW = "(N*m, rad, rad/s)"
_BEHIND_A_NUMBER = re.compile(rf"(?<=\d )({'|'.join(map(re.escape, _WRITTEN))})(?![\w*/^])")


@dataclass(frozen=True)
class Units:
    """``position``: "rad" or "m"; ``force``: what torques are in, "N*m", "N", or the unit of an input that
    no torque constant turns into one ("A")."""

    position: str = "rad"
    force: str = "N*m"

    @classmethod
    def of(cls, model: Model, data: DataSet) -> Units:
        """The units of a model on a data set. With a torque constant of 1, parameters are per unit of the
        input."""
        if model.robot != "generic":
            return cls()
        natural = "N" if data.position_unit == "m" else "N*m"
        plain = float(model.parameters["torque_constant"]) == 1.0
        return cls(data.position_unit, data.input_unit if plain else natural)

    def of_parameter(self, model: Model, name: str) -> str:
        """Unit of a parameter by its full name; "1" for a torque constant that is a plain gain."""
        if name in PARAMETER_UNITS:
            if name == "torque_constant" and model.robot != "sfj":
                return "1"
            return self.restated(PARAMETER_UNITS[name])
        head, _, tail = name.rpartition(".")
        effect = next(e for e in model.effects if f"{e.location}.{e.effect}" == head)
        return self.restated(effect.entry.parameter(tail).unit)

    def restated(self, unit: str) -> str:
        """A unit of a turning joint driven by N·m as that of this machine: kg*m^2 -> kg."""
        if self == Units() or (unit not in _WRITTEN and not unit.startswith("N*m/(")):
            return unit
        if unit == "kg*m^2":
            natural = {"rad": "N*m", "m": "N"}[self.position]
            mass = {"rad": unit, "m": "kg"}[self.position]
            return mass if self.force == natural else f"{self.force}*s^2/{self.position}"
        return unit.replace("N*m", self.force).replace("rad", self.position)

    def restated_all(self, content: Any, key: str = "") -> Any:
        """Plain data with every value of a key "unit" restated, and every unit behind a number in a text."""
        if isinstance(content, Mapping):
            return {k: self.restated_all(v, str(k)) for k, v in content.items()}
        if isinstance(content, (list, tuple)):
            return [self.restated_all(v, key) for v in content]
        if not isinstance(content, str) or self == Units():
            return content
        if key == "unit":
            return self.restated(content)
        content = content.replace(_OF_A_LAW, f"({self.force}, {self.position}, {self.position}/s)")
        return _BEHIND_A_NUMBER.sub(lambda m: self.restated(m[1]), content)
