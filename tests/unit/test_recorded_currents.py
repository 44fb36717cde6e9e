"""What currents leave of a command and of what an effect makes of it, against plain least squares."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from haptic_teleop_sysid.diagnosis.evidence.recorded_currents import _errors


def left(given_, sensed):
    columns = np.column_stack([given_, np.ones(len(given_))])
    return sensed - columns @ np.linalg.lstsq(columns, sensed, rcond=None)[0]


@given(seed=st.integers(0, 10_000), spikes=st.integers(1, 5))
def test_the_samples_that_speak_most_for_an_effect_do_not_count(seed, spikes):
    draw = np.random.default_rng(seed)
    command = draw.normal(size=300)
    expected = np.roll(command, 1)
    sensed = 0.9 * expected + 0.2 + 0.05 * draw.normal(size=300)
    sensed[draw.integers(0, 300, 4)] += 3.0
    gains = left(command, sensed) ** 2 - left(expected, sensed) ** 2
    rest = np.argsort(gains)[:-spikes]
    wanted = [np.mean(left(one[rest], sensed[rest]) ** 2) for one in (command, expected)]
    assert _errors(command, expected, sensed, spikes) == pytest.approx(wanted, rel=1e-9)


def test_a_command_that_does_not_change_explains_nothing():
    sensed = np.random.default_rng(1).normal(size=100)
    before, after = _errors(np.zeros(100), np.zeros(100), sensed, 3)
    assert before == pytest.approx(after)
    assert before > 0.5
