"""What somebody has confirmed by hand for one device: kept in a file of the user's, by the device's identity.

`doctor --omni` writes it, the driver reads it at every start. An entry holds the words that layout and axis
map have to give for this device (`OmniDriver.confirmation`); after any change of either they are others.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import platformdirs
import yaml

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.strict_yaml import dump_yaml, parse_yaml, yaml_problem

NAME = "omni_confirmed.yaml"
REMEDY = "put it right or delete it, then run `haptic-teleop doctor --omni`."


def confirmation_file(stated: str = "") -> Path:
    """The file that the parameter `confirmations` names; "": the user's own."""
    return Path(stated) if stated else Path(platformdirs.user_config_dir("haptic_teleop")) / NAME


def confirmed_words(path: Path, identity: str) -> str:
    """The words that were confirmed for the device `identity`; "" for none. Raises ConfigurationError where
    the file is there but cannot be understood."""
    return str(_entries(path).get(identity, {}).get("words", ""))


def confirmed_identities(path: Path) -> list[str]:
    """The devices with an entry. Raises ConfigurationError as `confirmed_words`."""
    return list(_entries(path))


def confirm(path: Path, identity: str, words: str, details: Mapping[str, Any]) -> None:
    """Writes or replaces the entry of `identity`, as a whole or not at all; details: what else to keep.
    Raises ConfigurationError."""
    entries = {**_entries(path), identity: {"words": words, **details}}
    text = dump_yaml(entries)
    scratch = path.with_name(path.name + ".new")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        scratch.write_text(text, "utf-8")
        os.replace(scratch, path)
    except OSError as refusal:
        raise ConfigurationError(
            f"{path}: what was confirmed cannot be written ({refusal.strerror}); make room or rights there, "
            "or name another file with the parameter confirmations."
        ) from refusal


def _entries(path: Path) -> dict[str, dict[str, Any]]:
    try:
        content = parse_yaml(path.read_text("utf-8"))
    except FileNotFoundError:
        return {}
    except OSError as refusal:
        raise ConfigurationError(f"{path}: cannot be read ({refusal.strerror}); {REMEDY}") from refusal
    except yaml.YAMLError as problem:
        raise ConfigurationError(f"{path}: {yaml_problem(problem)} {REMEDY}") from None
    except UnicodeDecodeError as problem:
        raise ConfigurationError(f"{path}: is no text ({problem}); {REMEDY}") from problem
    if content is None:
        return {}
    if not isinstance(content, dict) or not all(isinstance(entry, dict) for entry in content.values()):
        raise ConfigurationError(f"{path}: holds no devices with their words; {REMEDY}")
    return {str(identity): entry for identity, entry in content.items()}
