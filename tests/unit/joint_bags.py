"""Bags of joint states and wrenches, written by rosbags, of ROS 1 or 2."""

from pathlib import Path

import numpy as np
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore

STATE, WRENCH = "sensor_msgs/msg/JointState", "geometry_msgs/msg/WrenchStamped"


def joint_bag(path: Path, seconds, joints, kind="MCAP", wrench=None):
    """Write a bag: `joints` name -> (position, velocity, effort), each (n,) or None for none of any joint;
    `wrench`: (n, 6) forces and torques on /ft. Returns the path."""
    ros1 = kind == "ros1"
    store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_KILTED)
    types = store.types
    writer = Writer1(path) if ros1 else Writer2(path, version=9, storage_plugin=StoragePlugin[kind])
    serialize = store.serialize_ros1 if ros1 else store.serialize_cdr
    nothing = np.zeros(0)
    with writer:
        states = writer.add_connection("/joint_states", STATE, typestore=store)
        forces = None if wrench is None else writer.add_connection("/ft", WRENCH, typestore=store)
        for i, time in enumerate(seconds):
            stamp = round(1e9 * (50.0 + time))
            instant = types["builtin_interfaces/msg/Time"](sec=stamp // 10**9, nanosec=stamp % 10**9)
            header = types["std_msgs/msg/Header"](**({"seq": i} if ros1 else {}), stamp=instant, frame_id="")
            values = [
                nothing if any(j[k] is None for j in joints.values())
                else np.array([j[k][i] for j in joints.values()]) for k in range(3)
            ]  # fmt: skip
            message = types[STATE](header, list(joints), *values)
            writer.write(states, stamp, serialize(message, STATE))
            if forces is not None:
                vector = types["geometry_msgs/msg/Vector3"]
                pair = types["geometry_msgs/msg/Wrench"](vector(*wrench[i, :3]), vector(*wrench[i, 3:]))
                writer.write(forces, stamp, serialize(types[WRENCH](header, pair), WRENCH))
    return path
