"""`acquire` in a ROS graph: plant, experiment and recorder as processes, and a bag that `estimate` can
read."""

import math
import subprocess
import sys

import numpy as np
import pytest
import yaml
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from ros_graph import Sink, Source

from haptic_teleop_control.nodes.acquisition import AcquisitionNode
from haptic_teleop_control.recording import read_recording
from haptic_teleop_control.robots import SFJ_JOINTS


def test_an_experiment_in_the_graph_moves_one_stage_and_ends_in_a_bag(tmp_path, repository):
    content = yaml.safe_load((repository / "config" / "acquire_sfj_stage2.yaml").read_text())
    content["acquisition"]["ros__parameters"]["signal"] |= {"delay": 0.5, "duration": 1.5}
    path, bag = tmp_path / "acquire.yaml", tmp_path / "bag"
    path.write_text(yaml.safe_dump(content))
    command = [sys.executable, "-m", "haptic_teleop_control.front_door", "acquire"]
    done = subprocess.run(
        [*command, "--config", str(path), "--output", str(bag)], capture_output=True, text=True, timeout=110
    )
    assert done.returncode == 0, done.stderr
    recording = read_recording(bag)
    assert recording.complete
    states = recording.topic("/sfj/joint_states")
    assert np.ptp(states.signal("stage2_motor", "position")) > 0.01
    commands = recording.topic("/sfj/effort_command")
    assert np.any(commands.signal("stage2_motor", "effort"))
    assert not np.any(commands.signal("stage1_motor", "effort"))
    # Every command answers a state, by its stamp.
    assert np.array_equal(commands.stamp, states.stamp)
    assert any(name.endswith("acquisition") for name in recording.parameters)


@pytest.mark.long
@pytest.mark.parametrize("options", [[], ["--lockstep"]], ids=["graph", "lockstep"])
def test_an_experiment_that_is_aborted_ends_soon_after_and_says_so(tmp_path, repository, options):
    content = yaml.safe_load((repository / "config" / "acquire_sfj_stage2.yaml").read_text())
    content["acquisition"]["ros__parameters"] |= {"limit": {"velocity": 1e-3}}
    content["scenario"]["ros__parameters"]["real_time_factor"] = 1.0
    path, bag = tmp_path / "acquire.yaml", tmp_path / "bag"
    path.write_text(yaml.safe_dump(content))
    command = [sys.executable, "-m", "haptic_teleop_control.front_door", "acquire", *options]
    done = subprocess.run(
        [*command, "--config", str(path), "--output", str(bag)], capture_output=True, text=True, timeout=110
    )
    assert done.returncode == 1, done.stderr
    said = " ".join(done.stderr.split()).count("beyond limit.velocity")
    assert said == (1 if options else 2), "by the node that finds it, and in the end"
    commands = read_recording(bag).topic("/sfj/effort_command")
    moved = commands.stamp[np.flatnonzero(np.any(commands.effort != 0.0, axis=1))]
    rest = (commands.stamp[-1] - moved[-1]) * 1e-9
    assert 0.9 < rest < 5.0, "the signal takes a minute"


class Experiment:
    """The node, and a robot that a test plays: it gives the states and says in which fault it is."""

    def __init__(self, graph, **parameters):
        self.graph = graph
        self.states = Source(graph, "/sfj/joint_states", SFJ_JOINTS)
        self.diagnostics = graph.probe.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self.commands = Sink(graph, "/sfj/effort_command")
        signal = {"signal__enabled": True, "signal__delay": 0.5, "signal__duration": 20.0,
                  "signal__step__enabled": True, "signal__step__amplitude": 0.05}  # fmt: skip
        self.node = graph.start(AcquisitionNode, **{**signal, **parameters})
        graph.until(lambda: self.states.connected() and self.commands.connected(), what="discovery")
        graph.until(lambda: self.diagnostics.get_subscription_count(), what="discovery")
        self.time = 1_000_000_000
        self.heard: list[str] = []  # names of the nodes whose statuses it has looked at
        look = self.node._robot_faults.step
        self.node._robot_faults.step = lambda node, *rest: (look(node, *rest), self.heard.append(node))[0]

    def effort(self, later=0.002):
        """The answer to the state that comes `later`, s."""
        self.time += round(later * 1e9)
        zero = [0.0] * 4
        self.states.send(self.time, position=zero, velocity=zero, effort=zero)
        answer = self.graph.until(lambda: self.commands.answer_to(self.time), what="an answer")
        return answer.effort[0]

    def says(self, message="", node="/sfj/sfj_driver", **counts):
        """A status of the robot: an error with `message`, or none, and counted faults."""
        level = DiagnosticStatus.ERROR if message else DiagnosticStatus.OK
        values = [KeyValue(key=f"fault {name}", value=str(count)) for name, count in counts.items()]
        status = DiagnosticStatus(level=level, name=node, message=message, values=values)
        before = self.heard.count(node)
        self.diagnostics.publish(DiagnosticArray(status=[status]))
        self.graph.until(lambda: self.heard.count(node) > before, what="the status")


@pytest.fixture
def running(graph):
    experiment = Experiment(graph)
    experiment.says(stale_command=3, overload=0)  # of what was before
    experiment.effort()
    assert experiment.effort(0.6) == pytest.approx(0.05 * 8.925)
    return experiment


def stays_ended(experiment, fault):
    assert experiment.node.faults.counts[fault] == 1
    assert experiment.node.state() == "aborted"
    assert experiment.effort() == 0.0
    assert experiment.graph.call("/acquisition/reset").success
    assert experiment.effort() == 0.0, "after a reset in mid-experiment"
    assert experiment.effort(0.6) == 0.0
    assert experiment.node.state() == "aborted"
    assert experiment.node.faults.latched is None, "the experiment's end is told once"


def test_a_robot_in_a_fault_ends_the_experiment_and_its_reset_does_not_bring_it_back(running):
    running.says("overload: the current was too high", stale_command=3, overload=1)
    assert running.effort() == 0.0
    assert running.node.faults.latched == "robot_fault"
    assert "/sfj/sfj_driver: overload" in running.node.faults.sentence
    running.says(stale_command=3, overload=1)  # the robot has been reset
    assert running.effort() == 0.0
    stays_ended(running, "robot_fault")


def test_a_fault_that_was_reset_between_two_diagnostics_ends_it_as_well(running):
    running.says(stale_command=3, overload=1)
    assert running.effort() == 0.0
    assert "overload" in running.node.faults.sentence
    stays_ended(running, "robot_fault")


def test_what_the_other_robot_or_the_past_says_does_not_end_it(running):
    running.says("silent: no report", node="/omni/omni_driver", silent=1)
    running.says(stale_command=3, overload=0)
    assert running.effort() == pytest.approx(0.05 * 8.925)
    assert running.node.faults.latched is None


def test_a_bad_state_ends_it_and_a_reset_does_not_let_the_signal_go_on_in_its_middle(running):
    running.time += 2_000_000
    running.states.send(running.time, position=[0.0] * 4, velocity=[math.nan] * 4, effort=[0.0] * 4)
    running.graph.until(lambda: running.node.faults.latched == "state")
    stays_ended(running, "state")


def test_a_robot_that_was_started_anew_does_not_get_the_rest_of_the_signal(running):
    assert running.effort(0.9) == pytest.approx(0.05 * 8.925)
    assert running.effort(1.1) == 0.0
    stays_ended(running, "stale_state")


def test_a_robot_that_is_in_a_fault_before_the_experiment_is_not_moved(graph):
    experiment = Experiment(graph)
    experiment.says("overload: the current was too high", overload=1)
    experiment.effort()
    assert experiment.effort(0.6) == 0.0
    assert experiment.node.faults.latched == "robot_fault"


def test_a_fault_of_a_node_is_told_at_once_and_not_at_the_next_second(graph):
    heard = []
    graph.probe.create_subscription(DiagnosticArray, "/diagnostics", heard.append, 10)
    experiment = Experiment(graph)
    experiment.node._report = lambda: None
    for timer in experiment.node.timers:
        timer.cancel()
    graph.listen(0.05)
    heard.clear()
    experiment.says("overload: the current was too high", overload=1)
    own = graph.until(lambda: [m.status[0] for m in heard if m.status[0].name == "/acquisition"])
    assert own[0].level == DiagnosticStatus.ERROR and "robot_fault" in own[0].message


@pytest.mark.long
def test_acquire_ends_with_1_names_the_robot_s_fault_and_keeps_what_was_recorded(tmp_path, repository):
    content = yaml.safe_load((repository / "config" / "acquire_sfj_stage1.yaml").read_text())
    content["scenario"]["ros__parameters"]["nodes"] = ["sfj_driver", "acquisition"]
    # A trip that the experiment reaches in its middle.
    content["sfj_driver"] = {"ros__parameters": {"device": "emulated", "stage1": {"deflection_trip": 0.01}}}
    del content["sfj_sim"]
    content["acquisition"]["ros__parameters"]["signal"] |= {"delay": 0.5, "duration": 3.0}
    path, bag = tmp_path / "acquire.yaml", tmp_path / "bag"
    path.write_text(yaml.safe_dump(content))
    command = [sys.executable, "-m", "haptic_teleop_control.front_door", "acquire"]
    done = subprocess.run(
        [*command, "--config", str(path), "--output", str(bag)], capture_output=True, text=True, timeout=110
    )
    assert done.returncode == 1, done.stderr
    assert "fault in /acquisition: robot_fault" in done.stderr
    assert "deflection" in done.stderr
    recording = read_recording(bag)
    assert recording.complete
    commands = recording.topic("/sfj/effort_command").signal("stage1_motor", "effort")
    asked = np.flatnonzero(commands)
    assert asked.size > 10
    assert not commands[asked[-1] + 1 :].any()
    assert len(commands) - asked[-1] > 100, "it went on to answer, with zero"
