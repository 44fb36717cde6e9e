"""Master and slave coupled, without ROS: who is asked for what, when nothing is driven, and what the link
does."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.laws import LAWS
from haptic_teleop_control.node_tables import FORCE_CONTROLLER
from haptic_teleop_control.robots import STAGES
from haptic_teleop_control.teleoperation.coupling import Coupling
from haptic_teleop_control.teleoperation.machine import State

MS = 1_000_000
SCENARIO_2 = {"master": "sfj", "slave": "omni", "master_rate": 500.0, "slave_rate": 1000.0,
              "omni_y.slave.observer.spring": 0.0}  # fmt: skip


class Rig:
    """A coupling and its two robots, sampled every 2 ms: the master first."""

    def __init__(self, **values: object) -> None:
        self.values = FORCE_CONTROLLER.check({"ramp_time": 0.0, **values})
        law = LAWS["augmented_error"].from_parameters(self.values, STAGES, 0.002)
        self.faults: list[str] = []
        self.entered: list[State] = []
        self.coupling = Coupling(
            self.values, law, lambda name, detail: self.faults.append(name), self.entered.append
        )
        self.now = 0
        self.to_master = self.to_slave = np.zeros(0)

    def step(self, reference: bool = True, master: bool = True, slave: bool = True) -> None:
        self.now += 2 * MS
        if reference:
            self.coupling.on_reference(self.now)
        if master:
            self.to_master = self.coupling.on_master(self.now).copy()
        if slave:
            self.to_slave = self.coupling.on_slave(self.now).copy()

    def run(self, seconds: float, **what: bool) -> None:
        for _ in range(round(seconds / 0.002)):
            self.step(**what)


@pytest.mark.parametrize("roles", [{}, SCENARIO_2], ids=["scenario 1", "scenario 2"])
def test_at_neutral_and_rest_it_engages_by_itself_and_asks_for_nothing(roles):
    rig = Rig(**roles)
    rig.run(0.1)
    assert rig.coupling.state is State.ENGAGED
    assert not rig.to_master.any() and not rig.to_slave.any()
    assert rig.faults == []


def test_in_scenario_1_the_command_and_the_feedback_go_their_ways():
    rig = Rig(**{"omni_y.feedback_gain": 0.2})
    rig.coupling.reference[:] = [0.05, 0.0]
    rig.coupling.slave[2][1] = 0.3  # Te of stage 1
    rig.coupling.slave[0][0] = 0.3 / 3.971
    rig.step()
    rig.step()
    assert rig.to_master[1] == pytest.approx(-0.2 * 0.3)
    s = 10.0 * 0.05 - 0.3
    assert rig.to_slave[0] / 8.925 == pytest.approx(5.0 / 3.971 * (2.0 * s + 10.0 * s * 0.004))
    assert rig.to_slave[1] == 0.0


def test_in_scenario_2_the_hand_s_torque_and_the_estimate_go_their_ways():
    rig = Rig(
        **SCENARIO_2, command_source="device",
        **{"stage1.master.feedback_gain": 1.0},
    )  # fmt: skip
    master, slave = rig.coupling.master, rig.coupling.slave
    rig.step()
    master[0][1], master[2][1] = 0.05, -3.971 * 0.05  # the arm is pushed ahead of the drive
    slave[2][1] = 0.06  # motor torque on an axis that does not move: it presses on something
    rig.run(0.2)
    assert rig.coupling.slave_port.environment_torque[0] == pytest.approx(0.06, abs=1e-4)
    s = 0.2 * (3.971 * 0.05 - 0.02) - 0.06
    assert rig.coupling.slave_port.law.augmented_error[0] == pytest.approx(s, abs=1e-4)
    # The drive, at zero, is to draw back by Te / Ks: current 60 A/rad times that.
    assert rig.to_master[0] / 8.925 == pytest.approx(-60.0 * 0.06 / 3.971, rel=1e-2)


def test_a_running_pattern_refuses_the_act_of_engaging_and_not_what_engages_by_itself():
    rig = Rig(auto_engage=False)
    rig.coupling.pattern_runs = True
    rig.step()
    assert "stop it first" in (rig.coupling.engage(rig.now) or "")
    rig.step()
    assert rig.coupling.state is State.DEVICES_READY
    rig.coupling.pattern_runs = False
    assert rig.coupling.engage(rig.now) is None
    rig = Rig(auto_engage=True)
    rig.coupling.pattern_runs = True
    rig.step()
    assert rig.coupling.state is State.ENGAGED
    assert rig.coupling.disengage(rig.now)
    assert "stop it first" in (rig.coupling.engage(rig.now) or "")


def test_the_feedback_of_a_master_that_was_aligned_for_long_ramps_in_by_itself():
    rig = Rig(auto_engage=False, ramp_time=0.2, **{"omni_y.feedback_gain": 0.2})
    rig.coupling.master[0][1] = 0.05
    rig.coupling.slave[2][1] = 0.5
    rig.coupling.reference[:] = 0.2
    rig.step()
    assert "stage1" in rig.coupling.engage(rig.now)
    rig.run(0.3)
    assert rig.to_master[1] == pytest.approx(-0.3 * 0.05)  # the spring alone
    rig.coupling.reference[:] = 0.0
    rig.step()
    assert rig.coupling.engage(rig.now) is None
    torques = []
    for _ in range(120):
        rig.step()
        torques.append(rig.to_master[1])
    assert torques[0] == pytest.approx(-0.015 - 0.1 * 0.01, abs=1e-3)
    assert torques[49] == pytest.approx(-0.015 - 0.05, abs=1e-3)
    assert torques[-1] == pytest.approx(-0.115)
    assert max(abs(b - a) for a, b in itertools.pairwise(torques)) < 0.0012


@pytest.mark.parametrize(
    ("missing", "fault"),
    [
        ({"reference": False}, "stale_reference"),
        ({"master": False}, "stale_master"),
        ({"slave": False}, "stale_slave"),
    ],
)
def test_whoever_goes_silent_while_engaged_ends_it(missing, fault):
    rig = Rig()
    rig.run(0.1)
    assert rig.coupling.state is State.ENGAGED
    rig.run(0.1, **missing)
    assert rig.faults == [fault]
    assert not rig.to_master.any()
    rig.run(1.0)
    assert rig.coupling.state is State.FAULT


def test_in_simulated_mode_the_device_may_be_absent_from_the_start():
    rig = Rig()
    rig.run(0.3, master=False)
    assert rig.coupling.state is State.ENGAGED and rig.faults == []


def test_after_a_fault_the_slave_s_torque_fades_and_the_master_s_is_gone_at_once():
    rig = Rig(ramp_out_time=0.05)
    rig.coupling.reference[:] = 0.05
    rig.coupling.master[0][1] = 0.05
    rig.run(0.1)
    full, felt = rig.to_slave[0], rig.to_master[1]
    assert full > 0.0 > felt
    rig.coupling.fault(rig.now, "time_jump", "")
    fading = []
    for _ in range(30):
        rig.step()
        fading.append(rig.to_slave[0])
        assert rig.to_master[1] == 0.0
    np.testing.assert_allclose(fading[:24], full * (1.0 - 0.04 * np.arange(1, 25)), rtol=1e-9)
    assert fading[25:] == [0.0] * 5


def test_after_a_fault_in_the_state_itself_nothing_fades():
    rig = Rig(ramp_out_time=0.05)
    rig.coupling.reference[:] = 0.05
    rig.run(0.1)
    rig.coupling.fault(rig.now, "non_finite_state", "", at_once=True)
    rig.step()
    assert not rig.to_slave.any()


@pytest.mark.parametrize("field", [0, 1])
def test_a_state_that_the_law_cannot_use_is_a_fault(field):
    rig = Rig()
    rig.run(0.1)
    rig.coupling.slave[field][0] = math.nan
    rig.step()
    assert rig.faults == ["non_finite_state"]
    assert not rig.to_slave.any()


def test_a_slave_that_moves_or_a_command_off_neutral_keeps_it_from_engaging():
    rig = Rig()
    rig.coupling.reference[:] = [0.0, 0.1]
    rig.step()
    assert rig.coupling.state is State.ALIGNING
    assert "artificial command of stage2 is +0.100 rad" in rig.coupling.obstacle(rig.now)
    rig.coupling.reference[:] = 0.0
    rig.coupling.slave[1][1] = -0.5
    rig.step()
    assert "moves with -0.50 rad/s" in rig.coupling.obstacle(rig.now)
    rig.coupling.slave[1][1] = 0.0
    rig.step()
    assert rig.coupling.state is State.ENGAGED


def test_a_command_that_cannot_be_taken_is_a_fault_only_while_it_commands():
    rig = Rig(**{**SCENARIO_2, "auto_engage": False})
    rig.run(0.1)
    rig.coupling.on_bad_reference(rig.now, "malformed_state", "names of the other robot")
    rig.run(0.1, reference=False)
    assert rig.faults == [] and rig.coupling.machine.may_change_roles
    assert "names of the other robot" in (rig.coupling.engage(rig.now) or "")
    rig.run(0.1)
    assert rig.coupling.engage(rig.now) is None
    rig.coupling.on_bad_reference(rig.now, "malformed_state", "names of the other robot")
    assert rig.coupling.state is State.FAULT and rig.faults == ["malformed_state"]


def test_in_manual_mode_the_command_that_nobody_follows_may_be_anything():
    rig = Rig(command_source="device")
    rig.run(0.1)
    rig.coupling.on_bad_reference(rig.now, "malformed_state", "names of the other robot")
    rig.run(0.1)
    assert rig.coupling.state is State.ENGAGED and rig.faults == []


def test_a_robot_in_a_fault_of_its_own_ends_the_coupling_and_keeps_it_from_engaging():
    rig = Rig(auto_engage=False)
    rig.run(0.1)
    assert rig.coupling.engage(rig.now) is None
    rig.coupling.on_robot_fault(rig.now, "/sfj/sfj_driver", "limit_switch: an end is reached")
    assert rig.coupling.state is State.FAULT and rig.faults == ["robot_fault"]
    rig.coupling.reset(rig.now)
    rig.run(0.1)
    refusal = rig.coupling.engage(rig.now) or ""
    assert "limit_switch" in refusal and "reset --controller /sfj/sfj_driver" in refusal
    rig.coupling.on_robot_fault(rig.now, "/omni/omni_driver", "device: it is gone")
    refusal = rig.coupling.engage(rig.now) or ""
    assert "it is gone" in refusal and "reset --controller /omni/omni_driver" in refusal
    assert "limit_switch" in refusal and "engage again" not in refusal
    rig.coupling.on_robot_fault(rig.now, "/omni/omni_driver", None)
    rig.coupling.on_robot_fault(rig.now, "/sfj/sfj_driver", None)
    assert rig.coupling.engage(rig.now) is None


def test_a_refusal_for_a_robot_s_own_fault_moves_no_master():
    rig = Rig(auto_engage=False, command_source="device")
    rig.coupling.master[0][1] = 0.3  # off neutral: to align would move it
    rig.run(0.1)
    rig.coupling.on_robot_fault(rig.now, "/sfj/sfj_driver", "limit_switch: an end is reached")
    assert "limit_switch" in (rig.coupling.engage(rig.now) or "")
    rig.run(0.1)
    assert rig.coupling.state is State.DEVICES_READY and not rig.to_master.any()
    rig.coupling.on_robot_fault(rig.now, "/sfj/sfj_driver", None)
    assert "it is being aligned" in (rig.coupling.engage(rig.now) or "")
    assert rig.coupling.state is State.ALIGNING


def test_a_position_that_is_no_number_is_not_aligned():
    rig = Rig(command_source="device")
    rig.coupling.master[0][1] = math.nan
    rig.step()
    assert rig.coupling.state is State.ALIGNING


@pytest.mark.parametrize("auto_engage", [True, False], ids=["engaged", "aligning"])
def test_a_reset_without_a_fault_changes_nothing_and_silence_is_still_noticed(auto_engage):
    rig = Rig(command_source="device", auto_engage=auto_engage)
    if not auto_engage:
        rig.coupling.master[0][1] = 0.2
        rig.step()
        rig.coupling.engage(rig.now)
    rig.run(0.1)
    before = rig.coupling.state
    assert before is (State.ENGAGED if auto_engage else State.ALIGNING)
    rig.coupling.reset(rig.now)
    rig.step()
    assert rig.coupling.state is before and rig.faults == []
    rig.coupling.reset(rig.now)
    for _ in range(300):
        rig.step(slave=False)
    assert rig.faults == ["stale_slave"]


class LinkedRig(Rig):
    """What either side sends is heard by the other `delay` s later."""

    def __init__(self, delay: float, **values: object) -> None:
        super().__init__(link=True, **values)
        self.delay = round(delay * 1e9)
        self.under_way: list[tuple[int, int, np.ndarray]] = []

    def step(self, **what: bool) -> None:
        super().step(**what)
        one = self.coupling
        self.under_way.append((self.now, 0, np.array(one.to_slave)))
        self.under_way.append((self.now, 1, np.array(one.to_master)))
        for sent, way, values in [p for p in self.under_way if p[0] + self.delay <= self.now + MS]:
            one.heard[2 * way : 2 * way + 2] = values
            age = (self.now + MS - sent) * 1e-9
            (one.on_backward if way else one.on_forward)(self.now + MS, age)
        self.under_way = [p for p in self.under_way if p[0] + self.delay > self.now + MS]


def test_over_the_link_command_and_feedback_are_late_and_the_spring_is_not():
    rig = LinkedRig(0.02, **{"omni_y.feedback_gain": 0.2, "command_source": "device"})
    rig.run(0.2)
    assert rig.coupling.state is State.ENGAGED
    rig.coupling.master[0][1] = 0.05
    rig.coupling.slave[2][3] = 0.4
    rig.step()
    assert rig.to_master[1] == pytest.approx(-0.3 * 0.05)
    assert rig.to_slave[0] == 0.0
    rig.run(0.04)
    assert rig.to_slave[0] > 0.0
    assert rig.coupling.heard[2, 1] == 0.4
    assert rig.coupling.round_trip == pytest.approx(0.042, abs=0.003)


def test_a_round_trip_beyond_the_limit_keeps_it_from_engaging_and_ends_it_when_it_grows():
    rig = LinkedRig(0.06, maximum_round_trip=0.1)
    rig.run(0.5)
    assert rig.coupling.state is State.ALIGNING
    assert "more than 100.0 ms" in rig.coupling.obstacle(rig.now)
    rig.delay = 30 * MS
    rig.run(0.5)
    assert rig.coupling.state is State.ENGAGED
    rig.delay = 80 * MS
    rig.run(0.5)
    assert rig.faults[:1] in (["slow_link"], ["stale_link"])


@pytest.mark.parametrize(
    ("roles", "coupled", "refused", "limit"),
    [({}, 0.044, 0.06, "100.0 ms"), (SCENARIO_2, 0.008, 0.02, "25.0 ms")],
    ids=["scenario 1", "scenario 2"],
)
def test_where_no_limit_is_stated_it_couples_up_to_the_delay_measured_to_be_passive_with_these_roles(
    roles, coupled, refused, limit
):
    rig = LinkedRig(coupled, **roles)
    rig.run(0.5)
    assert rig.coupling.state is State.ENGAGED
    rig = LinkedRig(refused, **roles)
    rig.run(0.5)
    assert rig.coupling.state is State.ALIGNING
    assert f"more than {limit}" in rig.coupling.obstacle(rig.now)


def test_changed_parameters_are_taken_or_refused_as_a_whole():
    rig = Rig()
    rig.coupling.update({**rig.values, "omni_y.torque_gain": 5.0, "passivity.controller": True})
    assert rig.coupling.passivity.controller
    assert rig.coupling.master_port.wanted.settings[0].torque_gain == 5.0
    with pytest.raises(ConfigurationError, match="spring"):
        rig.coupling.update({**rig.values, "omni_y.spring": -1.0})


def test_the_energies_are_those_of_the_ports():
    rig = Rig(**{"omni_y.spring": 0.3, "master_rate": 500.0})
    rig.run(0.1)
    one = rig.coupling
    # The hand moves the device by 0.1 rad in 0.2 s against the spring of the sample before.
    for k in range(100):
        one.master[0][1] = 0.001 * (k + 1)
        one.master[1][1] = 0.5
        one.master[2][1] = -0.3 * 0.001 * k
        rig.step()
    assert one.energies.master[0] == pytest.approx(0.5 * 0.3 * 0.1**2, rel=0.02)
