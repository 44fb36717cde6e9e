"""A bag with the messages of three kinds, of a robot whose elbow is the machine of `joint_logs`."""

import numpy as np
from joint_logs import machine
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

T, TORQUE, ANGLE, SPEED = machine(300)
JOINTS, WRENCH = "sensor_msgs/msg/JointState", "geometry_msgs/msg/WrenchStamped"
STATE = "control_msgs/msg/JointTrajectoryControllerState"
POINT = "trajectory_msgs/msg/JointTrajectoryPoint"
STATE_TEXT = """std_msgs/Header header
string[] joint_names
trajectory_msgs/JointTrajectoryPoint feedback
"""


def messages(store, ros1):
    """(time, ((topic, type, message) of each kind)) by sample."""
    vector = store.types["geometry_msgs/msg/Vector3"]
    none = np.zeros(0)
    duration = store.types["builtin_interfaces/msg/Duration"](sec=0, nanosec=0)
    for i in range(60):
        stamp = store.types["builtin_interfaces/msg/Time"](sec=50, nanosec=i * 2_000_000)
        head = store.types["std_msgs/msg/Header"](stamp=stamp, frame_id="", **({"seq": i} if ros1 else {}))
        states = store.types[JOINTS](
            header=head,
            name=["wrist", "elbow"],
            position=np.array([0.0, ANGLE[i]]),
            velocity=np.array([0.0, SPEED[i]]),
            effort=none,
        )
        wrench = store.types["geometry_msgs/msg/Wrench"](
            force=vector(x=0.0, y=0.0, z=0.0), torque=vector(x=0.0, y=0.0, z=TORQUE[i])
        )
        point = store.types[POINT](
            positions=ANGLE[i : i + 1],
            velocities=none,
            accelerations=none,
            effort=none,
            time_from_start=duration,
        )
        yield (
            50 * 10**9 + i * 2_000_000,
            (
                ("/joint_states", JOINTS, states),
                ("/ft", WRENCH, store.types[WRENCH](header=head, wrench=wrench)),
                ("/arm/state", STATE, store.types[STATE](header=head, joint_names=["elbow"], feedback=point)),
            ),
        )


def bag(path, kind):
    """A bag of ROS 1, or of ROS 2 in one of its storages."""
    ros1 = kind == "ros1"
    store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_KILTED)
    store.register(get_types_from_msg(STATE_TEXT, STATE))
    serialize = store.serialize_ros1 if ros1 else store.serialize_cdr
    writer = Writer1(path) if ros1 else Writer2(path, version=9, storage_plugin=StoragePlugin[kind])
    with writer:
        connections = {}
        for received, sent in messages(store, ros1):
            for topic, type_, message in sent:
                if topic not in connections:
                    connections[topic] = writer.add_connection(topic, type_, typestore=store)
                writer.write(connections[topic], received + 1000, serialize(message, type_))
    return path
