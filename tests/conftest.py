"""What all tests share: where the recordings lie, a ROS 2 graph of their own, and how they run beside each
other on several cores."""

import fcntl
import os
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import hypothesis
import pytest

sys.path.insert(0, str(Path(__file__).parent))  # pytest's importlib mode leaves helpers beside tests unfound
from stalls import Stalls

# As the front door does: on busy cores, threads that wait for each other take for ever over small products.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

REPOSITORY = Path(__file__).resolve().parents[1]

WORKER = os.environ.get("PYTEST_XDIST_WORKER", "")
"""Name of this process among those of pytest-xdist; empty where one process runs all tests."""

OF_THIS_RUN = REPOSITORY / ".pytest_cache"

# The same examples on every run: a failure here must be the change's and not the day's.
hypothesis.settings.register_profile("repeatable", derandomize=True, deadline=None, max_examples=50)
hypothesis.settings.load_profile("repeatable")

# DDS takes ports by domain; those of 0 to 101 are free of Linux' range for outgoing connections. 0 is the
# default, where the graphs of others are.
DOMAINS = range(1, 102)


BEGINNING = ("test_diagnose.py", "test_simulated_scenario.py", "test_scenario.py")
"""Files with which several processes begin: the first compiles what a diagnosis calls, for which others of
its kind would only wait; these wait for nodes most of their time, and at the end the others would wait for
them."""

LONG = (
    "test_verify_simulation.py", "test_diagnosis_doubt.py", "test_second_method.py", "test_blind.py",
    "test_blind_labels.py", "test_unnamed_physics.py", "test_diagnosis_forms.py", "test_diagnosis_events.py",
    "test_audit.py", "test_decompression_limits.py", "test_verify.py", "test_site_browser.py",
    "test_report_browser.py", "test_pages_of_commands.py", "test_many_recordings.py",
    "test_emulated_scenario.py", "test_estimate.py", "test_estimate_command.py", "test_trend.py",
)  # fmt: skip
"""Files of other kinds that take more than 10 s of processor time. They come before the short ones: one that
begins last keeps one core busy while the others have nothing left to do."""


def pytest_xdist_auto_num_workers() -> int:
    """One process more than there are cores: tests that start nodes wait for them much of their time."""
    return len(os.sched_getaffinity(0)) + 1


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """A test's folder says what kind it is. Where several processes share the tests, those that need the
    machine to themselves come last, when the others are through. Processes take tests by files: one of these
    among others would come in the middle, and its process wait until all happen to be between two tests."""
    for item in items:
        for kind in ("nodes", "end_to_end"):
            if item.path.is_relative_to(REPOSITORY / "tests" / kind):
                item.add_marker(kind)
    mixed = {i.path.name for i in items if _alone(i)} & {i.path.name for i in items if not _alone(i)}
    if mixed:
        raise pytest.UsageError(f"tests marked wall_time need a file without others: {', '.join(mixed)}")
    gone = {*BEGINNING, *LONG} - {path.name for path in (REPOSITORY / "tests").glob("*/test_*.py")}
    if gone:
        raise pytest.UsageError(f"tests/conftest.py gives a place to what is not there: {', '.join(gone)}")
    if WORKER:
        items.sort(key=lambda item: (_alone(item), _turn(item)))


def _turn(item: pytest.Item) -> int:
    """The place of a test's file: those that begin, those that drive the project from outside, the other long
    ones, the rest."""
    name = item.path.name
    if name in BEGINNING:
        return BEGINNING.index(name)
    if item.get_closest_marker("end_to_end"):
        return len(BEGINNING)
    return len(BEGINNING) + 1 + (LONG.index(name) if name in LONG else len(LONG))


def _alone(item: pytest.Item) -> bool:
    """Whether the test is about nodes that go by the machine's clock: other work on the cores would delay
    them."""
    return item.get_closest_marker("wall_time") is not None


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    """While a test runs that needs the machine to itself, the other processes of this run wait. (Outermost,
    so that waiting does not count towards the test's timeout.)"""
    if not WORKER:
        return (yield)
    OF_THIS_RUN.mkdir(exist_ok=True)
    with (OF_THIS_RUN / "alone.lock").open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX if _alone(item) else fcntl.LOCK_SH)
        return (yield)


@pytest.fixture(scope="session")
def repository() -> Path:
    """The top of the repository."""
    return REPOSITORY


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of sample recordings, which lies beside the repository; skips where it is not."""
    for folder in (os.environ.get("HAPTIC_TELEOP_DATA"), REPOSITORY.parent / "shared" / "data"):
        if folder and Path(folder).is_dir():
            return Path(folder)
    pytest.skip("no sample recordings in ../shared/data: put them there or set HAPTIC_TELEOP_DATA")


@pytest.fixture
def ros_domain() -> Iterator[int]:
    """A ROS_DOMAIN_ID that no other test run on this machine uses at the same time.

    Held by a lock on a file, which the kernel releases however the run ends.
    """
    for domain in DOMAINS:
        path = Path(tempfile.gettempdir(), f"haptic_teleop_domain_{domain}_{os.getuid()}.lock")
        with path.open("w") as file:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                continue
            yield domain
            return
    pytest.fail(f"all {len(DOMAINS)} domains are in use")


@pytest.fixture
def stalls(tmp_path: Path) -> Iterator[Stalls]:
    """How long the machine stands still during the test."""
    with Stalls(tmp_path) as stalls:
        yield stalls


@pytest.fixture(autouse=True)
def ros_isolation(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Tests with nodes see their own graph and nobody else's, and find the environment's ROS 2."""
    marked = request.node.get_closest_marker
    if marked("no_graph") or not (marked("nodes") or marked("end_to_end")):
        return
    monkeypatch.setenv("ROS_DOMAIN_ID", str(request.getfixturevalue("ros_domain")))
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    if not os.environ.get("AMENT_PREFIX_PATH"):
        monkeypatch.setenv("AMENT_PREFIX_PATH", sys.prefix)
