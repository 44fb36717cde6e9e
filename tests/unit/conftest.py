import shutil
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

# pytest's importlib mode leaves helpers beside the tests unfound
sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture(scope="session")
def hd_library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The emulated HD library, compiled."""
    from openhaptics_rig import compile_library

    return compile_library(tmp_path_factory.mktemp("hd"))


@pytest.fixture
def em(hd_library: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """The emulated HD library, stepped: its own clock paces the driver's counter, too."""
    from openhaptics_rig import Emulation

    from haptic_teleop_omni.transports import openhaptics

    emulation = Emulation(hd_library)
    plain = openhaptics.OpenHapticsTransport.__init__

    def with_its_clock(self: Any, settings: Any, clock_gettime: Any = None) -> None:
        plain(self, settings, clock_gettime or emulation.clock)

    monkeypatch.setattr(openhaptics.OpenHapticsTransport, "__init__", with_its_clock)
    monkeypatch.setattr(openhaptics, "CLOSING_TIME", 0.0)  # nobody ticks while it closes
    yield emulation
    emulation.stepped(True)


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """Chromium, from the system's packages (README.md); where it is missing, the test is skipped."""
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    found = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    if found is None:
        pytest.skip("no chromium: apt-get install chromium, then these tests run")
    with playwright.sync_playwright() as started:
        # As root, which a container's tests often are, chromium has no sandbox of its own.
        one = started.chromium.launch(executable_path=found, args=["--no-sandbox", "--disable-gpu"])
        yield one
        one.close()


@pytest.fixture
def unillustrated(monkeypatch: pytest.MonkeyPatch) -> None:
    """Reports without their pictures, which take seconds each: for tests of what is told. Others look at the
    pictures."""
    from haptic_teleop_sysid.commands import compare, dataset_report, verify
    from haptic_teleop_sysid.discovery import conclusion
    from haptic_teleop_sysid.report import page
    from haptic_teleop_sysid.runs import estimation_run

    for module in (compare, conclusion, dataset_report, estimation_run, verify):
        monkeypatch.setattr(module, "save_png", lambda picture, path: path)
    monkeypatch.setattr(page, "still", lambda plot, points: plot)
    monkeypatch.setattr(page, "inline_svg", lambda figure, prefix, description: "")
    monkeypatch.setattr(page, "available", lambda: False)


@pytest.fixture(autouse=True)
def nobodys_settings(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    """What the user of this machine has confirmed for a device is none of a test's business."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path_factory.getbasetemp() / "config"))
