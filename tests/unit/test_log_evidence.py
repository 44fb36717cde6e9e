"""Does an input drive a joint, or does it brake it? A mass with friction that a controller moves."""

import numpy as np
import pytest

from haptic_teleop_sysid.logs.evidence import brakes

DT, SECONDS = 0.01, 40.0


def held(late=0.0, damping=0.05, seed=0):
    """Input and velocity (n,) of a unit mass that follows steps, by a controller whose torque is late, s."""
    random, n, wait = np.random.default_rng(seed), round(SECONDS / DT), round(late / DT)
    wanted = np.repeat(random.uniform(-1.0, 1.0, n // 200), 200)
    angle, speed, input_, speeds = 0.0, 0.0, np.zeros(n), np.zeros(n)
    for k in range(n):
        input_[k] = 4.0 * (wanted[k] - angle) - 4.0 * speed
        torque = input_[k - wait] if k >= wait else 0.0
        speed += DT * (torque - damping * speed)
        angle += DT * speed
        speeds[k] = speed
    return input_, speeds


@pytest.mark.parametrize("late", [0.0, 0.04, 0.08, 0.12])
@pytest.mark.parametrize("seed", range(3))
def test_a_thrust_that_is_late_does_not_brake(late, seed):
    """A propeller takes time; the controller has braked before it does. (The recorded input takes energy out
    of a joint without friction by that.)"""
    input_, speed = held(late, damping=0.0, seed=seed)
    assert not brakes(input_, speed)
    if late == 0.08:
        assert np.mean(input_ * speed) < -0.1 * np.std(input_) * np.std(speed)


@pytest.mark.parametrize(("spring", "damping"), [(3.0, 0.5), (3.0, 1.0), (10.0, 2.0)])
def test_a_reversed_one_does_at_a_joint_on_a_spring(spring, damping):
    """Slowly moved it follows the spring's torque, which is behind the velocity."""
    time = DT * np.arange(round(SECONDS / DT))
    tones = [(0.2, 0.3), (0.3, 1.1), (0.45, 2.0)]
    angle, speed, acceleration = np.zeros((3, len(time)))
    for frequency, phase in tones:
        wide = 2.0 * np.pi * frequency
        angle += np.sin(wide * time + phase)
        speed += wide * np.cos(wide * time + phase)
        acceleration -= wide**2 * np.sin(wide * time + phase)
    input_ = 0.05 * acceleration + damping * speed + spring * angle
    assert brakes(-input_, speed)
    assert not brakes(input_, speed)


@pytest.mark.parametrize("damping", [1.0, 3.0])
@pytest.mark.parametrize("seed", range(3))
def test_a_reversed_one_does(damping, seed):
    input_, speed = held(damping=damping, seed=seed)
    assert brakes(-input_, speed)
    assert not brakes(input_, speed)
