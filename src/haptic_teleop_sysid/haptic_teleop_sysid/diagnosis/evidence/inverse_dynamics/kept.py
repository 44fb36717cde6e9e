"""Columns of terms, kept as far as there is room: those of hundreds of effects along an hour are large."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from .term import Term

FloatArray = NDArray[np.float64]

#: Bytes of the columns that the equations of one kind of recordings keep.
ROOM = 100_000_000


class Kept:
    """Columns (n, p) by term; those that were not asked for the longest make room, and are computed anew if
    they are asked for again."""

    def __init__(self) -> None:
        self._columns: OrderedDict[Term, FloatArray] = OrderedDict()
        self._size = 0

    def of(self, term: Term, made: Callable[[], FloatArray]) -> FloatArray:
        """The columns of a term, ``made`` if they are not kept."""
        if term not in self._columns:
            self.put(term, made())
        self._columns.move_to_end(term)
        return self._columns[term]

    def put(self, term: Term, columns: FloatArray) -> None:
        """Keep the columns of a term, at least until the next ones come."""
        self.drop(term)
        self._columns[term] = columns
        self._size += columns.nbytes
        while self._size > ROOM and len(self._columns) > 1:
            self.drop(next(iter(self._columns)))

    def drop(self, term: Term) -> None:
        """Free the columns of a term, if they are kept."""
        gone = self._columns.pop(term, None)
        self._size -= 0 if gone is None else gone.nbytes

    def __iter__(self) -> Iterator[Term]:
        return iter(self._columns)
