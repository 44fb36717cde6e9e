"""A robot by seed: parameters that the lab knows only roughly, and one effect of the table of effects that it
does not know of.

Kinds and scales of the effects are those of the blind benchmark; here they end in a model file that a plant
node reads.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_control.robots import STAGES
from haptic_teleop_sim.default_models import sfj_stage_model
from haptic_teleop_sim.kernel import simulate
from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sim.mujoco_effects import has_words, unexpressed
from haptic_teleop_sysid.blind.effects import KINDS, Kind, Scene

Array = NDArray[np.float64]

LEFT_OUT: dict[tuple[str, str], str] = {
    ("hard_stop", "arm"): "the wall of scenario 1 is a stop at the arm already",
    ("inertial_coupling", "arm"): "the other stage rests in an acquisition",
    ("gain_error", "actuator"): "no motion tells it from a common scale of inertias, damping and stiffness",
    ("friction_drift", "arm"): "the arms have next to no friction that could drift",
    ("channel_skew", "motor_encoder"): "a late channel of a running robot is a sensor delay",
    ("channel_skew", "arm_encoder"): "a late channel of a running robot is a sensor delay",
    ("channel_skew", "actuator"): "a running robot reports its current when it has measured it",
}
"""Places of the table of effects that are not drawn, and why."""
LATER = ("angle_dependent_inertia", "torque_speed_limit")
"""Effects that came to the table after the first robots, and the examples of the docs, were drawn."""
#: Sizes, in the blind benchmark's units of an effect, that are plain but not absurd.
SIZES = (1.5, 3.0)
OWN_SIZES = {"torque_saturation": (15.0, 30.0), "hard_stop": (4.0, 10.0), "friction_drift": (1.0, 2.0)}
#: How far the lab's numbers are off; the stiffness was measured.
SPREAD = {"torque_constant": 0.08, "stiffness": 0.0}
COMMON_SPREAD = 0.15
#: Shares of the experiment's limits that the drawn robot may use.
ROOM = 0.75
ATTEMPTS = 8
_DRAW = 4214
"""Keeps these draws apart from others of the same seed."""
_RENAMED = {"deflection": "displacement"}


@dataclass(frozen=True)
class Drawn:
    """models, lab: stage -> what the robot is, and what the lab believes of it; `stage` holds `hidden`.
    scored: the parameters of the hidden effect whose estimates are judged, the first is its size.
    """

    stage: str
    models: Mapping[str, Model]
    lab: Mapping[str, Model]
    scored: tuple[str, ...]

    @property
    def hidden(self) -> Effect:
        """The concealed effect."""
        return self.models[self.stage].effects[0]

    @property
    def in_mujoco(self) -> bool:
        """Whether MuJoCo has words for it."""
        return not unexpressed(self.models[self.stage])

    def label(self, nonce: str, seed: int, plant: str) -> dict[str, Any]:
        """What goes into the envelope, in the layout of the blind benchmark's labels."""
        hidden = self.hidden
        truth = {
            "effect": hidden.effect,
            "location": hidden.location,
            "parameters": dict(hidden.parameters),
            "scored": list(self.scored),
            "detectability": None,
        }
        return {
            "nonce": nonce,
            "seed": seed,
            "plant": plant,
            "kind": "single",
            "stage": self.stage,
            "loop": "open loop current",
            "truth": [truth],
            "sets": [[[hidden.effect, hidden.location]]],
            "truth_parameters": dict(self.models[self.stage].parameters),
            "models": {stage: model.to_mapping() for stage, model in self.models.items()},
        }


def lab_model(stage: str) -> Model:
    """The thesis' model with the lab's numbers: a flexible joint with six parameters and nothing else."""
    return replace(sfj_stage_model(stage), effects=(), source=f"the lab's model of {stage}")


def choices(only_mujoco: bool = False) -> list[tuple[Kind, str]]:
    """All (effect, place) that may be drawn."""
    found = [(kind, part) for kind in KINDS for part in kind.parts if (kind.effect, part) not in LEFT_OUT]
    return [(k, p) for k, p in found if not only_mujoco or has_words(k.effect, p)]


def _chosen(
    rng: np.random.Generator, of_later: np.random.Generator, listed: list[tuple[Kind, str]]
) -> tuple[Kind, str]:
    """One of the listed, all alike; those of LATER by numbers of their own, so that a seed that draws none of
    them draws what it always drew."""
    later = [one for one in listed if one[0].effect in LATER]
    first = [one for one in listed if one not in later]
    chosen = first[int(rng.integers(len(first)))]
    if of_later.random() < len(later) / len(listed):
        return later[int(of_later.integers(len(later)))]
    return chosen


def draw(
    seed: int, inputs: Mapping[str, Array], limits: Mapping[str, Mapping[str, float]], dt: float,
    only_mujoco: bool = False,
) -> Drawn:  # fmt: skip
    """The robot of a seed, the same for the same seed and experiment.

    inputs: stage -> (n,) current of the experiment that it will be sent through, A, samples every dt s.
    limits: stage -> limit.position, limit.velocity, limit.deflection at which that experiment aborts: the
    effect is made smaller until the robot keeps a distance. only_mujoco: draw what MuJoCo has words for.
    """
    rng = np.random.default_rng((seed, _DRAW))
    stage = str(rng.choice(list(STAGES)))
    kind, part = _chosen(rng, np.random.default_rng((seed, _DRAW, 1)), choices(only_mujoco))
    lab = {name: lab_model(name) for name in STAGES}
    models = {name: _off(rng, model) for name, model in lab.items()}
    quiet = simulate(models[stage], inputs[stage], dt).states
    scene = _scene(models[stage], inputs[stage], quiet, part, dt)
    drawn = kind.draw(rng, scene)
    size = rng.uniform(*OWN_SIZES.get(kind.effect, SIZES))
    hidden = _effect(kind, part, drawn, size, scene, stage)
    for _ in range(ATTEMPTS):
        if _within(models[stage].with_effects(hidden), inputs[stage], limits[stage], dt):
            break
        size *= 0.6
        hidden = _effect(kind, part, drawn, size, scene, stage)
    known = hidden.entry.parameter_names
    scored = tuple(name for key in kind.scored if (name := _RENAMED.get(key, key)) in known)
    models[stage] = models[stage].with_effects(hidden)
    return Drawn(stage, models, lab, scored)


def _off(rng: np.random.Generator, model: Model) -> Model:
    """A robot that differs from what the lab believes."""
    spread = {name: SPREAD.get(name, COMMON_SPREAD) for name in model.parameters}
    values = {
        name: float(f"{v * rng.uniform(1 - spread[name], 1 + spread[name]):.6g}")
        for name, v in model.parameters.items()
    }
    return replace(model.with_values(values), fixed=(), source=f"the drawn robot's {model.joint}")


def _effect(
    kind: Kind, part: str, drawn: dict[str, float], size: float, scene: Scene, stage: str
) -> Effect:
    sized = kind.sized(drawn, size, scene)
    bare = Effect(kind.effect, f"{stage}_{part}")
    named = {_RENAMED.get(name, name): float(f"{value:.6g}") for name, value in sized.items()}
    values = {name: value for name, value in named.items() if name in bare.entry.parameter_names}
    if kind.effect == "hard_stop":
        values["dissipation"] = 0.5
    return Effect(kind.effect, bare.location, values)


def _scene(model: Model, current: Array, states: Array, part: str, dt: float) -> Scene:
    """The scales that the effects are drawn by, from the motion without any."""
    p, column = model.parameters, 1 if part.startswith("arm") else 0
    load = p["arm_inertia"] * float(np.std(np.diff(states[:, 3]) / dt))
    return Scene(
        torque_constant=p["torque_constant"],
        stiffness=p["stiffness"],
        arm_inertia=p["arm_inertia"],
        arm_damping=p["arm_damping"],
        torque=load if column else p["torque_constant"] * float(np.std(current)),
        current=float(np.max(np.abs(current))),
        speed=float(np.std(states[:, 2 + column])),
        low=float(states[:, column].min()),
        high=float(states[:, column].max()),
        deflection=float(np.std(states[:, 0] - states[:, 1])),
        load=load,
        duration=len(current) * dt,
    )


def _within(model: Model, current: Array, limits: Mapping[str, float], dt: float) -> bool:
    states = simulate(model, current, dt).states
    reached = {
        "position": np.abs(states[:, 0]),
        "velocity": np.abs(states[:, 2]),
        "deflection": np.abs(states[:, 0] - states[:, 1]),
    }
    # Written so that a motion that is no number is none within limits.
    return all(float(np.max(values)) <= ROOM * limits[name] for name, values in reached.items())
