"""Compiled code is loaded only from where nobody else can have put it."""

import os
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from haptic_teleop_control.private_folder import make_private, prepare_private, untrusted
from haptic_teleop_sim.kernel import cache_directory, cache_folder

SOMEBODY = 65534


@pytest.fixture
def folder(tmp_path):
    one = tmp_path / "above" / "kernels"
    make_private(one)
    return one


def mode(path: Path) -> int:
    return stat.S_IMODE(path.lstat().st_mode)


def test_a_missing_folder_is_made_for_the_user_alone_with_all_above_it(folder):
    assert (mode(folder), mode(folder.parent)) == (0o700, 0o700)
    make_private(folder)
    assert untrusted(folder) is None


@pytest.mark.parametrize("bits", [0o777, 0o770, 0o702, 0o1777])
def test_a_folder_that_others_may_write_is_refused(folder, bits):
    folder.chmod(bits)
    assert untrusted(folder) == f"others may write to {folder} (mode {bits:04o})"


@pytest.mark.parametrize("what", ["folder", "above", "file"])
def test_what_belongs_to_somebody_else_is_refused(folder, what, monkeypatch):
    inside = folder / "__pycache__" / "code.nbi"
    inside.parent.mkdir()
    inside.touch()
    path = {"folder": folder, "above": folder.parent, "file": inside}[what]
    if os.geteuid() == 0:
        os.chown(path, SOMEBODY, -1)
        expected = SOMEBODY
    else:  # the other way round: the user is somebody else, and everything is foreign
        expected = os.geteuid()
        monkeypatch.setattr(os, "geteuid", lambda: SOMEBODY)
    problem = untrusted(folder)
    assert problem is not None and "belongs to the user" in problem
    assert str(path) in problem or expected != SOMEBODY


def test_symbolic_links_in_place_of_the_folder_or_in_it_are_refused(folder, tmp_path):
    link = tmp_path / "link"
    link.symlink_to(folder)
    assert untrusted(link) == f"{link} is a symbolic link"
    (folder / "code.py").symlink_to("/etc/hostname")
    assert untrusted(folder) == f"{folder / 'code.py'} is a symbolic link"


def test_a_link_above_the_folder_leads_to_a_place_that_is_judged(folder, tmp_path):
    (tmp_path / "link").symlink_to(folder.parent)
    assert untrusted(tmp_path / "link" / "kernels") is None
    folder.parent.chmod(0o757)
    for path in (folder, tmp_path / "link" / "kernels"):
        problem = untrusted(path)
        assert problem is not None and f"others may replace what lies in {folder.parent}" in problem
    folder.parent.chmod(0o1777)  # as /tmp: what lies there cannot be replaced by others
    assert untrusted(folder) is None


def test_a_file_that_others_may_write_matters_where_they_can_enter(folder):
    (folder / "code.nbi").touch()
    (folder / "code.nbi").chmod(0o666)
    assert untrusted(folder) is None
    folder.chmod(0o755)
    assert "others may write to" in str(untrusted(folder))


def test_what_is_no_directory_or_cannot_be_made_is_refused(tmp_path):
    file = tmp_path / "file"
    file.touch()
    assert prepare_private(file) == f"{file} is no directory"
    assert "cannot be used" in str(prepare_private(file / "kernels"))


def test_the_kernels_cache_takes_a_private_folder_for_one_that_is_not_trusted(folder, monkeypatch, capsys):
    monkeypatch.setenv("HAPTIC_TELEOP_CACHE", str(folder))
    cache_folder._usable.cache_clear()
    assert cache_directory() == folder and capsys.readouterr().err == ""
    folder.chmod(0o777)
    cache_folder._usable.cache_clear()
    private = cache_directory()
    said = capsys.readouterr().err
    assert private != folder and mode(private) == 0o700 and untrusted(private) is None
    assert f"others may write to {folder} (mode 0777)" in said and "HAPTIC_TELEOP_CACHE" in said
    assert os.environ["HAPTIC_TELEOP_CACHE"] == str(private), "so that children share it"
    assert cache_directory() == private and capsys.readouterr().err == "", "it is said once"
    cache_folder._remove(private, os.getpid())
    assert not private.exists()
    cache_folder._usable.cache_clear()


def test_code_in_a_folder_that_others_may_write_is_not_executed(tmp_path):
    code = (
        "from haptic_teleop_sim.kernel import build\n"
        "print(build._module('planted', lambda: 'x = 1', 'it').x)"
    )
    cache = tmp_path / "kernels"
    cache.mkdir(mode=0o700)
    (cache / "planted.py").write_text("x = 'planted'")

    def loaded() -> str:
        environment = {**os.environ, "HAPTIC_TELEOP_CACHE": str(cache), "TMPDIR": str(tmp_path)}
        done = subprocess.run(
            [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True
        )
        return done.stdout.strip()

    assert loaded() == "planted"
    cache.chmod(0o777)
    assert loaded() == "1"
    assert [path.name for path in tmp_path.iterdir()] == ["kernels"], "the private one is removed"


def test_a_cache_of_numba_that_others_may_write_is_not_used_by_what_the_front_door_starts(tmp_path):
    cache = tmp_path / "numba"
    cache.mkdir()
    cache.chmod(0o777)
    command = [sys.executable, "-m", "haptic_teleop_control.front_door", "lockstep", "--help"]
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(cache)}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    assert "NUMBA_CACHE_DIR is not used: others may write to" in done.stderr
    cache.chmod(0o700)
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    assert done.stderr == ""
