"""What a scenario was run with: from the recording itself, from the command line, or the nominal
numbers.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from haptic_teleop_control.robots import PAIRS, SFJ_STAGES
from haptic_teleop_sysid.recordings.recorded_parameters import recorded_value

CONTROLLER = ("force_controller",)
PLANT = ("sfj_sim", "sfj_driver")


@dataclass(frozen=True)
class StageSettings:
    """One stage's settings; None where nothing says. `source` tells for each where its value comes from.

    lambda_ N·m·s/rad; torque_gain N·m/rad, neutral rad: master position -> desired torque; wall_angle rad;
    stiffness N·m/rad; torque_constant N·m/A (nominal, of messages); current_limit A; desired_torque_limit
    N·m.
    """

    lambda_: float | None
    torque_gain: float | None
    neutral: float
    wall_angle: float | None
    stiffness: float
    torque_constant: float
    current_limit: float
    desired_torque_limit: float = math.inf
    source: Mapping[str, str] = field(default_factory=dict)


def stage_settings(
    parameters: Mapping[str, Any], stage: str, overrides: Mapping[str, float] | None = None
) -> StageSettings:
    """Return the settings of `stage`: `overrides` (field name -> value) first, then the recording, then
    nominal numbers.
    """
    axis = PAIRS[stage]
    facts = SFJ_STAGES[stage]
    overrides = overrides or {}
    source: dict[str, str] = {}

    def find(name: str, keys: tuple[str, ...], nodes: tuple[str, ...], nominal: float | None) -> float | None:
        if name in overrides:
            source[name] = "command line"
            return float(overrides[name])
        found = recorded_value(parameters, keys, nodes)
        if found is not None:
            source[name] = f"recording, {found[1]}"
            return found[0]
        source[name] = "nominal" if nominal is not None else "unknown"
        return nominal

    def of_stage(*names: str) -> tuple[str, ...]:
        return tuple(f"{stage}.{name}" for name in names) + names

    lambda_ = find("lambda", of_stage("lambda", "lambda_"), CONTROLLER, None)
    gain_keys = (f"{axis}.torque_gain", *of_stage("torque_gain"))
    torque_gain = find("torque_gain", gain_keys, CONTROLLER, None)
    neutral = find("neutral", (f"{axis}.neutral", f"{stage}.neutral"), CONTROLLER, 0.0)
    wall = find("wall", of_stage("wall.angle", "wall_angle"), PLANT, None)
    stiffness = find("stiffness", (f"{stage}.stiffness",), CONTROLLER, facts.stiffness)
    constant = find("torque_constant", (f"{stage}.torque_constant",), CONTROLLER, facts.torque_constant)
    limit = find("current_limit", (f"{stage}.current_limit",), CONTROLLER, facts.current_limit)
    assert neutral is not None and stiffness is not None and constant is not None and limit is not None
    desired_limit = recorded_value(parameters, (f"{axis}.desired_torque_limit",), CONTROLLER)
    return StageSettings(
        lambda_=lambda_,
        torque_gain=torque_gain,
        neutral=neutral,
        wall_angle=wall,
        stiffness=stiffness,
        torque_constant=constant,
        current_limit=limit,
        desired_torque_limit=math.inf if desired_limit is None else desired_limit[0],
        source=source,
    )
