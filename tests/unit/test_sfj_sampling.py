"""The board's sampling task: which samples a late reader gets, which got lost, and by whose clock."""

import numpy as np
import pytest
from device_rigs import SfjRig, StillRobot

from haptic_teleop_2dsfj.sample_clock import SampleClock
from haptic_teleop_control.device import ReadResult
from haptic_teleop_control.errors import ConfigurationError

PUSH = (2.0, 0.4)  # N·m
DT = 0.002


class Numbered(StillRobot):
    """A robot whose angle tells how many samples have passed."""

    def advance(self, current) -> None:
        super().advance(current)
        self.angles = np.full(4, 0.002 * len(self.given))


def refusing(plant=None, **parameters) -> SfjRig:
    """A card that does not know how to overwrite samples."""
    rig = SfjRig(plant, board__watchdog=0.2, **parameters)
    rig.driver.close()
    rig.hil.refuse("task_set_buffer_overflow_mode", -1079)
    rig.driver.open()
    return rig


# A card that does not overwrite.


def test_a_card_that_does_not_overwrite_is_used_all_the_same_and_that_is_said():
    rig = refusing()
    assert rig.run(100, PUSH) is None
    assert rig.latch.latched is None
    assert any(rig.plant.given[-1])
    said = f"{rig.driver.describe()} {rig.driver.measurements()['samples']}"
    assert (
        said.count("the card does not overwrite: task_set_buffer_overflow_mode") == said.count("-1079") == 2
    )
    assert "newest" in SfjRig().driver.describe()


@pytest.mark.parametrize("card", [SfjRig, refusing])
def test_a_late_reader_gets_the_newest_sample_and_knows_how_many_it_missed(card):
    rig = card(Numbered(), **({"board__watchdog": 0.2} if card is SfjRig else {}))
    rig.run(20)
    rig.clock.advance(15.3 * DT)
    assert rig.driver.read() is ReadResult.STATE
    newest = 0.002 * len(rig.plant.given)
    assert rig.driver.position == pytest.approx([newest] * 4, abs=3e-4)
    assert rig.driver.missed == 14
    rig.run(300)
    assert rig.driver.missed == 14
    assert rig.latch.latched is None


def test_a_queue_that_is_full_is_a_lost_board_at_zero():
    rig = refusing()
    rig.run(20, PUSH)
    rig.clock.advance(1.1)
    assert rig.driver.read() is ReadResult.LOST
    assert rig.latch.latched == "board_error"
    assert "full" in rig.latch.sentence
    assert not rig.hil.volts.any() and not any(rig.hil.amplifier_on)
    rig.reset()
    rig.run(3, PUSH)
    assert rig.latch.latched is None


# Whether the samples keep step with the steady clock.


def until_found(rig: SfjRig, seconds: float) -> float:
    """s until the fault, driven with PUSH."""
    begun = rig.clock.now()
    while rig.latch.latched is None and rig.clock.now() - begun < seconds * 1e9:
        rig.cycle(PUSH)
    return (rig.clock.now() - begun) * 1e-9


@pytest.mark.parametrize("lost", [1, 3])
def test_a_sample_that_is_lost_without_a_word_is_found_and_stops_the_robot(lost):
    rig = SfjRig()
    rig.run(300, PUSH)
    rig.hil.lose(lost)
    assert until_found(rig, 5.0) < 0.45
    assert rig.latch.latched == "sample_clock"
    assert f"{lost}.0 samples too few" in rig.latch.sentence
    assert not rig.hil.volts.any() and not any(rig.hil.amplifier_on)
    rig.reset()
    until_found(rig, 5.0)
    assert rig.latch.latched is None, "it is told once"


@pytest.mark.parametrize(("stretch", "word"), [(1.01, "few"), (0.99, "many"), (2.0, "few"), (0.5, "many")])
def test_a_board_with_another_rate_than_it_was_asked_for_is_found(stretch, word):
    rig = SfjRig()
    rig.driver.close()
    rig.hil.stretch = stretch
    rig.driver.open()
    assert until_found(rig, 10.0) < 1.2
    assert rig.latch.latched == "sample_clock"
    assert word in rig.latch.sentence


@pytest.mark.parametrize("stretch", [1.0 - 2e-4, 1.0, 1.0 + 2e-4])
def test_quartzes_that_differ_a_late_loop_and_counted_losses_are_no_fault(stretch):
    rig = SfjRig(board__watchdog=0.2)
    rig.driver.close()
    rig.hil.stretch = stretch
    rig.driver.open()
    random = np.random.default_rng(1)
    for cycle in range(15_000):  # 30 s
        if cycle % 1000 == 500:
            rig.clock.advance(0.015)
        elif cycle % 3 == 0:
            rig.clock.advance(random.exponential(1e-3))
        rig.cycle()
    assert rig.latch.latched is None
    assert rig.driver.missed > 15 * 6


def test_a_machine_on_which_every_read_comes_late_for_a_while_is_no_fault():
    clock = SampleClock(DT)
    random = np.random.default_rng(2)
    for k in range(5000):
        busy = 1000 < k < 3000
        late = random.exponential(3e-3) if busy and k % 40 else 5e-5
        assert clock.step(round((k * DT + late) * 1e9), 1) is None


# What is asked of the card.


def test_the_clock_that_paces_the_samples_is_a_parameter():
    assert SfjRig().hil.clock == 0
    assert SfjRig(board__clock=-1).hil.clock == -1
    with pytest.raises(ConfigurationError, match=r"board\.clock"):
        SfjRig(board__clock=20)


def test_after_an_expiry_zero_is_written_before_anything_else_and_before_the_amplifier_goes_on():
    rig = SfjRig()
    rig.run(5, PUSH)
    rig.clock.advance(0.1)
    rig.cycle(PUSH)  # finds the board expired, which brings back what flowed when it is cleared
    rig.reset()
    rig.run(3, PUSH)
    rig.clock.advance(0.1)  # killed
    rig.board().open()
    calls = rig.hil.calls
    cleared = [k for k, call in enumerate(calls) if call == "watchdog_clear"]
    assert len(cleared) >= 3
    assert {calls[k + 1] for k in cleared} == {"write_analog"}
    assert not rig.hil.volts.any()


def test_the_amplifier_goes_on_with_zero_at_the_outputs():
    rig = SfjRig()
    rig.run(2)
    rig.hil.volts[:] = 1.0  # whoever wrote it
    rig.driver.board.enable(True)
    assert all(rig.hil.amplifier_on)
    assert not rig.hil.volts.any()
