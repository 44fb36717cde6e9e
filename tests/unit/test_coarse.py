"""Free runs over thinned recordings rank models as those over all samples do."""

from dataclasses import replace

import numpy as np
import pytest
from identification_plants import STAGE, stage_recording

from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.diagnosis.evidence.proof import Course
from haptic_teleop_sysid.recordings.dataset import load_dataset

FRICTION = Effect("coulomb_friction", "stage1_motor", {"torque": 0.2})
TRUTH = replace(STAGE, effects=(FRICTION,))


@pytest.fixture(scope="module")
def course() -> Course:
    recording = load_dataset(stage_recording(TRUTH, seconds=60.0), TRUTH)
    return Course.of(TRUTH, [recording])


def test_the_errors_of_models_are_nearly_the_same_and_their_order_is(course: Course) -> None:
    heavier = {"arm_inertia": 1.2 * STAGE.parameters["arm_inertia"]}
    models = [TRUTH, STAGE, TRUTH.with_values(heavier), STAGE.with_values(heavier)]
    coarse = course.coarse(12.0)
    assert [len(d) for d in coarse.data] == [15000]
    errors = np.array([[100.0 - c.percent(m)[0] for m in models] for c in (course, coarse)])
    assert np.all(np.diff(errors[0]) > 1.0)  # each is clearly worse than the one before
    np.testing.assert_allclose(errors[1], errors[0], rtol=0.05, atol=0.1)


def test_windows_are_the_same_stretches_of_time(course: Course) -> None:
    cut = replace(course, windows=(replace(course.windows[0], spans=((0, 1001), (1001, 30000))),))
    spans = cut.coarse(12.0).windows[0].spans
    assert spans == ((0, 500), (501, 15000))


def test_nothing_is_thinned_where_the_motion_is_too_fast_for_it(course: Course) -> None:
    assert course.coarse(130.0).data == course.data
