"""A log that is written more often than the encoder is read, at no steady ratio."""

from dataclasses import replace

import numpy as np
import pytest
from stepped_machines import RIGID, pendulum

from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.group_search import search_groups
from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.motion import banded
from haptic_teleop_sysid.diagnosis.evidence.measured_map import measured_map
from haptic_teleop_sysid.diagnosis.evidence.reading_error import reading_error
from haptic_teleop_sysid.diagnosis.inputs.scales import recording_scales
from haptic_teleop_sysid.estimation.records import Record
from haptic_teleop_sysid.estimation.whole_fit import fit_from_scratch

EVERY = 6


def slowly(one: Record) -> Record:
    """Every sixth sample: a motion that is fast for its log."""
    thin = slice(None, len(one) // EVERY * EVERY, EVERY)
    held = one.input[: len(one) // EVERY * EVERY].reshape(-1, EVERY).mean(axis=1)
    return replace(
        one, input=held, measured=one.measured[thin], exogenous=one.exogenous[thin], dt=EVERY * one.dt
    )


def seldom(one: Record, seed: int, least: int, most: int) -> Record:
    """The record with a reading at every ``least`` to ``most`` samples alone."""
    steps = np.random.default_rng(seed).integers(least, most + 1, len(one))
    at = np.cumsum(steps)
    measured = np.full_like(one.measured, np.nan)
    at = at[at < len(one)]
    measured[at] = one.measured[at]
    return replace(one, measured=measured)


def test_friction_is_found_where_readings_stand_alone():
    recordings = [slowly(pendulum(seed, coulomb=0.3)) for seed in (0, 1)]
    few = [seldom(one, seed, 2, 4) for seed, one in enumerate(recordings)]
    found = search_groups(RIGID, few[:1], few[1:], recording_scales(RIGID, few[:1]))
    (effect,) = found.levels[0][0].effects
    assert effect.effect == "coulomb_friction"
    assert effect.parameters["torque"] == pytest.approx(0.3, rel=0.15)


def test_where_no_sample_counts_no_map_is_drawn():
    recordings = [seldom(slowly(pendulum(seed, coulomb=0.3)), seed, 8, 12) for seed in (0, 1)]
    cutoff = 0.1 / recordings[0].dt  # as if each sample had a reading
    assert not len(banded(recordings[0], True, cutoff).kept)
    fit = fit_from_scratch(RIGID, recordings[:1])
    kinds = recordings[:1], recordings[1:]
    found = measured_map(fit, RIGID, *kinds, lambda model: (1.0, 1.0), cutoff=cutoff)
    assert "cannot be computed" in found.why
    assert reading_error(RIGID, [], *kinds, cutoff) is None
