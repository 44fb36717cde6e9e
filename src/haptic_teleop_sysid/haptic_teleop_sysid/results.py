"""What every command of this package writes beside its report: JSON that any reader accepts, with the tool's
version.
"""

from __future__ import annotations

import importlib.metadata
import json
import math
import os
import threading
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np


def tool_version() -> str:
    """Return the installed version of this package, or the one of its sources, and that it is, when it runs
    from those; "unknown" where neither says."""
    try:
        return importlib.metadata.version("haptic_teleop_sysid")
    except importlib.metadata.PackageNotFoundError:
        manifest = Path(__file__).parents[1] / "package.xml"
    try:
        found = ElementTree.parse(manifest).findtext("version")
    except (OSError, ElementTree.ParseError):
        found = None
    return f"{found} (sources)" if found else "unknown"


def plain(value: Any) -> Any:
    """Return `value` as JSON knows it: numpy numbers and arrays unwrapped, numbers that are not finite as
    null.
    """
    if isinstance(value, dict):
        return {str(key): plain(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(entry) for entry in value]
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, Path):
        return str(value)
    return value


def write_json(path: str | Path, content: dict[str, Any]) -> Path:
    """Write `content` as indented JSON and return the path; a half-written file is never left behind."""
    target = Path(path)
    # Named by who writes: of two that do the same work at the same time either may be first.
    partial = target.with_name(f"{target.name}.{os.getpid()}-{threading.get_ident()}.partial")
    partial.write_text(json.dumps(plain(content), indent=2, allow_nan=False) + "\n", encoding="utf-8")
    partial.replace(target)
    return target
