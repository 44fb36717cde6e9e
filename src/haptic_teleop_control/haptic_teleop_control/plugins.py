"""Objects found by name at run time: "module:object", as in the registries of executables.

A driver package knows no simulation, and yet its emulated device needs a plant. So the plant is a parameter:
the dotted name of a factory, which any package may provide. So is a force law of the user's own.
"""

from __future__ import annotations

import importlib
import importlib.util
import sys
from pathlib import Path
from typing import Any

from haptic_teleop_control.errors import ConfigurationError


def load_object(target: str, parameter: str) -> Any:
    """The object that "module:object" names. A module that is not installed may lie in the working directory.

    Raises ConfigurationError naming `parameter` and the remedy.
    """
    module, separator, name = target.partition(":")
    if not (separator and name.isidentifier() and all(part.isidentifier() for part in module.split("."))):
        raise ConfigurationError(f"{parameter} is {target!r}; write module:object.")
    _reach_working_directory(module)
    try:
        return getattr(importlib.import_module(module), name)
    except (ModuleNotFoundError, AttributeError) as missing:
        if isinstance(missing, ModuleNotFoundError) and not module.startswith(missing.name or "?"):
            raise  # the module is there, but something that it needs is not: that is another problem
        raise ConfigurationError(
            f"{parameter} is {target!r}, which cannot be found ({missing}); install the package that "
            "provides it, start from the folder that holds it, or correct the name."
        ) from missing


def _reach_working_directory(module: str) -> None:
    """As `python -m` does, but for this module only, and behind everything that is installed."""
    top, here = module.partition(".")[0], str(Path.cwd())
    is_here = Path(here, f"{top}.py").is_file() or Path(here, top).is_dir()
    if is_here and here not in sys.path and importlib.util.find_spec(top) is None:
        sys.path.append(here)
