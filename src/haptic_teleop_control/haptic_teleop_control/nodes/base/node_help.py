"""What `--help` says of a node, all of it from what the node states of itself."""

from __future__ import annotations

import re
import shutil
import textwrap

from haptic_teleop_control.nodes.base.haptic_node import HapticNode

#: Columns of a help's lines: within the terminal's own, and of a pipe's.
NARROWEST, WIDEST = 60, 100
#: Blanks from which a line stands below a heading, and what follows stands below it alike.
FAR = 4


def node_help(node_class: type[HapticNode]) -> str:
    """What the node does, its topics and its parameters, for `--help`."""
    namespace = f"/{node_class.NAMESPACE}" if node_class.NAMESPACE else ""
    lines = [f"{node_class.NAME}: {node_class.SUMMARY}", ""]
    lines += [
        f"usage: haptic-teleop {node_class.NAME} "
        "[--ros-args [--params-file FILE] [-p NAME:=VALUE] [-r OLD:=NEW] ...]",
        "",
    ]
    lines += [
        f"node {namespace}/{node_class.NAME}",
        *(f"  {topic}" for topic in node_class.TOPICS),
        "",
        *node_class.NOTES,
        *([""] if node_class.NOTES else []),
        "parameters",
    ]
    for entry in node_class.TABLE:
        notes = [entry.limits(), "changeable while running" if entry.runtime else ""]
        default = f"{entry.default!r} {entry.unit}".strip()
        lines.append(f"  {entry.name} [{default}]")
        text = "; ".join(note for note in (entry.meaning, *notes) if note)
        lines.append(f"      {text}")
    width = min(max(shutil.get_terminal_size((WIDEST, 24)).columns, NARROWEST), WIDEST)
    return "\n".join(folded(line, width) for line in lines)


def folded(line: str, width: int) -> str:
    """The line in lines of ``width`` columns, each below what stands behind the last gap of two blanks in the
    left part of the first one; a longer word stays whole."""
    own = len(line) - len(line.lstrip())
    gaps = [found.end() for found in re.finditer(r"(?<=\S) {2,}", line) if found.end() < 0.6 * width]
    below = gaps[-1] if gaps else own + 2 * (own < FAR)
    return textwrap.fill(
        line, width, subsequent_indent=" " * below,
        drop_whitespace=True, break_long_words=False, break_on_hyphens=False,
    )  # fmt: skip
