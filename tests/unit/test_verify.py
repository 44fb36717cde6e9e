"""Verification reads back what was put into recordings made from formulas."""

import html
import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scenario_recordings import CONSTANT, PARAMETERS, Made, scenario

from haptic_teleop_control.errors import MismatchError
from haptic_teleop_control.recording import Recording, read_recording, write_recording
from haptic_teleop_sim import lockstep
from haptic_teleop_sysid.commands import verify
from haptic_teleop_sysid.report import Page
from haptic_teleop_sysid.report.roles import ROLES
from haptic_teleop_sysid.verification.conclusion import conclusion
from haptic_teleop_sysid.verification.contact import longest_still
from haptic_teleop_sysid.verification.overlay_report import Overlays
from haptic_teleop_sysid.verification.page import verification_page
from haptic_teleop_sysid.verification.pictures import stage_picture
from haptic_teleop_sysid.verification.run import agreement, examine
from haptic_teleop_sysid.verification.tables import settings_table
from haptic_teleop_sysid.verification.verdicts import verdicts

FIELDS = ("position", "velocity", "effort")


def contact_of(made: Made, stage: str = "stage1"):
    (contact,) = examine(scenario(made), "made").merits[stage].contacts
    return contact


def write(recording: Recording, path: Path) -> str:
    return str(write_recording(path, recording.topics, recording.parameters, recording.experiment))


def test_phases_are_found_where_they_were_made():
    made = Made()
    phases = examine(scenario(made), "made").merits["stage1"].phases
    assert [kind for kind, _, _ in phases] == ["idle", "free", "contact", "release", "idle"]
    starts = [start for _, start, _ in phases]
    # Torque fades with 50 ms and is a tenth after 50 ms x ln 10.
    expected = [0.0, made.onset, made.touch, made.release, made.release + 0.05 * math.log(10.0)]
    assert np.allclose(starts, expected, atol=0.01)


def test_without_a_wall_everything_is_free_motion():
    merit = examine(scenario(Made(contact=False)), "made").merits["stage1"]
    assert not merit.contacts
    assert [kind for kind, _, _ in merit.phases] == ["idle", "free", "idle"]


@pytest.mark.parametrize("droop", [0.0, 0.06, -0.08])
def test_free_speed_and_its_distance_from_the_law(droop):
    made = Made(droop=droop)
    (motion,) = examine(scenario(made), "made").merits["stage2"].free
    assert motion.expected_speed == pytest.approx(made.torque / 0.5)
    assert motion.speed == pytest.approx(made.speed, rel=2e-3)
    assert motion.error_percent == pytest.approx(-100.0 * droop, abs=0.2)


@pytest.mark.parametrize("damping", [0.3, 0.5, 0.7])
def test_overshoot_of_a_second_order_contact(damping):
    made = Made(damping=damping)
    assert contact_of(made).overshoot_percent == pytest.approx(made.overshoot, abs=0.1)


def test_settling_time_is_when_the_torque_stays_within_five_percent():
    # Aperiodic limit: 1 - exp(-wt)(1 + wt) enters the band once, at wt = 4.7439 (root of exp(-x)(1 + x) =
    # 0.05).
    contact = contact_of(Made(damping=0.999999, frequency=8.0))
    assert contact.settling_time == pytest.approx(4.7439 / 8.0, abs=0.006)


def test_a_torque_beside_the_band_never_settles():
    contact = contact_of(Made(offset=-0.06))
    assert contact.settling_time is None
    assert contact.settled_error == pytest.approx(-0.06, abs=1e-3)


def test_negative_commands_count_like_positive_ones():
    made = Made()
    recording = scenario(made)
    mirrored = {
        name: replace(
            series,
            **{field: -getattr(series, field) for field in FIELDS if getattr(series, field) is not None},
        )
        for name, series in recording.topics.items()
    }
    contact = contact_of(made)
    (other,) = examine(replace(recording, topics=mirrored), "mirrored").merits["stage1"].contacts
    assert other.overshoot_percent == pytest.approx(contact.overshoot_percent)
    assert other.settling_time == contact.settling_time
    assert other.settled_torque == pytest.approx(-contact.settled_torque)
    assert other.start == contact.start


@pytest.mark.parametrize("bounces", [0, 1, 3])
def test_bounces_are_counted_where_the_arm_leaves_the_wall(bounces):
    contact = contact_of(Made(bounces=bounces))
    assert contact.bounces == bounces
    assert contact.rebound == pytest.approx(0.02 if bounces else 0.0, abs=1e-3)


def test_a_speed_that_still_rises_is_not_called_steady():
    recording = scenario(Made(contact=False, release=1.3, duration=4.0))
    states = recording.topics["/sfj/joint_states"]
    time = states.time()
    velocity = states.velocity.copy()
    velocity[:, 0] = np.clip(time - 1.0, 0.0, 0.3)
    recording.topics["/sfj/joint_states"] = replace(states, velocity=velocity)
    merits = examine(recording, "made").merits
    assert not merits["stage1"].free[0].steady
    assert merits["stage2"].free[0].steady


def test_peak_current_is_the_measured_one():
    made = Made()
    peak = made.torque * (1.0 + made.overshoot / 100.0) / CONSTANT["stage2"] + 0.01
    assert examine(scenario(made), "made").merits["stage2"].peak_current == pytest.approx(peak, rel=1e-3)


def test_latency_comes_from_stamps_and_arrivals():
    (latency,) = examine(scenario(Made(latency=0.0013, state_delay=0.0004)), "made").graph["latency"]
    assert latency["command_topic"] == "/sfj/effort_command"
    assert latency["from_stamp"]["p50"] == pytest.approx(0.0013, abs=1e-9)
    assert latency["between_arrivals"]["max"] == pytest.approx(0.0009, abs=1e-9)
    assert latency["unanswered"] == 0
    assert latency["late_percent"] == 0.0


def test_answers_later_than_two_periods_are_counted():
    recording = scenario(Made())
    commands = recording.topics["/sfj/effort_command"]
    received = commands.received.copy()
    received[:50] += 4_000_000
    recording.topics["/sfj/effort_command"] = replace(commands, received=received)
    (latency,) = examine(recording, "made").graph["latency"]
    assert latency["late_percent"] == pytest.approx(100.0 * 50 / len(commands))
    assert latency["from_stamp"]["max"] == pytest.approx(0.0047, abs=1e-9)


def test_lost_samples_and_unanswered_states_are_counted_apart():
    graph = examine(scenario(Made(lost=(700, 1500, 1501), unanswered=(900, 2000))), "made").graph
    assert graph["topics"]["/sfj/joint_states"]["lost"] == 3
    assert graph["topics"]["/reference"]["lost"] == 0
    assert graph["latency"][0]["unanswered"] == 2


@pytest.mark.parametrize(
    ("reception", "told"),
    [
        ({}, "3 samples missing (0.06 %), never taken or lost on the way."),
        ({"lost_on_the_way": {"/sfj/joint_states": 1}}, "missing (0.06 %): 2 never taken, 1 lost on the way"),
        ({"lost_on_the_way": {"/sfj/joint_states": 0}}, "missing (0.06 %): 3 never taken, 0 lost on the way"),
    ],
)
def test_what_the_recorder_counted_is_told_apart_from_what_was_never_taken(reception, told):
    made = replace(scenario(Made(lost=(700, 1500, 1501))), reception=reception)
    texts = [text for _, text in verdicts(examine(made, "made"))]
    (sentence,) = (text for text in texts if text.startswith("/sfj/joint_states:"))
    assert told in sentence


def test_rate_is_that_of_the_stamps():
    graph = examine(scenario(Made(), rate=250.0), "made").graph
    assert graph["topics"]["/sfj/joint_states"]["rate"] == pytest.approx(250.0)
    assert graph["topics"]["/reference"]["rate"] == pytest.approx(500.0)


def test_settings_come_from_the_recording_before_nominal_ones_and_from_the_command_line_before_both():
    settings = examine(scenario(Made()), "made").merits["stage1"].settings
    assert settings["lambda"] == 0.5
    assert settings["source"]["lambda"] == "recording, /force_controller: stage1.lambda"
    assert settings["source"]["stiffness"] == "nominal"
    (motion,) = examine(scenario(Made()), "made", {"stage1": {"lambda": 0.25}}).merits["stage1"].free
    assert motion.expected_speed == pytest.approx(0.6 / 0.25)


def test_an_unknown_torque_gain_is_asked_for():
    with pytest.raises(MismatchError, match=r"mybag.*torque gain of stage1.*--torque-gain"):
        examine(scenario(Made(), parameters={}), "mybag")


def test_a_recording_of_something_else_is_refused():
    recording = scenario(Made())
    del recording.topics["/sfj/joint_states"]
    with pytest.raises(MismatchError, match=r"mybag.*/sfj/joint_states"):
        examine(recording, "mybag")


def test_manual_mode_takes_the_device_for_the_command():
    recording = scenario(Made())
    recording.parameters = {
        **PARAMETERS,
        "/force_controller": {**PARAMETERS["/force_controller"], "command_source": "device"},
    }
    merit = examine(recording, "made").merits["stage1"]
    assert not merit.free  # the device was not moved in this recording
    assert merit.settings["desired_torque_from"].startswith("/omni/joint_states")


def led_by_hand(made: Made, angle) -> Recording:
    """The recording with a device that a hand leads along `angle`(time s), rad, on both axes."""
    recording = scenario(made)
    omni = recording.topics["/omni/joint_states"]
    position = np.zeros(omni.position.shape)
    position[:, 1:] = angle(omni.time())[:, None]
    recording.topics["/omni/joint_states"] = replace(omni, position=position)
    recording.parameters = {
        **PARAMETERS,
        "/force_controller": {**PARAMETERS["/force_controller"], "command_source": "device"},
    }
    return recording


def withdrawn(time):
    """0.06 rad from 1 s on, with a tremor of 1 %, and from 7 s on within 2 s back to 0."""
    level = np.interp(time, [1.0, 1.0 + 1e-6, 7.0, 9.0], [0.0, 0.06, 0.06, 0.0])
    return level * (1.0 + 0.01 * np.sin(60.0 * time))


def sentences(recording: Recording, beginning: str) -> list[tuple[str, str]]:
    return [one for one in verdicts(examine(recording, "made")) if one[1].startswith(beginning)]


@pytest.mark.parametrize(("offset", "status"), [(0.0, "good"), (-0.06, "bad"), (0.06, "bad")])
def test_of_a_contact_led_by_a_hand_it_counts_what_is_pressed_while_the_hand_holds_still(offset, status):
    made = Made(damping=0.7, offset=offset)  # the torque stays when the hand draws back at 7 s
    recording = led_by_hand(made, withdrawn)
    (contact,) = examine(recording, "made").merits["stage1"].contacts
    assert contact.held == pytest.approx((made.touch, 7.0 + 2.0 * 0.1), abs=0.1)
    assert contact.desired_torque == pytest.approx(0.6, rel=0.02)
    assert contact.settled_torque == pytest.approx(0.6 + offset, abs=1e-3)
    ((told, sentence),) = sentences(recording, "Stage 1 in contact")
    assert told == status
    assert "while the hand that leads holds still" in sentence
    # The same torques, where an artificial command asks for the same: it must have settled at the end.
    recording.parameters = PARAMETERS
    reference = recording.topics["/reference"]
    both = np.repeat(withdrawn(reference.time())[:, None], 2, axis=1)
    recording.topics["/reference"] = replace(reference, position=both)
    ((told, sentence),) = sentences(recording, "Stage 1 in contact")
    assert told == "bad" and "does not settle" in sentence


def test_a_contact_in_which_the_hand_never_holds_still_is_not_judged():
    def restless(time):
        return np.where((time >= 1.0) & (time < 9.0), 0.06 * (1.0 + 0.3 * np.sin(6.0 * time)), 0.0)

    recording = led_by_hand(Made(), restless)
    ((status, sentence),) = sentences(recording, "Stage 1 in contact")
    assert status == "plain" and "not judged: a hand leads" in sentence


def test_the_longest_stretch_within_a_band_is_that_of_all_stretches():
    rng = np.random.default_rng(3)
    for band in (0.0, 0.3, 1.0, 9.0):
        values = np.round(np.cumsum(rng.normal(0.0, 0.2, 40)), 1)
        every = [(a, b) for a in range(40) for b in range(a + 1, 41) if np.ptp(values[a:b]) <= band]
        first, after = longest_still(values, band)
        assert (first, after) in every
        assert after - first == max(b - a for a, b in every)


def test_two_runs_agree_when_only_their_delay_differs():
    first, second = (
        examine(scenario(Made()), "a"),
        examine(scenario(Made(onset=1.5, release=9.5, duration=10.5)), "b"),
    )
    assert all(value > 99.0 for signals in agreement(first, second).values() for value in signals.values())
    slower = examine(scenario(Made(droop=0.3)), "c")
    assert agreement(first, slower)["stage1"]["arm_position"] < 90.0


def test_the_command_writes_report_pictures_and_figures(tmp_path, capsys):
    bag = write(scenario(Made()), tmp_path / "bag <1>")
    other = write(scenario(Made(droop=0.1)), tmp_path / "bag 2")
    output = tmp_path / "out"
    assert verify.main([bag, other, "--output", str(output), "--remove-delay"]) == 0
    result = json.loads((output / "verify.json").read_text())
    contact = result["runs"][bag]["stages"]["stage1"]["contacts"][0]
    assert contact["desired_torque"] == pytest.approx(0.6)
    assert set(result["agreement"]) == {other}
    page = (output / "report.html").read_text()
    assert "bag &lt;1&gt;" in page
    assert "bag <1>" not in page
    assert page.count("<svg role=") == 4  # two stages, energy, latency
    assert result["runs"][bag]["energy_j"]["slave"]["end"][0] > 0.0
    assert (output / "stage1.png").stat().st_size > 10_000
    told = capsys.readouterr().out
    assert "Stage 1 in free motion" in told
    # What happened and what to do come first, as on the page.
    first, then = told.splitlines()[:2]
    assert first.startswith(("ok: ", "note: ")) and "rad/s" in first and then.startswith("what to do: ")
    assert first.split(": ", 1)[1] in html.unescape(page)


@pytest.mark.usefixtures("unillustrated")
def test_an_earlier_report_is_kept_unless_overwriting_is_asked_for(tmp_path, capsys):
    bag = write(scenario(Made(duration=3.0, release=2.9)), tmp_path / "bag")
    output = tmp_path / "out"
    output.mkdir()
    (output / "verify.json").write_text("mine")
    assert verify.main([bag, "--output", str(output)]) == 2
    assert "--overwrite" in capsys.readouterr().err
    assert (output / "verify.json").read_text() == "mine"
    assert verify.main([bag, "--output", str(output), "--overwrite"]) == 1  # it never settles
    assert (output / "verify.json").read_text() != "mine"


@pytest.mark.parametrize(
    "arguments", [["--lambda", "-1"], ["--wall", "nan"], ["--torque-gain", "1", "2", "3"], ["--lamda", "1"]]
)
def test_impossible_arguments_end_with_status_2(tmp_path, arguments):
    assert verify.main([str(tmp_path / "bag"), "--output", str(tmp_path / "out"), *arguments]) == 2


def test_a_missing_bag_ends_with_status_2_and_its_name(tmp_path, capsys):
    assert verify.main([str(tmp_path / "absent"), "--output", str(tmp_path / "out")]) == 2
    assert "absent" in capsys.readouterr().err


def test_the_first_line_says_what_happened_whether_it_is_good_and_what_to_do():
    good = examine(scenario(Made()), "good")
    status, happened, todo = conclusion([good], ["good"])
    assert status == "good" and todo.startswith("nothing is wrong")
    assert "Stage 1 moves freely at 1.14 rad/s and presses with 0.600 of 0.600 N·m asked" in happened
    wrong = examine(scenario(Made(offset=0.2)), "wrong")
    status, happened, todo = conclusion([good, wrong], ["good", "wrong"])
    assert status == "bad" and happened.startswith("wrong came to its end, but not as promised. Stage 1")
    assert "0.8000 N·m of 0.6000 N·m asked" in happened and "pictures" in todo
    late = examine(scenario(Made(droop=0.2)), "slow")
    assert conclusion([late], ["slow"])[0] == "fair"


def test_several_runs_stand_side_by_side_with_one_line_of_what_they_did(tmp_path):
    runs = [examine(scenario(Made(damping=d)), f"damping {d}") for d in (0.3, 0.5, 0.7)]
    labels = [run.name for run in runs]
    most = runs[0].merits["stage1"].contacts[0].overshoot_percent
    _, happened, _ = conclusion(runs, labels)
    assert happened.startswith("3 runs of scenario 1 came to their end. Stage 1 moves freely at 1.14 rad/s")
    assert f"overshoot at most {most:.0f} % (damping 0.3)" in happened and len(happened) < 300
    plots = {stage: stage_picture(runs, stage, labels) for stage in ("stage1", "stage2")}
    page = verification_page(runs, labels, {}, plots, Overlays({}, {}, {}))
    assert not page.figures, "those of one run alone would tell nothing of the others"
    table = page.sections[0].blocks[0]
    assert page.sections[0].title == "The runs side by side" and len(table.rows) == 2 * len(runs)
    overshoot = [float(row[table.header.index("overshoot (%)")]) for row in table.rows[:3]]
    found = [run.merits["stage1"].contacts[0].overshoot_percent for run in runs]
    assert overshoot == pytest.approx(found, abs=0.05)


def test_of_several_runs_the_difference_to_the_first_can_be_shown():
    runs = [examine(scenario(Made(droop=d)), f"droop {d}") for d in (0.0, 0.05)]
    plot = stage_picture(runs, "stage1", ["one", "two"])
    assert len(plot.difference) == len(plot.panels) == 5 and plot.difference_of == "each run less one"
    (slower,) = plot.difference[2].series
    free = runs[0].merits["stage1"].free[0]
    inside = (slower.time > free.start + 0.5 * free.duration) & (slower.time < free.start + free.duration)
    assert np.median(slower.value[inside]) == pytest.approx(-0.05 * free.speed, rel=0.1)
    assert "Show each run less one instead" in page_of(plot)
    told = stage_picture(runs, "stage1", ["recorded", "lab"], roles=["measured", "given"])
    assert told.difference_of == "measured less simulated"
    assert np.nanmax(np.abs(told.difference[2].series[0].value + slower.value)) == 0.0
    assert not stage_picture(runs[:1], "stage1", ["one"]).difference
    motor, arm = told.panels[1].series[2:4]
    assert (motor.label, arm.label) == ("lab: motor", "lab: arm")
    assert stripes(arm.dash) != stripes(ROLES["given"].dash)


def stripes(dash):
    """A dash as it repeats: as short as it can be."""
    for size in range(2, len(dash), 2):
        if dash == dash[:size] * (len(dash) // size):
            return dash[:size]
    return dash


def page_of(plot):
    page = Page("Runs")
    page.section("Stage 1").plot(plot, "Stage 1")
    return page.render()


def test_walls_and_limits_have_a_name_in_the_legend():
    run = examine(scenario(Made()), "made")
    stage = run.stages["stage1"]
    settings = replace(stage.settings, current_limit=float(np.nanmax(stage.current)))
    run.stages["stage1"] = replace(stage, settings=settings)
    plot = stage_picture([run], "stage1", ["made"])
    assert {"wall", "current limit"} <= {series.label for series in plot.legend()}
    assert not any(panel.guides for panel in plot.panels)


def test_settings_have_units_and_a_source():
    run = examine(scenario(Made()), "made")
    header, rows, _ = settings_table([run], ["made"])
    assert header[-2:] == ["unit", "source"]
    units = {row[2]: row[4] for row in rows}
    assert units["lambda"] == "N·m·s/rad" and units["current_limit"] == "A" and "" not in units.values()


def test_a_contact_that_had_time_to_settle_and_has_not_is_a_failure_wherever_the_recording_ends():
    for duration in (10.0, 8.0):  # released at 9 s, or pressing until the end
        run = examine(scenario(Made(offset=-0.06, duration=duration)), "made")
        (contact,) = run.merits["stage1"].contacts
        assert contact.settling_time is None and not contact.cut_off
        assert [s for s, text in verdicts(run) if text.startswith("Stage 1 in contact")] == ["bad"]


@pytest.mark.parametrize("law", ["augmented_error", "disturbance_observer"])  # this one is thrown back far
def test_a_contact_that_the_end_of_the_recording_cuts_off_is_no_free_motion(tmp_path, law):
    shipped = Path(__file__).parents[2] / "config" / "scenario1_sim.yaml"
    scenario_file = tmp_path / "scenario.yaml"
    scenario_file.write_text(shipped.read_text().replace("law: augmented_error", f"law: {law}"))
    assert lockstep.main([str(scenario_file), "--duration", "6", "--record", str(tmp_path / "bag")]) == 0
    recording = read_recording(tmp_path / "bag")
    run = examine(recording, "cut")
    (contact,) = run.merits["stage1"].contacts
    # By the angle of the arm: it is at the wall of 1 rad for the first time.
    states = recording.topics["/sfj/joint_states"]
    touch = states.time()[np.argmax(states.signal("stage1_arm", "position") > 0.999)]
    assert contact.cut_off and contact.start == pytest.approx(touch, abs=0.01)
    assert not run.merits["stage2"].contacts[0].cut_off
    (told,) = [v for v in verdicts(run) if "has not settled when the recording ends" in v[1]]
    assert told[0] == "fair" and not [v for v in verdicts(run) if "met no wall" in v[1]]
    assert "meets the wall just before the recording ends" in conclusion([run], ["cut"])[1]
    assert run.merits["stage1"].free[0].speed > 0.5  # and not that of a rebound
