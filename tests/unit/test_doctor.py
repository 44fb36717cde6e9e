"""`doctor` finds what is there, names the remedy for what is not, and says so in its exit status."""

import re
import sys
import types
from pathlib import Path

import pytest

from haptic_teleop_2dsfj import doctor_checks as sfj
from haptic_teleop_control import doctor
from haptic_teleop_control.health import ABSENT, BAD, OK, OPEN, SLOW, Check
from haptic_teleop_omni import doctor_checks as omni
from haptic_teleop_omni.confirmation import confirm, confirmation_file


def by_subject(checks: list[Check]) -> dict[str, Check]:
    return {check.subject: check for check in checks}


def hid_device(root: Path) -> Path:
    (root / "sys/class/hidraw/hidraw3/device").mkdir(parents=True)
    (root / "sys/class/hidraw/hidraw3/device/uevent").write_text("HID_ID=0003:00002988:00000304\n")
    (root / "dev").mkdir()
    node = root / "dev/hidraw3"
    node.touch()
    return node


def test_a_touch_that_may_be_opened_is_found(tmp_path):
    hid_device(tmp_path)
    found = by_subject(omni.checks(tmp_path))["Omni"]
    assert found.level == OK
    assert "hidraw3" in found.finding


def test_a_touch_without_permission_is_a_problem_with_the_udev_rule_as_remedy(tmp_path, monkeypatch):
    hid_device(tmp_path)
    monkeypatch.setattr(omni.os, "access", lambda path, mode: False)
    found = by_subject(omni.checks(tmp_path))["Omni"]
    assert found.level == BAD
    assert "--udev-rule" in found.remedy


def firewire_device(root: Path) -> None:
    device = root / "sys/bus/firewire/devices/fw1"
    device.mkdir(parents=True)
    (device / "vendor").write_text("0x000b99\n")


def serial_device(root: Path) -> None:
    device = root / "sys/bus/usb/devices/1-2"
    (device / "1-2:1.0/tty/ttyACM3").mkdir(parents=True)
    (device / "idVendor").write_text("2988\n")
    (device / "idProduct").write_text("0302\n")


@pytest.mark.parametrize(
    ("connect", "node", "word"), [(firewire_device, "fw1", "FireWire"), (serial_device, "ttyACM3", "USB")]
)
def test_every_generation_is_recognised_and_its_rights_are_looked_at(tmp_path, connect, node, word):
    connect(tmp_path)
    found = by_subject(omni.checks(tmp_path))["Omni"]
    assert found.level == BAD
    assert word in found.finding and node in found.finding
    assert "--udev-rule" in found.remedy
    (tmp_path / "dev").mkdir()
    (tmp_path / "dev" / node).touch()
    found = by_subject(omni.checks(tmp_path))["Omni"]
    assert found.level == OK
    assert "openhaptics" in found.finding


def test_the_maker_s_library_and_what_was_confirmed_are_looked_at(em, tmp_path, monkeypatch):
    found = by_subject(omni.checks(tmp_path))
    assert found["OpenHaptics"].level == found["confirmed Omnis"].level == ABSENT
    assert "doctor --omni" in found["confirmed Omnis"].remedy
    monkeypatch.setattr("ctypes.util.find_library", lambda name: str(em.path) if name == "HD" else None)
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    monkeypatch.setenv("GTDD_HOME", str(tmp_path))
    confirm(confirmation_file(), "Emulated Omni:EM0001", "words", {})
    found = by_subject(omni.checks(tmp_path))
    assert found["OpenHaptics"].level == found["OpenHaptics configuration"].level == OK
    assert "EM0001" in found["confirmed Omnis"].finding
    confirmation_file().write_text("[]\n")
    assert by_subject(omni.checks(tmp_path))["confirmed Omnis"].level == BAD


def test_without_a_device_it_is_absent_and_that_is_no_problem(tmp_path):
    assert by_subject(omni.checks(tmp_path))["Omni"].level == ABSENT


def test_an_installed_rule_is_found(tmp_path):
    folder = tmp_path / "etc/udev/rules.d"
    folder.mkdir(parents=True)
    assert by_subject(omni.checks(tmp_path))["udev rule"].level == ABSENT
    (folder / omni.RULE).write_text(omni.udev_rule())
    assert by_subject(omni.checks(tmp_path))["udev rule"].level == OK


def test_the_sdk_without_its_library_is_a_problem(monkeypatch):
    assert sfj.checks()[0].level == ABSENT
    monkeypatch.setattr(sfj, "_package", lambda: True)
    monkeypatch.setattr(sfj.ctypes.util, "find_library", lambda name: None)
    assert sfj.checks()[0].level == BAD


@pytest.mark.parametrize(("limit", "level"), [("", OPEN), ("SUBNET", OPEN), ("LOCALHOST", OK), ("off", OK)])
def test_a_graph_that_the_whole_network_sees_is_a_problem_for_robots(monkeypatch, limit, level):
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", limit)
    monkeypatch.delenv("ROS_LOCALHOST_ONLY", raising=False)
    assert doctor._discovery().level == level


def test_wheels_in_a_sourced_shell_are_a_problem(monkeypatch):
    pytest.importorskip("rclpy", reason="needs ROS 2")
    monkeypatch.setenv("ROS_DISTRO", "jazzy")
    assert doctor._ros()[0].level == BAD
    monkeypatch.delenv("ROS_DISTRO")
    assert doctor._ros()[0].level == OK


def test_refused_real_time_scheduling_is_a_problem_for_robots_with_its_remedy(monkeypatch):
    def refuse(*_: object) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(doctor.os, "sched_setscheduler", refuse)
    check = doctor._realtime()
    assert check.level == SLOW
    assert "rtprio" in check.remedy


def test_the_exit_status_counts_problems_and_with_hardware_what_is_absent(monkeypatch, capsys):
    found = [Check("a", OK, "there"), Check("b", ABSENT, "not there", "buy one")]
    monkeypatch.setattr(doctor, "all_checks", lambda: found)
    assert doctor.main([]) == 0
    assert "b: not there; buy one" in capsys.readouterr().out
    assert doctor.main(["--hardware"]) == 1
    found[1] = Check("b", OPEN, "seen by all", "close it")
    capsys.readouterr()
    assert doctor.main([]) == 0 and "0 problems; 1 more that only robots" in capsys.readouterr().out
    assert doctor.main(["--hardware"]) == 1 and "1 problem\n" in capsys.readouterr().out
    found[1] = Check("b", SLOW, "late", "hurry")
    assert doctor.main([]) == 0 and "slow     b: late; hurry" in capsys.readouterr().out
    assert doctor.main(["--hardware"]) == 1
    found.append(Check("c", BAD, "broken", "mend it"))
    assert doctor.main([]) == 1


@pytest.mark.parametrize(("late", "level"), [(0.0002, OK), (0.003, SLOW), (0.05, BAD)])
def test_a_loop_that_misses_samples_is_not_called_fine(monkeypatch, late, level):
    """A clock on which every sleep takes its time, and one in the middle too long."""
    now = iter(range(10**9))
    clock = {"t": 0.0}

    def sleep(wait):
        clock["t"] += wait + (late if next(now) == 100 else 0.0)

    monkeypatch.setattr(doctor, "time", types.SimpleNamespace(monotonic=lambda: clock["t"], sleep=sleep))
    check = doctor._timing()
    assert check.level == level
    assert f"{1e3 * late:.2f} ms (most)" in check.finding


def test_it_asks_every_package_that_has_something_to_say():
    subjects = {check.subject for check in doctor.all_checks()}
    assert {"Python", "ROS 2", "timing", "OpenHaptics", "confirmed Omnis", "Quanser SDK"} <= subjects


def test_commissioning_the_2dsfj_asks_for_every_line_that_is_not_the_omnis(repository):
    page = (repository / "docs/first_contact.md").read_text()
    (told,) = re.findall(r"^\| 1 \| `haptic-teleop doctor --hardware`; [^|]+ \| ([^|]+) \|", page, re.M)
    own = [*doctor.environment_checks(), *sfj.checks()]
    assert set(re.findall(r"`([^`]+)`", told)) - {"slow"} == {"board server", *(c.subject for c in own)}


def test_the_offered_udev_rule_names_the_device(capsys):
    assert doctor.main(["--udev-rule"]) == 0
    rule = capsys.readouterr().out
    assert 'ATTRS{idVendor}=="2988", ATTRS{idProduct}=="0304"' in rule


def test_a_quanser_package_is_found_by_its_name(monkeypatch):
    package = types.ModuleType("quanser")
    package.__path__ = []  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "quanser", package)
    assert not sfj._package()


def test_a_quanser_package_that_cannot_be_loaded_is_no_traceback(monkeypatch, tmp_path):
    (tmp_path / "quanser").mkdir()
    (tmp_path / "quanser" / "__init__.py").write_text("raise OSError('libhil.so is not there')\n")
    monkeypatch.delitem(sys.modules, "quanser", raising=False)
    monkeypatch.syspath_prepend(str(tmp_path))
    assert sfj.checks()[0].level == ABSENT


@pytest.mark.parametrize(
    ("version", "told"), [("7.1.3", False), ("9.1.0", False), ("9.1.1", True), ("10.0", True)]
)
def test_an_rclpy_that_does_not_tell_senders_is_named_with_what_that_costs(monkeypatch, version, told):
    monkeypatch.setattr(doctor.metadata, "version", lambda name: version)
    assert ("second sender" in doctor._senders()) is not told
