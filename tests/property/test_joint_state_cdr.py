"""The codec of joint states against rosbags' general serialiser, both ways, over messages of any shape."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from rosbags.typesys import Stores, get_typestore

from haptic_teleop_control.recording.joint_state_cdr import decode, encode
from haptic_teleop_control.recording.series import JointStateSeries

STORE = get_typestore(Stores.ROS2_KILTED)
TYPE = "sensor_msgs/msg/JointState"
JointState, Header, Time = (
    STORE.types[name] for name in (TYPE, "std_msgs/msg/Header", "builtin_interfaces/msg/Time")
)
TEXT = st.text(st.characters(codec="utf-8", exclude_characters="\0", exclude_categories=["Cs"]), max_size=9)
VALUE = st.floats(allow_nan=True, allow_infinity=True, width=64)


@st.composite
def joint_states(draw):
    names = tuple(draw(st.lists(TEXT, max_size=5, unique=True)))
    n = draw(st.integers(1, 6))
    stamps = draw(st.lists(st.integers(-(2**31) * 10**9, (2**31 - 1) * 10**9), min_size=n, max_size=n))
    fields = {}
    for field in ("position", "velocity", "effort"):
        if names and draw(st.booleans()):
            values = draw(st.lists(VALUE, min_size=n * len(names), max_size=n * len(names)))
            fields[field] = np.array(values).reshape(n, len(names))
    stamp = np.array(stamps, np.int64)
    return JointStateSeries(stamp, stamp, names, **fields, frame_id=draw(TEXT))


def by_rosbags(series, i, order="<"):
    rows = [None if f is None else f[i] for f in (series.position, series.velocity, series.effort)]
    seconds, nanoseconds = divmod(int(series.stamp[i]), 10**9)
    message = JointState(
        Header(Time(seconds, nanoseconds), series.frame_id),
        list(series.names),
        *(np.zeros(0) if row is None else row for row in rows),
    )
    return bytes(STORE.serialize_cdr(message, TYPE, little_endian=order == "<"))


def equal(left, right):
    if left is None or right is None:
        return left is right
    return np.array_equal(left, right, equal_nan=True)


def assert_same(left, right):
    assert left.names == right.names
    assert left.frame_id == right.frame_id
    assert np.array_equal(left.stamp, right.stamp)
    for field in ("position", "velocity", "effort"):
        assert equal(getattr(left, field), getattr(right, field)), field


@given(joint_states())
def test_encoded_bytes_are_those_of_the_general_serialiser(series):
    matrix = encode(series)
    for i in range(len(series)):
        assert matrix[i].tobytes() == by_rosbags(series, i)


@given(joint_states(), st.sampled_from("<>"))
def test_messages_of_the_general_serialiser_are_decoded_in_either_byte_order(series, order):
    decoded = decode([by_rosbags(series, i, order) for i in range(len(series))])
    assert decoded.problems == ()
    assert_same(decoded, series)


@given(joint_states())
def test_encoding_and_decoding_gives_the_series_back(series):
    assert_same(decode(encode(series)), series)


@settings(max_examples=60)
@given(st.lists(joint_states(), min_size=1, max_size=4), st.randoms(use_true_random=False))
def test_messages_of_changing_layout_keep_their_own_values(parts, random):
    messages = [(part, i) for part in parts for i in range(len(part))]
    random.shuffle(messages)
    decoded = decode([by_rosbags(part, i) for part, i in messages])
    names = messages[0][0].names
    assert decoded.names == names
    assert len(decoded) == len(messages)
    for row, (part, i) in enumerate(messages):
        assert decoded.stamp[row] == part.stamp[i]
        for field in ("position", "velocity", "effort"):
            source, values = getattr(part, field), getattr(decoded, field)
            for column, name in enumerate(names):
                has = source is not None and name in part.names
                expected = source[i, part.names.index(name)] if has else np.nan
                found = np.nan if values is None else values[row, column]
                assert np.array_equal(found, expected, equal_nan=True)


@settings(max_examples=200)
@given(joint_states(), st.data())
def test_a_cut_or_altered_message_is_left_out_or_decoded_but_never_raises(series, data):
    message = bytearray(by_rosbags(series, 0))
    if data.draw(st.booleans()):
        message = message[: data.draw(st.integers(0, len(message)))]
    else:
        message[data.draw(st.integers(0, len(message) - 1))] ^= 1 << data.draw(st.integers(0, 7))
    decoded = decode([bytes(message)])
    assert len(decoded) == 1 or decoded.problems


@given(joint_states(), st.integers(1, 50))
def test_a_message_cut_before_its_last_value_is_told(series, cut):
    whole = by_rosbags(series, 0)
    cut = min(cut, len(whole))
    decoded = decode([whole, whole[: len(whole) - cut]])
    assert len(decoded) == 1
    assert "1 of 2 messages" in decoded.problems[0]
