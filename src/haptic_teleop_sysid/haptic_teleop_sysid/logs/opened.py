"""Recordings and logs alike, for commands that take either."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.recording import Recording, read_recording
from haptic_teleop_sysid.logs.convert import convert
from haptic_teleop_sysid.logs.log import named
from haptic_teleop_sysid.logs.mapping import Mapping, load_mapping
from haptic_teleop_sysid.logs.reading import ReadOptions, is_foreign, kind_of, read_log
from haptic_teleop_sysid.logs.story import UNUSED
from haptic_teleop_sysid.logs.suggest import propose


def open_recording(path: str | Path, mapping: str | Path | None = None) -> Recording:
    """Return a recording, or the one that `import` would make of a log (CSV, MATLAB, npz, Parquet, ROS bag).

    A ``mapping`` file goes for logs, and for bags where it names topics. Raises what `read_recording` raises,
    and for logs what `imported` raises.
    """
    place = Path(path)
    known = None if mapping is None else load_mapping(mapping)
    if not is_foreign(place) and (known is None or not known.topics()):
        return told(read_recording(path))
    return imported(place, known)


def imported(path: Path, mapping: Mapping | None, options: ReadOptions | None = None) -> Recording:
    """Return what a log becomes by a mapping, or by its headers where there is none.

    Raises ConfigurationError, with what is open, where headers do not say all; RecordingError for a log that
    cannot be read; MismatchError where it contradicts itself or the mapping.
    """
    options = options or ReadOptions()
    if mapping is not None:
        if kind_of(path) == "bag":
            if not mapping.topics():
                raise ConfigurationError(
                    f"{path} is a bag, and {mapping.source} names no topic: name columns like "
                    '"/joint_states:position[elbow]"; a rosbag2 recording of joint states needs no import.'
                )
            options = replace(options, topics=mapping.topics())
        return convert(read_log(path, replace(options, stated=mapping.stated)), mapping)
    log = read_log(path, options)
    proposal = propose(log, by_values=False)
    if proposal.lacking:
        raise ConfigurationError(f"{path}: {proposal.lacking[0]}.")
    if proposal.open or not proposal.usable:
        first = "; ".join(proposal.open[:2]) + (
            f"; and {len(proposal.open) - 2} more" if len(proposal.open) > 2 else ""
        )
        joints = any(":position[" in c.name or ":effort[" in c.name for c in log.columns)
        recorded = joints and path.suffix != ".bag"
        already = " (a rosbag2 recording of joint states is taken as it is and needs no import)"
        raise ConfigurationError(
            f"{path}{already if recorded else ''}: its headers leave open what is what ({first}): write a "
            f"mapping with `haptic-teleop import {path} --suggest > mapping.yaml`, look it through, and give "
            "--mapping mapping.yaml."
        )
    found = proposal.mapping("header")
    if proposal.notes:
        found = replace(found, notes=tuple(proposal.notes))
    if proposal.unused:
        unused = tuple(c for c in log.columns if c.name in proposal.unused)
        found = replace(found, notes=(*found.notes, f"{UNUSED}: {named(unused)}"))
    return convert(log, found)


def told(recording: Recording) -> Recording:
    """The recording, with what was odd about the log that it was imported from among its problems."""
    story = recording.experiment.get("import")
    odd: Sequence[str] = story.get("odd", ()) if isinstance(story, dict) else ()
    recording.problems += [str(one) for one in odd if str(one) not in recording.problems]
    return recording
