"""Models in MuJoCo's own words: what of it expresses which effect at which place of a stage.

Dry friction is a constraint of MuJoCo's solver, a stop a joint limit, backlash the slack of the tendon that
is the spring, a lag the actuator's own; delay, dead zone and payload happen before and beside the engine. No
formula of this project's kernel takes part.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

from haptic_teleop_control.errors import ModelError

from .model import Effect, Model
from .mujoco_xml import GRAVITY, Attributes, inertial, number, tag

#: Impedance of joint limits: the smaller, the nearer a limit is to a spring that adds to other torques.
_IMPEDANCE = 0.02
#: rad of penetration at which a stop's dissipation gives the damping that MuJoCo's limits have throughout.
_TYPICAL_PENETRATION = 0.004
#: Share of the arm's inertia that comes from its mass being off the axis, where gravity is to pull.
_OFF_AXIS = 0.3


@dataclass
class StageWords:
    """One stage as MJCF attributes, and what no attribute says.

    torque (2,): constant torque at motor and arm, N·m. delay: s. dead: N·m. payload: (time s, inertia kg·m²),
    or None.
    """

    model: Model
    motor: Attributes = field(default_factory=dict)
    arm: Attributes = field(default_factory=dict)
    spring: Attributes = field(default_factory=dict)
    actuator: Attributes = field(default_factory=dict)
    mass: tuple[float, float, float] = (1.0, 0.0, 0.0)  # kg, its distance m, its angle from hanging, rad
    motor_mass: tuple[float, float, float] | None = None  # likewise, where gravity pulls at the motor
    mode: str = ""
    torque: list[float] = field(default_factory=lambda: [0.0, 0.0])
    delay: float = 0.0
    dead: float = 0.0
    payload: tuple[float, float] | None = None

    def side(self, effect: Effect) -> Attributes:
        """Attributes of the hinge that the effect sits at."""
        return self.motor if effect.location.endswith("_motor") else self.arm


def _coulomb(words: StageWords, effect: Effect) -> None:
    words.side(effect)["frictionloss"] = number(effect.values["torque"])


def _drag(words: StageWords, effect: Effect) -> None:
    side = words.side(effect)
    side["damping"] = f"{side['damping']} {number(effect.values['coefficient'])}"


def _ground(words: StageWords, effect: Effect) -> None:
    values = effect.values
    words.side(effect).update(stiffness=number(values["stiffness"]), springref=number(values["rest"]))


def _constant(words: StageWords, effect: Effect) -> None:
    words.torque[0 if effect.location.endswith("_motor") else 1] += effect.values["torque"]


def _gravity(words: StageWords, effect: Effect) -> None:
    values = effect.values
    if values["torque"] > 0.0:
        # m g l is given; m l² takes its share of the inertia that the part is to have about its axis.
        motor = effect.location.endswith("_motor")
        inertia = words.model.parameters["motor_inertia" if motor else "arm_inertia"]
        length = _OFF_AXIS * inertia * GRAVITY / values["torque"]
        mass = (values["torque"] / (GRAVITY * length), length, values["phase"])
        if motor:
            words.motor_mass = mass
        else:
            words.mass = mass


def _stop(words: StageWords, effect: Effect) -> None:
    values, motor = effect.values, effect.location.endswith("_motor")
    inertia = words.model.parameters["motor_inertia" if motor else "arm_inertia"]
    low, high = -1e3, 1e3
    if values["angle"] > 0.0 or values["both_sides"] > 0.5:
        high = abs(values["angle"])
    if values["angle"] <= 0.0 or values["both_sides"] > 0.5:
        low = -abs(values["angle"])
    # In contact MuJoCo gives (1 - d) a0 - b v - k r: at rest that is a spring of k inertia / (1 - d).
    stiffness = (1.0 - _IMPEDANCE) * values["stiffness"] / inertia
    damping = values["dissipation"] * values["stiffness"] * _TYPICAL_PENETRATION / inertia
    words.side(effect).update(
        limited="true",
        range=f"{number(low)} {number(high)}",
        solreflimit=f"{number(-stiffness)} {number(-max(damping, 1e-9))}",
        solimplimit=f"{_IMPEDANCE} {_IMPEDANCE} 0.001",
    )


def _backlash(words: StageWords, effect: Effect) -> None:
    half = 0.5 * effect.values["width"]
    words.spring["springlength"] = f"{number(-half)} {number(half)}"


def _hardening(words: StageWords, effect: Effect) -> None:
    words.spring["stiffness"] += f" 0 {number(effect.values['cubic'])}"


def _joint_damping(words: StageWords, effect: Effect) -> None:
    words.spring["damping"] = number(effect.values["coefficient"])


def _mode(words: StageWords, effect: Effect) -> None:
    values = effect.values
    rate = 2.0 * math.pi * values["frequency"]
    stiffness, damping = values["inertia"] * rate**2, 2.0 * values["damping_ratio"] * rate * values["inertia"]
    hinge = {"axis": "0 1 0", "stiffness": number(stiffness), "damping": number(damping)}
    words.mode = f"<body>{tag('joint', hinge)}{inertial(values['inertia'])}</body>"


def _lag(words: StageWords, effect: Effect) -> None:
    words.actuator.update(dyntype="filterexact", dynprm=number(max(effect.values["time_constant"], 1e-6)))


def _saturation(words: StageWords, effect: Effect) -> None:
    limit = number(effect.values["limit"])
    words.actuator.update(forcelimited="true", forcerange=f"-{limit} {limit}")


def _delay(words: StageWords, effect: Effect) -> None:
    words.delay = effect.values["delay"]


def _dead_zone(words: StageWords, effect: Effect) -> None:
    words.dead = effect.values["width"]


def _payload(words: StageWords, effect: Effect) -> None:
    words.payload = (effect.values["time"], effect.values["inertia"])


_SAID: dict[tuple[str, str], Callable[[StageWords, Effect], None]] = {
    ("coulomb_friction", "motor"): _coulomb,
    ("coulomb_friction", "arm"): _coulomb,
    ("quadratic_drag", "motor"): _drag,
    ("quadratic_drag", "arm"): _drag,
    ("spring_to_ground", "motor"): _ground,
    ("spring_to_ground", "arm"): _ground,
    ("constant_torque", "motor"): _constant,
    ("constant_torque", "arm"): _constant,
    ("gravity", "arm"): _gravity,
    ("hard_stop", "motor"): _stop,
    ("hard_stop", "arm"): _stop,
    ("backlash", "joint"): _backlash,
    ("hardening_spring", "joint"): _hardening,
    ("joint_damping", "joint"): _joint_damping,
    ("extra_flexible_mode", "arm"): _mode,
    ("actuator_lag", "actuator"): _lag,
    ("torque_saturation", "actuator"): _saturation,
    ("input_delay", "actuator"): _delay,
    ("dead_zone", "actuator"): _dead_zone,
    ("payload_change", "arm"): _payload,
}


def has_words(effect: str, place: str) -> bool:
    """Whether MuJoCo can express the effect at this place, e.g. ("backlash", "joint")."""
    return (effect, place) in _SAID


def unexpressed(model: Model) -> list[Effect]:
    """The model's effects that MuJoCo has no words for; empty when it can be built."""
    return [
        e
        for e in model.effects
        if not has_words(e.effect, model.place(e.location)) or e.values.get("smoothing", 0.0) > 0.0
    ]


def stage_words(model: Model) -> StageWords:
    """A flexible joint in MuJoCo's words. Raises ModelError for another structure or an unknown effect."""
    if model.rigid:
        raise ModelError(f"{model.source}: MuJoCo's 2DSFJ needs structure flexible_joint; give such a model.")
    if lacking := unexpressed(model):
        named = ", ".join(f"{e.effect} at {e.location}" for e in lacking)
        raise ModelError(f"{model.source}: MuJoCo has no words for {named}; use sfj_sim for this model.")
    words = plain_words(model)
    for effect in model.effects:
        say(words, effect)
    return words


def plain_words(model: Model) -> StageWords:
    """The structure alone, without its effects; a rigid body has neither arm nor spring."""
    p = model.parameters
    words = StageWords(model)
    words.motor["damping"] = number(p["motor_damping"])
    if not model.rigid:
        words.arm["damping"] = number(p["arm_damping"])
        words.spring["stiffness"], words.spring["springlength"] = number(p["stiffness"]), "0"
    return words


def say(words: StageWords, effect: Effect) -> None:
    """Add one effect; KeyError for one without words. Gravity may pull at the motor, too."""
    place = words.model.place(effect.location)
    _SAID[effect.effect, "arm" if effect.effect == "gravity" else place](words, effect)
