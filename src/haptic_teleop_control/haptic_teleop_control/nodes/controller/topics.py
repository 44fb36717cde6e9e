"""The topics of the force controller: those of each robot, and those of each direction of the link."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from haptic_teleop_control.nodes.base.haptic_node import HapticNode
from haptic_teleop_control.nodes.streams.joint_states import FIELDS, JointStatePublisher, JointStateReceiver
from haptic_teleop_control.robots import OMNI_JOINTS, SFJ_JOINTS, SFJ_MOTOR_JOINTS, STAGES

JOINTS = {"omni": (OMNI_JOINTS, OMNI_JOINTS), "sfj": (SFJ_JOINTS, SFJ_MOTOR_JOINTS)}
"""Robot -> joints of its states, joints of its commands."""

LINK_FIELDS = ("velocity", "effort")


class RobotTopics:
    """One robot's topics: its states in, its commands out.

    name: a key of JOINTS. views: position (rad), velocity (rad/s) and effort (N·m) of the newest state,
    (joints,) each. effort: (motors,) N·m, memory of the command that `out` sends next. last_stamp, seen,
    answered: stamps of the states that were accepted, received and answered last, ns; 0 before the first.

    on_state(self), on_problem(self, kind, detail, stamp) and accept(self, stamp, received) are called as
    `JointStateReceiver` says.
    """

    def __init__(
        self,
        node: HapticNode,
        name: str,
        on_state: Callable[[RobotTopics], None],
        on_problem: Callable[[RobotTopics, str, str, int], None],
        accept: Callable[[RobotTopics, int, int], bool],
    ) -> None:
        states, motors = JOINTS[name]
        self.name = name
        self.last_stamp = self.seen = self.answered = 0
        self.out = JointStatePublisher(node, f"{name}/effort_command", motors, ("effort",), command=True)
        self.effort = self.out.view["effort"]
        self.input = JointStateReceiver(
            node, f"{name}/joint_states", states, FIELDS,
            partial(on_state, self), partial(on_problem, self), partial(accept, self),
            silence=node.values["timeout"], listening=False,
        )  # fmt: skip
        value = self.input.value
        self.views = (value["position"], value["velocity"], value["effort"])


class LinkTopics:
    """One direction of the link: what is sent into it, and what comes out at the other end.

    name: who sends, "master" or "slave". last_stamp: of the packet that was accepted last, ns. sent: stamp of
    the packet that was sent last, ns. packets: in simulated time, stamp -> effort (N·m) and velocity (rad/s)
    that came out and are not delivered yet.

    The callbacks are those of `RobotTopics`, but that on_problem is not told which topics it concerns.
    """

    def __init__(
        self,
        node: HapticNode,
        name: str,
        on_heard: Callable[[LinkTopics], None],
        on_problem: Callable[[str, str, int], None],
        accept: Callable[[LinkTopics, int, int], bool],
    ) -> None:
        self.last_stamp = self.sent = 0
        self.packets: dict[int, tuple[Any, Any]] = {}
        self.backward = name == "slave"
        self.out = JointStatePublisher(node, f"teleoperation/{name}", STAGES, LINK_FIELDS)
        self.input = JointStateReceiver(
            node, f"link/teleoperation/{name}", STAGES, LINK_FIELDS,
            partial(on_heard, self), on_problem, partial(accept, self),
            silence=node.values["timeout"], listening=False,
        )  # fmt: skip

    def send(self, stamp: int, torque: Any, velocity: Any) -> None:
        """Send torques (stages,), N·m, and velocities (stages,), rad/s, with `stamp` (ns)."""
        self.out.view["effort"][:] = torque
        self.out.view["velocity"][:] = velocity
        self.out.send(stamp)
        self.sent = stamp

    def keep(self) -> None:
        """What has just come out waits in `packets` for its moment."""
        value = self.input.value
        self.packets[self.input.stamp] = (value["effort"].copy(), value["velocity"].copy())
