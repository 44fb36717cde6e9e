"""The emulated devices measure with scales of their own: a driver with a wrong one is found on them."""

import math
from dataclasses import replace

import numpy as np
import pytest
from device_rigs import OmniRig, StillOmni, StillRobot

from haptic_teleop_2dsfj.board import Board
from haptic_teleop_2dsfj.build import all_faults
from haptic_teleop_2dsfj.driver import SfjDriver
from haptic_teleop_2dsfj.local_board import emulated_hil
from haptic_teleop_2dsfj.settings import TABLE, SfjDriverSettings
from haptic_teleop_control.clocks import VirtualClock
from haptic_teleop_control.device import Reporter
from haptic_teleop_omni.driver import OmniDriver

EFFORT = np.array([1.0, 0.1])  # N·m
ANGLES = np.array([0.05, 0.04, -0.05, -0.03])
CONSTANTS = np.array([8.925, 1.392])  # N·m/A
PLANTS: list[StillRobot] = []


def plant(file: str, rate: float) -> StillRobot:
    PLANTS.append(StillRobot())
    return PLANTS[-1]


def session(**wrong) -> tuple[SfjDriver, StillRobot]:
    """The driver and its emulated board as the node makes them, once the robot has been turned to ANGLES."""
    stated = {name.replace("__", "."): value for name, value in wrong.items()}
    values = TABLE.check({
        "device": "emulated", "emulated.plant": f"{__name__}:plant", "ramp_time": 0.0,
        "stage1.current_slew": math.inf, "stage2.current_slew": math.inf,
        "supervisor.sense_margin": 10.0, "supervisor.highest_speed": 1e6, **stated,
    })  # fmt: skip
    settings, clock = SfjDriverSettings.from_parameters(values), VirtualClock()
    hil = emulated_hil(values, settings.board, clock)
    reporter, latch = Reporter.to_latch(all_faults())
    driver = SfjDriver(settings, Board(settings.board, lambda: hil, clock=clock), reporter)
    driver.open()
    driver.read()
    PLANTS[-1].angles[:] = ANGLES
    for _ in range(4):
        driver.read()
        driver.write(EFFORT)
    assert latch.latched is None, latch.sentence
    return driver, PLANTS[-1]


def wrong_by(found, true) -> float:
    """Largest relative difference."""
    return float(np.max(np.abs(np.asarray(found) / true - 1.0)))


def errors(driver: SfjDriver, robot: StillRobot) -> dict[str, float]:
    flowing = np.array(robot.given[-1])
    return {
        "angle": wrong_by(driver.position, ANGLES),
        "current": wrong_by(flowing, EFFORT / CONSTANTS),
        "measured": wrong_by(driver.effort[0::2], flowing * CONSTANTS),
    }


def test_with_the_right_scales_angles_and_currents_agree():
    assert all(error < 0.03 for error in errors(*session()).values())


@pytest.mark.parametrize(
    ("wrong", "value", "what"),
    [
        ("amplifier__a_per_v", 0.55, "current"),
        ("amplifier__command_sign", 1, "current"),
        ("amplifier__sense_a_per_v", -2.2, "measured"),
        ("amplifier__sense_a_per_v", 2.0, "measured"),
        ("joint_encoder__gearing", 6.9, "angle"),
        ("stage1__gear_ratio", 90.0, "angle"),
        ("stage2__gear_ratio", 50.0, "angle"),
        ("board__range", 5.0, None),  # both know of it
    ],
)
def test_a_wrong_scale_of_the_2dsfj_s_driver_shows_on_the_emulated_board(wrong, value, what):
    found = errors(*session(**{wrong: value}))
    for name, error in found.items():
        assert (error > 0.08) == (name == what), found


def test_a_wrong_number_of_counts_per_turn_shows(monkeypatch):
    monkeypatch.setattr("haptic_teleop_2dsfj.driver.ENCODER_COUNTS_PER_TURN", 4000)
    assert errors(*session())["angle"] == pytest.approx(0.024, abs=0.01)


@pytest.mark.parametrize("direction", ["input", "output", None])
def test_a_wrong_scale_in_a_layout_shows_on_the_emulated_omni(direction):
    robot = StillOmni()
    rig = OmniRig(robot)
    layout = rig.layout
    if direction:
        report = getattr(layout, direction)
        name = "encoder_y" if direction == "input" else "torque_y"
        wrong = replace(report.fields[name], scale=report.fields[name].scale * 1.1)
        layout = replace(layout, **{direction: replace(report, fields={**report.fields, name: wrong})})
    rig.device._layout = layout  # the emulated device has the driver's own layout, as in the node
    rig.driver = OmniDriver(rig.settings, layout, rig.device, rig.reporter)
    rig.driver.open()
    rig.run(2)
    for _ in range(300):
        robot.angles += 0.001
        rig.cycle((0.1, 0.1, 0.1))
    turned, pushed = (values / values[2] for values in (rig.driver.position, robot.given[-1]))
    assert wrong_by(turned, np.ones(3)) == pytest.approx(0.1 if direction == "input" else 0.0, abs=0.01)
    assert wrong_by(pushed, np.ones(3)) == pytest.approx(
        1 - 1 / 1.1 if direction == "output" else 0.0, abs=0.01
    )
