"""Which device each running driver has, as the drivers' diagnostics tell it."""

from __future__ import annotations

from diagnostic_msgs.msg import DiagnosticArray

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.nodes.graph_client import graph_client
from haptic_teleop_control.nodes.streams.senders import SENDERS_TOLD, Info, publishers, with_info
from haptic_teleop_control.senders import NAMELESS

TOPIC = "/diagnostics"
"""Every node of this project publishes there, so who is there and silent is known, too."""

ROUND = 5.0
"""s after the first driver's diagnostics within which those of everybody else come, who is there: they come
once a second, later where the computer is busy."""

TOLD = (
    "device", "board", "transport", "serial number", "layout", "torque output", "calibration", "angles (rad)",
    "measured current (A)",
)  # fmt: skip
"""Values of a driver's diagnostics that say what it drives, whether it may, and for the hand at the robot
what it measures."""


def devices(wait: float) -> int:
    """Prints a line for each driver that runs, and one for whom nothing is heard of although it is there;
    returns 0, or 1 with such a one. A ConfigurationError when no driver is heard within `wait` s: printed,
    and SystemExit."""
    found: dict[str, str] = {}
    heard: set[bytes] = set()

    def take(message: DiagnosticArray, info: Info) -> None:
        found.update(told(message))
        heard.add(bytes(info.get("publisher_gid", {}).get("data", b"")))

    with graph_client("operate") as client:
        client.node.create_subscription(DiagnosticArray, TOPIC, with_info(take), 50)

        def silent() -> dict[bytes, str]:
            return {one: name for one, name in publishers(client.node, TOPIC).items() if one not in heard}

        if not client.until(lambda: bool(found), wait, "a driver"):
            raise ConfigurationError(
                f"no driver is heard within {wait:g} s: start a scenario with drivers and the same "
                "ROS_DOMAIN_ID first."
            )
        known = SENDERS_TOLD and client.until(lambda: not silent(), ROUND)
        if not SENDERS_TOLD:
            client.until(lambda: False, ROUND)
        lines = [found[name] for name in sorted(found)]
        if SENDERS_TOLD and not known:
            names = sorted({name or NAMELESS for name in silent().values()})
            lines.append(
                f"{', '.join(names)}: there, but not heard for {ROUND:g} s; a process that was killed is "
                "listed for some 20 s"
            )
        print("\n".join(lines))
        client.status = 0 if known or not SENDERS_TOLD else 1
        return client.status


def told(message: DiagnosticArray) -> dict[str, str]:
    """A line for each driver that a message of diagnostics tells of, by the driver's name."""
    lines = {}
    for status in message.status:
        values = {entry.key: entry.value for entry in status.values}
        if "device" in values:
            what = ", ".join(f"{key} {values[key]}" for key in TOLD if values.get(key))
            lines[status.name] = f"{status.name}: {what}: {status.message}"
    return lines
