"""A proposed mapping as the YAML file that a user looks through, with what speaks for each entry beside."""

from __future__ import annotations

import json
import re
from typing import Any

from haptic_teleop_control.strict_yaml import parse_yaml
from haptic_teleop_sysid.logs.log import Log
from haptic_teleop_sysid.logs.mapping import VERSION
from haptic_teleop_sysid.logs.suggest import MISSING, Choice, Proposal

_FILL = "FILL IN"


def mapping_text(log: Log, proposal: Proposal, refused: str = "") -> str:
    """Return the mapping file; entries that are not stated by the file's headers say how sure they are.
    ``refused``: why `import` does not take it yet."""
    lines = [
        f"# Proposed for {log.path.name}. Look it through: what is not `stated` was drawn from names, ranges",
        "# and the agreement between columns.",
        f"haptic_teleop_import: {VERSION}",
    ]
    if refused:
        lines.insert(2, f"# Not to be imported as it stands: {_line(refused)}")
    if proposal.time is not None:
        lines.append(f"time: {_entry(proposal.time)}")
    elif not log.stamps:
        lines.append(f"time: {{rate: {_FILL}}}  # missing: Hz, or {{column: ..., unit: ms}}")
    lines.append("joints:" if proposal.joints else "joints: {}")
    for joint, signals in proposal.joints.items():
        lines.append(f"  {_scalar(joint)}:")
        if "input" in signals:
            lines.append(f"    input: {_entry(signals['input'])}")
        else:
            lines.append("    # input: no column was found; without one nothing can be identified")
        for part in ("motor", "arm"):
            kinds = {n.partition("_")[2]: c for n, c in signals.items() if n.startswith(f"{part}_")}
            if kinds:
                lines.append(f"    {part}:")
                lines += [f"      {kind}: {_entry(choice)}" for kind, choice in kinds.items()]
    if proposal.unused:
        lines.append("# not used:")
        lines += [f"#   {_scalar(name)}" for name in proposal.unused[:40]]
        if len(proposal.unused) > 40:
            lines.append(f"#   and {len(proposal.unused) - 40} more")
    return "\n".join(lines) + "\n"


def _entry(choice: Choice) -> str:
    content: dict[str, Any] = choice.entry.plain()
    if choice.sure == MISSING and content.get("unit") != "counts":
        content["unit"] = content.get("unit") or _FILL
    if content.get("unit") == "counts" and "counts_per_turn" not in content:
        content["counts_per_turn"] = _FILL
    flow = ", ".join(f"{key}: {_scalar(value)}" for key, value in content.items())
    return f"{{{flow}}}  # {choice.sure}: {_line('; '.join(choice.why))}"


def _line(text: str) -> str:
    """A text as a comment may hold it."""
    return "".join(c if c.isprintable() else " " for c in text)


def _scalar(value: Any) -> str:
    """A value on one line, in quotes unless it is a number or a plain word."""
    if value == _FILL or not isinstance(value, str):
        return str(value).lower() if isinstance(value, bool) else str(value)
    plain = re.fullmatch(r"[A-Za-z_][A-Za-z0-9_*/.]*", value) and parse_yaml(value) == value
    return value if plain else json.dumps(value, ensure_ascii=False)
