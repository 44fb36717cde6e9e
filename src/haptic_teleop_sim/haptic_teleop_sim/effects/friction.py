"""Friction: torques that oppose the motion, and what changes them."""

from __future__ import annotations

from .entry import EffectEntry
from .friction_forms import (
    by_exponential,
    by_gauss,
    differs,
    falling,
    falls,
    gives,
    giving,
    grows,
    hardly_sliding,
    rippled,
    sided,
    varies,
)
from .hypothesis import Refinement, drifts, noticeable
from .parameter import CONTACT, EffectParameter

#: All forms of dry friction: one at a place.
_DRY = ("dry friction",)


def _rate(torque: float, p: dict[str, float]) -> tuple[float, float]:
    """Stiffness of the sticking contact, or the slope of the smoothed sign."""
    if p["smoothing"] > 0.0:
        return 0.0, abs(torque) / p["smoothing"]
    return abs(torque) / p["contact_angle"], 0.0


def _torque(name: str, meaning: str, typical: float = 0.2) -> EffectParameter:
    return EffectParameter(name, "N*m", meaning, minimum=0.0, typical=typical, scale="torque")


COULOMB = EffectEntry(
    name="coulomb_friction",
    kind="friction",
    where=("motor", "arm"),
    parameters=(_torque("torque", "friction torque while sliding"), *CONTACT),
    sentence="a dry friction torque of constant size opposes the motion",
    equation=lambda s, p: -p.torque * s.direction,
    rate=lambda p, ks: _rate(p["torque"], p),
    memory="direction",
    condition="sign of {v}",
    separated=(
        ("stribeck_friction", "move three times as far and through zero very slowly"),
        ("asymmetric_friction", "hold constant speeds in both directions"),
        ("presliding_friction", "move below breakaway first, then slide"),
    ),
    practical=noticeable("torque"),
    families=_DRY,
    jumps="torque",
    large=True,
)

STRIBECK = EffectEntry(
    name="stribeck_friction",
    kind="friction",
    where=("motor", "arm"),
    parameters=(
        _torque("coulomb", "friction torque at speed (Fc of equation 22)", 0.15),
        _torque("breakaway", "friction torque where sliding starts (Fc + Fcs)", 0.3),
        EffectParameter(
            "velocity",
            "rad/s",
            "velocity over which friction falls (1/alpha)",
            minimum=1e-4,
            typical=0.2,
            scale="velocity",
            grid=(0.05, 0.2, 0.6),
            neutral=None,
        ),
        *CONTACT,
    ),
    sentence="dry friction is largest where the motion starts and falls with speed (equation 22)",
    equation=lambda s, p: (
        -(p.coulomb + (p.breakaway - p.coulomb) * s.sech(s.velocity / p.velocity)) * s.direction
    ),
    rate=lambda p, ks: _rate(max(p["breakaway"], p["coulomb"]), p),
    memory="direction",
    condition="{v} near reversal",
    practical=falls,
    families=_DRY,
    ordered=(("coulomb", "breakaway", "this friction falls with speed"),),
    refinement=Refinement("coulomb_friction", falling),
    other_forms=(by_gauss, by_exponential),
    large=True,
)

ASYMMETRIC = EffectEntry(
    name="asymmetric_friction",
    kind="friction",
    where=("motor", "arm"),
    parameters=(
        _torque("positive", "friction torque while moving in the positive direction"),
        _torque("negative", "friction torque while moving in the negative direction", 0.1),
        *CONTACT,
    ),
    sentence="dry friction differs between the two directions of motion",
    equation=lambda s, p: (
        -((p.positive + p.negative) * s.direction + (p.positive - p.negative) * s.direction**2) / 2
    ),
    rate=lambda p, ks: _rate(2 * max(p["positive"], p["negative"]), p),
    memory="direction",
    condition="direction of {v}",
    practical=differs,
    families=_DRY,
    refinement=Refinement("coulomb_friction", sided),
)

PRESLIDING = EffectEntry(
    name="presliding_friction",
    kind="friction",
    where=("motor", "arm"),
    parameters=(
        _torque("torque", "friction torque while sliding"),
        EffectParameter(
            "stiffness",
            "N*m/rad",
            "stiffness of the contact before it slides",
            minimum=1e-9,
            typical=3.0,
            # A hundredth of the torque over a hundredth to a sixth of the angle that was reached.
            scale="torque_per_angle",
            grid=(1.0, 0.25, 0.06),
            neutral=None,
        ),
    ),
    sentence="friction builds up over a small elastic displacement before the contact slides (Dahl)",
    equation=lambda s, p: -p.torque * s.direction,
    rate=lambda p, ks: (abs(p["stiffness"]), 0.0),
    memory="ratio",
    condition="displacement since the last reversal",
    practical=gives,
    families=_DRY,
    refinement=Refinement("coulomb_friction", giving),
    begun_from=Refinement("spring_to_ground", hardly_sliding),
    large=True,
)

QUADRATIC_DRAG = EffectEntry(
    name="quadratic_drag",
    kind="friction",
    where=("motor", "arm"),
    parameters=(
        EffectParameter(
            "coefficient",
            "N*m*s^2/rad^2",
            "torque per squared velocity",
            minimum=0.0,
            typical=0.2,
            scale="drag",
        ),
    ),
    sentence="a drag that grows with the square of the speed opposes the motion",
    equation=lambda s, p: -p.coefficient * s.velocity * s.abs(s.velocity),
    steepness=(lambda s, p: 0, lambda s, p: 2 * s.abs(p.coefficient * s.velocity)),
    condition="{v} squared",
    separated=(("coulomb_friction", "drive at three times the speed"),),
    large=True,
)

POSITION_DEPENDENT = EffectEntry(
    name="position_dependent_friction",
    kind="friction",
    where=("motor", "arm"),
    parameters=(
        EffectParameter(
            "torque",
            "N*m",
            "mean friction torque",
            minimum=0.0,
            typical=0.2,
            scale="torque",
            steady=True,
        ),
        EffectParameter(
            "amplitude",
            "N*m",
            "how far friction varies about its mean",
            minimum=0.0,
            typical=0.15,
            scale="torque",
        ),
        EffectParameter(
            "order",
            "cycles/rev",
            "cycles per revolution",
            minimum=0.1,
            maximum=500.0,
            typical=3.0,
            grid=(1, 2, 3, 4, 5, 6, 8, 10, 12, 16, 20),
            neutral=None,
            scan="order",
        ),
        EffectParameter(
            "phase", "rad", "phase at zero angle", typical=0.5, neutral=None, default=0.0, turns="phase"
        ),
        *CONTACT,
    ),
    sentence="dry friction varies with the angle",
    equation=lambda s, p: -(p.torque + p.amplitude * s.sin(p.order * s.position + p.phase)) * s.direction,
    rate=lambda p, ks: _rate(p["torque"] + p["amplitude"], p),
    memory="direction",
    condition="{q} while moving",
    follows="angle",
    practical=varies,
    families=_DRY,
    ordered=(("amplitude", "torque", "friction never pushes"),),
    refinement=Refinement("coulomb_friction", rippled),
)

DRIFT = EffectEntry(
    name="friction_drift",
    kind="friction_factor",
    where=("motor", "arm"),
    parameters=(
        EffectParameter(
            "change",
            "of the friction",
            "relative change of all friction there, in the end",
            minimum=-1.0,
            maximum=20.0,
            typical=0.4,
            grid=(-0.6, 1.0),
        ),
        EffectParameter(
            "time_constant",
            "s",
            "time over which it changes",
            minimum=0.05,
            typical=0.3,
            scale="duration",
            grid=(0.1, 0.4, 1.5),
            neutral=None,
        ),
    ),
    sentence="friction changes in the course of the recording, as a drive does that warms up",
    equation=lambda s, p: 1 + p.change * (1 - s.exp(-s.time / p.time_constant)),
    condition="time",
    follows="time",
    practical=drifts,
)

LOAD_DEPENDENT = EffectEntry(
    name="load_dependent_friction",
    kind="friction",
    where=("motor",),
    parameters=(
        EffectParameter(
            "coefficient",
            "of the joint torque",
            "friction torque per transmitted joint torque",
            minimum=0.0,
            maximum=100.0,
            typical=0.15,
        ),
        *CONTACT,
    ),
    sentence="friction grows with the torque that the transmission carries",
    equation=lambda s, p: -p.coefficient * s.abs(s.stiffness * s.deflection) * s.direction,
    # Of the sticking contact of a joint that is deflected by up to 0.2 rad.
    rate=lambda p, ks: _rate(0.2 * p["coefficient"] * ks, p),
    memory="direction",
    rigid_body=False,
    condition="joint torque while moving",
    practical=grows,
    large=True,
)

ENTRIES = (
    COULOMB,
    STRIBECK,
    ASYMMETRIC,
    PRESLIDING,
    QUADRATIC_DRAG,
    POSITION_DEPENDENT,
    DRIFT,
    LOAD_DEPENDENT,
)
