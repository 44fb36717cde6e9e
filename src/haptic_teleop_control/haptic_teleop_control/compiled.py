"""``njit`` of numba, which is imported when the first function is called, with a cache on disk into which
several processes may write at once, and where one compiles what the others wait for.

Importing numba takes a third of a second of processor time, and many commands and nodes call no compiled
function. So ``njit`` here only keeps what numba is to compile; and numba is loaded without what it only looks
for, which takes as long again.

Numba lists a function's machine code, one file for each set of argument types, in an index. Two processes
that compile the function for different types at the same time both read the index, both take the next free
number, and what is found under it afterwards can be the other's code. Here only one process at a time adds
to an index; and only one compiles a function, which takes seconds, while others that need it wait and then
read it from the cache.

Compiled functions copy one array into another element by element: an assignment of a whole row brings along
the text of the error that other shapes would be, whose formatting takes two seconds to compile.
"""

from __future__ import annotations

import fcntl
import os
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache, cached_property, partial, update_wrapper, wraps
from typing import Any

__all__ = ["is_told", "load_numba", "njit", "telling_compilation"]

_told: list[Callable[[], None]] = []
_loading = threading.RLock()


def njit(function: Callable[..., Any] | None = None, **options: Any) -> Any:
    """Decorator: the function, compiled by numba with ``options`` when it is first called."""
    return partial(_Compiled, options=options) if function is None else _Compiled(function, options)


class _Compiled:
    """Stands for numba's dispatcher of a function, in Python and in other compiled functions.

    dispatcher: numba's own, made when it is first asked for.
    """

    def __init__(self, function: Callable[..., Any], options: dict[str, Any]) -> None:
        self._function, self._options = function, options
        update_wrapper(self, function)

    @cached_property
    def dispatcher(self) -> Any:
        dispatcher = load_numba().njit(**self._options)(self._function)
        compile_at_once = dispatcher.compile

        def compile_alone(signature: Any) -> Any:
            with _alone(dispatcher):
                return compile_at_once(signature)

        dispatcher.compile = compile_alone
        return dispatcher

    def __call__(self, *arguments: Any) -> Any:
        return self.dispatcher(*arguments)

    def __getattr__(self, name: str) -> Any:
        # Also what numba asks of a function that another one calls. What only Python's own protocols ask
        # must not start it.
        if name.startswith("__"):
            raise AttributeError(name)
        return getattr(self.dispatcher, name)

    def __reduce__(self) -> str:
        return self.__qualname__  # as any function: by its name


@contextmanager
def _alone(dispatcher: Any) -> Iterator[None]:
    """Within it no other process compiles this function, unless it is one that is not kept."""
    from numba.core.compiler_lock import global_compiler_lock

    # First the lock among threads, always: they would wait for each other otherwise. Functions call each
    # other in no circle, so processes do not.
    with global_compiler_lock:
        file = _lock_file(dispatcher)
        if file is None or file in _held:
            yield
            return
        with open(file, "w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            _held.add(file)
            try:
                yield
            finally:
                _held.remove(file)


_held: set[str] = set()


def _lock_file(dispatcher: Any) -> str | None:
    cache = dispatcher._cache
    if getattr(cache, "cache_path", None) is None:
        return None
    try:
        os.makedirs(cache.cache_path, exist_ok=True)
    except OSError:
        return None
    file = f"{cache._cache_file._index_path}.compiling"
    return file if os.access(cache.cache_path, os.W_OK) else None


@contextmanager
def telling_compilation(tell: Callable[[], None]) -> Iterator[None]:
    """Calls ``tell`` whenever something begins to be compiled within this block."""
    _told.append(tell)
    try:
        yield
    finally:
        _told.remove(tell)


def is_told() -> bool:
    """Whether somebody says when something is compiled."""
    return bool(_told)


@contextmanager
def _without(name: str) -> Iterator[None]:
    """Within it a module that is not loaded yet cannot be. numba asks for `coverage`, where that is
    installed, to tell it lines of compiled functions; it loads for a tenth of a second in every node."""
    absent = name not in sys.modules
    if absent:
        sys.modules[name] = None  # type: ignore[assignment]
    try:
        yield
    finally:
        if absent:
            del sys.modules[name]


def _without_linear_algebra() -> None:
    """Loads numba's functions of arrays without scipy.linalg, which they only look for, in half a second
    of processor time. What is compiled with a product of matrices asks for it again."""
    from numba.np import linalg

    ensure = getattr(linalg, "ensure_blas", None)
    if ensure is None:  # another numba, which then loads what it wants
        return
    linalg.ensure_blas = lambda: None
    try:
        import numba.np.arraymath  # noqa: F401
    finally:
        linalg.ensure_blas = ensure


def load_numba() -> Any:
    """The package numba, with the cache and the telling of this module."""
    with _loading:  # two threads at once would each put their own around numba's functions
        return _loaded()


@cache
def _loaded() -> Any:
    with _without("coverage"):
        import numba
    _without_linear_algebra()
    from numba.core import event
    from numba.core.caching import IndexDataCacheFile

    class Tells(event.Listener):
        def on_start(self, event: Any) -> None:
            for tell in list(_told):
                tell()

        def on_end(self, event: Any) -> None:
            pass

    event.register("numba:compile", Tells())

    save = IndexDataCacheFile.save

    @wraps(save)
    def save_alone(self: Any, key: object, data: object) -> None:
        # Beside the index and not the index itself: that one is replaced by each who saves.
        with open(f"{self._index_path}.lock", "w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)  # let go with the file, however that ends
            save(self, key, data)

    IndexDataCacheFile.save = save_alone
    return numba
