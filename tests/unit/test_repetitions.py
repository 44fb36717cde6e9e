"""In simulated time the packets of one tick are said again together; each is recorded once."""

from haptic_teleop_control.nodes.recording.repetitions import REMEMBERED, Repetitions


def test_packets_that_are_said_again_together_or_late_are_repetitions_and_overtaken_ones_are_none():
    said = Repetitions()
    told = [said.is_one(stamp) for stamp in (10, 30, 20, 10, 30, 20, 40, 20)]
    assert told == [False, False, False, True, True, True, False, True]
    assert said.newest == 40


def test_what_is_remembered_is_bounded():
    said = Repetitions()
    assert not any(said.is_one(stamp) for stamp in range(1, 3 * REMEMBERED))
    assert len(said._stamps) == len(said._order) == REMEMBERED
