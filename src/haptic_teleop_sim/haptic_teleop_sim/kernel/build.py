"""Builds the compiled modules once per set of effects and keeps its compiled code on disk.

The source of the effects and of the integrator is hashed; the joined module is written under that hash in the
user's cache directory (see ``cache_folder.py``), where numba keeps the machine code beside it.  Changing an
equation therefore never meets stale code.
"""

from __future__ import annotations

import hashlib
import importlib.util
import os
import re
import sys
import tempfile
from collections.abc import Callable
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType

from haptic_teleop_control.compiled import is_told

from .cache_folder import cache_directory

_PACKAGE = Path(__file__).resolve().parent.parent
_MARK = "# <generated functions are inserted here>"
_IMPORTS = "# <functions of the kernel are imported here>"


#: Compiled loops around the kernel, each a module of its own: the functions of the kernel that it calls, and
#: the modules of the control package, which are part of what decides whether it is stale.
_AROUND = {
    "stepping": (
        "actuated, advance, encoder_reading, spread",
        ("filters", "laws.augmented_error", "laws.master_side", "laws.contract", "omni_compensation"),
    ),
    "free_runs": ("innovations_series, predict_series, simulate_series", ("filters",)),
}
_OPTIONS = "cache=True, error_model='numpy', nogil=True, fastmath={'contract'}"
# Functions marked `inner` or `called` allocate nothing: without counting references to their arrays they take
# a third of the time. A call hands over some sixty words, which takes longer than most equations: `inner`
# ones become part of what calls them.
_DECORATORS = {
    "njit": _OPTIONS,
    "called": f"{_OPTIONS}, _nrt=False",
    "inner": f"{_OPTIONS}, _nrt=False, forceinline=True",
}
_KERNEL = ("integrator.py", "sensitivities.py", "sensitivity_steps.py", "sample.py", "prediction.py")
_JOIN = "# <the text below joins the kernel>"


def _fingerprint(*paths: Path, seed: str = "") -> str:
    import numba  # with the first kernel only: it takes long

    digest = hashlib.sha256(f"numba {numba.__version__} {_DECORATORS} {_KERNEL} {seed}".encode())
    for path in paths:
        digest.update(path.name.encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:16]


def _compiled(text: str) -> str:
    for mark, chosen in _DECORATORS.items():
        text = re.sub(rf"^@{mark}$", f"@njit({chosen})", text, flags=re.MULTILINE)
    return text


def _kernel_source() -> str:
    from .codegen import dispatch_source  # sympy is needed only here

    first, *others = (_text(name) for name in _KERNEL)
    before, after = first.split(_MARK)
    joined = [other.split(_JOIN)[1] for other in others]
    return _compiled("\n".join([before, dispatch_source(), after, *joined]))


def _text(name: str) -> str:
    return (_PACKAGE / "kernel" / name).read_text(encoding="utf-8")


def _write_atomically(path: Path, text: str) -> None:
    handle, temporary = tempfile.mkstemp(dir=path.parent, suffix=".tmp")
    with os.fdopen(handle, "w", encoding="utf-8") as file:
        file.write(text)
    os.replace(temporary, path)


@lru_cache(maxsize=1)
def kernel() -> ModuleType:
    """The compiled kernel module; says so on standard error when it has to be compiled first."""
    # Compiled code of the loops around it lies elsewhere: editing them must not make the kernel stale.
    beside = (*(f"{name}.py" for name in _AROUND), "build.py", "cache_folder.py")
    others = {_PACKAGE / "kernel" / name for name in beside}
    own = {*(_PACKAGE / "effects").glob("*.py"), *(_PACKAGE / "kernel").glob("*.py")} - others
    name = f"haptic_teleop_kernel_{_fingerprint(*sorted(own))}"
    return _module(name, _kernel_source, "the plant kernels, once for this set of effects (some 30 s)")


@lru_cache(maxsize=1)
def stepping() -> ModuleType:
    """The compiled stepping functions around the kernel (`stepping.py`)."""
    return _around("stepping", "the stepping functions")


@lru_cache(maxsize=1)
def free_runs() -> ModuleType:
    """The compiled loops of free simulations over windows (`free_runs.py`)."""
    return _around("free_runs", "the loops of free simulations")


def _around(name: str, what: str) -> ModuleType:
    called, control = _AROUND[name]
    inner = kernel().__name__
    paths = [Path(str(find_spec(f"haptic_teleop_control.{module}").origin)) for module in control]  # type: ignore
    template = _PACKAGE / "kernel" / f"{name}.py"
    own = f"haptic_teleop_{name}_{_fingerprint(template, *paths, seed=inner)}"
    imports = f"from {inner} import {called}"
    return _module(own, lambda: _compiled(_text(template.name).replace(_IMPORTS, imports)), what)


def _module(name: str, source: Callable[[], str], what: str) -> ModuleType:
    path = cache_directory() / f"{name}.py"
    if not path.exists() and not is_told():
        print(f"haptic-teleop: compiling {what} ...", file=sys.stderr, flush=True)
    if not path.exists():
        _write_atomically(path, source())
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module
