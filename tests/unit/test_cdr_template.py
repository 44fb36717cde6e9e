"""Messages of one sender are read and written in place; whatever is not like the first is left to others."""

import struct
from dataclasses import replace

import numpy as np
import pytest

from haptic_teleop_control.recording.cdr_layout import STAMP, find_layout
from haptic_teleop_control.recording.cdr_template import PUT_STAMP, Template, zeros
from haptic_teleop_control.recording.joint_state_cdr import decode, encode
from haptic_teleop_control.recording.series import FIELDS, JointStateSeries

JOINTS = ("stage1_motor", "arm", "x")
STAMPS = np.array([1_000_000_001, 2_999_999_999, 2**31 * 10**9 - 1])


def made(fields=FIELDS, joints=JOINTS, stamps=STAMPS, seed=1) -> JointStateSeries:
    values = np.random.default_rng(seed).normal(size=(3, len(fields), len(joints)))
    columns = {field: values[:, i] for i, field in enumerate(fields)}
    return JointStateSeries(stamps, stamps, tuple(joints), **columns)


def messages(series: JointStateSeries) -> list[bytes]:
    return [row.tobytes() for row in encode(series)]


@pytest.mark.parametrize("wanted", [FIELDS, ("effort",), ("effort", "position")])
@pytest.mark.parametrize("frame", ["", "base_link"])
def test_stamp_and_numbers_are_read_where_they_lie(wanted, frame):
    series = replace(made(), frame_id=frame)
    first, *others = messages(series)
    template = Template(first, wanted)
    for row, message in enumerate([first, *others]):
        assert template.fits(message)
        sec, nanosec, *values = template.read(message)
        assert sec * 10**9 + nanosec == STAMPS[row]
        in_order = [field for field in FIELDS if field in wanted]
        assert values == [float(x) for field in in_order for x in getattr(series, field)[row]]
        for field in wanted:
            assert np.array_equal(np.frombuffer(message[template.at[field]]), getattr(series, field)[row])


def test_what_differs_in_more_than_stamp_and_numbers_does_not_fit():
    template = Template(messages(made())[0], FIELDS)
    others = [
        made(joints=("arm", "stage1_motor", "x")),
        made(joints=("stage1_motor", "arm", "y")),
        made(fields=("position", "velocity")),
        made(fields=("effort",)),
        replace(made(), frame_id="f"),
    ]
    for other in others:
        assert not any(template.fits(message) for message in messages(other)), other.names
    message = messages(made())[0]
    assert not template.fits(message[:-1]) and not template.fits(message + b"\0") and not template.fits(b"")
    for at in set(range(len(message))) - set(range(STAMP, STAMP + 8)):
        broken = bytearray(message)
        broken[at] ^= 0x40
        number = any(part.start <= at < part.stop for part in template.at.values())
        assert template.fits(bytes(broken)) == (number or at in gaps()), at


def gaps():
    """Bytes that mean nothing in a message of JOINTS with all fields and no frame: the encapsulation's
    options, and what fills up to the next aligned value. Senders leave there what was in their memory."""
    found, at = {2, 3}, 12

    def aligned(size, to):
        nonlocal at
        start = at + -(at - 4) % to
        found.update(range(at, start))
        at = start + size

    for text in ("", None, *JOINTS):
        aligned(4, 4)
        at += 0 if text is None else len(text) + 1
    for _ in FIELDS:
        aligned(4, 4)
        aligned(8 * len(JOINTS), 8)
    return found


def test_a_field_that_is_not_read_may_hold_anything():
    template = Template(messages(made())[0], ("effort",))
    assert template.fits(messages(replace(made(), position=np.full((3, 3), np.nan)))[0])


def test_what_cannot_be_read_in_place_is_refused():
    with pytest.raises(ValueError, match="no effort"):
        Template(messages(made(fields=("position",)))[0], ("effort",))
    with pytest.raises(ValueError, match="byte order"):
        Template(b"\0\0\0\0" + struct.pack(">iIIIIII", 1, 2, 0, 0, 0, 0, 0), ())
    with pytest.raises(ValueError):
        Template(b"\0\1\0\0", ())


@pytest.mark.parametrize("fields", [FIELDS, ("effort",), ("position", "velocity")])
def test_a_message_of_zeros_takes_stamp_and_numbers_in_place(fields):
    message = bytearray(zeros(JOINTS, fields))
    assert find_layout(bytes(message)).size == len(message)
    PUT_STAMP(message, STAMP, 7, 8)
    for number, field in enumerate(fields):
        message[Template(bytes(message), fields).at[field]] = np.full(3, float(number)).tobytes()
    series = decode([bytes(message)])
    assert series.names == JOINTS and series.stamp[0] == 7_000_000_008 and not series.problems
    for field in FIELDS:
        found = getattr(series, field)
        assert (found is not None) == (field in fields)
        assert found is None or found.tolist() == [[float(fields.index(field))] * 3]
