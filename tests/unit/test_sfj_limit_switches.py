"""The limit switches of the 2DSFJ on an emulated board: hits, what is vetoed after them, broken wiring."""

import numpy as np
import pytest
from device_rigs import SfjRig, StillRobot

from haptic_teleop_2dsfj.limit_switches import LimitSwitches

PUSH = (2.0, 0.4)  # N·m


def off(rig: SfjRig) -> bool:
    return not rig.hil.volts.any() and not any(rig.hil.amplifier_on)


@pytest.mark.parametrize(
    ("switch", "name", "towards"),
    [(0, "STAGE 1: MAX", (2.0, 0)), (1, "STAGE 1: MIN", (-2.0, 0)),
     (2, "STAGE 2: MAX", (0, 0.4)), (3, "STAGE 2: MIN", (0, -0.4))],
)  # fmt: skip
def test_a_limit_switch_stops_at_once_says_which_and_lets_the_arm_only_away(switch, name, towards):
    rig = SfjRig()
    rig.run(3, towards)
    rig.hil.stuck[switch] = 0
    rig.cycle(towards)
    assert rig.latch.latched == "limit_switch"
    assert f"{name} limit switch hit" in rig.latch.sentence
    assert off(rig)
    rig.run(5, towards)
    assert off(rig), "latched"
    rig.reset()
    rig.run(3, towards)
    assert rig.plant.given[-1] == (0.0, 0.0), "still pressed: towards the stop is vetoed"
    rig.run(3, tuple(-value for value in towards))
    assert any(rig.plant.given[-1]), "away from it is allowed"
    assert rig.latch.latched is None


def test_an_arm_at_the_end_of_its_range_presses_its_switch():
    plant = StillRobot()
    rig = SfjRig(plant)
    rig.cycle()
    plant.angles[:2] = 1.4
    rig.cycle()
    plant.angles[:2] = 1.5
    rig.run(2)
    assert rig.driver.switches.hits == [1, 0, 0, 0]


def test_a_bouncing_switch_is_one_hit():
    switches = LimitSwitches(debounce=10)
    switches.start([1, 1, 1, 1])
    levels = [0, 1, 0, 1, 1, 1, 0, 1, 1, 0] + [1] * 9 + [0] + [1] * 10
    reports = [switches.step([level, 1, 1, 1]) for level in levels]
    assert [report for report in reports if report] == [("limit_switch", "STAGE 1: MAX limit switch hit")]
    assert not switches.pressed[0]
    assert switches.step([0, 1, 1, 1]), "released for its time, the next one counts"


def test_a_chattering_switch_never_lets_current_flow_towards_it():
    rig = SfjRig()
    rig.hil.stuck[0] = 0
    rig.cycle()
    rig.latch.reset()
    for sample in range(40):
        rig.hil.stuck[0] = sample % 2
        rig.cycle((2.0, 0.0))
    assert not np.any([given[0] for given in rig.plant.given])


def test_both_ends_pressed_at_the_start_is_broken_wiring():
    rig = SfjRig()
    rig.driver.close()
    rig.hil.stuck |= {2: 0, 3: 0}
    rig.driver.open()
    assert rig.latch.latched == "limit_switch_stuck"
    rig.run(3, PUSH)
    assert off(rig)


def test_both_ends_pressed_while_it_runs_is_broken_wiring_too():
    rig = SfjRig()
    rig.run(3, PUSH)
    rig.hil.stuck[0] = 0
    rig.cycle(PUSH)
    assert rig.latch.latched == "limit_switch"
    rig.reset()
    rig.hil.stuck[1] = 0
    rig.cycle((-2.0, 0.0))
    assert rig.latch.latched == "limit_switch_stuck"
    rig.reset()
    assert rig.latch.latched == "limit_switch_stuck", "a reset does not mend a cable"
    rig.run(3, (2.0, 0.0))
    assert off(rig)


@pytest.mark.parametrize(("switch", "away"), [(0, -1.0), (1, 1.0)])
def test_a_switch_that_stays_pressed_when_its_arm_has_left_is_stuck(switch, away):
    plant = StillRobot()
    rig = SfjRig(plant)
    rig.hil.stuck[switch] = 0
    rig.cycle()
    rig.reset()
    for angle in np.arange(0.0, 0.34, 0.02):
        plant.angles[:2] = away * angle
        rig.cycle((2.0 * away, 0.0))
    assert rig.latch.latched is None
    plant.angles[:2] = away * 0.36
    rig.cycle((2.0 * away, 0.0))
    rig.cycle((2.0 * away, 0.0))
    assert rig.latch.latched == "limit_switch_stuck"
    assert f"STAGE 1: {'MAX' if switch == 0 else 'MIN'}" in rig.latch.sentence
    assert off(rig)
