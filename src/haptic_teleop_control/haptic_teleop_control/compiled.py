"""``njit`` of numba, with a cache on disk into which several processes may write at once.

Numba lists a function's machine code, one file for each set of argument types, in an index. Two processes
that compile the function for different types at the same time both read the index, both take the next free
number, and what is found under it afterwards can be the other's code. Here only one process at a time adds
to an index.
"""

from __future__ import annotations

import fcntl
from functools import wraps
from typing import Any

from numba import njit
from numba.core.caching import IndexDataCacheFile

__all__ = ["njit"]

_save = IndexDataCacheFile.save


@wraps(_save)
def _save_alone(self: Any, key: object, data: object) -> None:
    # Beside the index and not the index itself: that one is replaced by each who saves.
    with open(f"{self._index_path}.lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # let go with the file, however that ends
        _save(self, key, data)


IndexDataCacheFile.save = _save_alone
