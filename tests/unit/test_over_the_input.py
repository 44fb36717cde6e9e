"""A function of the input alone is an actuator's, in a closed loop, too; one of the motion is none. Rigid
joints that are stepped here."""

import numpy as np
import pytest
from stepped_machines import DT, RIGID, record

from haptic_teleop_sysid.diagnosis.evidence.over_the_input import over_the_input

FINE, SECONDS, CUTOFF = 10, 16.0, 6.0


def moved(seed, torque, resists=lambda v: 0.0, closed=True):
    """A joint of 0.14 kg·m² and 0.35 N·m·s/rad that is driven by ``torque`` (of the input, N·m), while
    something resists: in a loop around its angle, or by a sum of sines."""
    luck, n = np.random.default_rng(seed), round(SECONDS / DT)
    t = DT * np.arange(n)
    waves = [np.sin(2 * np.pi * f * t + luck.uniform(0, 6.3)) for f in luck.uniform(0.1, 1.5, 8)]
    wanted = np.sum(waves, axis=0) / np.sqrt(8)
    q = v = 0.0
    angles, inputs = np.empty(n), np.empty(n)
    for k in range(n):
        angles[k] = q
        inputs[k] = 14.0 * (0.5 * wanted[k] - q) - 1.5 * v if closed else 2.0 * wanted[k]
        push = torque(inputs[k]) + 0.01 * luck.standard_normal()
        for _ in range(FINE):
            v += DT / FINE * (push - 0.35 * v - resists(v)) / 0.14
            q += DT / FINE * v
    return record(inputs, angles[:, None], 1e-6)


def asked(*how, **more):
    return over_the_input(RIGID, [], [moved(0, *how, **more)], [moved(1, *how, **more)], CUTOFF)


@pytest.mark.parametrize("closed", [True, False])
@pytest.mark.parametrize(
    "torque",
    [
        lambda u: 0.5 * u * abs(u),
        lambda u: np.sign(u) * np.sqrt(abs(u)),
        lambda u: u + 0.3 * abs(u),
    ],
    ids=["series-wound", "valve", "pushes better than it pulls"],
)
def test_what_an_actuator_makes_of_the_input_alone_is_told(torque, closed):
    assert asked(torque, closed=closed)


@pytest.mark.parametrize("closed", [True, False])
@pytest.mark.parametrize(
    "resists",
    [
        lambda v: 0.0,
        lambda v: 0.3 * v * abs(v),
        lambda v: 0.8 * v * np.exp(-(v**2)),
        lambda v: 0.3 * max(v, 0.0) ** 2,
    ],
    ids=["nothing", "drag", "eddy current", "one way"],
)
def test_what_resists_the_motion_is_not_the_actuator_s(resists, closed):
    assert not asked(lambda u: u, resists, closed=closed)
