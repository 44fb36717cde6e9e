"""The link: what it does to packets is what its settings say, and the same for the same seed."""

from __future__ import annotations

import numpy as np
import pytest

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.teleoperation.link_model import LinkChannel, LinkSettings

N = 20_000


def arrivals(channel=0, **settings):
    link = LinkChannel(LinkSettings(**settings), channel)
    return link, [link.transmit(k * 0.001) for k in range(N)]


def test_nothing_set_is_a_wire():
    _, found = arrivals()
    assert found == [[k * 0.001] for k in range(N)]


def test_a_delay_is_kept_exactly():
    _, found = arrivals(delay=0.03)
    assert found == [[k * 0.001 + 0.03] for k in range(N)]


def test_jitter_stays_within_its_bounds_and_keeps_the_order():
    _, found = arrivals(delay=0.02, jitter=0.01)
    times = np.array([one[0] for one in found])
    age = times - np.arange(N) * 0.001
    assert np.all(np.diff(times) >= 0.0)
    assert age.min() >= 0.01 - 1e-12 and age.max() <= 0.03 + 1e-12
    assert np.ptp(age) > 0.008


@pytest.mark.parametrize(("loss", "burst"), [(0.01, 1.0), (0.05, 1.0), (0.2, 1.0), (0.1, 20.0)])
def test_the_share_lost_and_the_length_of_bursts_are_those_asked_for(loss, burst):
    link, found = arrivals(loss=loss, burst=burst)
    gone = np.array([not one for one in found])
    assert link.lost == gone.sum()
    # Three standard deviations of a mean over that many bursts.
    spread = 3.0 * np.sqrt(loss * (1.0 - loss) * (2.0 * burst - 1.0 + 2.0 * loss) / N)
    assert gone.mean() == pytest.approx(loss, abs=spread)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], gone.astype(int), [0]])))
    lengths = edges[1::2] - edges[::2]
    assert lengths.mean() == pytest.approx(burst, rel=0.25)


def test_overtaken_packets_arrive_after_later_ones():
    _, found = arrivals(delay=0.01, reorder=0.05, overtaken_by=0.004)
    times = np.array([one[0] for one in found])
    late = times - np.arange(N) * 0.001 > 0.0135
    assert late.mean() == pytest.approx(0.05, abs=0.006)
    assert np.all(np.diff(times[~late]) > 0.0)
    assert np.any(np.diff(times) < 0.0)


def test_duplicates_arrive_twice():
    link, found = arrivals(duplicate=0.1)
    twice = np.array([len(one) == 2 for one in found])
    assert twice.mean() == pytest.approx(0.1, abs=0.008)
    assert link.repeated == twice.sum()


def test_equal_seeds_give_equal_luck_and_other_seeds_and_channels_do_not():
    settings = {"delay": 0.02, "jitter": 0.01, "loss": 0.1, "reorder": 0.05, "duplicate": 0.02}
    assert arrivals(seed=3, **settings)[1] == arrivals(seed=3, **settings)[1]
    assert arrivals(seed=3, **settings)[1] != arrivals(seed=4, **settings)[1]
    assert arrivals(0, seed=3, **settings)[1] != arrivals(1, seed=3, **settings)[1]


def test_one_option_does_not_change_the_luck_of_another():
    plain = [bool(one) for one in arrivals(loss=0.1)[1]]
    mixed = [bool(one) for one in arrivals(loss=0.1, delay=0.05, jitter=0.02, reorder=0.1)[1]]
    assert plain == mixed


def test_a_link_that_loses_everything_is_refused():
    with pytest.raises(ConfigurationError, match="loss"):
        LinkSettings(loss=1.0)
