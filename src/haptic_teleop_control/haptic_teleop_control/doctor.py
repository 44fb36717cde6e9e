"""`doctor`: what is there and what is missing, each line OK or with its remedy.

Each package may bring a module `doctor_checks` with `checks() -> list[Check]` for its own devices,
`udev_rule() -> str`, and `board_checks(address, key_file) -> list[Check]` for a board in another computer.
"""

from __future__ import annotations

import importlib
import importlib.util
import os
import platform
import re
import resource
import shutil
import sys
import threading
import time
from importlib import metadata
from pathlib import Path

from haptic_teleop_control.command_line import ArgumentParser, run_command
from haptic_teleop_control.front_door import PACKAGES, version
from haptic_teleop_control.health import BAD, HARDWARE_ONLY, OK, OPEN, SLOW, Check
from haptic_teleop_control.plugins import load_object

MESSAGES = ("sensor_msgs", "std_srvs", "diagnostic_msgs")
LOOP_TIME = 0.5  # s, for the measurement of the loop
SENDERS_TOLD = (9, 1, 1)
"""From this version on, rclpy tells who sent a message."""
PERIOD, LATE = 1e-3, 0.02  # s: of the loop; the board's watchdog


OMNI_BY_HAND = "haptic_teleop_omni.hands_on:verify_by_hand"
"""Loaded when it is needed: this package knows no driver."""

OMNI_HELP = (
    "verify layout and axis map of a real Omni by hand, with the force off, and write down what was "
    "confirmed; FILE: parameter file whose section omni_driver says how it is reached"
)


def environment_checks() -> list[Check]:
    """Python, ROS, discovery, scheduling, timing, disk."""
    return [
        _python(),
        _packages(),
        *_ros(),
        _discovery(),
        _realtime(),
        _timing(),
        _disk(Path.cwd()),
    ]


def all_checks() -> list[Check]:
    """Those of the environment, then those that the packages bring."""
    found = environment_checks()
    for module in _contributions():
        found += module.checks()
    return found


def _contributions() -> list:
    return [
        importlib.import_module(f"{package}.doctor_checks")
        for package in PACKAGES
        if importlib.util.find_spec(package) and importlib.util.find_spec(f"{package}.doctor_checks")
    ]


def _python() -> Check:
    return Check("Python", OK, f"{platform.python_version()} in {sys.prefix}, haptic-teleop {version()}")


def _packages() -> Check:
    missing = [package for package in PACKAGES if importlib.util.find_spec(package) is None]
    if missing:
        return Check(
            "packages", BAD, f"{', '.join(missing)} not installed", "run `make setup` or `colcon build`"
        )
    return Check("packages", OK, f"all {len(PACKAGES)} are installed")


def _ros() -> list[Check]:
    found = importlib.util.find_spec("rclpy")
    distribution = os.environ.get("ROS_DISTRO", "")
    if found is None or not found.origin:
        remedy = "run `make setup` and use .venv/bin/haptic-teleop, or source a ROS 2 installation"
        return [Check("ROS 2", BAD, "Python finds no rclpy", remedy)]
    wheels = Path(found.origin).is_relative_to(sys.prefix)
    if wheels and distribution and not Path("/opt/ros", distribution, "lib").is_relative_to(sys.prefix):
        text = f"rclpy comes from wheels in {sys.prefix}, but ROS_DISTRO is {distribution}"
        return [Check("ROS 2", BAD, text, "use one of both: open a shell in which nothing was sourced")]
    where = f"wheels in {sys.prefix}" if wheels else f"{distribution} from {Path(found.origin).parents[4]}"
    missing = [name for name in MESSAGES if importlib.util.find_spec(name) is None]
    if missing:
        return [
            Check("ROS 2", BAD, f"{where}, without {', '.join(missing)}", "install these message packages")
        ]
    return [Check("ROS 2", OK, f"{where}{_senders()}")]


def _senders() -> str:
    """What this rclpy cannot do, in words."""
    try:
        found = metadata.version("rclpy")
    except metadata.PackageNotFoundError:
        return ""
    if tuple(int(part) for part in re.findall(r"\d+", found)[:3]) >= SENDERS_TOLD:
        return ""
    return (
        f"; rclpy {found} does not tell who sent a message: a second sender on a topic is only a warning in "
        "the diagnostics and not a fault (ROS 2 Kilted tells it)"
    )


def _discovery() -> Check:
    limit = os.environ.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "").upper()
    domain = os.environ.get("ROS_DOMAIN_ID", "0")
    if limit in ("LOCALHOST", "OFF") or os.environ.get("ROS_LOCALHOST_ONLY") == "1":
        return Check("discovery", OK, f"{limit or 'LOCALHOST'}, domain {domain}")
    return Check(
        "discovery",
        OPEN,
        f"{limit or 'SUBNET (default)'}, domain {domain}: whoever is on this network can command the robots",
        "export ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST (with ROS_STATIC_PEERS for a second machine)",
    )


def _realtime() -> Check:
    refusal: list[OSError] = []

    def request() -> None:  # in a thread of its own, which takes the scheduling class with it when it ends
        try:
            os.sched_setscheduler(threading.get_native_id(), os.SCHED_FIFO, os.sched_param(20))
        except OSError as error:
            refusal.append(error)

    thread = threading.Thread(target=request)
    thread.start()
    thread.join()
    kernel = platform.version()
    preemption = next(
        (name for name in ("PREEMPT_RT", "PREEMPT_DYNAMIC", "PREEMPT") if name in kernel), "no preemption"
    )
    if refusal:
        highest = resource.getrlimit(resource.RLIMIT_RTPRIO)[1]
        return Check(
            "real-time scheduling",
            SLOW,
            f"SCHED_FIFO 20 is refused ({refusal[0].strerror}, limit {highest}), kernel {preemption}",
            "add `@realtime - rtprio 99` to /etc/security/limits.conf, join that group and log in again",
        )
    return Check("real-time scheduling", OK, f"SCHED_FIFO is permitted, kernel {preemption}")


def _timing() -> Check:
    """A 1 kHz loop in this process, without real-time scheduling."""
    late = []
    due = time.monotonic()
    end = due + LOOP_TIME
    while due < end:
        due += PERIOD
        wait = due - time.monotonic()
        if wait > 0.0:
            time.sleep(wait)
        late.append(time.monotonic() - due)
        due = max(due, time.monotonic() - PERIOD)
    late.sort()
    high, worst = late[int(0.99 * len(late))], late[-1]
    text = f"a 1 kHz loop is late by {1e3 * high:.2f} ms (99 %), {1e3 * worst:.2f} ms (most)"
    if worst > LATE:
        return Check(
            "timing",
            BAD,
            text,
            "stop other programs, set realtime_priority",
        )
    if worst > PERIOD:
        lost = f"{text}: samples of a device would be missed, simulated time does not mind"
        return Check("timing", SLOW, lost, "set realtime_priority where a device shall run")
    return Check("timing", OK, text)


def _disk(folder: Path) -> Check:
    free = shutil.disk_usage(folder).free
    text = f"{free / 1e9:.1f} GB free in {folder}"
    if free < 1e9:
        return Check("disk", BAD, text, "make room: a recording takes about 1 MB per second")
    return Check("disk", OK, text)


def _doctor(arguments: list[str]) -> int:
    parser = ArgumentParser(
        prog="haptic-teleop doctor",
        description="Say what is there: environment, ROS 2, scheduling, devices; each line OK or the remedy.",
        epilog="Exit status: 0 when nothing is a problem, 1 otherwise. What only a real robot needs (its "
        "libraries, a punctual clock, files that others cannot write) is no problem without --hardware.",
    )
    parser.add_argument(
        "--hardware", action="store_true", help="count what only a real robot needs as a problem, too"
    )
    parser.add_argument("--udev-rule", action="store_true", help="print the udev rules for the devices")
    parser.add_argument(
        "--board", metavar="HOST[:PORT]", help="ask the sfj_board_server there what it has; disturbs nobody"
    )
    parser.add_argument("--board-key", metavar="FILE", default="", help="its key; default: that of this user")
    parser.add_argument("--omni", nargs="?", const="", metavar="FILE", help=OMNI_HELP)
    options = parser.parse_args(arguments)
    if options.omni is not None:
        return load_object(OMNI_BY_HAND, "--omni")(options.omni)
    if options.udev_rule:
        for module in _contributions():
            if hasattr(module, "udev_rule"):
                print(module.udev_rule(), end="")
        return 0
    found = all_checks()
    if options.board:
        for module in _contributions():
            if hasattr(module, "board_checks"):
                found += module.board_checks(options.board, options.board_key)
    for check in found:
        print(check.line)
    counted = (BAD, *HARDWARE_ONLY) if options.hardware else (BAD,)
    problems = sum(check.level in counted for check in found)
    others = 0 if options.hardware else sum(check.level in HARDWARE_ONLY for check in found)
    also = f"; {others} more that only robots would mind (--hardware counts them)" if others else ""
    print(f"{problems} problem{'' if problems == 1 else 's'}{also}")
    return 1 if problems else 0


def main(argv: list[str] | None = None) -> int:
    return run_command(_doctor, argv)
