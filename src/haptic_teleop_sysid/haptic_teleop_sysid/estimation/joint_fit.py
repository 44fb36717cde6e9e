"""Parameters and noise model together: alternate until neither gains."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from haptic_teleop_sim.kernel import pack
from haptic_teleop_sim.model import Model

from .gauss_newton import Fit, Limits, fit_parameters
from .noise import NoiseModel
from .records import Record
from .tuning import initial_noise, tune_noise


def fit_model(
    model: Model,
    records: Sequence[Record],
    *,
    noise: NoiseModel | None = None,
    free: tuple[str, ...] | None = None,
    rounds: int = 4,
    gain: float = 1.0,
    iterations: int = 15,
    progress: Callable[[int, float], None] | None = None,
    limits: Limits | None = None,
) -> Fit:
    """Fit the free parameters and the noise levels to recordings in turn, until a round gains less than
    ``gain`` nats.

    Without ``noise`` it starts from ``initial_noise`` with a coarse search; with one, from there.
    """
    factor = 4.0 if noise is None else 2.0
    noise = initial_noise(pack(model), records) if noise is None else noise
    fit: Fit | None = None
    for _ in range(rounds):
        noise, _ = tune_noise(pack(model), noise, records, factor=factor)
        before = fit.log_likelihood if fit is not None else float("-inf")
        fit = fit_parameters(
            model, noise, records, free=free, iterations=iterations, progress=progress, limits=limits
        )
        model = fit.model
        factor = 2.0
        if fit.log_likelihood - before < gain:
            break
    assert fit is not None
    return fit
