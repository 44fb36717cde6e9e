"""What the board server needs of its system: nothing that Windows lacks. It was never run there: these tests
ask a type checker that knows what Windows has, and run it with everything else taken away."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from board_wire import HERE

from haptic_teleop_2dsfj.board_settings import BoardSettings
from haptic_teleop_2dsfj.remote.board import RemoteBoard
from haptic_teleop_2dsfj.remote.key_file import read_key
from haptic_teleop_2dsfj.remote.link import UdpClient
from haptic_teleop_2dsfj.remote.settings import RemoteSettings
from haptic_teleop_control.clocks import SteadyClock

GUARDED = {
    "serve.py": {"sched_setscheduler", "sched_param", "SCHED_FIFO"},
    "private_folder.py": {"geteuid", "getgrgid", "getpwuid"},
}
"""What is asked for where it is, and done without where it is not: the run below does without."""

WINDOWS = """
import argparse, ctypes, hmac, ipaddress, os, secrets, select, signal, socket, sys, time, types
import importlib.abc, importlib.metadata, platformdirs, subprocess, numpy, yaml  # each has another face there
class Missing(importlib.abc.MetaPathFinder):
    NAMES = {"fcntl", "grp", "pwd", "resource", "termios", "tty", "pty", "syslog", "readline", "posix_ipc",
             "rclpy", "sensor_msgs", "numba", "scipy", "sympy", "rosbags", "mcap", "matplotlib", "joblib"}
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in self.NAMES:
            raise ModuleNotFoundError(name, name=name)
sys.meta_path.insert(0, Missing())
for name in Missing.NAMES:
    sys.modules.pop(name, None)
HAS = {"SIGABRT", "SIGFPE", "SIGILL", "SIGINT", "SIGSEGV", "SIGTERM", "SIG_DFL", "SIG_IGN"}
LACKS = {
    os: "chown chroot confstr ctermid eventfd eventfd_read fchdir fchmod fchown fork forkpty "
        "fpathconf getegid geteuid getgid getgroups getloadavg getpgid getpgrp getpriority "
        "getresuid getsid getuid killpg lchown lockf memfd_create mkfifo mknod nice openpty "
        "pathconf pidfd_open pipe2 posix_fadvise posix_fallocate posix_spawn pread pwrite readv "
        "register_at_fork sched_get_priority_max sched_getaffinity sched_param sched_setaffinity "
        "sched_setscheduler sched_yield sendfile setgid setpgid setpriority setsid setuid statvfs "
        "sync sysconf tcgetpgrp ttyname uname wait wait3 wait4 waitid writev SCHED_FIFO O_CLOEXEC "
        "O_DIRECTORY O_DSYNC O_NOCTTY O_NOFOLLOW O_NONBLOCK O_SYNC",
    signal: " ".join({n for n in dir(signal) if n.startswith("SIG")} - HAS) + " alarm getitimer pause "
            "pthread_kill pthread_sigmask setitimer siginterrupt sigpending sigtimedwait sigwait sigwaitinfo",
    select: "epoll poll",
    socket: "AF_UNIX AF_NETLINK AF_PACKET MSG_DONTWAIT SO_REUSEPORT SO_BINDTODEVICE recv_fds send_fds",
    time: "clock_gettime clock_gettime_ns clock_settime pthread_getcpuclockid tzset CLOCK_MONOTONIC",
}
for module, names in LACKS.items():
    for name in names.split():
        if hasattr(module, name):
            delattr(module, name)
timers = lambda period: print("timeBeginPeriod", period, flush=True)
ctypes.windll = types.SimpleNamespace(winmm=types.SimpleNamespace(timeBeginPeriod=timers))
sys.platform = "win32"
sys.modules["plant"] = plant = type(sys)("plant")
class Robot:
    def sense(self): return numpy.zeros(4), numpy.zeros(2)
    def advance(self, current): pass
plant.still = lambda file, rate: Robot()
from haptic_teleop_control.front_door import main
sys.exit(main(sys.argv[1:]))
"""


@pytest.mark.long
def test_no_module_of_the_server_asks_for_what_windows_lacks():
    """By the standard library's stubs, which say what is where."""
    listed = (
        "import haptic_teleop_control.front_door, haptic_teleop_2dsfj.remote.serve, sys\n"
        "for n, m in sys.modules.items():\n"
        "    if n.startswith('haptic') and m.__file__: print(m.__file__)"
    )
    found = subprocess.run([sys.executable, "-c", listed], check=True, capture_output=True, text=True)
    files = found.stdout.split()
    assert {"serve.py", "server.py", "board.py", "link.py", "clocks.py"} <= {Path(f).name for f in files}
    pyright = shutil.which("pyright", path=f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}")
    if pyright is None:
        pytest.skip("no pyright, which knows what Windows has")
    command = [pyright, "--pythonplatform", "Windows", "--outputjson", *files]
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    report = json.loads(done.stdout)
    assert report["summary"]["filesAnalyzed"] >= len(files)
    lacking: dict[str, set[str]] = {}
    for entry in report["generalDiagnostics"]:
        if entry["severity"] == "error":
            name = re.match(r'"(\w+)"', entry["message"])
            lacking.setdefault(Path(entry["file"]).name, set()).add(name[1] if name else entry["message"])
    assert lacking == GUARDED


def test_the_command_serves_a_client_without_posix_without_ros_and_with_numpy_alone(tmp_path):
    # Compiled code in a folder whose owner nobody knows is not used, and that is said first.
    environment = {**os.environ, "XDG_CONFIG_HOME": str(tmp_path), "NUMBA_CACHE_DIR": str(tmp_path / "numba")}
    process = subprocess.Popen(
        [sys.executable, "-c", WINDOWS, "sfj_board_server", "-p", "device:=emulated", "-p", "port:=0",
         "-p", "emulated.plant:=plant:still", "-p", "realtime_priority:=10"],
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=environment,
    )  # fmt: skip
    try:
        assert "NUMBA_CACHE_DIR is not used" in process.stdout.readline()
        assert process.stdout.readline() == "timeBeginPeriod 1\n"
        lines = [process.stdout.readline(), process.stdout.readline()]
        assert "no real-time scheduling" in lines[0]
        found = re.search(r"emulated board q8 0 at 500 Hz, 127\.0\.0\.1:(\d+) for", lines[1])
        assert found, lines
        key, port = read_key(str(tmp_path / "haptic_teleop" / "board.key")), int(found[1])
        settings = RemoteSettings(port=port, silence=0.4)
        remote = RemoteBoard(BoardSettings(), settings, UdpClient(HERE, port), key, SteadyClock(), True)
        remote.open()
        while remote.round_trips.count < 5:
            remote.read()
            if not remote.reload_watchdog():
                remote.rearm_watchdog()
            remote.enable(True)
            remote.write(0.05, -0.05)
        remote.close()
        assert "is here" in process.stdout.readline()
        process.send_signal(signal.SIGINT)
        assert process.wait(20) == 0
    finally:
        process.kill()
        process.wait()
