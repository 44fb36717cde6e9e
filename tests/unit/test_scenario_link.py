"""The scenarios over a link and with a hand, in lockstep: delay, loss, energies, and what damps them."""

import json

import numpy as np
import pytest

from haptic_teleop_control.teleoperation.recorded_energy import port_energies
from haptic_teleop_sim.lockstep import main
from haptic_teleop_sim.scenario_parameters import check_scenario
from haptic_teleop_sim.scenario_run import simulate_scenario

COMPENSATED = {
    "compensation.level.kp": 1.0, "compensation.level.ki": 4.0, "compensation.level.kd": 0.03,
    "compensation.spring": 0.1173, "compensation.ramp_time": 0.0, "operator.mode": "trajectory",
}  # fmt: skip


def held(stiffness: float = 3.0, gain: float = 0.1, link: dict | None = None, **controller: object) -> dict:
    """Scenario 1 in device mode: the hand leads both arms to a wall at 0.4 rad and holds."""
    omni, control = dict(COMPENSATED), {"command_source": "device", "link": link is not None, **controller}
    for axis, angle in (("omni_y", 0.06), ("omni_z", 0.08)):
        way = [0.0, angle * (1.0 + 0.3 / stiffness)]
        omni |= {f"{axis}.hand.times": [0.2, 0.6], f"{axis}.hand.angles": way}
        omni |= {f"{axis}.hand.stiffness": stiffness, f"{axis}.hand.damping": 0.017 * stiffness}
        control |= {f"{axis}.feedback_gain": gain, f"{axis}.torque_limit": 0.446}
    walls = {
        f"stage{i}.wall.{key}": value for i in (1, 2) for key, value in (("angle", 0.4), ("dissipation", 1.0))
    }
    return {
        "sfj_sim": walls, "omni_sim": omni, "force_controller": control, "signal_generator": {},
        "link": link or {},
    }  # fmt: skip


def run(content: dict, duration: float = 3.0):
    return simulate_scenario(check_scenario(content), duration)


def test_the_torque_that_the_operator_feels_is_that_of_the_contact():
    result = run(held(gain=0.1))
    device, states = result.topics["/omni/effort_command"], result.topics["/sfj/joint_states"]
    angle = result.topics["/omni/joint_states"].position
    felt = device.effort[-500:, 1:] + 0.3 * angle[-500:, 1:]  # less the spring
    contact = states.effort[-250:, [1, 3]]
    np.testing.assert_allclose(felt.mean(axis=0), -0.1 * contact.mean(axis=0), rtol=0.02)
    assert contact.mean(axis=0).min() > 0.4


def test_a_link_without_delay_changes_nothing_that_matters():
    plain, linked = run(held()), run(held(link={}))
    states = [one.topics["/sfj/joint_states"] for one in (plain, linked)]
    np.testing.assert_allclose(states[0].position, states[1].position, atol=2e-3)


def test_a_delay_shifts_the_slave_by_just_that_time():
    late = [run(held(gain=0.0, link={"delay": delay})).topics["/sfj/joint_states"] for delay in (0.0, 0.05)]
    # Without feedback nothing comes back, so the slave does the same 25 samples later.
    np.testing.assert_allclose(late[1].position[25 + 100 : 700], late[0].position[100 : 700 - 25], atol=2e-3)


def test_what_was_sent_is_recorded_by_stage():
    result = run(held(link={"delay": 0.02}))
    sent = result.topics["/teleoperation/master"]
    assert sent.names == ("stage1", "stage2")
    angle = result.topics["/omni/joint_states"].position[:, 1:]
    np.testing.assert_allclose(sent.effort, 10.0 * angle, atol=1e-12)
    back = result.topics["/teleoperation/slave"]
    np.testing.assert_array_equal(back.effort, result.topics["/sfj/joint_states"].effort[:, [1, 3]])


def test_equal_seeds_give_equal_runs_over_a_bad_link():
    bad = {"delay": 0.02, "jitter": 0.01, "loss": 0.05, "reorder": 0.05, "duplicate": 0.05}
    one, two, three = (run(held(link={**bad, "seed": seed}), 1.5) for seed in (5, 5, 6))
    position = [r.topics["/sfj/joint_states"].position for r in (one, two, three)]
    np.testing.assert_array_equal(position[0], position[1])
    assert not np.array_equal(position[0], position[2])
    assert not one.counts and not three.counts


def test_a_dead_link_is_a_fault_and_ends_the_motion():
    result = run(held(link={"loss": 0.5, "burst": 400.0, "seed": 3}), 3.0)
    assert result.counts["fault stale_link"] == 1
    ended = next(at for at, state in result.states if state == "fault")
    commands = result.topics["/sfj/effort_command"]
    later = commands.time() > ended + 0.06
    assert later.any() and not commands.effort[later].any()


def test_a_slow_link_is_never_engaged():
    result = run(held(link={"delay": 0.06}, maximum_round_trip=0.1), 1.0)
    assert [state for _, state in result.states] == ["devices_ready", "aligning"]
    assert not result.topics["/sfj/effort_command"].effort.any()
    assert "the link's round trip takes 12" in result.obstacle


def test_the_command_says_when_the_robots_were_not_coupled_and_nothing_when_they_were(tmp_path, capsys):
    for delay, said in ((0.06, "not coupled at the end, aligning: "), (0.01, "")):
        file = tmp_path / f"delay_{delay}.yaml"
        content = {
            "scenario": {"nodes": ["sfj_sim", "omni_sim", "link", "force_controller"]},
            "force_controller": {"link": True, "command_source": "device"},
            "link": {"delay": delay},
        }
        nodes = {name: {"ros__parameters": values} for name, values in content.items()}
        file.write_text(json.dumps(nodes), encoding="utf-8")  # JSON text is YAML text
        assert main([str(file), "--duration", "0.5"]) == 0
        told = capsys.readouterr().err
        assert said in told if said else "not coupled" not in told


@pytest.mark.parametrize("link", [None, {"delay": 0.03}])
def test_the_energies_counted_while_running_are_those_of_the_recording(link):
    result = run(held(link=link))
    ports = port_energies(result.topics, "omni", "sfj")
    coupled = next(at for at, state in result.states if state == "engaged")
    for name in ("master", "slave"):
        one = ports[name]
        before = one.energy[max(int(np.searchsorted(one.time, coupled - 1e-9)) - 1, 0)]
        np.testing.assert_allclose(one.energy[-1] - before, result.energies[name], atol=2e-6)
    assert np.all(result.energies["slave"] > 0.0)  # the arms were moved, and pressed


def test_a_link_gives_away_more_energy_the_longer_it_takes():
    runs = [run(held(link={"delay": delay}, maximum_round_trip=1.0)) for delay in (0.0, 0.02, 0.08)]
    lowest = [result.energies["lowest link"].min() for result in runs]
    assert lowest[0] > -1e-4
    assert lowest[2] < lowest[1] < lowest[0]


def test_an_axis_that_is_hardly_held_swings_up_over_a_link_and_the_controller_stops_that():
    loose = {"stiffness": 0.1, "gain": 0.2, "link": {"delay": 0.03}}
    swings, calm = (run(held(**loose, **{"passivity.controller": on}), 6.0) for on in (False, True))
    energy = [result.energies["lowest master"].min() for result in (swings, calm)]
    assert energy[0] < -0.1
    assert energy[1] > -0.02
    angle = [result.topics["/omni/joint_states"].position[-2000:, 1:] for result in (swings, calm)]
    assert np.ptp(angle[0], axis=0).max() > 0.1 > 5.0 * np.ptp(angle[1], axis=0).max()


def surfaces(link: dict | None = None) -> dict:
    """Scenario 2 in device mode: hands on the arms lead both axes of the Omni to a surface and hold."""
    angle = 0.52 / 3.95 * (1.0 + 3.95 / 15.0)
    hands = {"operator.mode": "trajectory"}
    control = {
        "master": "sfj",
        "slave": "omni",
        "master_rate": 500.0,
        "slave_rate": 1000.0,
        "command_source": "device",
        "link": link is not None,
    }
    omni = {**COMPENSATED, "operator.mode": "none", "omni_y.wall.angle": 0.3, "omni_z.wall.angle": 0.3}
    for stage in ("stage1", "stage2"):
        hands |= {f"{stage}.hand.times": [0.2, 0.6], f"{stage}.hand.angles": [0.0, angle]}
        control |= {f"{stage}.master.feedback_gain": 1.0}
    return {
        "sfj_sim": hands, "omni_sim": omni, "force_controller": control, "signal_generator": {},
        "link": link or {},
    }  # fmt: skip


@pytest.mark.parametrize(("delay", "last"), [(0.01, "engaged"), (0.02, "aligning")])
def test_scenario_2_is_coupled_at_10_ms_each_way_and_not_at_20_where_it_was_not_passive(delay, last):
    result = run(surfaces({"delay": delay}), 0.3)  # the hands have just begun to push
    assert result.states[-1][1] == last
    assert result.topics["/omni/effort_command"].effort[:, 1:].any() == (last == "engaged")
    assert ("more than 25.0 ms" in result.obstacle) == (last == "aligning")


def test_in_scenario_2_the_hand_feels_the_surface_by_the_drive():
    result = run(surfaces(), 5.0)
    states, device = result.topics["/sfj/joint_states"], result.topics["/omni/joint_states"]
    touch = int(np.argmax(np.all(device.position[:, 1:] > 0.3, axis=1))) // 2
    before = -states.effort[touch - 200 : touch - 100, [1, 3]].mean(axis=0)
    after = -states.effort[-250:, [1, 3]].mean(axis=0)
    # A hand of 15 N·m/rad gives way, so of the 0.1 N·m of contact it feels a good part more than before.
    assert np.all(after - before > 0.05)
    assert np.all(device.position[-1, 1:] == pytest.approx(0.3, abs=2e-3))
    assert not result.counts
