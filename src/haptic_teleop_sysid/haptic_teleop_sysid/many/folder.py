"""The recordings of a folder: bags as folders or files, and logs by their endings."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_sysid.logs.prose import is_prose
from haptic_teleop_sysid.logs.reading import BAG_SUFFIXES, SUFFIXES

_STORED = (*(s for s in BAG_SUFFIXES if s != ".bag"), ".mcap.zstd", ".db3.zstd")
_METADATA = "metadata.yaml"
RESULTS = frozenset({"trend.json", "estimates.json", "overview.json"})
"""Files by which a folder of results is known: its tables are no logs."""


@dataclass(frozen=True)
class Found:
    """A recording: ``name`` is its own one in results, unique and a relative path; ``path`` where it lies."""

    name: str
    path: Path


@dataclass(frozen=True)
class Listing:
    """``found``: recordings in the order of the places where they were found, within a folder by name;
    ``passed``: texts that are none; ``typed``: whether recordings were named themselves."""

    found: tuple[Found, ...]
    passed: tuple[str, ...] = ()
    typed: bool = False

    @property
    def told(self) -> list[str]:
        """What was passed over, in a sentence."""
        return [f"passed over, being no recording: {', '.join(self.passed)}"] if self.passed else []


def find_recordings(places: Sequence[str | Path]) -> Listing:
    """Return the recordings in folders, at any depth, and those that are named themselves.

    What looks like a recording counts, whether it can be read or not; texts in folders that are no table, and
    folders with results of these commands, are passed over. Raises ConfigurationError for a place that is not
    there or holds none.
    """
    found: dict[str, Found] = {}
    passed: list[str] = []
    typed = False
    for place in map(Path, places):
        if _is_recording(place):
            here, typed = [(place, Path(place.name))], True
        else:
            within = sorted(_within(place), key=lambda one: in_order(str(one[1])))
            here = [one for one in within if not is_prose(one[0])]
            passed += [str(relative) for path, relative in within if (path, relative) not in here]
        if not here:
            why = "holds no recording" if place.is_dir() else "is no recording" if place.exists() else None
            raise ConfigurationError(
                f"{place} {why or 'is not there'}: give a folder of bags or logs (or some of them)."
            )
        for path, relative in here:
            name, number = str(relative), 1
            if any(f.path.resolve() == path.resolve() for f in found.values()):
                raise ConfigurationError(f"{path} is given twice: name each recording once.")
            while name in found:
                number += 1
                name = f"{relative}_{number}"
            found[name] = Found(name, path)
    return Listing(tuple(found.values()), tuple(passed), typed)


def in_order(name: str) -> list[tuple[int, str]]:
    """A key by which names are sorted as people count: week2 before week10."""
    return [(int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"(\d+)", name) if part]


def _within(folder: Path) -> list[tuple[Path, Path]]:
    listed: list[tuple[Path, Path]] = []
    for top, folders, files in os.walk(folder):
        here = Path(top)
        if RESULTS & set(files):
            folders.clear()
            continue
        bags = [name for name in folders if _is_bag(here / name)]
        folders[:] = sorted(name for name in folders if name not in bags and not name.startswith("."))
        listed += [(here / name, (here / name).relative_to(folder)) for name in bags]
        logs = [here / name for name in files if name.endswith((*SUFFIXES, *_STORED)) and name[0] != "."]
        listed += [(path, path.relative_to(folder)) for path in logs]
    return listed


def _is_bag(path: Path) -> bool:
    """Whether a folder is one recording of rosbag2: it has its metadata, or nothing but parts of one."""
    if not path.is_dir():
        return False
    names = [entry.name for entry in path.iterdir()]
    if _METADATA in names:
        return True
    parts = [name for name in names if name.endswith(_STORED)]
    return bool(parts) and all(name.startswith(f"{path.name}_") for name in parts)


def _is_recording(path: Path) -> bool:
    return path.is_file() or _is_bag(path)
