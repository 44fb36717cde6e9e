"""Builds the kernel module once per set of effects and keeps its compiled code on disk.

The source of the effects and of the integrator is hashed; the joined module is written under that hash in the
user's cache directory, where numba keeps the machine code beside it.  Changing an equation therefore never meets
stale code.  ``HAPTIC_TELEOP_CACHE`` names another directory.
"""

from __future__ import annotations

import hashlib
import importlib.util
import os
import sys
import tempfile
from functools import lru_cache
from pathlib import Path
from types import ModuleType

import numba
import platformdirs

_PACKAGE = Path(__file__).resolve().parent.parent
_MARK = "# <generated functions are inserted here>"


def cache_directory() -> Path:
    """Where kernels are kept: ``HAPTIC_TELEOP_CACHE`` or the user's cache directory."""
    chosen = os.environ.get("HAPTIC_TELEOP_CACHE")
    return Path(chosen) if chosen else Path(platformdirs.user_cache_dir("haptic_teleop")) / "kernels"


def _fingerprint() -> str:
    digest = hashlib.sha256(f"numba {numba.__version__}".encode())
    for path in sorted([*(_PACKAGE / "effects").glob("*.py"), *(_PACKAGE / "kernel").glob("*.py")]):
        digest.update(path.name.encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:16]


def _source() -> str:
    from .codegen import dispatch_source  # noqa: PLC0415 (sympy is needed only here)

    text = (Path(__file__).parent / "integrator.py").read_text(encoding="utf-8")
    text = text.replace("@njit\n", "@njit(cache=True, error_model='numpy')\n")
    generated = dispatch_source().replace("@njit\n", "@njit(cache=True, error_model='numpy')\n")
    before, after = text.split(_MARK)
    return f"{before}\n{generated}\n{after}"


def _write_atomically(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
    handle, temporary = tempfile.mkstemp(dir=path.parent, suffix=".tmp")
    with os.fdopen(handle, "w", encoding="utf-8") as file:
        file.write(text)
    os.replace(temporary, path)


@lru_cache(maxsize=1)
def kernel() -> ModuleType:
    """The compiled kernel module; says so on standard error when it has to be compiled first."""
    name = f"haptic_teleop_kernel_{_fingerprint()}"
    path = cache_directory() / f"{name}.py"
    if not path.exists():
        print("haptic-teleop: compiling the plant kernels, once for this set of effects (about a minute) ...",
              file=sys.stderr, flush=True)
        _write_atomically(path, _source())
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module
