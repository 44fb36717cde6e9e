"""Warnings: what has grown by more than its share since the last look, and what stands."""

from haptic_teleop_control.warning_list import Warnings


def test_what_has_grown_since_the_last_look_is_a_warning_once():
    lost = [3]
    warnings = Warnings()
    warnings.watch(lambda: lost[0], "messages were lost")
    assert warnings.take() == []
    lost[0] += 2
    assert warnings.take() == ["2 messages were lost"]
    assert warnings.take() == []


def test_a_share_is_that_of_the_time_since_the_last_look():
    missed, periods = [0], [0]
    warnings = Warnings()
    warnings.watch(lambda: missed[0], "periods were skipped", lambda: periods[0], 0.01)
    for more, expected in ((10, []), (11, ["11 of 1000 periods were skipped"]), (10, [])):
        missed[0] += more
        periods[0] += 1000
        assert warnings.take() == expected


def test_a_statement_stands_until_it_is_replaced_or_withdrawn():
    warnings = Warnings()
    warnings.state("disk", "little is free")
    assert warnings.take() == warnings.take() == ["little is free"]
    warnings.state("disk", "less is free")
    assert warnings.take() == ["less is free"]
    warnings.state("disk", "")
    assert warnings.take() == []
