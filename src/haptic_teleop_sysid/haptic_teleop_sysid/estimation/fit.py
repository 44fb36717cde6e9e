"""A fitted model, and what a fit is whose arithmetic fails."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field
from functools import wraps
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_sim.model import Model

from .likelihood import FAILURES
from .noise import NoiseModel
from .records import Record

FloatArray = NDArray[np.float64]
Answer = TypeVar("Answer")


@dataclass(frozen=True)
class Fit:
    """A fitted model.

    ``log_likelihood`` of the recordings; ``information`` (p, p): Gauss-Newton information matrix of
    ``free`` at the end; ``gradient`` (p,); ``converged`` with a sentence in ``message``.
    """

    model: Model
    noise: NoiseModel
    free: tuple[str, ...]
    log_likelihood: float
    information: FloatArray
    gradient: FloatArray
    converged: bool
    iterations: int
    message: str
    at_bound: tuple[str, ...] = field(default=())
    _asked: dict[Hashable, Any] = field(default_factory=dict, init=False, compare=False, repr=False)

    def once(
        self, question: Hashable, records: Sequence[Record], answer: Callable[[], Answer]
    ) -> Answer:
        """The answer to a question about this fit and some records, which several steps of a diagnosis ask:
        computed when it is asked first. A copy by `replace` knows nothing yet."""
        key = question, tuple(map(id, records))
        if key not in self._asked:
            self._asked[key] = answer(), tuple(records)  # kept: another record could get the same identity
        found: Answer = self._asked[key][0]
        return found


def ends_with_its_model(fit: Callable[..., Fit]) -> Callable[..., Fit]:
    """A fit whose arithmetic fails (FAILURES) is one that predicts nothing: the search goes on without it."""

    @wraps(fit)
    def guarded(model: Model, noise: NoiseModel, records: Sequence[Record], **more: Any) -> Fit:
        try:
            return fit(model, noise, records, **more)
        except FAILURES as failure:
            free = model.free_parameters() if more.get("free") is None else more["free"]
            nothing = np.zeros((len(free), len(free)))
            why = f"its arithmetic failed: {failure}"
            return Fit(model, noise, free, -np.inf, nothing, nothing.sum(axis=0), False, 0, why)

    return guarded
