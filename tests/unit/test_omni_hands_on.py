"""`doctor --omni` on the emulated HD library, with a hand that turns its axes."""

import math
from pathlib import Path

import numpy as np
import pytest
import yaml
from openhaptics_rig import NEUTRAL, HdRig

from haptic_teleop_control import doctor
from haptic_teleop_control.acquisition import TABLE as ACQUISITION
from haptic_teleop_control.device import Reporter
from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.node_tables import SCENARIO
from haptic_teleop_control.parameter_files import check_parameter_file
from haptic_teleop_omni.axis_map import AxisMap
from haptic_teleop_omni.build import ALL_FAULTS, make_driver
from haptic_teleop_omni.confirmation import confirmed_words
from haptic_teleop_omni.hands_on import verify_by_hand
from haptic_teleop_omni.settings import TABLE

FIRST_CONTACT = Path(__file__).parents[2] / "config" / "first_contact_omni.yaml"

GOOD = [(0.0, 0.0, 0.0), (0.3, 0.0, 0.0), (0.3, 0.3, 0.0), (0.3, 0.3, 0.4)]
"""Where the hand brings the library's angles, about neutral, rad: neutral, left, up, out."""


class Hand:
    """Goes from pose to pose, slowly enough for a hand, and presses Enter in each."""

    def __init__(self, em, poses) -> None:
        self.em, self.poses, self.at, self.torques = em, list(poses), np.zeros(3), []

    def __call__(self) -> bool:
        self.torques.append(not self.em.off())
        if not self.poses:
            raise AssertionError("asked for more than there is")
        way = np.array(self.poses[0]) - self.at
        self.at = self.at + np.clip(way, -0.01, 0.01)
        self.em.place(NEUTRAL + self.at)
        if np.abs(way).max() > 0.01:
            return False
        self.poses.pop(0)
        return True


@pytest.fixture
def run(em, tmp_path, capsys):
    """Runs the verification with the poses and parameters given: exit status, what was said."""

    def verify(poses, **parameters):
        own = {"openhaptics.library": str(em.path), "confirmations": str(tmp_path / "confirmed.yaml")}
        own |= {name.replace("__", "."): value for name, value in parameters.items()}
        file = tmp_path / "omni.yaml"
        file.write_text(yaml.safe_dump({"omni_driver": {"ros__parameters": own}}))
        em.place(NEUTRAL)
        hand = Hand(em, poses)
        status = verify_by_hand(str(file), hand)
        assert not any(hand.torques), "force"
        return status, capsys.readouterr().out

    return verify


@pytest.fixture
def ticking(em, monkeypatch):
    """A period of the servo thread before each state, as time goes by while the user thinks."""
    from haptic_teleop_omni.driver import OmniDriver

    plain = OmniDriver.read

    def read(self):
        em.c.em_tick()
        return plain(self)

    monkeypatch.setattr(OmniDriver, "read", read)


def driver_of(em, tmp_path, **parameters):
    own = {"device": "hardware", "openhaptics.library": str(em.path)}
    own |= {"confirmations": str(tmp_path / "confirmed.yaml")}
    own |= {name.replace("__", "."): value for name, value in parameters.items()}
    return make_driver(own, Reporter.to_latch(ALL_FAULTS)[0])


def test_what_was_confirmed_by_hand_lets_this_device_drive_with_this_map_alone(em, tmp_path, run, ticking):
    status, said = run(GOOD)
    assert status == 0
    assert said.count("good") == 4
    assert "Emulated Omni:EM0001" in said
    path = tmp_path / "confirmed.yaml"
    entry = yaml.safe_load(path.read_text())["Emulated Omni:EM0001"]
    assert entry["moved"]["omni_y"][1] == pytest.approx(0.3, abs=1e-3)
    assert set(entry) == {"words", "on", "device", "moved"}
    driver = driver_of(em, tmp_path)
    driver.open()
    assert driver.may_drive
    assert confirmed_words(path, driver.transport.identity) == driver.confirmation
    driver.close()
    other = driver_of(em, tmp_path, openhaptics__axis_zero=[0.0, 0.9, 1.1])
    other.open()
    assert not other.may_drive
    other.close()
    second = driver_of(em, tmp_path, openhaptics__device_name="Second Device")
    second.open()
    assert not second.may_drive
    second.close()


@pytest.mark.parametrize(
    ("poses", "words"),
    [
        ([(0.0, 0.4, 0.0), *((x, y + 0.4, z) for x, y, z in GOOD[1:])],
         ["NOT neutral", "openhaptics.axis_zero: [0.000, 1.308, 1.128]"]),
        ([GOOD[0], (-0.3, 0.0, 0.0), (-0.3, 0.3, 0.0), (-0.3, 0.3, 0.4)],
         ["WRONG sign", "openhaptics.axis_sign: [-1.0, 1.0, 1.0]"]),
        ([GOOD[0], GOOD[1], (0.3, 0.3, 0.25), (0.3, 0.3, 0.6)], ["NOT alone", "axis_relative_z"]),
        ([GOOD[0], (0.0, 0.3, 0.0), (0.0, 0.6, 0.0), (0.0, 0.6, 0.4)], ["WRONG axis", "omni_y moved most"]),
        ([GOOD[0], GOOD[0], GOOD[0], GOOD[0]], ["no axis moved", "NOT verified"]),
    ],
)  # fmt: skip
def test_what_is_not_as_it_should_be_is_named_with_its_parameter_and_confirms_nothing(
    em, tmp_path, run, ticking, poses, words
):
    status, said = run(poses)
    assert status == 1
    for word in words:
        assert word in said
    assert "NOT confirmed" in said
    assert not (tmp_path / "confirmed.yaml").exists()


def test_the_zero_that_it_proposes_is_right_for_a_map_with_other_signs(em, tmp_path, run, ticking):
    poses = [(0.0, -0.4, 0.0), *((x, y - 0.4, z) for x, y, z in GOOD[1:])]
    _, said = run(poses, openhaptics__axis_sign=[1.0, -1.0, 1.0])
    proposed = yaml.safe_load(said.split("openhaptics.axis_zero: ")[1].split("\n")[0])
    assert AxisMap(sign=(1.0, -1.0, 1.0), zero=tuple(proposed)).angles(
        [NEUTRAL[0], NEUTRAL[1] - 0.4, NEUTRAL[2]]
    ) == pytest.approx([0.0] * 3, abs=1e-3)


@pytest.mark.parametrize(
    ("parameters", "word"),
    [
        ({"openhaptics__axis_sing": [1.0, 1.0, 1.0]}, "axis_sing"),
        ({"openhaptics__axis_sign": [2.0, 1.0, 1.0]}, "axis_sign"),
    ],
)
def test_a_mistake_in_the_file_is_named_before_anything_is_opened(em, run, parameters, word):
    with pytest.raises(ConfigurationError, match=rf"omni\.yaml.*{word}"):
        run(GOOD, **parameters)
    assert not em.c.em_is_open(0)


def test_a_device_without_a_name_of_its_own_cannot_be_confirmed(em, run):
    em.c.em_nameless(0)
    with pytest.raises(ConfigurationError, match="neither model nor serial number"):
        run(GOOD)


def test_a_device_without_a_serial_number_is_confirmed_by_nobody_s_hand(em, tmp_path, run):
    em.c.em_numberless(0)
    with pytest.raises(ConfigurationError, match=r"tells no serial number.*layout_confirmed_for"):
        run(GOOD)
    # Nor by what was written down for its model: its driver asks for the words in the file.
    rig = HdRig(em, tmp_path)
    assert not rig.driver.may_drive
    rig.driver.close()
    stated = HdRig(em, tmp_path, confirmed=False, layout_confirmed_for=rig.driver.confirmation)
    assert stated.driver.may_drive
    stated.driver.close()


def test_a_file_that_says_nothing_to_the_driver_is_no_file_of_its(repository):
    with pytest.raises(ConfigurationError, match="says nothing to omni_driver"):
        verify_by_hand(str(repository / "config" / "board_server.yaml"))


def test_a_device_that_goes_away_ends_it_in_one_sentence(em, tmp_path, run, ticking, capsys):
    em.c.em_refuse(0x0302)
    file = tmp_path / "omni.yaml"
    file.write_text(
        yaml.safe_dump({"omni_driver": {"ros__parameters": {"openhaptics.library": str(em.path)}}})
    )
    assert doctor.main(["--omni", str(file)]) == 2
    assert "HD_COMM_ERROR" in capsys.readouterr().err


def test_the_file_for_the_first_contact_fits_its_nodes_and_stays_far_below_the_device_s_limits():
    checked = check_parameter_file(FIRST_CONTACT, {t.node_name: t for t in (TABLE, ACQUISITION, SCENARIO)})
    driver, experiment = checked["omni_driver"], checked["acquisition"]
    levels = experiment["signal.steps.levels"]
    assert max(map(abs, levels)) < driver["torque.peak"] < 0.119 / 2, "half of what may flow for ever"
    assert sum(levels) == 0.0
    assert driver["transport"] == "openhaptics"
    defaults = AxisMap()
    assert driver["openhaptics.axis_zero"] == list(defaults.zero)
    assert driver["openhaptics.axis_sign"] == list(defaults.sign)


@pytest.mark.parametrize("values", [(2.0, 1.0, 1.0), (0.0, 1.0, 1.0), (1.0, 1.0), (1.0, math.nan, 1.0)])
def test_a_sign_is_one_or_minus_one(values):
    with pytest.raises(ConfigurationError, match="axis_sign"):
        AxisMap(sign=values)


def test_the_emulated_hand_does_what_is_asked_for_and_goes_on_by_the_button(em, tmp_path, ticking, capsys):
    """EM_MOVES=doctor, with which docs/first_contact.md has the command tried without a device."""
    em.c.em_moves(0, 2)
    file, confirmed = tmp_path / "omni.yaml", tmp_path / "confirmed.yaml"
    own = {"openhaptics.library": str(em.path), "confirmations": str(confirmed)}
    file.write_text(yaml.safe_dump({"omni_driver": {"ros__parameters": own}}))
    assert verify_by_hand(str(file), lambda: False) == 0
    assert capsys.readouterr().out.count("good") == 4
    moved = yaml.safe_load(confirmed.read_text())["Emulated Omni:EM0001"]["moved"]
    assert np.array([moved[f"omni_{axis}"] for axis in "xyz"]) == pytest.approx(0.35 * np.eye(3), abs=0.01)
