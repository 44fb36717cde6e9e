"""What an estimate is, whatever method made it."""

from __future__ import annotations

from dataclasses import dataclass

from haptic_teleop_sim.model import Model

from .gauss_newton import Fit
from .uncertainty import Uncertainty

#: Standard errors between two methods beyond which one of them must be wrong.
DISAGREEMENT = 3.0


@dataclass(frozen=True)
class Misled:
    """What the one-step predictor found where it was misled: its values by parameter; error of the simulated
    angles, relative to their spread, with its values and with those of the predictor that looks ``ahead``,
    s."""

    values: dict[str, float]
    error: float
    error_ahead: float
    ahead: float


@dataclass(frozen=True)
class Estimate:
    """``model`` with the values found by ``method`` from ``start``; ``converged`` with a sentence in
    ``message``; ``fit`` and ``uncertainty`` for the prediction-error method, None for the others, which
    know no noise; ``starts``: log-likelihood reached from each start (the given one first); ``seconds`` it
    took; ``output_error``: value and standard error (NaN where it has none) of the free parameters by the
    cross-check, empty where that did not arrive, None where it was not asked for; ``misled``: set where the
    one-step predictor was not believed, and ``fit`` is that of the one that looks further ahead."""

    model: Model
    start: Model
    method: str
    converged: bool
    message: str
    seconds: float
    iterations: int
    fit: Fit | None = None
    uncertainty: Uncertainty | None = None
    starts: tuple[float, ...] = ()
    output_error: dict[str, tuple[float, float]] | None = None
    misled: Misled | None = None

    def disagreement(self) -> dict[str, float]:
        """Parameters that the output error puts elsewhere, by more than 10 % and DISAGREEMENT of its own
        standard errors: name -> its value. Empty without a cross-check.

        Where the model is right the predictor is efficient, and the variance of the difference is that of the
        output error less the predictor's (Hausman, Econometrica 46, 1978): at most the former."""
        unsure, found = self.uncertainty, self.model.parameter_values()
        if not self.output_error or unsure is None:
            return {}
        apart = {}
        for name, (other, std) in self.output_error.items():
            if name in unsure.undetermined:
                continue
            difference = abs(other - found[name])
            # Not so with a standard error that is no number: nothing can then be said.
            if difference > DISAGREEMENT * std and difference > 0.1 * abs(found[name]):
                apart[name] = other
        return apart
