"""Recordings: rosbag2 directories of joint states, read and written in bulk, whole or damaged."""

from haptic_teleop_control.recording.quality import StreamQuality, bag_problems
from haptic_teleop_control.recording.reader import Recording, read_recording
from haptic_teleop_control.recording.series import JointStateSeries
from haptic_teleop_control.recording.writer import RecordingWriter, write_recording

__all__ = [
    "JointStateSeries",
    "Recording",
    "RecordingWriter",
    "StreamQuality",
    "bag_problems",
    "read_recording",
    "write_recording",
]
