"""Does an effect do what its kind can do at all?  Friction takes energy, wherever the joint is and however it
moves; a fit may give it sizes with which it would drive."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from haptic_teleop_sim.effects.on_arrays import NUMERIC
from haptic_teleop_sim.model import Effect

from ..inputs.scales import Scales

#: Share of the power, over all places and velocities of the recordings, with which friction may drive: an
#: amplitude that is a fifth too large for its mean.
DRIVES = 0.03
_PLACES, _VELOCITIES = 400, (-1.0, -0.3, 0.3, 1.0)


def friction_drives(effect: Effect, scales: Scales) -> bool:
    """Whether a friction of these sizes drives the joint somewhere on its way; False for what is no
    friction."""
    equation = effect.entry.equation
    if effect.entry.kind != "friction" or equation is None or effect.entry.rates:
        return False
    channel = 1 if effect.location.endswith("_arm") else 0
    places = np.linspace(scales.lowest[channel], scales.highest[channel], _PLACES)
    position, share = (a.ravel() for a in np.meshgrid(places, _VELOCITIES))
    velocity = share * scales.size["velocity"]
    variables = SimpleNamespace(
        position=position,
        velocity=velocity,
        deflection=np.full_like(position, scales.size["deflection"]),
        stiffness=scales.size["stiffness"],
        time=np.zeros_like(position),
        exogenous=np.zeros_like(position),
        direction=np.sign(velocity),
        **NUMERIC,
    )
    power = np.asarray(equation(variables, SimpleNamespace(**effect.values)), dtype=float) * velocity
    whole = float(np.sum(np.abs(power)))
    return whole > 0.0 and float(np.sum(np.maximum(power, 0.0))) > DRIVES * whole
