"""The cache of compiled code, written by several processes at once."""

import pickle
import re
import subprocess
import sys
from pathlib import Path

import pytest
from numba.core.caching import IndexDataCacheFile

KEYS = 150

WRITER = """
import sys
from haptic_teleop_control import compiled
compiled.load_numba()
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


FUNCTIONS = """
from haptic_teleop_control.compiled import njit

@njit(cache=True)
def inner(x):
    return x * x

@njit(cache=True)
def outer(x):
    return inner(x) + 1.0
"""

CALLER = """
import sys
sys.path.insert(0, sys.argv[1])
import functions
assert "numba" not in sys.modules
print("ready", flush=True)
sys.stdin.readline()
value = functions.outer(3.0)
print(value, sum(functions.outer.stats.cache_misses.values()))
"""


def test_one_of_the_processes_that_need_a_function_compiles_it_and_none_before_it_is_called(tmp_path):
    (tmp_path / "functions.py").write_text(FUNCTIONS)
    callers = [
        subprocess.Popen(
            [sys.executable, "-c", CALLER, str(tmp_path)],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        )
        for _ in range(2)
    ]  # fmt: skip
    for caller in callers:
        assert caller.stdout is not None and caller.stdout.readline() == "ready\n"
    answers = [caller.communicate("go\n")[0].split() for caller in callers]
    assert [float(value) for value, _ in answers] == [10.0, 10.0]
    assert sorted(misses for _, misses in answers) == ["0", "1"]


def test_a_compiled_function_is_passed_on_by_its_name_and_tells_what_it_is():
    from haptic_teleop_control.filters import velocity_step

    assert pickle.loads(pickle.dumps(velocity_step)) is velocity_step
    assert velocity_step.__name__ == "velocity_step"
    assert velocity_step.__doc__ == velocity_step.py_func.__doc__


def test_every_compiled_function_is_kept_in_that_cache(repository: Path) -> None:
    own = repository / "src/haptic_teleop_control/haptic_teleop_control/compiled.py"
    direct = re.compile(r"^from numba import .*\bnjit\b|numba\.n?jit", re.MULTILINE)
    found = [p for p in (repository / "src").rglob("*.py") if p != own and direct.search(p.read_text())]
    assert found == []


PRODUCT = """
import sys
import numpy as np
from haptic_teleop_control.compiled import njit

@njit
def plain(x):
    return x.sum()

@njit
def product(x):
    return np.linalg.inv(x) @ x

x = np.array([[2.0, 1.0], [1.0, 3.0]])
assert plain(x) == 7.0
assert "scipy.linalg" not in sys.modules and "coverage" not in sys.modules
assert np.allclose(product(x), np.eye(2))
import coverage
"""


@pytest.mark.long
def test_linear_algebra_is_loaded_with_the_first_function_that_has_some():
    subprocess.run([sys.executable, "-c", PRODUCT], check=True)
