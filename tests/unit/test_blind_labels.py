"""The labels of the blind benchmark: how large an effect is in its recording, and what else it could be."""

from dataclasses import replace

import numpy as np
import pytest

from haptic_teleop_sysid.blind.cases import Unlucky, _as_large, _recorded, _rivals, _sketched, draw_case
from haptic_teleop_sysid.blind.detect import Column, Driven, base_columns, beyond, whiten, whitener
from haptic_teleop_sysid.blind.effects import BY_NAME, PLACES
from haptic_teleop_sysid.blind.planting import Planted
from haptic_teleop_sysid.blind.rivals import rivals


def test_a_stop_that_the_recording_does_not_reach_is_not_planted() -> None:
    """Random torque may keep the robot from a stop that it just touches without: d' is the recording's."""
    index = next(i for i in range(len(PLACES)) if _single_effect(i) == "hard_stop")
    case = draw_case(5, "single", index, "stop", levels=(32.0,))
    truth = case.label["truth"][0]
    stop, filter_ = case.planted[0], whitener(case.settings[0].robot)

    def again(one: Planted) -> float:
        (seen, _) = _recorded([one], list(case.settings), case.pushes, case.scenes)
        return _as_large([one], *seen, filter_, False)[0].detectability

    assert again(stop) == pytest.approx(truth["detectability"], rel=1e-6)
    farther = {**stop.parameters, "angle": 2.0 * stop.parameters["angle"]}
    with pytest.raises(Unlucky):
        again(replace(stop, parameters=farther))


def test_what_is_told_apart_is_told_along_the_recording_as_it_was_made() -> None:
    """In a loop random torque is in the command, which tells a lag from a delay better than without."""
    case = draw_case(11, "clean", 5, "lag")
    setting = list(case.settings)
    scene, robot = case.scenes, case.settings[0].robot
    assert setting[0].experiment.loop == "force loop"
    lag = Planted(BY_NAME["actuator_lag"], "actuator", {"time_constant": 0.008})
    recorded = [(driven, added[0]) for driven, added in _recorded([lag], setting, case.pushes, scene)]
    nats = [
        _rivals(lag, seen, robot, whitener(robot), False)["input_delay", "actuator"]
        for seen in (_sketched(lag, setting, scene), recorded)
    ]
    assert nats[1] > 2.0 * nats[0] > 0.0


def test_what_is_late_is_told_from_a_delay_at_its_full_force_alone() -> None:
    """Half a delay at twice its force is nearly a lag, but no actuator does that."""
    case = draw_case(11, "clean", 5, "lag")
    setting, filter_ = list(case.settings), whitener(case.settings[0].robot)
    constant, lag = 0.008, Planted(BY_NAME["actuator_lag"], "actuator", {"time_constant": 0.008})
    seen = [(driven, added[0]) for driven, added in _recorded([lag], setting, case.pushes, case.scenes)]
    told = _rivals(lag, seen, case.settings[0].robot, filter_, False)["input_delay", "actuator"]
    gain = case.settings[0].robot.truth["torque_constant"]
    left = []
    for delay in np.linspace(0.5, 1.5, 41) * constant:
        apart = 0.0
        for driven, truth in seen:
            late = np.interp(driven.time - delay, driven.time, driven.current)
            both = whiten(
                filter_, [truth, Column(motor_force=gain * (late - driven.current))], len(driven.time)
            )
            rest = beyond(base_columns(filter_, driven, False), both)
            apart += 0.5 * float(np.sum((rest[:, 0] - rest[:, 1]) ** 2))
        left.append(apart)
    assert told == pytest.approx(min(left), rel=0.3)


def _single_effect(index: int) -> str:
    order = np.random.default_rng((5, 55)).permutation(len(PLACES))
    return PLACES[int(order[index])][0]


@pytest.mark.parametrize("seed", [5, 6])
def test_a_late_reading_and_a_late_stamp_are_one_thing_in_the_labels(seed: int) -> None:
    """Whatever the delay and the loop, also where the grid of rivals holds the truth's own only roughly."""
    order = np.random.default_rng((seed, 55)).permutation(len(PLACES))
    index = next(i for i in range(len(PLACES)) if PLACES[int(order[i])] == ("sensor_delay", "motor_encoder"))
    case = draw_case(seed, "single", index, "late", levels=(128.0,))
    assert ("channel_skew", f"{case.label['stage']}_motor_encoder") in case.label["sets"][0]
    assert not case.label["isolable"]


def test_a_delay_is_compared_with_a_lag_of_its_own_length() -> None:
    """Of 0.1 ms the two are one thing; the shortest lag of the grid is 2 ms, 67 nats away."""
    index = next(i for i in range(len(PLACES)) if _single_effect(i) == "input_delay")
    case = draw_case(5, "single", index, "delay", levels=(32.0,))
    assert case.label["truth"][0]["parameters"]["delay"] < 2e-4
    assert ("actuator_lag", f"{case.label['stage']}_actuator") in case.label["sets"][0]


@pytest.mark.parametrize("place", ["motor", "arm"])
def test_what_always_pulls_at_the_motor_or_at_the_arm_is_one_thing_to_zeroed_encoders(place: str) -> None:
    order = np.random.default_rng((5, 55)).permutation(len(PLACES))
    index = next(i for i in range(len(PLACES)) if PLACES[int(order[i])] == ("constant_torque", place))
    case = draw_case(5, "single", index, "pull", levels=(32.0,))
    stage = case.label["stage"]
    (same,) = case.label["sets"]
    assert {("constant_torque", f"{stage}_motor"), ("constant_torque", f"{stage}_arm")} <= {
        tuple(one) for one in same
    }
    assert not case.label["isolable"]


def test_a_spring_at_the_arm_and_gravity_are_one_thing_over_small_angles_whichever_it_is() -> None:
    order = np.random.default_rng((5, 55)).permutation(len(PLACES))
    for index in range(len(PLACES)):
        effect = PLACES[int(order[index])]
        if effect not in (("spring_to_ground", "arm"), ("gravity", "arm")):
            continue
        case = draw_case(5, "single", index, "spring", levels=(32.0,))
        arm = f"{case.label['stage']}_arm"
        (same,) = case.label["sets"]
        assert {("spring_to_ground", arm), ("gravity", arm)} <= {tuple(one) for one in same}


def test_a_spring_at_the_motor_and_half_a_wave_of_ripple_are_one_thing() -> None:
    time = np.arange(0.0, 20.0, 0.01)
    angle = 0.4 * np.sin(time)
    nothing = np.zeros_like(time)
    driven = Driven(angle, angle, nothing, nothing, nothing, nothing, nothing + 1e-9, nothing, time)
    ripples = [
        rival
        for rival in rivals(driven, driven, 1.0, 1.0, known_gain=False)
        if rival.effect == "torque_ripple"
    ]
    spring = 0.43 - angle
    left = []
    for ripple in ripples:
        columns = np.column_stack([column.motor_force for column in ripple.columns])
        rest = spring - columns @ np.linalg.lstsq(columns, spring)[0]
        left.append(float(np.std(rest) / np.std(spring)))
    assert min(left) < 0.1


@pytest.mark.parametrize("seed", [5, 6])
def test_a_torque_speed_limit_acts_by_its_slope(seed: int) -> None:
    """One that holds the torque at standstill as well would be a saturation where the slope is small."""
    order = np.random.default_rng((seed, 55)).permutation(len(PLACES))
    index = next(i for i in range(len(PLACES)) if PLACES[int(order[i])][0] == "torque_speed_limit")
    case = draw_case(seed, "single", index, "limit", levels=(32.0,))
    own, filter_ = case.planted[0], whitener(case.settings[0].robot)
    assert own.detectability > 8.0
    flat = replace(own, parameters={**own.parameters, "slope": 1e-9})
    with pytest.raises(Unlucky):
        (seen, _) = _recorded([flat], list(case.settings), case.pushes, case.scenes)
        _as_large([flat], *seen, filter_, False)
