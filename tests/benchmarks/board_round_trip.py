"""How long a datagram is on its way between driver and board server and back, at 500 Hz, without ROS: over
loopback, and between two network namespaces joined by a virtual cable (where the user may make them), in
normal and in real-time scheduling (where permitted). Beside it what the machine gives at best: an echo of
datagrams of the same size, between the same processes and as often.
"""

import contextlib
import json
import re
import signal
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))
from _namespaces import AT_CLIENT, AT_SERVER, Namespaces, ends_with_us

SECONDS = 20.0
MEDIAN = 1e-3
"""s, half a period: what a round trip over loopback must not take."""
PERIOD, SIZE = 2e-3, 130
PYTHON = sys.executable
SERVER = [PYTHON, "-m", "haptic_teleop_2dsfj.remote.serve"]
COLUMNS = f"   {'':42} {'median':>8} {'99 %':>8} {'99.9 %':>8} {'most':>8}"


def board_client(host: str, port: int, key: str, seconds: float) -> list[float]:
    """Quantiles of the round trips of a client that drives, s."""
    from haptic_teleop_2dsfj.board_settings import BoardSettings
    from haptic_teleop_2dsfj.remote.board import RemoteBoard
    from haptic_teleop_2dsfj.remote.key_file import read_key
    from haptic_teleop_2dsfj.remote.link import UdpClient
    from haptic_teleop_2dsfj.remote.settings import RemoteSettings
    from haptic_teleop_control.clocks import SteadyClock

    clock = SteadyClock()
    remote = RemoteSettings(host=host, port=port, silence=0.4)
    board = RemoteBoard(BoardSettings(), remote, UdpClient(host, port), read_key(key), clock, emulated=True)
    board.open()
    end = clock.now() + seconds * 1e9
    while clock.now() < end:
        board.read()
        if not board.reload_watchdog():
            board.rearm_watchdog()
        board.enable(True)
        board.write(0.05, -0.05)
    board.close()
    trips = board.round_trips
    return [*(trips.quantile(share) for share in (0.5, 0.99, 0.999)), trips.largest]


def echo_client(host: str, port: int, seconds: float) -> list[float]:
    """The same of bare datagrams."""
    from haptic_teleop_2dsfj.remote.round_trip import RoundTrips

    trips, data = RoundTrips(), bytes(SIZE)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
        link.connect((host, port))
        link.settimeout(1.0)
        due = time.perf_counter()
        end = due + seconds
        while due < end:
            due = max(due + PERIOD, time.perf_counter())
            time.sleep(max(0.0, due - time.perf_counter()))
            begun = time.perf_counter()
            link.send(data)
            link.recv(1024)
            trips.add(time.perf_counter() - begun)
    return [*(trips.quantile(share) for share in (0.5, 0.99, 0.999)), trips.largest]


def echo_server(host: str) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
        link.bind((host, 0))
        print(f"{host}:{link.getsockname()[1]} for", flush=True)
        while True:
            link.sendto(*link.recvfrom(1024))


def measure(kind: str, before: list[list[str]], host: str, peer: str, key: str, priority: int) -> list[float]:
    """before: what stands before either program: server, client."""
    realtime = ["chrt", "-f", str(priority)] if priority else []
    if kind == "echo":
        command = [PYTHON, __file__, "echo-server", host]
    else:
        rules = (f"host:={host}", f"peer:={peer}", "port:=0", "device:=emulated", f'key.file:="{key}"')
        command = [*SERVER, *(part for rule in rules for part in ("-p", rule))]
    command = [*ends_with_us(), *before[0], *realtime, *command]
    server = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        assert server.stdout is not None
        found = None
        while found is None:
            line = server.stdout.readline()
            assert line, "the server ended"
            found = re.search(rf"{re.escape(host)}:(\d+) for", line)
        client = [PYTHON, __file__, kind, host, found[1], key, str(SECONDS)]
        done = subprocess.run(
            [*ends_with_us(), *before[1], *realtime, *client], check=True, stdout=subprocess.PIPE, text=True
        )
        return json.loads(done.stdout)
    finally:
        server.terminate()
        server.wait()


def main() -> int:
    kept = True
    print(COLUMNS + "   (ms)")
    with contextlib.ExitStack() as stack:
        key = str(Path(stack.enter_context(tempfile.TemporaryDirectory())) / "board.key")
        subprocess.run([*SERVER, "--make-key", key], check=True, capture_output=True)
        may = subprocess.run(["chrt", "-f", "20", "true"], check=False, capture_output=True).returncode == 0
        ways = [("loopback", [[], []], "127.0.0.1", "127.0.0.1")]
        try:
            joined = stack.enter_context(Namespaces())
            ways.append(("two namespaces", joined.enter, AT_SERVER, AT_CLIENT))
        except (OSError, subprocess.CalledProcessError) as refusal:
            print(f"   two namespaces cannot be made here: {refusal} {getattr(refusal, 'stderr', '') or ''}")
        for name, before, host, peer in ways:
            for priority in (0, 20) if may else (0,):
                for kind in ("echo", "board"):
                    found = measure(kind, before, host, peer, key, priority)
                    title = f"{kind}, {name}{', SCHED_FIFO' if priority else ''}"
                    print(f"   {title:42} " + " ".join(f"{1e3 * v:8.3f}" for v in found), flush=True)
                    if (kind, name, priority) == ("board", "loopback", 0):
                        kept = found[0] < MEDIAN
    return 0 if kept else 1


if __name__ == "__main__":
    if sys.argv[1:2] == ["echo-server"]:
        echo_server(sys.argv[2])
    elif sys.argv[1:2] == ["echo"]:
        print(json.dumps(echo_client(sys.argv[2], int(sys.argv[3]), float(sys.argv[5]))))
    elif sys.argv[1:2] == ["board"]:
        print(json.dumps(board_client(sys.argv[2], int(sys.argv[3]), sys.argv[4], float(sys.argv[5]))))
    else:
        for name in ("SIGTERM", "SIGHUP"):
            signal.signal(getattr(signal, name), lambda number, _: sys.exit(128 + number))
        sys.exit(main())
