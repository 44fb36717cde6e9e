"""Products of shifted series against numpy's own, by both ways, and of series shorter than the lags."""

import numpy as np
import pytest

from haptic_teleop_sysid.estimation import correlation as module
from haptic_teleop_sysid.estimation.correlation import autocorrelation, correlation

RANDOM = np.random.default_rng(3)


@pytest.mark.parametrize("lags", [0, 5, 300])
@pytest.mark.parametrize("n", [4, 500])
@pytest.mark.parametrize("few", [0, 1000])
def test_it_is_what_numpy_says(n, lags, few, monkeypatch):
    monkeypatch.setattr(module, "FEW", few)
    a, b = RANDOM.normal(size=(2, n))
    expected = np.correlate(b, a, "full")[n - 1 :]
    expected = np.pad(expected, (0, max(lags + 1 - n, 0)))[: lags + 1]
    assert correlation(a, b, lags) == pytest.approx(expected, abs=1e-9)


def test_an_autoregressive_series_forgets_by_its_factor():
    e = np.zeros(200_000)
    noise = RANDOM.normal(size=len(e))
    for k in range(1, len(e)):
        e[k] = 0.8 * e[k - 1] + noise[k]
    assert autocorrelation(e, 4) == pytest.approx(0.8 ** np.arange(5), abs=0.02)
    assert np.all(autocorrelation(np.zeros(9), 3) == 0.0)
