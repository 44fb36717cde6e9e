"""Energies at the ports: against closed forms, and what the passivity controller does about a deficit."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.recording import JointStateSeries
from haptic_teleop_control.robots import OMNI_JOINTS, SFJ_JOINTS
from haptic_teleop_control.teleoperation.passivity import PassivitySettings, PortEnergies
from haptic_teleop_control.teleoperation.recorded_energy import port_energies

DT = 0.001
ZERO = np.zeros(1)


def test_a_spring_gives_back_what_it_took_and_its_energy_is_half_k_x_squared():
    ports = PortEnergies(1, DT, DT)
    k, amplitude, omega = 0.3, 0.1, 2.0 * math.pi
    seen = []
    for n in range(1000):
        t = (n + 0.5) * DT
        torque = np.array([-k * amplitude * math.sin(omega * t)])
        ports.at_master(torque, np.array([amplitude * omega * math.cos(omega * t)]), ZERO)
        seen.append(ports.master[0])
    assert max(seen) == pytest.approx(0.5 * k * amplitude**2, rel=1e-3)
    assert abs(seen[-1]) < 1e-6 and ports.lowest_master[0] > -1e-6


def test_what_drives_the_hand_on_is_a_deficit():
    ports = PortEnergies(1, DT, DT)
    for _ in range(100):
        ports.at_master(np.array([0.05]), np.array([0.2]), ZERO)
    assert ports.master[0] == pytest.approx(-0.05 * 0.2 * 0.1)
    assert ports.lowest_master[0] == ports.master[0]


def test_the_slave_s_port_counts_what_the_environment_got():
    ports = PortEnergies(2, DT, 0.002)
    for _ in range(50):
        ports.at_slave(np.array([0.6, 0.0]), np.array([0.5, 1.0]), np.zeros(2), np.zeros(2))
    np.testing.assert_allclose(ports.slave, [0.6 * 0.5 * 0.1, 0.0])


def delayed(samples, steps):
    return np.concatenate([np.zeros(steps), samples])[: len(samples)]


@pytest.mark.parametrize("steps", [0, 40])
def test_a_link_without_delay_keeps_nothing_and_one_with_delay_against_the_phase_gives_energy_away(steps):
    """F leads v by 90°, as in a spring: E = -F V t sin(omega 2 d) / 2 per s for the delay d each way."""
    omega, span = 2.0 * math.pi * 2.0, 1.0
    t = np.arange(round(span / DT)) * DT
    v, force = 0.5 * np.cos(omega * t), 0.2 * np.sin(omega * t)
    ports = PortEnergies(1, DT, DT)
    at_master, at_slave = delayed(force, steps), delayed(v, steps)
    for k in range(len(t)):
        ports.at_master(ZERO, v[k : k + 1], at_master[k : k + 1])
        ports.at_slave(ZERO, ZERO, force[k : k + 1], at_slave[k : k + 1])
    expected = -0.5 * 0.2 * 0.5 * (math.sin(omega * steps * DT) * 2.0) * (span - steps * DT)
    assert ports.link[0] == pytest.approx(expected, abs=0.004)
    if not steps:
        assert ports.link[0] == 0.0
        assert ports.lowest_link[0] > -2e-4  # master and slave take turns within a sample


def test_the_controller_takes_back_a_deficit_in_one_sample_where_its_damping_suffices():
    settings = PassivitySettings(controller=True, maximum_damping=5.0)
    ports = PortEnergies(1, DT, DT)
    ports.at_master(np.array([0.001]), np.array([0.5]), ZERO)
    deficit = ports.master[0]
    torque = ports.damping(np.array([0.5]), settings).copy()
    assert torque[0] < 0.0
    ports.at_master(torque, np.array([0.5]), ZERO)
    assert deficit < 0.0 and ports.master[0] == pytest.approx(0.0, abs=1e-15)


def test_the_damping_is_bounded_and_silent_at_rest_and_when_it_is_off():
    ports = PortEnergies(1, DT, DT)
    ports.at_master(np.array([10.0]), np.array([1.0]), ZERO)
    on = PassivitySettings(controller=True, maximum_damping=0.02)
    assert ports.damping(np.array([-0.4]), on)[0] == pytest.approx(0.02 * 0.4)
    assert ports.damping(np.array([0.01]), on)[0] == 0.0
    assert ports.damping(np.array([math.nan]), on)[0] == 0.0
    assert ports.damping(np.array([0.4]), PassivitySettings())[0] == 0.0


@given(st.lists(st.tuples(st.floats(-1, 1), st.floats(-2, 2)), max_size=80))
def test_damping_never_puts_energy_in(samples):
    settings = PassivitySettings(controller=True)
    ports = PortEnergies(1, DT, DT)
    for torque, velocity in samples:
        added = ports.damping(np.array([velocity]), settings)[0]
        assert added * velocity <= 0.0
        ports.at_master(np.array([torque + added]), np.array([velocity]), ZERO)


def test_samples_that_are_no_numbers_are_left_out():
    ports = PortEnergies(1, DT, DT)
    ports.at_master(np.array([math.nan]), np.array([1.0]), ZERO)
    ports.at_slave(np.array([1.0]), np.array([math.inf]), ZERO, ZERO)
    assert ports.master[0] == ports.slave[0] == ports.link[0] == 0.0


def test_a_damping_that_is_none_is_refused():
    with pytest.raises(ConfigurationError, match="maximum_damping"):
        PassivitySettings(maximum_damping=-1.0)


def test_energies_of_a_recording_are_torque_times_way():
    """The 2DSFJ presses with 0.5 N·m over 0.2 rad; the hand moves the Omni by 0.1 rad against 0.03 N·m, while
    the device adds 0.2 N·m of its own."""
    n, stamp = 101, np.arange(101, dtype=np.int64) * 10_000_000 + 10**9
    ones = np.ones((n, 1))
    sfj = JointStateSeries(
        stamp, stamp, SFJ_JOINTS, ones * np.zeros(4), ones * [0.0, 0.2, 0.0, 0.0], ones * [0.0, 0.5, 0.0, 0.0]
    )
    omni = JointStateSeries(
        stamp, stamp, OMNI_JOINTS, ones * np.zeros(3), ones * [0.0, 0.1, 0.0], ones * [0.0, 0.17, 0.0]
    )
    command = JointStateSeries(stamp, stamp, OMNI_JOINTS, None, None, ones * [0.0, -0.03, 0.0])
    topics = {"/sfj/joint_states": sfj, "/omni/joint_states": omni, "/omni/effort_command": command}
    ports = port_energies(topics, "omni", "sfj")
    np.testing.assert_allclose(ports["slave"].energy[-1], [0.5 * 0.2 * 1.01, 0.0])
    np.testing.assert_allclose(ports["master"].energy[-1], [0.03 * 0.1 * 1.0, 0.0])
    assert not ports["master"].lowest.any()
    swapped = port_energies({"/sfj/joint_states": sfj}, "sfj", "omni")
    assert set(swapped) == {"master"}
    np.testing.assert_allclose(swapped["master"].lowest, [-0.5 * 0.2 * 1.01, 0.0])
