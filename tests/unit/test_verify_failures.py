"""What makes a recording a failure is told first, in words and as data, and by the exit status."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore
from scenario_recordings import START, Made, scenario

from haptic_teleop_control.parameter_files import load_parameter_file
from haptic_teleop_control.recording import Recording, RecordingWriter, read_recording
from haptic_teleop_control.recording.said import DIAGNOSTICS_TYPE, Status
from haptic_teleop_control.recording.texts import STRING_TYPE, encode_text
from haptic_teleop_sim.lockstep import record_scenario
from haptic_teleop_sim.scenario_parameters import check_scenario
from haptic_teleop_sysid.commands import demo, verify
from haptic_teleop_sysid.shipped_files import find_scenario
from haptic_teleop_sysid.verification.conclusion import conclusion
from haptic_teleop_sysid.verification.run import examine
from haptic_teleop_sysid.verification.verdicts import verdicts

pytestmark = pytest.mark.usefixtures("unillustrated")

SECOND = 1_000_000_000
STALE = "stale_slave: the slave's state stopped; look whether its driver still runs (0.061 s)."


def at(seconds: float) -> int:
    return START + round(seconds * SECOND)


def reports(node: str, *levels: int, message: str = STALE, counts: dict[int, int] | None = None):
    """A report of `node` each second from 0.5 s on."""
    return [
        (
            at(0.5 + k),
            [
                Status(
                    0, node, level, message if level else "engaged",
                    {"fault stale_slave": str((counts or {}).get(k, 0)), "periods skipped": str(3 * k)},
                )
            ],
        )
        for k, level in enumerate(levels)
    ]  # fmt: skip


def encode_diagnostics(stamp: int, statuses: list[Status]) -> bytes:
    """A serialised DiagnosticArray (CDR) of `statuses`, stamped `stamp` ns."""
    store = get_typestore(Stores.ROS2_KILTED)
    make = store.types.__getitem__
    time = make("builtin_interfaces/msg/Time")(sec=stamp // 10**9, nanosec=stamp % 10**9)
    header = make("std_msgs/msg/Header")(stamp=time, frame_id="")
    pair, status = make("diagnostic_msgs/msg/KeyValue"), make("diagnostic_msgs/msg/DiagnosticStatus")
    content = [
        status(
            level=one.level,
            name=one.node,
            message=one.message,
            hardware_id="",
            values=[pair(key=key, value=value) for key, value in one.values.items()],
        )
        for one in statuses
    ]
    message = make(DIAGNOSTICS_TYPE)(header=header, status=content)
    return bytes(store.serialize_cdr(message, DIAGNOSTICS_TYPE))


def bag(path, recording: Recording, diagnostics=(), states=(), reception=None) -> str:
    """Writes the recording as a recorder does, with what nodes said."""
    about = {"parameters": recording.parameters, "experiment": recording.experiment}
    with RecordingWriter(path, **about) as writer:
        for received, statuses in diagnostics:
            writer.write("/diagnostics", DIAGNOSTICS_TYPE, received, encode_diagnostics(received, statuses))
        for received, text in states:
            writer.write("/force_controller/state", STRING_TYPE, received, encode_text(text))
        writer.write_series(recording.topics)
        if reception is not None:
            writer.describe(reception=reception)
    return str(path)


def verified(path: str, folder, *arguments: str):
    """Exit status, verify.json, and the texts of the page's verdicts in their order."""
    status = verify.main([path, "--output", str(folder), "--no-simulation", *arguments])
    return status, json.loads((folder / "verify.json").read_text()), (folder / "report.html").read_text()


GOOD = {
    "diagnostics": reports("/force_controller", 0, 0, 0),
    "states": [(at(0.0), "off"), (at(0.1), "engaged")],
}


def test_a_run_without_a_fault_ends_with_0_and_says_so(tmp_path):
    status, result, page = verified(bag(tmp_path / "bag", scenario(Made()), **GOOD), tmp_path / "out")
    assert status == 0 and result["failed"] is False and "Fault in" not in page
    (run,) = result["runs"].values()
    assert run["faults"] == [] and not run["failed"]


def planned(seconds: object) -> Recording:
    made = scenario(Made())
    return replace(made, experiment={**made.experiment, "planned_duration": seconds})


@pytest.mark.parametrize("reception", [None, {"lost_on_the_way": {}, "ended": False}])
def test_a_run_that_was_cut_off_begins_with_that_and_ends_with_1(tmp_path, capsys, reception):
    path = bag(tmp_path / "bag", planned(20.0), **GOOD, reception=reception)
    status, result, page = verified(path, tmp_path / "out")
    printed = capsys.readouterr().out.splitlines()
    lasted = result["runs"][path]["cut_off"]
    assert status == 1 and result["failed"] and lasted.endswith("of 20 s"), lasted
    assert printed[0].startswith(f"bad: The run was {lasted}") and "let it run to its end" in printed[1]
    assert result["runs"][path]["verdicts"][0][1].startswith(f"The run was {lasted}") and lasted in page


@pytest.mark.parametrize(
    ("seconds", "reception"),
    [(20.0, {"ended": True}), (0.0, {"ended": False}), ("long", None), (math.nan, None)],
)
def test_what_came_to_its_end_or_had_none_was_not_cut_off(tmp_path, seconds, reception):
    path = bag(tmp_path / "bag", planned(seconds), **GOOD, reception=reception)
    status, result, _ = verified(path, tmp_path / "out")
    assert status == 0 and result["runs"][path]["cut_off"] == ""


def test_of_a_fault_the_end_is_no_second_failure(tmp_path):
    said = {"diagnostics": reports("/force_controller", 0, 2, 2)}
    path = bag(tmp_path / "bag", planned(20.0), **said, reception={"ended": False})
    _, result, _ = verified(path, tmp_path / "out")
    assert result["runs"][path]["cut_off"] == "" and result["failed"]


def test_a_damaged_recording_says_so_first_with_the_remedy_and_ends_with_1(tmp_path, capsys):
    path = bag(tmp_path / "bag", planned(20.0), **GOOD)
    (tmp_path / "bag" / "metadata.yaml").unlink()
    status, _, _ = verified(path, tmp_path / "out")
    printed = capsys.readouterr().out.splitlines()
    assert status == 1 and "was cut off" in printed[0] and f"recover {path}" in printed[1]


def test_a_promise_that_is_not_kept_ends_with_1_too(tmp_path, capsys):
    path = bag(tmp_path / "bag", scenario(Made(duration=3.0, release=2.9)), **GOOD)
    status, result, _ = verified(path, tmp_path / "out")
    assert status == 1 and result["conclusion"]["status"] == "bad" and "bad: " in capsys.readouterr().out


def test_a_latched_fault_comes_first_on_page_terminal_and_in_json_and_ends_with_1(tmp_path, capsys):
    said = {
        "diagnostics": reports("/force_controller", 0, 0, 0, 2, 2, 0, 0),
        "states": [(at(0.1), "engaged"), (at(3.2), "fault"), (at(5.0), "off"), (at(5.1), "engaged")],
    }
    path = bag(tmp_path / "bag", scenario(Made()), **said)
    status, result, page = verified(path, tmp_path / "out")
    assert status == 1 and result["failed"] is True
    (fault,) = result["runs"][path]["faults"]
    assert fault["node"] == "/force_controller" and fault["sentence"] == STALE
    assert (fault["start"], fault["end"]) == (pytest.approx(3.2), pytest.approx(5.0))
    sentence = (
        "Fault in /force_controller: stale_slave: the slave's state stopped; look whether its driver still "
        "runs (0.061 s) (in fault from 3.20 s to 5.00 s)."
    )
    assert result["runs"][path]["verdicts"][0] == ["bad", sentence]
    printed = capsys.readouterr().out.splitlines()
    assert printed[0].startswith("bad: The run failed. ") and sentence in printed[0]
    assert sentence in printed[printed.index(path) + 1], "right below the recording's name"
    first, then = page.index("Fault in /force_controller"), page.index("Stage 1 in free motion")
    assert first < then


@pytest.mark.parametrize(
    ("said", "node", "words"),
    [
        ({"diagnostics": reports("/sfj/sfj_sim", 0, 2, 2)}, "/sfj/sfj_sim", "to the end of the recording"),
        ({"states": [(at(2.0), "fault")]}, "/force_controller", "does not say which"),
        ({"states": [(at(2.0), "fault"), (at(11.0), "off")]}, "/force_controller", "to the end of"),
        (
            {"diagnostics": reports("/omni/omni_driver", 0, 0, 0, counts={1: 2, 2: 2})},
            "/omni/omni_driver",
            "counted 2 times",
        ),
        ({"reception": {"problems": ["only 3 MB are free, so the recording is ended"]}}, "recorder", "3 MB"),
        ({"diagnostics": reports("/somebodys_node", 0, 3, message="no data")}, "/somebodys_node", "no data"),
    ],
    ids=[
        "a robot's node",
        "the state alone",
        "a node that stops",
        "counted and reset in between",
        "the recorder",
        "another's node",
    ],
)
def test_whoever_reports_a_fault_is_heard(tmp_path, said, node, words):
    status, result, _ = verified(bag(tmp_path / "bag", scenario(Made()), **said), tmp_path / "out")
    (run,) = result["runs"].values()
    assert status == 1 and [fault["node"] for fault in run["faults"]] == [node]
    assert words in run["verdicts"][0][1]


def test_what_was_counted_before_the_recording_began_and_a_warning_are_no_faults_of_it(tmp_path):
    said = {"diagnostics": reports("/force_controller", 0, 1, 0, message="warm", counts={0: 4, 1: 4, 2: 4})}
    assert verified(bag(tmp_path / "bag", scenario(Made()), **said), tmp_path / "out")[0] == 0


def test_faults_of_several_recordings_stand_before_everything_else_on_the_page(tmp_path):
    good = bag(tmp_path / "good", scenario(Made()), **GOOD)
    bad = bag(tmp_path / "bad", scenario(Made()), states=[(at(2.0), "fault")])
    assert verify.main([good, bad, "--output", str(tmp_path / "out"), "--no-simulation"]) == 1
    page = (tmp_path / "out" / "report.html").read_text()
    assert page.index("bad: Fault in") < page.index("good: Stage 1")


def test_diagnostics_that_cannot_be_decoded_are_told_and_the_rest_is_read(tmp_path):
    path = bag(tmp_path / "bag", scenario(Made()), **GOOD)
    with RecordingWriter(tmp_path / "broken") as writer:
        writer.write("/diagnostics", DIAGNOSTICS_TYPE, at(1.0), b"\x00\x01\x00\x00\xff\xff\xff\xff")
        writer.write(
            "/diagnostics", DIAGNOSTICS_TYPE, at(2.0), encode_diagnostics(0, GOOD["diagnostics"][0][1])
        )
        writer.write_series(read_recording(path).topics)
    recording = read_recording(tmp_path / "broken")
    assert len(recording.diagnostics) == 1 and "1 of 2 messages cannot be decoded" in recording.problems[0]


def test_the_demo_ends_with_1_where_a_node_had_a_fault(tmp_path, monkeypatch, capsys):
    def run(scenario_file, directory, duration, factor):
        bag(directory, scenario(Made()), states=[(at(2.0), "fault"), (at(2.5), "off")])
        return 0

    monkeypatch.setattr(demo, "run_scenario", run)
    assert demo.main(["--output", str(tmp_path / "demo"), "--duration", "10"]) == 1
    assert "Fault in /force_controller" in capsys.readouterr().out


def test_lockstep_stores_a_fault_so_that_verify_tells_it(tmp_path):
    sections = {node: dict(values) for node, values in load_parameter_file(find_scenario()).items()}
    sections["force_controller"]["timeout"] = 0.005
    sections["signal_generator"]["rate"] = 100.0  # 10 ms between two references
    parameters = check_scenario(sections, source="scenario1_sim.yaml", duration=6.0)
    record_scenario(parameters, tmp_path / "bag")
    status, result, _ = verified(str(tmp_path / "bag"), tmp_path / "out")
    (run,) = result["runs"].values()
    assert status == 1 and "stale_reference: the reference stopped" in run["verdicts"][0][1]


# The computer.


def computer(recording: Recording) -> tuple[str, str]:
    ((status, text),) = (
        one for one in verdicts(examine(recording, "m")) if one[1].startswith("The computer")
    )
    return status, text


def test_one_line_says_what_the_computer_did_to_the_rate():
    assert computer(scenario(Made())) == (
        "good", "The computer, not the robots: it kept the rate: no sample is missing."
    )  # fmt: skip
    lossy = replace(
        scenario(Made(lost=tuple(range(700, 740)))), reception={"lost_on_the_way": {"/sfj/joint_states": 3}}
    )
    lossy.reception["lost_on_the_way"] |= dict.fromkeys(lossy.topics, 0) | {"/sfj/joint_states": 3}
    skipped = [one for _, statuses in reports("/sfj/sfj_sim", 0, 0, 0) for one in statuses]
    status, text = computer(replace(lossy, diagnostics=skipped))
    total = sum(len(one) for one in scenario(Made()).topics.values())
    assert status == "bad"
    assert f"80 of {total} samples are missing" in text, "40 states, and the commands that would answer them"
    assert "77 never taken because it was late, 3 lost on the way" in text and "skipped 6 periods" in text
    assert examine(lossy, "m").as_json()["machine"]["missing"] == 80


def of_simulated_time(recording: Recording, **told: str) -> Recording:
    """The recording as if time had been simulated, at the end of which the coordinator says `told`."""
    control = {**recording.parameters["/force_controller"], "use_sim_time": True}
    topics = {name: replace(one, received=one.stamp) for name, one in recording.topics.items()}
    said = {name.replace("_", " ").replace("real time", "real-time"): value for name, value in told.items()}
    return replace(
        recording,
        topics=topics,
        parameters={**recording.parameters, "/force_controller": control},
        diagnostics=[
            Status(at(1.0), "/time_coordinator", 0, "running", dict.fromkeys(said, "7.0")),
            Status(at(9.0), "/time_coordinator", 0, "over", said),
        ],
    )


def summary(recording: Recording, tmp_path, capsys) -> str:
    """What the demo prints of it."""
    run = examine(recording, "made")
    found = verify.Verification([run], {}, *conclusion([run], ["made"]))
    verify.print_summary(found, tmp_path / "report.html", figures_only=True)
    return capsys.readouterr().out


def test_of_simulated_time_it_tells_how_fast_it_went_and_no_latency(tmp_path, capsys):
    told = {"real_time_factor": "0.842", "real_time_factor_wanted": "1", "ticks_asked_for_again": "3"}
    recording = of_simulated_time(scenario(Made()), **told)
    run = examine(recording, "made")
    (line,) = (one for one in verdicts(run) if one[1].startswith("Simulated time"))
    assert line == (
        "good",
        "Simulated time: no sample is missing; real-time factor 0.84 achieved by the machine that ran it "
        "(wanted: 1).",
    )
    assert not any("computer" in text or "0.00 ms" in text for _, text in verdicts(run))
    printed = summary(recording, tmp_path, capsys)
    assert "real-time factor" in printed and "0.84" in printed and "latency" not in printed
    assert f"0 of {run.machine.expected} samples missing" in printed
    path = bag(tmp_path / "bag", recording, [(one.received, [one]) for one in recording.diagnostics])
    _, result, page = verified(path, tmp_path / "out")
    clock = result["runs"][path]["machine"]["clock"]
    assert clock == {"kind": "simulated", "achieved": 0.842, "wanted": 1.0, "repeats": 3}
    assert {one["from_stamp"] for one in result["runs"][path]["graph"]["latency"]} == {None}
    assert line[1] in page and "Loop latency of the slave" not in page


def test_a_sample_that_simulated_time_lacks_is_bad_and_a_state_without_answer_too():
    told = {"real_time_factor": "3.5", "real_time_factor_wanted": "0"}
    lossy = of_simulated_time(scenario(Made(lost=(700,), unanswered=(800,))), **told)
    found = verdicts(examine(lossy, "m"))
    ((status, line),) = (one for one in found if one[1].startswith("Simulated time"))
    assert status == "bad" and "samples are missing" in line and "(wanted: as fast as it goes)" in line
    assert ("bad", "/sfj/effort_command answers /sfj/joint_states: 1 states unanswered.") in found


def test_without_a_clock_there_is_neither_latency_nor_pace(tmp_path, capsys):
    sections = {node: dict(values) for node, values in load_parameter_file(find_scenario()).items()}
    record_scenario(check_scenario(sections, source="s", duration=6.0), tmp_path / "bag")
    recording = read_recording(tmp_path / "bag")
    lines = [text for _, text in verdicts(examine(recording, "m"))]
    assert "Lockstep, without a clock: no sample is missing." in lines
    assert not any(" ms " in text for text in lines)
    assert "lockstep, without a clock; 0 of 21000 samples missing" in summary(recording, tmp_path, capsys)


def test_what_the_emulated_network_loses_is_not_the_computers_doing():
    recording = scenario(Made())
    states = recording.topics["/sfj/joint_states"]
    kept = np.delete(np.arange(len(states)), np.arange(500, 900, 7))
    through = replace(
        states, stamp=states.stamp[kept], received=states.received[kept], position=None,
        velocity=states.velocity[kept], effort=states.effort[kept],
    )  # fmt: skip
    recording.topics["/link/teleoperation/slave"] = through
    assert computer(recording)[0] == "good"
    ((status, text),) = (one for one in verdicts(examine(recording, "m")) if one[1].startswith("/link/"))
    assert status == "plain" and "58 samples missing" in text


def test_help_tells_the_exit_status(capsys):
    assert verify.main(["--help"]) == 0
    told = " ".join(capsys.readouterr().out.split())
    assert '1 the report is written and begins with "bad": a fault, a run that was cut off' in told
