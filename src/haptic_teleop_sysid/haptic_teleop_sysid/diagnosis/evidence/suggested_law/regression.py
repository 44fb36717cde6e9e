"""Sparse regression: which few products leave least of the torque that is missing, where they were not
fitted.

Terms are taken in one by one, the one that is worth most first; one that another is worth more than gives way
to it, and one whose loss costs less than its numbers must gain goes again (thresholding). Every set is fitted
to either kind of recordings and judged by the other, together with the structure's own parameters. (PySINDy's
optimisers take one matrix and no second side; the products that `inverse_dynamics.products` keeps make
hundreds of candidates cost a second.)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from ..inverse_dynamics.groups import Search
from .library import Function, Product

#: Terms at most, the share of what is missing that each must explain, and the log-likelihood that each of its
#: numbers must gain, on recordings that were not fitted.
MOST_TERMS, LEAST_SHARE, A_NUMBER = 3, 0.02, 4.0
#: Steps by which an order, a place or a width is refined around the best of its grid.
_REFINED, _FIRST_STEP = 60, 0.08
#: Forms of a term of which the best shape is sought so.
_REFINED_FORMS = 3


@dataclass(frozen=True)
class Law:
    """``terms`` with their ``coefficients`` (N·m by the units of their functions); ``explained``: share of
    what is missing that they explain where they were not fitted."""

    terms: tuple[Product, ...]
    coefficients: tuple[float, ...]
    explained: float


def sparse_law(search: Search, products: Sequence[Product]) -> Law | None:
    """The law that is worth its terms; None where no term is."""
    chosen: tuple[Product, ...] = ()
    while len(chosen) < MOST_TERMS:
        best = _best(search, products, chosen)
        if best is None or not _worth(search, (*chosen, best), chosen, best):
            break
        chosen = (*chosen, best)
        for term in chosen[:-1]:
            rest = tuple(t for t in chosen if t is not term)
            instead = _best(search, products, rest)
            if instead is not None and _score(search, (*rest, instead)) > _score(search, chosen):
                chosen = (*rest, instead)
        for term in chosen:
            rest = tuple(t for t in chosen if t is not term)
            if rest and not _worth(search, chosen, rest, term):
                chosen = rest
    if not chosen:
        return None
    side = search.sides[0]
    values = search.fitted(0, chosen)[len(side.side.names) :]
    scale = side.side.arm_scale(search.fitted(0, chosen)) if chosen[0].place == "arm" else 1.0
    return Law(chosen, tuple(float(scale * v) for v in values), search.explained(chosen))


def _best(search: Search, products: Sequence[Product], beside: tuple[Product, ...]) -> Product | None:
    """The term that is worth most beside others, at the best of its shapes."""
    ranked = sorted(products, key=lambda p: -_score(search, (*beside, p)))
    found = [_refined(search, beside, p) for p in _different(ranked)]
    return max(found, key=lambda p: _score(search, (*beside, p)), default=None)


def _different(ranked: Sequence[Product]) -> list[Product]:
    """The best few of different form."""
    found: dict[str, Product] = {}
    for p in ranked:
        found.setdefault(p.text, p)
        if len(found) == _REFINED_FORMS:
            break
    return list(found.values())


def _score(search: Search, terms: tuple[Product, ...]) -> float:
    """Log-likelihood where it was not fitted, less what so many numbers must gain."""
    return search.likelier(terms) - A_NUMBER * sum(t.parameters for t in terms)


def _worth(search: Search, wide: tuple[Product, ...], narrow: tuple[Product, ...], term: Product) -> bool:
    gained = search.likelier(wide) - search.likelier(narrow)
    share = search.explained(wide) - search.explained(narrow)
    return bool(gained > A_NUMBER * term.parameters and share > LEAST_SHARE)


def _refined(search: Search, beside: tuple[Product, ...], term: Product) -> Product:
    """The term at the shape, near the one of the grid, that leaves least."""
    start = np.array([value for f in term.factors for _, value, _ in f.shape])
    if not len(start):
        return term
    scales = np.maximum(np.abs(start), 1e-3)
    best, least = term, search.left_over((*beside, term))

    def left(step: np.ndarray) -> float:
        nonlocal best, least
        trial = _reshaped(term, start + scales * step)
        found = search.left_over((*beside, trial))
        if found < least:
            best, least = trial, found
        return found

    simplex = np.vstack([0.0 * start, _FIRST_STEP * np.eye(len(start))])
    options = {"maxfev": _REFINED, "initial_simplex": simplex}
    scipy.optimize.minimize(left, 0.0 * start, method="Nelder-Mead", options=options)
    return best


def _reshaped(term: Product, numbers: np.ndarray) -> Product:
    """The term with other numbers in its functions' shapes."""
    place, factors = 0, list[Function]()
    for f in term.factors:
        own = numbers[place : place + len(f.shape)]
        place += len(f.shape)
        if len(f.shape):
            shape = tuple((n, float(v), u) for (n, _, u), v in zip(f.shape, own, strict=True))
            f = replace(f, shape=shape)
        factors.append(f)
    return replace(term, factors=tuple(factors))
