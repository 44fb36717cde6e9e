"""Elements and numbers of an MJCF text."""

from __future__ import annotations

import math

GRAVITY = 9.81
"""m/s²"""

Attributes = dict[str, str]


def inertial(about_axis: float, mass: float = 1.0, length: float = 0.0, angle: float = 0.0) -> str:
    """An element with moment of inertia `about_axis`, kg·m², whose `mass`, kg, hangs at `length`, m, off the
    axis, `angle`, rad, from straight down."""
    own = number(about_axis - mass * length**2)
    place = f"{number(-length * math.sin(angle))} 0 {number(-length * math.cos(angle))}"
    return tag("inertial", {"pos": place, "mass": number(mass), "diaginertia": f"{own} {own} {own}"})


def tag(name: str, attributes: Attributes) -> str:
    """An element without content."""
    return f"<{name} {xml_words(attributes)}/>"


def xml_words(attributes: Attributes) -> str:
    """Attributes as they stand in an element."""
    return " ".join(f'{name}="{value}"' for name, value in attributes.items())


def number(value: float) -> str:
    """A number with twelve digits."""
    return f"{value + 0.0:.12g}"  # without the sign of a zero
