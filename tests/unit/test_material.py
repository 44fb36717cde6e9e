"""Effects whose name says more than the recordings can: a spring that is a constant torque, a friction in a
direction in which the joint never moves."""

import numpy as np
import pytest
from stepped_machines import DT, RIGID

from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.diagnosis.hypotheses.material import material
from haptic_teleop_sysid.diagnosis.inputs.scales import recording_scales
from haptic_teleop_sysid.estimation.records import Record


def moved(angle):
    """A recording of a motion, with a torque of 1 N·m to and fro."""
    measured = np.column_stack([angle, np.full(len(angle), np.nan)])
    torque = np.sign(np.sin(np.arange(len(angle))))
    return Record("made here", DT, torque, measured, np.zeros(len(angle)), (1e-5, 1e-5))


TIME = DT * np.arange(5000)


@pytest.mark.parametrize(("rest", "named"), [(0.5, True), (-9.0, True), (-25.0, False), (1e3, False)])
def test_a_spring_whose_rest_is_far_away_is_a_constant_torque(rest, named):
    scales = recording_scales(RIGID, [moved(np.sin(TIME))])
    assert material(Effect("spring_to_ground", "j_motor", {"stiffness": 0.1, "rest": rest}), scales) == named


def test_friction_differs_only_between_directions_that_are_gone():
    sided = Effect("asymmetric_friction", "j_motor", {"positive": 0.3, "negative": 0.6})
    to_and_fro, onward = np.sin(TIME), 3.0 * TIME + np.sin(TIME)
    # An encoder's steps at rest are no way back.
    luck = np.random.default_rng(0)
    starting = np.where(TIME > 2.0, 20.0 * (TIME - 2.0), 0.0) + 1e-3 * luck.integers(0, 2, len(TIME))
    for angle, share, named in ((to_and_fro, 1.0, True), (onward, 0.0, False), (starting, 0.0, False)):
        scales = recording_scales(RIGID, [moved(angle)])
        assert scales.both_ways[0] == pytest.approx(share, abs=0.2)
        assert material(sided, scales) == named
    # Either direction may be in another recording.
    assert material(sided, recording_scales(RIGID, [moved(onward), moved(-onward)]))


@pytest.mark.parametrize(("order", "named"), [(1.0, False), (1.1, False), (0.7, True), (2.0, True)])
def test_a_ripple_of_one_cycle_a_turn_is_gravity(order, named):
    scales = recording_scales(RIGID, [moved(4.0 * np.sin(TIME))])
    ripple = Effect("torque_ripple", "j_motor", {"amplitude": 0.3, "order": order, "phase": 0.2})
    assert material(ripple, scales) == named
