"""How much faster than real time scenario 1 runs when simulated time goes as fast as it can.

The graph composed in one process and as a process for each node, with and without a recording, and the
lockstep runner beside them; by turns in one run, so that the other work of the machine falls on all of them.
What counts is simulated seconds per second from the first tick to the last, without the start of the
processes.

Promise: composed, without a recording, at least 3 times real time on a machine that has two cores to itself.
Where other work kept the processor from us, seconds of the processor count instead of those of the clock.
"""

import argparse
import json
import os
import re
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

SCENARIO = Path(__file__).resolve().parents[2] / "config" / "scenario1_sim.yaml"
ROUNDS, SECONDS = 3, 10.0
AIM = 3.0
FRONT_DOOR = (sys.executable, "-m", "haptic_teleop_control.front_door")
KINDS = {
    "composed": (False, False),
    "composed, recorded": (False, True),
    "processes": (True, False),
    "processes, recorded": (True, True),
}
ALONE = "composed, alone in its process"


def lockstep(seconds):
    """Simulated seconds per second of the runner without nodes."""
    from haptic_teleop_sim.lockstep import run_scenario

    run_scenario(SCENARIO, 0.1)  # compiles
    start = time.perf_counter()
    run_scenario(SCENARIO, seconds)
    return seconds / (time.perf_counter() - start)


def graph(seconds, processes, recorded):
    """The real-time factor that `scenario` tells at its end."""
    with tempfile.TemporaryDirectory() as folder:
        command = [*FRONT_DOOR, "scenario", str(SCENARIO), "--duration", f"{seconds:g}"]
        command += ["--real-time-factor", "0"]
        command += ["--processes"] if processes else []
        command += ["--record", str(Path(folder, "bag"))] if recorded else []
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    found = re.findall(r"real-time factor ([\d.]+)", done.stderr)
    if done.returncode or not found:
        raise SystemExit(f"{' '.join(command)} ended with {done.returncode}:\n{done.stderr}")
    return float(found[-1])


def alone(seconds):
    """Figures of `run_alone` in a process of its own."""
    command = [sys.executable, __file__, "--alone", f"{seconds:g}"]
    answer = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True).stdout
    return json.loads(answer.splitlines()[-1])


def run_alone(seconds):
    """The composed nodes with their coordinator and nobody else; prints simulated seconds per second of the
    clock and of the processor."""
    import rclpy

    from haptic_teleop_control.nodes.base.registry import node_class
    from haptic_teleop_control.nodes.base.ros_arguments import parse_ros_arguments
    from haptic_teleop_control.nodes.base.run import SWITCH_INTERVAL, create_nodes, spin
    from haptic_teleop_control.simulated_time.messages import HALTED, OVER

    sys.setswitchinterval(SWITCH_INTERVAL)
    rclpy.init()
    names = ["sfj_sim", "omni_sim", "force_controller", "signal_generator"]
    stated = {"participants": json.dumps(names), "real_time_factor": "0.0", "duration": f"{seconds:.1f}"}
    rules = [part for key, value in stated.items() for part in ("-p", f"time_coordinator:{key}:={value}")]
    arguments = parse_ros_arguments(["--ros-args", "--params-file", str(SCENARIO), *rules])
    nodes = create_nodes([node_class(name) for name in [*names, "time_coordinator"]], arguments)
    coordinator = nodes[-1]._coordinator
    begun = []

    def over():
        if not begun and coordinator.ticks > 0.1 * seconds * 1000:
            begun.extend((time.perf_counter(), time.process_time(), coordinator.stamp))
        return coordinator.state in (OVER, HALTED)

    spin(nodes, over)
    simulated = (coordinator.stamp - begun[2]) * 1e-9
    clock, processor = time.perf_counter() - begun[0], time.process_time() - begun[1]
    if coordinator.state == HALTED:
        raise SystemExit(coordinator.reason)
    print(json.dumps([simulated / clock, simulated / processor]), flush=True)
    rclpy.try_shutdown()


def main():
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    os.environ["ROS_DOMAIN_ID"] = str(50 + os.getpid() % 50)
    parser = argparse.ArgumentParser()
    parser.add_argument("--rounds", type=int, default=ROUNDS)
    parser.add_argument("--seconds", type=float, default=SECONDS, help="simulated, of each run")
    parser.add_argument("--alone", type=float, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.alone is not None:
        run_alone(given.alone)
        return 0
    factors = {"lockstep": [], ALONE: [], **{kind: [] for kind in KINDS}}
    processor = []
    for _ in range(given.rounds):
        factors["lockstep"].append(lockstep(given.seconds))
        by_clock, by_processor = alone(given.seconds)
        factors[ALONE].append(by_clock)
        processor.append(by_processor)
        for kind, options in KINDS.items():
            factors[kind].append(graph(given.seconds, *options))
    fastest = statistics.median(factors["lockstep"])
    print("simulated seconds per second, median of the rounds (least to most), and as a share of lockstep")
    for kind, found in factors.items():
        middle = statistics.median(found)
        spread = f"({min(found):.2f} to {max(found):.2f})"
        print(f"  {kind:32} {middle:7.2f}  {spread:18}  {100 * middle / fastest:6.2f} %")
    print(f"  {ALONE + ', processor':32} {statistics.median(processor):7.2f}  (per second of the processor)")
    kept = max(statistics.median(factors[ALONE]), statistics.median(processor)) >= AIM
    print(f"   {'kept' if kept else 'NOT KEPT'}: composed, at least {AIM:g} times real time")
    return 0 if kept else 1


if __name__ == "__main__":
    sys.exit(main())
