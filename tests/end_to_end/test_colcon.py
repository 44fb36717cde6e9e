"""The workspace builds with colcon and its installed executables start, as on a machine with ROS 2."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from haptic_teleop_control import front_door

BIN = Path(sys.executable).parent
pytestmark = [pytest.mark.no_graph, pytest.mark.long]

PACKAGES = sorted(front_door.PACKAGES)


def run(*command: str, cwd: Path, timeout: float = 60) -> subprocess.CompletedProcess[str]:
    """Run a command as a user would who has this environment's programs on the PATH and its ROS 2 sourced."""
    foreign = ("PYTHONPATH", "COLCON_PREFIX_PATH")
    environment = {key: value for key, value in os.environ.items() if key not in foreign}
    environment["PATH"] = f"{BIN}{os.pathsep}{environment['PATH']}"
    environment["AMENT_PREFIX_PATH"] = sys.prefix
    return subprocess.run(
        command, cwd=cwd, env=environment, capture_output=True, text=True, timeout=timeout, check=False
    )


def in_workspace(workspace: Path, command: str) -> subprocess.CompletedProcess[str]:
    """Run a command in a shell that has sourced the built workspace."""
    return run("bash", "-c", f"source install/setup.bash && {command}", cwd=workspace)


@pytest.fixture(scope="module")
def checkout(repository: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What colcon finds in a clone: a copy, because a build leaves files beside the sources."""
    folder = tmp_path_factory.mktemp("workspace")
    leftovers = shutil.ignore_patterns("__pycache__", "*.egg-info", "build", "install", "log")
    for name in ("src", "config"):
        if (repository / name).exists():
            shutil.copytree(repository / name, folder / name, ignore=leftovers)
    shutil.copy(repository / "pyproject.toml", folder)
    return folder


@pytest.fixture(scope="module")
def workspace(checkout: Path) -> Path:
    """The workspace, built."""
    built = run("colcon", "build", "--executor", "sequential", cwd=checkout, timeout=110)
    assert built.returncode == 0, built.stdout + built.stderr
    return checkout


def test_colcon_lists_five_ros_packages(checkout):
    # A manifest that colcon cannot read makes it take the package for plain Python, without a word.
    listed = run("colcon", "list", cwd=checkout).stdout.splitlines()
    assert [tuple(line.split()) for line in listed] == [
        (name, f"src/{name}", "(ros.ament_python)") for name in PACKAGES
    ]


def test_every_executable_is_installed_where_ros2_run_looks_and_nowhere_on_the_path(workspace):
    for package, entries in front_door.registries().items():
        prefix = workspace / "install" / package
        folder = prefix / "lib" / package
        installed = {path.name for path in folder.iterdir()} if folder.exists() else set()
        assert installed == set(entries)
        assert not (prefix / "bin").exists()


def test_every_package_is_in_the_ament_index_with_its_manifest(workspace):
    for package in PACKAGES:
        share = workspace / "install" / package / "share"
        assert (share / "ament_index/resource_index/packages" / package).exists()
        assert (share / package / "package.xml").exists()


def test_the_sourced_workspace_runs_its_own_copy_and_not_the_sources(workspace):
    done = in_workspace(workspace, f"python -c 'import {','.join(PACKAGES)}; print({PACKAGES[-1]}.__file__)'")
    assert done.stdout.startswith(f"{workspace}/install/{PACKAGES[-1]}/"), done.stderr


@pytest.mark.parametrize("executable", ["haptic_teleop_sysid/compare", "haptic_teleop_sim/sfj_sim"])
def test_an_installed_executable_starts(workspace, executable):
    package, name = executable.split("/")
    done = in_workspace(workspace, f"install/{package}/lib/{package}/{name} --help")
    assert done.returncode == 0, done.stderr
    assert "usage:" in done.stdout


def test_an_installed_executable_refuses_a_missing_file_with_status_2_and_its_name(workspace):
    compare = "install/haptic_teleop_sysid/lib/haptic_teleop_sysid/compare"
    done = in_workspace(workspace, f"{compare} --model no_model.yaml --bag no_bag --output out")
    assert done.returncode == 2
    assert "no_model.yaml" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("package", PACKAGES)
def test_every_file_of_a_package_is_installed(workspace, package):
    def files(folder: Path) -> set[Path]:
        found = (path.relative_to(folder) for path in folder.rglob("*") if path.is_file())
        return {path for path in found if "__pycache__" not in path.parts}

    (installed,) = (workspace / "install" / package / "lib").glob(f"python3.*/site-packages/{package}")
    assert files(workspace / "src" / package / package) == files(installed)


def test_the_settings_are_installed_into_the_share_folder_of_control(workspace):
    source = workspace / "config"
    installed = workspace / "install/haptic_teleop_control/share/haptic_teleop_control/config"
    files = {path.relative_to(source): path.read_bytes() for path in source.rglob("*.yaml")}
    assert files
    assert {path.relative_to(installed): path.read_bytes() for path in installed.rglob("*.yaml")} == files


def test_the_launch_file_is_installed_where_ros2_launch_looks(workspace):
    share = workspace / "install/haptic_teleop_control/share/haptic_teleop_control"
    sources = workspace / "src/haptic_teleop_control/launch"
    names = {path.name for path in sources.glob("*.launch.py")}
    assert names
    assert {path.name for path in (share / "launch").glob("*.launch.py")} == names
