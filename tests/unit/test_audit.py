"""What must hold of the code base as a whole, read from the code base."""

import ast
import importlib.metadata
import os
import re
import subprocess
import sys
import tomllib
import xml.etree.ElementTree as ElementTree
from collections import Counter
from collections.abc import Mapping
from functools import cache
from pathlib import Path

import pytest

from haptic_teleop_control import front_door

REPOSITORY = Path(__file__).resolve().parents[2]
PACKAGES = sorted(path.parent for path in REPOSITORY.glob("src/*/package.xml"))
LONGEST_MODULE = 500  # lines; the aim is 150
ROSDEP_KEYS = {
    "h5py": "python3-h5py",
    "jinja2": "python3-jinja2",
    "joblib": "python3-joblib",
    "matplotlib": "python3-matplotlib",
    "numba": "python3-numba",
    "numpy": "python3-numpy",
    "pandas": "python3-pandas",
    "platformdirs": "python3-platformdirs",
    "rich": "python3-rich",
    "scipy": "python3-scipy",
    "sympy": "python3-sympy",
    "yaml": "python3-yaml",
}
"""What a module is called in rosdep's database. rosbags, mcap (which brings zstandard and lz4), pyarrow and
mat-io are no Debian packages: the README says how to install them beside a ROS installation."""


def sources(folder: Path) -> list[Path]:
    return [path for path in folder.rglob("*.py") if "__pycache__" not in path.parts]


@cache
def imported(path: Path) -> frozenset[str]:
    """The top-level modules that a source file imports, at its top or within functions."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            found.add(node.module.split(".")[0])
    return frozenset(found)


def manifest_of(package: Path) -> ElementTree.ElementTree:
    return ElementTree.parse(package / "package.xml")


@cache
def owners() -> Mapping[str, list[str]]:
    """The distributions that brought each module into this environment; to read it takes a second."""
    return importlib.metadata.packages_distributions()


def ros_modules() -> set[str]:
    """The modules that the ROS 2 wheels brought into this environment."""
    return {name for name, who in owners().items() if any(owner.startswith("ros-") for owner in who)}


@pytest.mark.parametrize("name", front_door.executables())
def test_every_executable_starts_and_explains_itself(name):
    done = subprocess.run(
        [sys.executable, "-m", "haptic_teleop_control.front_door", name, "--help"],
        env={**os.environ, "PYTHONPROFILEIMPORTTIME": "1"},
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    # As it is typed where no workspace of ROS 2 is sourced.
    assert f"usage: haptic-teleop {name}" in done.stdout
    # What takes half a second to import is imported by who calls it, so that starting takes little.
    loaded = {line.rpartition("|")[2].strip() for line in done.stderr.splitlines()}
    assert "haptic_teleop_control.command_line" in loaded
    assert not {"numba", "matplotlib", "bokeh", "joblib"} & loaded


def test_no_two_packages_offer_the_same_name():
    counted = Counter(name for entries in front_door.registries().values() for name in entries)
    assert [name for name, times in counted.items() if times > 1] == []


def test_the_front_door_knows_every_package():
    assert {path.name for path in PACKAGES} == set(front_door.PACKAGES)


def test_no_module_is_longer_than_the_cap():
    files = sources(REPOSITORY / "src") + sources(REPOSITORY / "tests")
    lengths = {str(path.relative_to(REPOSITORY)): len(path.read_text().splitlines()) for path in files}
    assert {path: lines for path, lines in lengths.items() if lines > LONGEST_MODULE} == {}


def test_nothing_is_imported_from_a_test_file():
    """What several tests need lies in a helper, whose name does not begin with `test_`. Programs that tests
    start, written out in them, are looked through, too."""
    asked = re.compile(r"^\s*(?:from|import) +(?:\w+\.)*test_\w+", re.MULTILINE)
    files = {path: path.read_text() for path in sources(REPOSITORY / "tests")}
    assert [path.name for path, text in files.items() if asked.search(text)] == []


def test_one_version_everywhere():
    versions = {path.name: manifest_of(path).findtext("version") for path in PACKAGES}
    versions["pyproject"] = tomllib.loads((REPOSITORY / "pyproject.toml").read_text())["project"]["version"]
    assert len(set(versions.values())) == 1, versions


def test_no_setup_py_at_the_top_hides_the_packages_from_colcon():
    assert not (REPOSITORY / "setup.py").exists()
    assert not (REPOSITORY / "setup.cfg").exists()


def test_the_import_contract_forbids_every_ros_module_that_is_imported_anywhere():
    settings = tomllib.loads((REPOSITORY / "pyproject.toml").read_text())["tool"]["importlinter"]
    contract = next(c for c in settings["contracts"] if "ROS 2" in c["name"])
    used = set().union(*(imported(path) for path in sources(REPOSITORY / "src"))) & ros_modules()
    assert used <= set(contract["forbidden_modules"])


def test_every_library_that_is_imported_is_a_declared_dependency():
    project = tomllib.loads((REPOSITORY / "pyproject.toml").read_text())["project"]
    groups = [group for name, group in project["optional-dependencies"].items() if name != "dev"]
    requirements = [*project["dependencies"], *(requirement for group in groups for requirement in group)]
    declared = {re.split(r"[^a-z0-9-]", requirement)[0] for requirement in requirements}
    # Parts of a ROS installation that have no wheel can only be declared in a manifest.
    stated = {element.text for package in PACKAGES for element in manifest_of(package).iter("exec_depend")}
    imports = set().union(*(imported(path) for path in sources(REPOSITORY / "src")))
    libraries = imports - set(sys.stdlib_module_names) - set(front_door.PACKAGES) - {"setuptools"}
    # ROS modules that come along with rclpy are its affair. An optional library may be missing here; it then
    # counts by its own name.
    undeclared = {
        name
        for name in libraries - ros_modules() - stated
        if not declared & {owner.lower().replace("_", "-") for owner in owners().get(name, [name])}
    }
    assert undeclared == set()


@pytest.mark.parametrize("package", PACKAGES, ids=lambda path: path.name)
def test_the_manifest_declares_what_the_package_imports(package):
    declared = {element.text for element in manifest_of(package).iter("exec_depend")}
    files = sources(package / package.name) + sources(package / "launch")
    needed = set().union(*(imported(path) for path in files)) - {package.name}
    others = ros_modules() | {path.name for path in PACKAGES} | {"launch", "launch_ros"}
    assert needed & others <= declared
    # rosdep refuses to install anything when a single key is unknown to it: only those listed here are.
    assert {ROSDEP_KEYS[name] for name in needed & set(ROSDEP_KEYS)} <= declared
    assert {key for key in declared if key.startswith("python3-")} <= set(ROSDEP_KEYS.values())


def test_the_lock_pins_every_requirement_exactly_and_names_no_index():
    lock = (REPOSITORY / "requirements.lock").read_text()
    requirements = [line for line in lock.splitlines() if line and not line.startswith((" ", "#"))]
    assert requirements
    assert all(re.match(r"[a-z0-9.-]+(\[[a-z,]+\])?==[^ *]+ ", line) for line in requirements)
    hashed = re.findall(r"^[^\s#].*(?:\n +--hash=sha256:[0-9a-f]{64}.*)+", lock, re.MULTILINE)
    assert len(hashed) == len(requirements)
    assert "://" not in lock


def test_set_up_takes_the_lock_as_it_is():
    # Left to resolve, pip 23 takes the newest release of what is asked for with an extra, whatever is pinned.
    lines = (REPOSITORY / "tools" / "set_up.sh").read_text().splitlines()
    (locked,) = [line for line in lines if "pip install" in line and "requirements.lock" in line]
    assert "--no-deps" in locked
    assert "--require-hashes" in locked
