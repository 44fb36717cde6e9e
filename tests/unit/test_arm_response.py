"""How the arm of a flexible joint follows its motor, and that response found from recordings."""

import numpy as np
import pytest
import scipy
from stepped_machines import ELASTIC, drive, record, two_masses

from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.arm_response import ArmResponse
from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.parity_equations import Signals
from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.parity_fit import best_arm_response, left_by, rms
from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.parity_signals import signals


def test_columns_are_filtered_as_scipy_filters_them():
    arm = ArmResponse(200.0, 3.0, 0.005)
    columns = np.random.default_rng(0).normal(size=(400, 3)).cumsum(axis=0)
    numerator, denominator, _ = scipy.signal.cont2discrete(([200.0], [1.0, 3.0, 200.0]), 0.005, "foh")
    found = scipy.signal.lfilter(np.ravel(numerator), denominator, columns - columns[0], axis=0)
    expected = columns[0] + found
    assert arm.each(columns) == pytest.approx(expected, abs=1e-10)
    assert arm(columns[:, 1]) == pytest.approx(expected[:, 1], abs=1e-10)
    assert arm.each(columns[:, :0]).shape == (400, 0)
    free = arm.by_itself(400)
    assert free[:2] == pytest.approx(np.array([[1.0, 0.0], [1.0, 1.0]]))
    assert free[2:] == pytest.approx(-denominator[1] * free[1:-1] - denominator[2] * free[:-2])


@pytest.mark.parametrize("damping", [0.03, 0.1])
def test_it_is_found_from_any_model_also_where_the_logarithm_of_the_damping_is_none(damping):
    """A damping of 0.1 over an inertia of 0.1 is 1 / s."""
    torque = drive(0, 2.0)
    model = ELASTIC.with_values({"arm_damping": damping})
    one = record(torque, two_masses(torque, 20.0, (0.06, 0.3), (0.1, 0.3), 0.0), 1e-6)
    parts = [signals(model, one, 6.0, [])]
    (found,) = best_arm_response(model, parts, Signals.without_arm_encoder, descends=True)
    assert found.stiffness == pytest.approx(200.0, rel=0.02)
    assert found.damping == pytest.approx(3.0, rel=0.02)
    # Without the motor's encoder inertias and dampings make up for some of it: what it leaves is told.
    (found,) = best_arm_response(model, parts, Signals.without_motor_encoder, descends=False)
    equation = parts[0].without_motor_encoder(found, parts[0].kept)
    assert left_by([equation]) < 0.002 * rms([equation.target])
