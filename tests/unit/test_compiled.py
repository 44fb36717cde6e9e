"""The cache of compiled code, written by several processes at once."""

import re
import subprocess
import sys
from pathlib import Path

from numba.core.caching import IndexDataCacheFile

KEYS = 150

WRITER = """
import sys
from haptic_teleop_control import compiled
from numba.core.caching import IndexDataCacheFile
folder, name, count = sys.argv[1:]
print("ready", flush=True)
sys.stdin.readline()
files = IndexDataCacheFile(folder, "f", "stamp")
for key in range(int(count)):
    files.save((name, key), (name, key))
"""


def test_what_two_processes_save_at_once_is_all_found_again_each_under_its_own_key(tmp_path: Path) -> None:
    names = ("a", "b")
    writers = [
        subprocess.Popen(
            [sys.executable, "-c", WRITER, str(tmp_path), name, str(KEYS)],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        )
        for name in names
    ]
    for writer in writers:
        assert writer.stdout is not None and writer.stdout.readline() == "ready\n"
    for writer in writers:
        assert writer.stdin is not None
        writer.stdin.write("go\n")
        writer.stdin.flush()
    assert [writer.wait() for writer in writers] == [0, 0]
    files = IndexDataCacheFile(str(tmp_path), "f", "stamp")
    saved = [(name, key) for name in names for key in range(KEYS)]
    assert [files.load(key) for key in saved] == saved


def test_every_compiled_function_is_kept_in_that_cache(repository: Path) -> None:
    own = repository / "src/haptic_teleop_control/haptic_teleop_control/compiled.py"
    direct = re.compile(r"^from numba import .*\bnjit\b|numba\.n?jit", re.MULTILINE)
    found = [p for p in (repository / "src").rglob("*.py") if p != own and direct.search(p.read_text())]
    assert found == []
