"""A disk that fills up is told while there is time to act."""

from haptic_teleop_control.recording.free_space import AHEAD, LONGEST, SHORTEST, FreeSpace

GB = 1e9


def test_plenty_is_no_warning_and_little_is_one_before_the_rate_is_known():
    assert FreeSpace(0.5 * GB).warning(0.0, 100 * GB) == ""
    assert "lasts for about 100 s" in FreeSpace(0.5 * GB).warning(0.0, 0.6 * GB)


def test_the_time_left_is_told_by_the_rate_that_was_measured():
    """10 MB/s of others and ours: 4 GB above the minimum last for 400 s."""
    space = FreeSpace(1 * GB)
    assert space.warning(0.0, 5.2 * GB) == ""
    sentence = space.warning(20.0, 5.0 * GB)
    assert "about 400 s more" in sentence and "5000 MB" in sentence and "1000 MB" in sentence


def test_a_disk_that_does_not_fill_any_more_is_no_warning():
    space = FreeSpace(1 * GB)
    assert space.warning(0.0, 1.2 * GB)
    assert space.warning(SHORTEST, 1.2 * GB) == ""


def test_the_rate_is_that_of_late():
    """After an hour at rest it fills at 10 MB/s."""
    space, free, now = FreeSpace(0.0), 5 * GB, 0.0
    for now in range(0, 3600, 10):
        space.warning(float(now), free)
    for later in range(0, int(2 * LONGEST) + 1, 10):
        sentence = space.warning(float(now + later), free - 1e7 * later)
    left = (free - 1e7 * 2 * LONGEST) / 1e7
    assert left < AHEAD
    assert f"about {left:.0f} s more" in sentence


def test_below_the_minimum_nothing_is_left():
    space = FreeSpace(1 * GB)
    space.warning(0.0, 0.5 * GB)
    assert "about 0 s" in space.warning(SHORTEST, 0.5 * GB)
