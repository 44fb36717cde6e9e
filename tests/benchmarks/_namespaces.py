"""Two network namespaces joined by a virtual cable, of which nothing is left whatever becomes of the program.

They have no names. Each lives as long as a process in it, and that ends when the pipe to this program does:
also at a SIGKILL.
"""

import os
import subprocess
import types

AT_SERVER, AT_CLIENT = "10.76.5.1", "10.76.5.2"


def ends_with_us() -> list[str]:
    """Before a command: it ends when this program does, also where that has ended before the kernel was told
    so."""
    still_here = f'[ "$PPID" = {os.getpid()} ] && exec "$@"'
    return ["setpriv", "--pdeathsig", "TERM", "sh", "-c", still_here, "sh"]


class Namespaces:
    """enter: two commands, to be put before one that shall run at either address. Raises OSError or
    CalledProcessError where the user may not make any."""

    def __enter__(self) -> "Namespaces":
        self._keepers: list[subprocess.Popen[str]] = []
        try:
            self._join()
        except BaseException:
            self.__exit__(None, None, None)
            raise
        return self

    def __exit__(self, *_: type[BaseException] | BaseException | types.TracebackType | None) -> None:
        for keeper in self._keepers:
            keeper.kill()
            keeper.communicate()

    @property
    def keepers(self) -> list[int]:
        """Processes with which the namespaces end."""
        return [keeper.pid for keeper in self._keepers]

    def _join(self) -> None:
        for _ in range(2):
            keep = ["unshare", "--net", "sh", "-c", "echo here; exec cat >/dev/null"]
            keeper = subprocess.Popen(
                keep, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
            )
            self._keepers.append(keeper)
            assert keeper.stdout is not None
            if not keeper.stdout.readline():
                said = keeper.communicate()[1]
                raise subprocess.CalledProcessError(keeper.wait(), keep, stderr=said)
        self.enter = [["nsenter", "--net", "--target", str(pid)] for pid in self.keepers]
        self._ip(0, "link", "add", "server", "type", "veth", "peer", "client", "netns", str(self.keepers[1]))
        for side, (end, address) in enumerate((("server", AT_SERVER), ("client", AT_CLIENT))):
            self._ip(side, "addr", "add", f"{address}/24", "dev", end)
            self._ip(side, "link", "set", end, "up")

    def _ip(self, side: int, *arguments: str) -> None:
        subprocess.run([*self.enter[side], "ip", *arguments], check=True, capture_output=True, text=True)
