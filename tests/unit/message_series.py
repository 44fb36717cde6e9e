"""Joint states at 20 Hz, so that a chunk of one second of a recording is small."""

import numpy as np

from haptic_teleop_control.recording import JointStateSeries

TYPE = "sensor_msgs/msg/JointState"
START = 1_700_000_000_000_000_000
SECOND = 1_000_000_000


def series(n):
    """``n`` messages of one joint, whose angle counts them."""
    stamp = START + np.arange(n) * (SECOND // 20)
    return JointStateSeries(stamp, stamp + 1000, ("j",), np.arange(n, dtype=float)[:, None] + 0.25)
