"""What `--help` says of a node, all of it from what the node states of itself."""

from __future__ import annotations

import textwrap

from haptic_teleop_control.nodes.base.haptic_node import HapticNode


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
        lines += textwrap.wrap(text, 100, initial_indent="      ", subsequent_indent="      ")
    return "\n".join(lines)
