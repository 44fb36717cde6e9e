"""Objects found by name at run time: "module:object", as in the registries of executables.

A driver package knows no simulation, and yet its emulated device needs a plant. So the plant is a parameter:
the dotted name of a factory, which any package may provide.
"""

from __future__ import annotations

import importlib
from typing import Any

from haptic_teleop_control.errors import ConfigurationError


def load_object(target: str, parameter: str) -> Any:
    """The object that "module:object" names. Raises ConfigurationError naming `parameter` and the remedy."""
    module, separator, name = target.partition(":")
    if not (module and separator and name):
        raise ConfigurationError(f"{parameter} is {target!r}; write module:object.")
    try:
        return getattr(importlib.import_module(module), name)
    except (ModuleNotFoundError, AttributeError) as missing:
        if isinstance(missing, ModuleNotFoundError) and not module.startswith(missing.name or "?"):
            raise  # the module is there, but something that it needs is not: that is another problem
        raise ConfigurationError(
            f"{parameter} is {target!r}, which cannot be found ({missing}); install the package that "
            "provides it or correct the name."
        ) from missing
