import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore

from haptic_teleop_control.errors import RecordingError
from haptic_teleop_control.recording import JointStateSeries, bag_problems
from haptic_teleop_control.recording.joint_state_cdr import decode, encode

MS = 1_000_000


def series(stamp, names=("a", "b"), position=None, **fields):
    stamp = np.asarray(stamp, np.int64)
    if position is None:
        position = np.arange(len(stamp) * len(names), dtype=float).reshape(len(stamp), len(names))
    return JointStateSeries(stamp, stamp + 40_000, tuple(names), position, **fields)


def test_joints_named_in_another_order_land_in_their_own_column():
    first = encode(series([0, 1], ("a", "b"), np.array([[1.0, 2.0], [3.0, 4.0]])))
    other = encode(series([2], ("b", "a"), np.array([[6.0, 5.0]])))
    decoded = decode([*(row.tobytes() for row in first), other[0].tobytes()])
    assert decoded.names == ("a", "b")
    assert decoded.position.tolist() == [[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]]
    assert decoded.problems == ()


def test_a_missing_and_a_new_joint_are_told_and_the_rest_is_kept():
    first = encode(series([0], ("a", "b"), np.array([[1.0, 2.0]])))[0].tobytes()
    other = encode(series([1], ("a", "c"), np.array([[3.0, 9.0]])))[0].tobytes()
    decoded = decode([first, other])
    assert decoded.position[:, 0].tolist() == [1.0, 3.0]
    assert np.isnan(decoded.position[1, 1])
    assert any("no joint b" in p for p in decoded.problems)
    assert any("joint c" in p for p in decoded.problems)


def test_a_field_of_another_length_than_the_names_is_left_out_and_told():
    store = get_typestore(Stores.ROS2_KILTED)
    header = store.types["std_msgs/msg/Header"](store.types["builtin_interfaces/msg/Time"](0, 0), "")
    kind = "sensor_msgs/msg/JointState"
    message = store.types[kind](header, ["a"], np.ones(2), np.full(1, 7.0), np.zeros(0))
    decoded = decode([bytes(store.serialize_cdr(message, kind))])
    assert decoded.position is None
    assert decoded.velocity.tolist() == [[7.0]]
    assert "2 values of position for 1 joints" in decoded.problems[0]


def test_an_unknown_joint_or_field_is_refused_with_those_that_are_there():
    one = series([0, 1])
    with pytest.raises(RecordingError, match=r"no joint 'c'.*a, b"):
        one.signal("c", "position")
    with pytest.raises(RecordingError, match=r"'effort' of 'a'.*position"):
        one.signal("a", "effort")
    assert one.signal("b", "position").tolist() == [1.0, 3.0]


def test_time_counts_from_the_first_stamp_or_from_a_given_origin():
    one = series([5 * MS, 7 * MS])
    assert one.time().tolist() == [0.0, 0.002]
    assert one.time(origin=0).tolist() == [0.005, 0.007]


def test_shapes_that_do_not_fit_are_refused():
    with pytest.raises(ValueError, match="position has shape"):
        series([0, 1], position=np.zeros((2, 3)))


def test_a_perfect_stream_has_no_problems_and_its_true_rate():
    quality = bag_problems(series(np.arange(1000) * MS))
    assert quality.problems == ()
    assert quality.rate == pytest.approx(1000.0)
    assert quality.latency == pytest.approx(40e-6)


@pytest.mark.parametrize("dropped", [[500], [500, 501, 502], [10, 300, 305, 900]])
def test_dropped_samples_are_counted_exactly(dropped):
    stamps = np.delete(np.arange(1000) * MS, dropped)
    assert bag_problems(series(stamps)).lost == len(dropped)


def test_jitter_without_loss_is_not_taken_for_loss():
    rng = np.random.default_rng(3)
    late = np.where(rng.random(5000) < 0.05, rng.uniform(0.5, 0.95, 5000), 0.0)  # late, then in time again
    quality = bag_problems(series(((np.arange(5000) + late) * MS).astype(np.int64)))
    assert quality.lost == 0
    assert quality.jitter > 0


def test_loss_is_counted_under_jitter():
    rng = np.random.default_rng(4)
    stamps = ((np.arange(20_000) + rng.normal(0, 0.05, 20_000)) * MS).astype(np.int64)
    dropped = rng.choice(np.arange(1, 19_999), 200, replace=False)
    assert bag_problems(series(np.delete(stamps, dropped))).lost == 200


def test_a_gap_is_told_with_its_place_and_length():
    stamps = np.concatenate((np.arange(100), np.arange(160, 300))) * MS
    quality = bag_problems(series(stamps), "/sfj/joint_states")
    assert quality.gaps == ((pytest.approx(0.099), pytest.approx(0.061)),)
    assert quality.lost == 60
    assert any(
        p.startswith("/sfj/joint_states: 1 gap ") and "0.061 s after 0.099 s" in p for p in quality.problems
    )


def test_repeated_and_backward_stamps_are_counted():
    stamps = np.arange(100) * MS
    stamps[50] = stamps[49]
    stamps[70] = stamps[60]
    quality = bag_problems(series(stamps))
    assert (quality.duplicates, quality.backwards) == (1, 1)
    assert len([p for p in quality.problems if "stamp" in p]) == 2


def test_values_that_are_no_number_are_counted_by_signal_and_constant_ones_are_remarked():
    position = np.ones((10, 2))
    position[3, 0] = np.nan
    position[7, 0] = np.inf
    quality = bag_problems(series(np.arange(10) * MS, position=position))
    assert quality.non_finite == {"a.position": 2}
    assert quality.constant == ("b.position",)
    assert any("a.position has 2 values" in p for p in quality.problems)
    assert not any("b.position" in p for p in quality.problems)


@pytest.mark.parametrize("n", [0, 1, 2])
def test_streams_too_short_to_judge_are_judged_without_an_error(n):
    assert bag_problems(series(np.arange(n) * MS)).count == n
