"""How quickly a current may come: the slew limit, and the ramp after each start and reset."""

import numpy as np
import pytest
from device_rigs import SfjRig

from haptic_teleop_2dsfj.settings import SfjDriverSettings

PUSH = (2.0, 0.4)  # N·m
STEP = 20.0 / 4096 * 0.5  # A per step of a 12-bit output over ±10 V at 0.5 A/V
RAMP, CAREFUL = 0.2, 0.1  # s; A, where the thesis (3.1.1) begins to ask for care


def test_as_shipped_no_sample_changes_the_current_by_more_than_the_thesis_calls_careful():
    defaults = SfjDriverSettings().stages
    rig = SfjRig(stage1__current_slew=defaults[0].current_slew, stage2__current_slew=defaults[1].current_slew)
    for sample in range(200):  # to and fro at every sample, then at every tenth
        sign = (-1.0) ** (sample if sample < 100 else sample // 10)
        rig.cycle((sign * 50.0, sign * 50.0))
    currents = np.abs(np.diff([(0.0, 0.0), *rig.plant.given], axis=0))
    assert currents.max() <= CAREFUL + STEP
    assert currents.max() > CAREFUL - STEP, "and it may change by so much"
    assert np.abs(rig.plant.given[:100]).max() <= CAREFUL + STEP


def ramp(rig: SfjRig, samples: int) -> np.ndarray:
    """Current of stage 1 in each sample from now on, with PUSH."""
    begun = len(rig.plant.given)
    rig.run(samples, PUSH)
    return np.array([given[0] for given in rig.plant.given[begun:]])


def follows_the_ramp(currents: np.ndarray) -> bool:
    whole = PUSH[0] / 8.925
    expected = whole * np.minimum(1.0, np.arange(len(currents)) * 0.002 / RAMP)
    return bool(np.abs(currents - expected).max() <= STEP) and currents[-1] > whole - STEP


@pytest.mark.parametrize("fault", ["watchdog_expired", "limit_switch", "board_error", "stale_command"])
def test_after_a_fault_and_its_reset_the_effort_ramps_in_from_zero(fault):
    rig = SfjRig(ramp_time=RAMP)
    rig.run(150, PUSH)
    if fault == "watchdog_expired":
        rig.clock.advance(0.1)
    elif fault == "limit_switch":
        rig.hil.stuck[1] = 0  # the other way is free
    elif fault == "board_error":
        rig.hil.unplug()
    else:
        rig.latch.count(fault)
    rig.run(3, PUSH)
    assert rig.latch.latched == fault
    if fault == "board_error":
        rig.hil.plug()
    rig.reset()
    rig.cycle(PUSH)
    assert follows_the_ramp(np.array([0.0, *ramp(rig, 130)]))
    assert rig.latch.latched is None


def test_a_fault_that_is_reset_before_the_next_sample_ramps_in_as_well():
    rig = SfjRig(ramp_time=RAMP)
    rig.run(150, PUSH)
    rig.latch.count("stale_command")
    rig.reset()
    rig.cycle(PUSH)
    assert follows_the_ramp(np.array([0.0, *ramp(rig, 130)]))


def test_as_shipped_the_first_command_ramps_in_and_a_late_loop_does_not_make_it_longer():
    assert SfjDriverSettings().ramp_time == RAMP
    rig = SfjRig(ramp_time=RAMP, board__watchdog=0.2)
    rig.run(5)
    rig.cycle(PUSH)
    rig.clock.advance(0.1)
    currents = ramp(rig, 80)
    assert currents.max() == pytest.approx(PUSH[0] / 8.925, abs=STEP)
