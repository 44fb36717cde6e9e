"""A device that does not come back is found by whoever looks, and a machine that stands still is none."""

import pytest

from haptic_teleop_control.clocks import VirtualClock
from haptic_teleop_control.device_watch import DeviceWatch


@pytest.fixture
def watch():
    return DeviceWatch(VirtualClock(), 0.5)


def looks(watch: DeviceWatch, seconds: float) -> tuple[str, float] | None:
    found = None
    for _ in range(round(seconds / 0.1)):
        watch.clock.advance(0.1)
        found = watch.look()
    return found


def test_a_call_that_lasts_too_long_is_named_with_its_time(watch):
    watch.enter("read")
    assert looks(watch, 0.5) is None
    assert looks(watch, 0.1) == ("read", pytest.approx(0.6))
    assert looks(watch, 10.0) == ("read", pytest.approx(10.6))
    watch.leave()
    assert looks(watch, 1.0) is None


def test_many_short_calls_are_none_however_long_all_of_them_take(watch):
    for _ in range(100):
        watch.enter("read")
        assert looks(watch, 0.2) is None
        watch.leave()
        watch.enter("write")
        assert looks(watch, 0.2) is None


def test_time_in_which_nobody_looked_does_not_count(watch):
    watch.enter("read")
    assert looks(watch, 0.2) is None
    watch.clock.advance(30.0)  # the whole process stood still
    assert watch.look() is None
    watch.leave()
    watch.clock.advance(30.0)
    watch.enter("read")
    watch.clock.advance(30.0)
    assert watch.look() is None
    assert looks(watch, 0.4) == ("read", pytest.approx(0.6))


def test_opening_a_device_may_take_longer(watch):
    watch.enter("reset", 10.0)
    assert looks(watch, 9.9) is None
    assert looks(watch, 0.2)
