"""What an exported file lacks costs in fit, and what the file gives where it is to be simulated."""

from __future__ import annotations

from typing import Any

import numpy as np

from haptic_teleop_control.errors import HapticTeleopError
from haptic_teleop_sim.export import Exported, Saying, replaced
from haptic_teleop_sim.export.mujoco_run import run_in_mujoco
from haptic_teleop_sim.export.target import gain_before
from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sim.mujoco_robot import mujoco_module
from haptic_teleop_sysid.commands.export_reference import Array, Fits, Reference, responses
from haptic_teleop_sysid.simulation.fit import fit_percent

LONGEST_RUN = 20.0
"""s that a file is simulated for where it is to go."""


def costs(model: Model, exported: Exported, reference: Reference) -> dict[str, Any]:
    """Return `fit` of the model and of what the file carries, and for each effect, and for the structure
    where the file changes it, `cost`: points of fit, by signal, that are lost by that alone."""
    whole = reference.fit(model)
    same = all(s.instead == (s.effect,) for s in exported.sayings) and not exported.structure
    result: dict[str, Any] = {
        "fit": {"model": whole, "as_exported": whole if same else reference.fit(exported.carried)},
        "effects": [_row(model, saying, whole, reference) for saying in exported.sayings],
        "structure": None,
    }
    if exported.rigid is not None:
        lost = _lost(whole, reference.fit(exported.rigid))
        result["structure"] = {"how": "approximated", "note": exported.structure, "cost": lost}
    return result


def _row(model: Model, saying: Saying, whole: Fits, reference: Reference) -> dict[str, Any]:
    row: dict[str, Any] = {
        "effect": saying.effect.effect,
        "location": saying.effect.location,
        "parameters": saying.effect.values,
        "how": saying.how,
        "note": saying.note,
        "instead": [] if saying.how == "expressed" else [_plain(e) for e in saying.instead],
        "cost": None,
    }
    if saying.how == "expressed":
        return row
    if saying.effect.entry.exogenous and reference.exogenous is None:
        row["why_no_cost"] = "what the other arm does is not known here: give a --bag in which it moves"
    elif saying.instead == (saying.effect,):
        row["why_no_cost"] = "it cannot be simulated here as it is there"
    else:
        row["cost"] = _lost(whole, reference.fit(replaced(model, [saying])))
    return row


def _plain(effect: Effect) -> dict[str, Any]:
    return {"effect": effect.effect, "location": effect.location, "parameters": dict(effect.parameters)}


def _lost(whole: Fits, without: Fits) -> Fits:
    return {signal: whole[signal] - without[signal] for signal in whole if signal in without}


def simulated_there(model: Model, exported: Exported, target: str, reference: Reference) -> dict[str, Any]:
    """Return how the file responds where it is to go, from rest, to the reference's input (its first
    LONGEST_RUN seconds): `fit` and `rms` of its signals against what the file is meant to carry and against
    the model, both simulated here; or `why_not`."""
    input_ = reference.input[: max(2, round(LONGEST_RUN / reference.dt))]
    try:
        engine, found = _run(model, exported, target, input_, reference.dt)
    except HapticTeleopError as error:
        return {"why_not": str(error)}
    against = {"as_exported": exported.carried, "model": model}
    result: dict[str, Any] = {"engine": engine, "seconds": len(input_) * reference.dt}
    for name, other in against.items():
        ours = responses(other, input_, reference.dt)
        pairs = {_signal(model, s): (y, found[s]) for s, y in ours.items() if s in found}
        result[name] = {
            "fit": {s: fit_percent(y, y_hat) for s, (y, y_hat) in pairs.items()},
            "rms": {s: float(np.sqrt(np.mean((y - y_hat) ** 2))) for s, (y, y_hat) in pairs.items()},
        }
    return result


def _signal(model: Model, name: str) -> str:
    place, _, what = name.partition("_")
    return f"{model.joint}_{place}.{what}"


def _run(
    model: Model, exported: Exported, target: str, input_: Array, dt: float
) -> tuple[str, dict[str, Array]]:
    if target == "python":
        space: dict[str, Any] = {}
        exec(compile(exported.text, "exported model", "exec"), space)  # written a moment ago, by this project
        return f"NumPy {np.__version__}", space["simulate"](input_, dt)
    engine = f"MuJoCo {mujoco_module().__version__}"
    found = run_in_mujoco(exported.text, model.joint, input_, dt, gain_before(model, None))
    if target == "urdf" and not model.rigid:
        found |= {f"arm_{what}": found[f"motor_{what}"] for what in ("position", "velocity")}
    return engine, found
