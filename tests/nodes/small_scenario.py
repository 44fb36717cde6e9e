"""A scenario of four nodes and 1.5 s, and the command that runs it."""

import subprocess
import sys

FILE = """
/**:
  ros__parameters: {use_sim_time: true}
scenario:
  ros__parameters: {nodes: [sfj_sim, omni_sim, force_controller, signal_generator], duration: 1.5}
sfj_sim:
  ros__parameters: {timeout: 0.05}
omni_sim:
  ros__parameters: {rate: 500.0}
force_controller:
  ros__parameters: {timeout: 0.05, master_rate: 500.0}
signal_generator:
  ros__parameters:
    rate: 200.0
    stage1: {enabled: true, step: {enabled: true, amplitude: 0.05}}
"""


def start(*arguments: str) -> subprocess.Popen:
    return subprocess.Popen(
        [sys.executable, "-m", "haptic_teleop_control.front_door", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
