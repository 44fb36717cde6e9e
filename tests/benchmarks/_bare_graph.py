"""The graph of scenario 1 with nothing in it: the same nodes, topics, rates and messages, and callbacks
that only copy the message. What our nodes may cost is measured against it."""

import time
from array import array

import numpy as np
from rclpy.node import Node
from sensor_msgs.msg import JointState

from haptic_teleop_control.nodes.signal_generator import PHASE
from haptic_teleop_control.nodes.streams.latency import LatencyMeter
from haptic_teleop_control.nodes.timing.deadline import DeadlineThread
from haptic_teleop_control.nodes.timing.time_base import LATEST_QOS
from haptic_teleop_control.robots import OMNI_JOINTS, SFJ_JOINTS, SFJ_MOTOR_JOINTS
from haptic_teleop_sim.nodes.omni_sim import OmniSim
from haptic_teleop_sim.nodes.sfj_sim import SfjSim

PHASES = {"sfj_sim": SfjSim.PHASE, "omni_sim": OmniSim.PHASE, "signal_generator": PHASE}


class BareSource(Node):
    """Publishes the same message at a rate, stamped; takes what comes back on the answer's topic."""

    def __init__(self, name, topic, joints, rate, answer=None):
        super().__init__(name)
        self.failure = None
        self.sent = 0
        self.latency = LatencyMeter()
        zeros = [0.0] * len(joints)
        self.message = JointState(name=list(joints))
        for field in ("position", "velocity", "effort") if answer else ("position",):
            setattr(self.message, field, array("d", zeros))
        self.out = self.create_publisher(JointState, topic, LATEST_QOS)
        if answer:
            self.create_subscription(JointState, answer, self.take, LATEST_QOS)
        self.thread = DeadlineThread(1.0 / rate, self.cycle, name, phase=PHASES[name])

    def start(self):
        self.thread.start()

    def cycle(self, periods):
        stamp = self.message.header.stamp
        stamp.sec, stamp.nanosec = divmod(time.time_ns(), 10**9)
        self.out.publish(self.message)
        self.sent += 1

    def take(self, message):
        stamp = message.header.stamp
        self.latency.add(time.time_ns() - stamp.sec * 10**9 - stamp.nanosec)

    def shutdown_safely(self):
        self.thread.stop()


class BareRelay(Node):
    """Answers each state with a copy: its stamp, and as many efforts as a command has."""

    def __init__(self):
        super().__init__("relay")
        self.failure = None
        self.create_subscription(JointState, "/reference", self.take, LATEST_QOS)
        for robot, joints in (("sfj", SFJ_MOTOR_JOINTS), ("omni", OMNI_JOINTS)):
            out = self.create_publisher(JointState, f"/{robot}/effort_command", LATEST_QOS)
            answer = JointState(name=list(joints), effort=array("d", [0.0] * len(joints)))
            copy = np.frombuffer(answer.effort)

            def relay(message, out=out, answer=answer, copy=copy):
                answer.header.stamp = message.header.stamp
                copy[:] = message.effort[: len(copy)]
                out.publish(answer)

            self.create_subscription(JointState, f"/{robot}/joint_states", relay, LATEST_QOS)

    def start(self):
        pass

    def take(self, message):
        pass

    def shutdown_safely(self):
        pass


def bare_node(name, rate):
    """A bare node in the place of the executable `name`."""
    if name == "force_controller":
        return BareRelay()
    if name == "signal_generator":
        return BareSource("signal_generator", "/reference", ("omni_y", "omni_z"), rate / 2)
    robot, joints = {"sfj_sim": ("sfj", SFJ_JOINTS), "omni_sim": ("omni", OMNI_JOINTS)}[name]
    return BareSource(name, f"/{robot}/joint_states", joints, rate, f"/{robot}/effort_command")
