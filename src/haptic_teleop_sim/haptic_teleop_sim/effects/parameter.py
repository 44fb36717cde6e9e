"""What an effect's entry says of one of its numbers, and the numbers that all dry friction shares."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

#: Displacement (rad) over which dry friction turns round when the motion does, unless a model says otherwise:
#: so small that it counts as a sticking contact, large enough to integrate. Of a joint that moves by about a
#: radian: a model in other units states its own, and diagnosis takes what fits the recording.
STICTION_ANGLE = 2e-5


@dataclass(frozen=True)
class EffectParameter:
    """One number of an effect.

    ``unit`` is the unit for a rotary joint, and of a ratio what it is a share of ("of the friction"): text,
    page and JSON write it behind the number, which alone would leave open what has changed.

    ``typical`` is the size at which the effect is neither negligible nor absurd, relative to the scales that
    diagnosis measures on a recording (see ``scale``): a torque of 0.2 means 20 % of the rms input torque.
    ``grid`` lists values worth trying as a start when the effect depends on the parameter in a non-convex way
    (an order, a width); where they would have to lie too dense for that, ``scan`` says along which scale
    diagnosis seeks them on a recording; ``hills``: from each of them a fit climbs another hill, so that one
    that knows nothing starts from all.  A parameter with a ``default`` is optional: left out of a model file
    it keeps the default and is not estimated.

    ``turns``: where an optional parameter is sought from the beginning, because the effect's size says
    little without it: a ``phase`` turns sine into cosine, an ``offset`` shifts the angle. ``numerical``: it
    is of the arithmetic and no property of the machine, and held in later estimations. ``told``: when a
    report speaks of it. ``in_current``: a measured current behind the effect shows it; says where to begin:
    at shares of the ``peak`` or of the ``rms`` of the command, or at a ``time`` in samples. While another
    parameter is scanned it is held at ``held`` of the travel; what is ``steady`` is the same at every value
    of that, and says nothing of it. ``smeared``: over how much of it, as a standard deviation in its unit,
    the equation smears what a machine may do at once: nobody knows the value better. ``form``: share by which
    a size is off (standard deviation) because a machine's law is never quite the equation; where nothing
    else is known as measured on three seeds of the blind benchmark, whose generator has another form for
    everything: 91 to 94 % of the 90 % intervals hold the truth with it, 93 to 97 % with twice as much.
    """

    name: str
    unit: str
    meaning: str
    minimum: float = -math.inf
    maximum: float = math.inf
    typical: float = 0.1
    scale: Literal[
        "torque",
        "peak",
        "angle",
        "deflection",
        "velocity",
        "stiffness",
        "torque_per_angle",
        "damping",
        "inertia",
        "drag",
        "peak_per_speed",
        "fastest",
        "cubic",
        "steep",
        "duration",
        "furthest",
        "one",
    ] = "one"
    grid: tuple[float, ...] = ()
    default: float | None = None
    neutral: float | None = 0.0
    hills: bool = False
    scan: Literal["", "order", "frequency", "furthest", "within", "delay"] = ""
    turns: Literal["", "phase", "offset"] = ""
    numerical: bool = False
    told: Literal["always", "unless zero", "never"] = "always"
    in_current: Literal["", "peak", "rms", "time"] = ""
    held: float = 0.0
    steady: bool = False
    smeared: float = 0.0
    form: float = 0.015

    def reported(self, value: float) -> bool:
        """Whether a report speaks of the parameter at this value."""
        return self.told == "always" or (self.told == "unless zero" and value != 0.0)

    def within(self, value: float) -> float:
        """The value, or the bound that it is beyond."""
        return min(max(value, self.minimum), self.maximum)


#: What every dry friction may state beside its own parameters: how its contact gives, and a smoothed sign.
CONTACT = (
    EffectParameter(
        "contact_angle",
        "rad",
        "displacement over which the contact gives before it slides",
        minimum=1e-12,
        default=STICTION_ANGLE,
        neutral=None,
        scale="one",
        numerical=True,
        told="never",
    ),
    EffectParameter(
        "smoothing",
        "rad/s",
        "velocity within which the sign of the velocity is smoothed, 1/beta of equation 22; "
        "0: friction that sticks",
        minimum=0.0,
        default=0.0,
        neutral=None,
        scale="velocity",
        numerical=True,
        told="unless zero",
    ),
)
