"""A proposed mapping as the YAML file that a user looks through, with what speaks for each entry beside."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from typing import Any

from haptic_teleop_control.strict_yaml import parse_yaml
from haptic_teleop_sysid.logs.log import Log
from haptic_teleop_sysid.logs.mapping import VERSION
from haptic_teleop_sysid.logs.proposal import FILL, MISSING, Choice, Proposal

#: Columns that are not used, of which nothing is open, that are listed.
_MOST = 40


def mapping_text(log: Log, proposal: Proposal, refused: str = "", notes: Sequence[str] = ()) -> str:
    """Return the mapping file; entries that are not stated by the file's headers say how sure they are, and
    what is open stands above the line that it is about. ``refused``: why `import` does not take it yet;
    ``notes``: what to know beside it."""
    left = list(proposal.doubts)

    def take(indent: str, joint: str = "", signal: str = "", column: str = "") -> list[str]:
        about = [d for d in left if (d.joint, d.signal, d.column) == (joint, signal, column)]
        left[:] = [d for d in left if d not in about]
        return [f"{indent}# open: {_line(d.text)}" for d in about]

    lines = [
        f"# Proposed for {log.path.name}. Look it through: what is not `stated` was drawn from names, ranges",
        "# and the agreement between columns.",
        f"haptic_teleop_import: {VERSION}",
    ]
    if refused:
        lines.insert(2, f"# Not to be imported as it stands: {_line(refused)}")
    lines += [f"# note: {_line(note)}" for note in notes]
    lines += take("", signal="time")
    if proposal.time is not None:
        lines.append(f"time: {_entry(proposal.time)}")
    elif not log.stamps:
        lines.append(f"time: {{rate: {FILL}}}  # missing: Hz, or {{column: ..., unit: ms}}")
    lines.append("joints:" if proposal.joints else "joints: {}")
    for joint, signals in proposal.joints.items():
        lines.append(f"  {_scalar(joint)}:")
        lines += take("    ", joint)
        lines += take("    ", joint, "input")
        if "input" in signals:
            lines.append(f"    input: {_entry(signals['input'])}")
        else:
            lines.append("    # input: no column was found; without one nothing can be identified")
        for part in ("motor", "arm"):
            kinds = {n.partition("_")[2]: c for n, c in sorted(signals.items()) if n.startswith(f"{part}_")}
            if kinds:
                lines.append(f"    {part}:")
                for kind, choice in kinds.items():
                    lines += take("      ", joint, f"{part}_{kind}")
                    lines.append(f"      {kind}: {_entry(choice)}")
    if proposal.unused:
        lines.append("# not used:")
        for number, name in enumerate(dict.fromkeys(proposal.unused)):
            about = take("#   ", column=name)
            if number < _MOST or about:
                lines += [f"#   {_line(_scalar(name))}", *about]
        if len(proposal.unused) > _MOST:
            lines.append(f"#   and {len(proposal.unused) - _MOST} more")
    top = next(i for i, line in enumerate(lines) if not line.startswith("#"))
    lines[top:top] = [f"# open: {_line(d.text)}" for d in left]
    return "\n".join(lines) + "\n"


def _entry(choice: Choice) -> str:
    content: dict[str, Any] = choice.entry.plain()
    if choice.sure == MISSING and content.get("unit") != "counts" and choice.entry.column != FILL:
        content["unit"] = content.get("unit") or FILL
    if content.get("unit") == "counts" and "counts_per_turn" not in content:
        content["counts_per_turn"] = FILL
    flow = ", ".join(f"{key}: {_scalar(value)}" for key, value in content.items())
    return f"{{{flow}}}  # {choice.sure}: {_line('; '.join(choice.why))}"


def _line(text: str) -> str:
    """A text as a comment may hold it."""
    return "".join(c if c.isprintable() else " " for c in text)


def _scalar(value: Any) -> str:
    """A value on one line, in quotes unless it is a number or a plain word."""
    if value == FILL or not isinstance(value, str):
        return str(value).lower() if isinstance(value, bool) else str(value)
    plain = re.fullmatch(r"[A-Za-z_][A-Za-z0-9_*/.]*", value) and parse_yaml(value) == value
    return value if plain else json.dumps(value, ensure_ascii=False)
