"""Least squares of many groups of terms on the same equations, from products that are computed once.

Of every term the columns are multiplied with the structure's and with those of its partners once; a group is
then solved, and judged on other equations, in the few numbers that it has, however long the recordings are.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import scipy
from numpy.typing import NDArray

from .bounded import RIDGE, scale_of, within_bounds
from .folds import Fold
from .latent import Latent
from .regression import Equations, signs
from .term import Term

FloatArray = NDArray[np.float64]
Terms = tuple[Term, ...]
#: Products (p, p) of columns, those with the target (p,), and its own.
Multiplied = tuple[FloatArray, FloatArray, float]

#: Weight that keeps a free curve straight, relative to the best visited knot.
STIFF = 0.05


class Products:
    """Equations, each weighted by what the structure leaves of it, and products of their columns."""

    def __init__(self, side: Equations | Fold) -> None:
        self.side = side
        self._rigid = side.model.rigid
        target, base = side.target, side.base
        rows = np.concatenate([*base])
        free = rows @ np.linalg.lstsq(rows, target.T.ravel(), rcond=None)[0] if rows.shape[1] else 0.0
        left = (target.T.ravel() - free).reshape(target.shape[::-1])
        self.weights = 1.0 / np.maximum(np.std(left, axis=1), 1e-300)
        self.target = target.T * self.weights[:, None]
        self.base = base * self.weights[:, None, None]
        self.samples = side.samples
        flat = np.concatenate([*self.base])
        # Of a few samples the structure may leave nothing, and weights overflow: nothing is fitted.
        with np.errstate(over="ignore", invalid="ignore"):
            self._whole = flat.T @ flat, flat.T @ self.target.ravel(), float(np.sum(self.target**2))
        # What columns of a term at each place are multiplied with: structure and target.
        self._partners: dict[str, FloatArray] = {}
        self._factors: dict[tuple[str, str], float] = {}
        self._own: dict[Term, FloatArray] = {}
        self._pairs: dict[tuple[Term, Term], FloatArray] = {}
        # A group that is solved on this side is judged on it soon, by the other side's solution.
        self._last: tuple[Terms, Multiplied] | None = None
        self._rest: tuple[Terms, Multiplied] | None = None

    def columns(self, terms: Terms) -> FloatArray:
        """All columns of a group, (equations n, p), motor first."""
        found = [np.concatenate([*self.base])]
        for term in terms:
            torque = self.side.torque(term)
            sign = self._signs(term.place)
            found.append(np.concatenate([s * torque for s in sign]))
        return np.column_stack(found)

    def left(self, terms: Terms, values: FloatArray) -> FloatArray:
        """What a solution leaves, (equations n,), motor first."""
        return self.target.ravel() - self.columns(terms) @ values

    def square_left(self, terms: Terms, values: FloatArray) -> float:
        """Sum of the squares of `left`."""
        products, mixed, whole = self._group(terms)
        with np.errstate(over="ignore", invalid="ignore"):
            return max(whole - 2.0 * float(values @ mixed) + float(values @ products @ values), 0.0)

    def fitted(self, terms: Terms) -> FloatArray:
        """Least squares (p,) within the bounds of structure and terms."""
        products, mixed = self.information(terms)
        limits = [self.side.bounds(), *(t.bounds() for t in terms)]
        low, high = (np.concatenate([pair[i] for pair in limits]) for i in (0, 1))
        return solved(products, mixed, low, high)

    def information(self, terms: Terms) -> tuple[FloatArray, FloatArray]:
        """Products (p, p) of the columns of a group, with what keeps free curves straight, and
        those with the target (p,)."""
        products, mixed, _ = self._group(terms)
        if not any(isinstance(term, Latent) for term in terms):
            return products, mixed
        products = products.copy()
        place = len(self.side.names)
        for term in terms:
            own = slice(place, place := place + self._width(term))
            if isinstance(term, Latent):
                bends = term.bends()
                most = float(np.max(np.diag(products)[own]))
                products[own, own] += STIFF**2 * most * bends.T @ bends
        return products, mixed

    def forget(self, terms: Iterable[Term]) -> None:
        """Free what is kept of terms that are not asked for again."""
        gone = {*terms}
        self.side.forget(gone)
        self._own = {t: kept for t, kept in self._own.items() if t not in gone}
        self._pairs = {pair: kept for pair, kept in self._pairs.items() if not gone & {*pair}}

    def unlike(self, term: Term, other: Term) -> float:
        """Share (mean square) of the torque of a term that no columns of another at the same place give."""
        whole = float(np.trace(self._pair(term, term)))
        return _beyond(self._pair(other, other), self._pair(other, term), whole)

    def own_shares(self, terms: Terms, values: FloatArray) -> list[float]:
        """Of each term's torque, with the factors ``values`` of all columns, the share (mean square) that no
        columns of the structure and of the other terms give."""
        products, found = self._group(terms)[0], []
        place = len(self.side.names)
        for term in terms:
            own = slice(place, place := place + self._width(term))
            others = np.delete(np.arange(len(products)), own)
            whole = float(values[own] @ products[own, own] @ values[own])
            mixed = products[others, own] @ values[own]
            found.append(_beyond(products[np.ix_(others, others)], mixed[:, None], whole))
        return found

    def _group(self, terms: Terms) -> Multiplied:
        """Products (p, p) of all columns, those with the target (p,), and its own."""
        if self._last is None or self._last[0] != terms:
            self._last = terms, self._multiplied(terms)
        return self._last[1]

    def _multiplied(self, terms: Terms) -> Multiplied:
        """`_group`, from that of all terms but the last: many groups differ in that one alone."""
        if not terms:
            return self._whole
        *others, one = terms
        rest = tuple(others)
        if self._rest is None or self._rest[0] != rest:
            self._rest = rest, self._multiplied(rest)
        before, before_mixed, whole = self._rest[1]
        partners = self._partner(one)
        known, structure = len(before), len(self.side.names)
        size = known + len(partners)
        products, mixed = np.empty((size, size)), np.empty(size)
        products[:known, :known], mixed[:known] = before, before_mixed
        products[known:, :structure], mixed[known:] = partners[:, :-1], partners[:, -1]
        place = structure
        for other in rest:
            own = slice(place, place := place + self._width(other))
            products[known:, own] = self._pair(one, other)
        products[known:, known:] = self._pair(one, one)
        products[:known, known:] = products[known:, :known].T
        return products, mixed, whole

    def _partner(self, term: Term) -> FloatArray:
        """Products (columns, p + 1) of a term's columns with the structure's and with the target."""
        if term not in self._own:
            if term.place not in self._partners:
                sign = self._signs(term.place)
                both = np.concatenate([self.base, self.target[:, :, None]], axis=2)
                # Series by series in memory: a product with one of them takes a fraction of the time.
                self._partners[term.place] = np.ascontiguousarray(np.tensordot(sign, both, axes=1).T)
            self._own[term] = (self._partners[term.place] @ self.side.torque(term)).T
        return self._own[term]

    def _signs(self, place: str) -> FloatArray:
        """Sign and weight (equations,) of an added torque at each equation."""
        return np.array(signs(place, self._rigid)) * self.weights

    def _factor(self, one: str, other: str) -> float:
        """What the products of torques at two places are weighted by."""
        if (one, other) not in self._factors:
            self._factors[one, other] = float(self._signs(one) @ self._signs(other))
        return self._factors[one, other]

    def _width(self, term: Term) -> int:
        """How many columns a term has."""
        return len(self._partner(term))

    def _pair(self, one: Term, other: Term) -> FloatArray:
        """Products (columns, columns) of two terms' columns."""
        if (one, other) not in self._pairs:
            factor = self._factor(one.place, other.place)
            # Torques at different equations have nothing to do with each other.
            found = (
                factor * self.side.torque(one).T @ self.side.torque(other)
                if factor != 0.0
                else np.zeros((self._width(one), self._width(other)))
            )
            self._pairs[one, other], self._pairs[other, one] = found, found.T
        return self._pairs[one, other]


def _beyond(among: FloatArray, mixed: FloatArray, whole: float) -> float:
    """Share (mean square) of some columns that no columns of others give; ``among``: products of the others
    (p, p), ``mixed``: those with the columns (p, columns), ``whole``: sum of the columns' own."""
    scale = scale_of(among)
    values, vectors = np.linalg.eigh(among / np.outer(scale, scale))
    along = vectors.T @ (mixed / scale[:, None])
    given = float(np.sum(along**2 / (np.maximum(values, 0.0) + RIDGE)[:, None]))
    return 1.0 - given / max(whole, 1e-300)


def solved(products: FloatArray, mixed: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
    """Least squares (p,) within bounds from products of columns (p, p) and with the target (p,); scaled, so
    that units do not matter, and the shortest where columns are alike."""
    if not len(products):
        return np.zeros(0)
    found, ended = within_bounds(products, mixed, low, high)
    if ended and np.all(np.isfinite(found)):
        return found
    # From the root of the products, which a rounding below zero does not stop.
    scale = scale_of(products)
    with np.errstate(over="ignore", invalid="ignore"):
        scaled = products / np.outer(scale, scale)
    values, vectors = np.linalg.eigh(scaled)
    root = np.sqrt(np.maximum(values, 0.0) + RIDGE)
    rows, right = root[:, None] * vectors.T, vectors.T @ (mixed / scale) / root
    bounds = (low * scale, high * scale)
    exact = scipy.optimize.lsq_linear(rows, right, bounds=bounds, method="bvls")
    return np.asarray(exact.x, dtype=np.float64) / scale
