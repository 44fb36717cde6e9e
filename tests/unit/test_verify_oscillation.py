"""Oscillation is a failure: what is put in is a formula, or a loop whose gains are too high."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scenario_recordings import CONSTANT, Made, scenario

from haptic_teleop_control.parameter_files import load_parameter_file
from haptic_teleop_control.recording import Recording, write_recording
from haptic_teleop_sim.lockstep import run_scenario
from haptic_teleop_sim.scenario_parameters import check_scenario
from haptic_teleop_sysid.commands import verify
from haptic_teleop_sysid.shipped_files import find_scenario
from haptic_teleop_sysid.verification.run import examine
from haptic_teleop_sysid.verification.verdicts import failures, verdicts

pytestmark = pytest.mark.usefixtures("unillustrated")

LIMIT = 0.94
"""A, of stage 1."""


def verified(path: str, folder):
    """Exit status and verify.json."""
    status = verify.main([path, "--output", str(folder), "--no-simulation"])
    return status, json.loads((folder / "verify.json").read_text())


def changed(**control):
    """Scenario 1 as it is shipped, with other gains for both stages."""
    sections = {node: dict(values) for node, values in load_parameter_file(find_scenario()).items()}
    own = {f"{stage}.{key}": value for stage in ("stage1", "stage2") for key, value in control.items()}
    sections["force_controller"] |= own
    return check_scenario(sections, source="scenario1_sim.yaml", duration=20.0)


def with_swing(signal: str, swing, recording: Recording | None = None) -> Recording:
    """The recording with `swing`(time s) added to one signal of stage 1: velocity, torque or current."""
    recording = recording or scenario(Made(contact=False, onset=0.5, release=9.5, amplitude=0.01))
    states, command = recording.topics["/sfj/joint_states"], recording.topics["/sfj/effort_command"]
    velocity, effort, commanded = states.velocity.copy(), states.effort.copy(), command.effort.copy()
    if signal == "velocity":
        velocity[:, 0] += swing(states.time())
    elif signal == "torque":
        effort[:, 1] += swing(states.time())
    else:
        commanded[:, 0] = CONSTANT["stage1"] * np.clip(swing(command.time()), -LIMIT, LIMIT)
    topics = {
        **recording.topics,
        "/sfj/joint_states": replace(states, velocity=velocity, effort=effort),
        "/sfj/effort_command": replace(command, effort=commanded),
    }
    return replace(recording, topics=topics)


def sine(frequency, amplitude, start=3.0, end=8.0, decay=0.0):
    def swing(time):
        since = time - start
        wave = amplitude * np.exp(-decay * since) * np.sin(2.0 * np.pi * frequency * since)
        return np.where((time >= start) & (time < end), wave, 0.0)

    return swing


def oscillation_of(recording: Recording, stage: str = "stage1"):
    return examine(recording, "made").merits[stage].oscillation


@pytest.mark.parametrize(
    ("signal", "frequency", "amplitude", "unit", "start"),
    [
        ("velocity", 12.3, 0.5, "rad/s", 3.0),
        ("velocity", 3.1, 0.2, "rad/s", 3.0),
        ("torque", 31.0, 0.06, "N·m", 3.0),
        ("torque", 2.2, 0.3, "N·m", 0.5),
        ("current", 60.0, 0.4, "A", 3.0),
    ],
)
def test_a_sustained_swing_is_told_with_frequency_amplitude_and_share(
    signal, frequency, amplitude, unit, start
):
    recording = with_swing(signal, sine(frequency, amplitude, start))
    found = oscillation_of(recording)
    assert found is not None and (found.kind, found.unit) == (signal, unit)
    assert found.frequency == pytest.approx(frequency, rel=0.02)
    assert found.amplitude == pytest.approx(amplitude, rel=0.1)
    assert found.share_percent == pytest.approx(10.0 * (8.0 - start), abs=15.0)
    assert found.start == pytest.approx(start, abs=0.8) and found.end == pytest.approx(8.0, abs=0.8)
    run = examine(recording, "made")
    assert run.merits["stage2"].oscillation is None
    assert failures(run) == verdicts(run)[:1] and "Stage 1 oscillates" in failures(run)[0][1]


@pytest.mark.parametrize("frequency", [1.6, 21.0, 125.0])
@pytest.mark.parametrize("duty", [0.5, 0.7])
def test_a_current_that_jumps_between_its_limits_is_told_at_any_frequency(frequency, duty):
    def jumps(time):
        phase = (time - 2.0) * frequency % 1.0
        return np.where((time >= 2.0) & (time < 8.3), np.where(phase < duty, LIMIT, -LIMIT), 0.0)

    found = oscillation_of(with_swing("current", jumps))
    assert found is not None and found.kind == "limits"
    assert found.frequency == pytest.approx(frequency, rel=0.05)
    assert found.amplitude == pytest.approx(LIMIT) and found.share_percent == pytest.approx(63.0, abs=8.0)
    run = examine(with_swing("current", jumps), "made")
    sentence = failures(run)[0][1]
    assert f"its current jumps between its limits of ±{LIMIT:g} A" in sentence
    assert not any("Stage 1 met no wall" in text for _, text in verdicts(run))


@pytest.mark.parametrize(
    "swing",
    [
        sine(12.0, 0.5, end=10.0, decay=0.5),
        sine(4.0, 0.8, end=10.0, decay=0.3),
        sine(12.0, 0.5, start=3.0, end=3.5),
        sine(12.0, 0.04),
        lambda time: 0.2 * np.random.default_rng(1).normal(size=len(time)),
    ],
    ids=["dies away", "dies away slowly", "short", "small", "noise"],
)
@pytest.mark.parametrize("signal", ["velocity", "torque"])
def test_what_dies_away_is_short_small_or_noise_is_no_oscillation(signal, swing):
    scale = 1.0 if signal == "velocity" else 0.4
    assert oscillation_of(with_swing(signal, lambda time: scale * swing(time))) is None


@pytest.mark.parametrize("frequency", [0.4, 2.0, 7.0])
@pytest.mark.parametrize("square", [False, True])
def test_what_a_swinging_command_makes_is_no_oscillation(frequency, square):
    """Answers with the command's frequency and three times it, as friction makes them."""
    recording = scenario(Made(contact=False, onset=0.5, release=9.5))
    reference = recording.topics["/reference"]

    def wave(time):
        tone = np.sin(2.0 * np.pi * frequency * (time - 0.5)) * (time > 0.5)
        return np.sign(tone) if square else tone

    position = np.repeat(0.06 * wave(reference.time())[:, None], 2, axis=1)
    recording.topics["/reference"] = replace(reference, position=position)
    answered = recording
    for signal, size in (("velocity", 1.0), ("torque", 0.3), ("current", 3.0)):
        answered = with_swing(
            signal, lambda time, size=size: size * (wave(time) + 0.3 * wave(3.0 * time)), answered
        )
    assert oscillation_of(answered) is None


def test_contact_that_rings_and_settles_and_bounces_are_no_oscillation():
    for made in (Made(), Made(damping=0.05, frequency=25.0), Made(bounces=3)):
        run = examine(scenario(made), "made")
        assert [merit.oscillation for merit in run.merits.values()] == [None, None], made


def test_a_loop_with_gains_that_are_too_high_fails_and_the_shipped_one_does_not(tmp_path):
    good, bad = changed(), changed(kpm=40.0)
    path = str(write_recording(tmp_path / "good", run_scenario(good, 20.0), dict(good.recorded), {}))
    assert verified(path, tmp_path / "good_out")[0] == 0
    topics = run_scenario(bad, 20.0)
    path = str(write_recording(tmp_path / "bad", topics, dict(bad.recorded), {}))
    status, result = verified(path, tmp_path / "bad_out")
    assert status == 1
    run = result["runs"][path]
    for stage, limit in (("stage1", 0.94), ("stage2", 1.2)):
        found = run["stages"][stage]["oscillation"]
        assert found["kind"] == "limits" and found["amplitude"] == pytest.approx(limit)
        # Independently: how often the drive turns round. The command comes after 4 of the 20 s.
        velocity = topics["/sfj/joint_states"].signal(f"{stage}_motor", "velocity")[3000:6500]
        turned = np.count_nonzero(np.diff(np.sign(velocity - velocity.mean())))
        assert found["frequency"] == pytest.approx(turned / 2.0 / 7.0, rel=0.05)
        assert found["share_percent"] == pytest.approx(80.0, abs=3.0)
    assert [text.split(":")[0] for _, text in run["verdicts"][:2]] == [
        "Stage 1 oscillates",
        "Stage 2 oscillates",
    ]


@pytest.mark.parametrize("frequency", [0.7, 3.0])
def test_a_tone_as_command_of_a_sound_loop_is_no_failure(frequency):
    sections = {node: dict(values) for node, values in load_parameter_file(find_scenario()).items()}
    times = np.arange(0.0, 9.0, 0.05 / frequency)
    tone = {
        f"{stage}.{key}": value
        for stage in ("stage1", "stage2")
        for key, value in {
            "enabled": True,
            "delay": 1.0,
            "steps.enabled": True,
            "steps.times": times.round(6).tolist(),
            "steps.levels": (0.06 * np.sin(2.0 * np.pi * frequency * times)).tolist(),
        }.items()
    }
    sections["signal_generator"] = {"kind": "position", "rate": 500.0, **tone}
    parameters = check_scenario(sections, source="tone")
    recording = Recording(None, run_scenario(parameters, 12.0), dict(parameters.recorded))
    run = examine(recording, "tone")
    assert np.ptp(run.stages["stage1"].motor_velocity) > 0.1
    assert failures(run) == []
