"""Physics beyond the table of effects, kept as rivals to what has a name.

A name is only as good as what it was compared with.  Where one of these explains recordings clearly better
than every named effect, the diagnosis says `unknown` and describes it, instead of giving the name that comes
nearest.
"""

from __future__ import annotations

from .entry import EffectEntry
from .parameter import EffectParameter

STEEP_DRAG = EffectEntry(
    name="steep_drag",
    kind="friction",
    where=("motor", "arm"),
    parameters=(
        EffectParameter(
            "coefficient",
            "N*m*s^3/rad^3",
            "torque per cubed velocity",
            minimum=0.0,
            typical=0.2,
            scale="steep",
        ),
    ),
    sentence="a drag that grows faster than the square of the speed opposes the motion",
    equation=lambda s, p: -p.coefficient * s.velocity**3,
    steepness=(lambda s, p: 0, lambda s, p: 3 * s.abs(p.coefficient) * s.velocity**2),
    unnamed=True,
    condition="{v} cubed",
)

VISCOUS_RIPPLE = EffectEntry(
    name="viscous_ripple",
    kind="friction",
    where=("motor", "arm"),
    parameters=(
        EffectParameter(
            "amplitude",
            "N*m*s/rad",
            "how far viscous friction varies about its mean",
            minimum=0.0,
            typical=0.3,
            scale="damping",
        ),
        EffectParameter(
            "order",
            "cycles/rev",
            "cycles per revolution",
            minimum=0.1,
            maximum=500.0,
            typical=3.0,
            grid=(1, 2, 4, 8, 16),
            neutral=None,
            scan="order",
        ),
        EffectParameter(
            "phase", "rad", "phase at zero angle", typical=0.5, neutral=None, default=0.0, turns="phase"
        ),
    ),
    sentence="viscous friction varies with the angle",
    equation=lambda s, p: -p.amplitude * s.sin(p.order * s.position + p.phase) * s.velocity,
    rate=lambda p, ks: (0.0, abs(p["amplitude"])),
    unnamed=True,
    condition="{v} and {q}",
)

CREEP = EffectEntry(
    name="creep",
    kind="torque",
    where=("joint",),
    parameters=(
        EffectParameter(
            "stiffness", "N*m/rad", "stiffness that gives way", minimum=0.0, typical=0.2, scale="stiffness"
        ),
        EffectParameter(
            "time_constant",
            "s",
            "time in which it gives way",
            minimum=0.01,
            # What gives way more slowly is a stiffer spring to a recording of half a minute.
            maximum=4.0,
            typical=0.3,
            neutral=None,
            grid=(0.05, 0.2, 0.8, 3.0),
        ),
    ),
    sentence="part of the joint's spring gives way with time (a Maxwell element)",
    # state0: the deflection that the dashpot has taken up.
    equation=lambda s, p: p.stiffness * (s.deflection - s.state0),
    rates=(lambda s, p: (s.deflection - s.state0) / p.time_constant,),
    rate=lambda p, ks: (abs(p["stiffness"]), 0.0, 1.0 / p["time_constant"]),
    rigid_body=False,
    unnamed=True,
    condition="deflection and how long it lasts",
)

DETENT = EffectEntry(
    name="detent",
    kind="torque",
    where=("motor", "arm"),
    momentary=True,
    parameters=(
        EffectParameter(
            "torque", "N*m", "largest torque on either side (negative: away)", typical=0.1, scale="torque"
        ),
        EffectParameter(
            "angle",
            "rad",
            "where it is",
            typical=0.5,
            scale="furthest",
            neutral=None,
            grid=(0.1, 0.5),
            scan="within",
        ),
        EffectParameter(
            "width",
            "rad",
            "distance of the largest torque from there",
            minimum=1e-6,
            maximum=0.5,
            typical=0.05,
            scale="angle",
            neutral=None,
            grid=(0.05,),
            held=0.05,
        ),
    ),
    sentence="a torque pulls towards (or away from) one angle from nearby",
    equation=lambda s, p: (
        -p.torque
        * (s.position - p.angle)
        / p.width
        * s.exp(0.5 - 0.5 * ((s.position - p.angle) / p.width) ** 2)
    ),
    rate=lambda p, ks: (2.0 * abs(p["torque"]) / p["width"], 0.0),
    unnamed=True,
    condition="{q} near one place",
    follows="angle",
)

ENTRIES = (STEEP_DRAG, VISCOUS_RIPPLE, CREEP, DETENT)
