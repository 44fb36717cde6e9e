"""How far a size is off because a machine's law is not quite the effect's equation."""

import math

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from haptic_teleop_sim.effects import effect_entry


@pytest.mark.parametrize("exponent", [1.0, 1.5, 2.0])
@pytest.mark.parametrize("travel", [4.0, 10.0])
def test_the_torque_of_a_hysteresis_is_as_far_off_as_its_entry_says(exponent, travel):
    """Loops after Bouc and Wen, in whose law the knee is sharper: the fitted torque is too large."""
    way = travel * np.sin(np.linspace(0.0, 4.0 * math.pi, 4000))  # of the yield deflection

    def bouc_wen(way):
        z = [0.0]
        for d in np.diff(way):
            wear = abs(z[-1]) ** exponent if d * z[-1] > 0.0 else 0.0
            z.append(z[-1] + d * (1.0 - wear))
        return np.array(z)

    def fitted(logarithm):
        z = [0.0]
        for d in np.diff(way):
            z.append(np.sign(d) + (z[-1] - np.sign(d)) * math.exp(-abs(d) / math.exp(logarithm)))
        columns = np.column_stack([z, way])  # the spring beside it is fitted, too
        return columns, np.linalg.lstsq(columns, loop, rcond=None)[0]

    def left(logarithm):
        columns, sizes = fitted(logarithm)
        return float(np.sum((loop - columns @ sizes) ** 2))

    loop = bouc_wen(way)
    best = minimize_scalar(left, bounds=(-2.0, 1.0), method="bounded")
    torque = fitted(best.x)[1][0]
    form = effect_entry("hysteresis").parameter("torque").form
    assert effect_entry("gravity").parameter("torque").form < form
    assert 0.0 < torque - 1.0 < 2.0 * form
