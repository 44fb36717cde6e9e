"""What an estimate is, whatever method made it."""

from __future__ import annotations

from dataclasses import dataclass, field

from haptic_teleop_sim.model import Model

from .fit import Fit
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
class FarSighted:
    """What a predictor finds that looks ``ahead``, s: value and standard error (infinite where it has none)
    by parameter, empty where its search did not arrive."""

    values: dict[str, tuple[float, float]]
    ahead: float


@dataclass(frozen=True)
class Estimate:
    """``model`` with the values found by ``method`` from ``start``; ``converged`` with a sentence in
    ``message``; ``fit`` and ``uncertainty`` for the prediction-error method, None for the others, which
    know no noise; ``starts``: log-likelihood reached from each start (the given one first); ``seconds`` it
    took; ``far_sighted``: the cross-check, None where it was not asked for; ``misled``: set where the
    one-step predictor was not believed, and ``fit`` is that of the one that looks further ahead;
    ``plain_std``: standard errors by parameter of a method without noise model, NaN where it has none;
    ``contradictions``: by effect, what of its numbers it cannot have, in words; ``by_form``: by parameter,
    the part of its standard error that other published forms of its law make; ``kept``: the undetermined
    parameters that ``model`` has as the start had them."""

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
    far_sighted: FarSighted | None = None
    misled: Misled | None = None
    plain_std: dict[str, float] = field(default_factory=dict)
    contradictions: dict[str, str] = field(default_factory=dict)
    by_form: dict[str, float] = field(default_factory=dict)
    kept: tuple[str, ...] = ()

    def disagreement(self) -> dict[str, float]:
        """Parameters that the far-sighted predictor puts elsewhere, by more than 10 % and DISAGREEMENT of its
        standard errors: name -> its value. Empty without a cross-check.

        Where the model is right one step ahead is efficient, and the variance of the difference is that of
        the other's less its own (Hausman, Econometrica 46, 1978): at most the former."""
        unsure, found = self.uncertainty, self.model.parameter_values()
        if self.far_sighted is None or unsure is None:
            return {}
        return {
            name: other
            for name, (other, std) in self.far_sighted.values.items()
            if name not in unsure.undetermined
            and abs(other - found[name]) > max(DISAGREEMENT * std, 0.1 * abs(found[name]))
        }
