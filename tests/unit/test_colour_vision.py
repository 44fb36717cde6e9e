"""Any two lines of any plot can be told apart, whatever colours a reader sees, by light and in the dark."""

import itertools

import numpy as np
import pytest

from haptic_teleop_sysid.report.roles import ROLES, RUNS, model_roles

#: What linear RGB becomes for somebody without red, green or blue cones (Machado, Oliveira and Fernandes,
#: IEEE Transactions on Visualization and Computer Graphics 15, 2009, severity 1).
VISION = {
    "common": np.eye(3),
    "protanopia": np.array(
        [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]]
    ),
    "deuteranopia": np.array(
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]]
    ),
    "tritanopia": np.array(
        [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]]
    ),
}
#: Least distance in CIE Lab (1976) of two lines, and of two that are both solid. About 2.3 is the least that
#: is seen of large areas side by side; thin lines need several times that.
APART, SAME_DASH = 14.0, 20.0
_XYZ = np.array([[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750]])
_XYZ = np.vstack([_XYZ, [0.0193339, 0.1191920, 0.9503041]])


def linear(colour):
    """Linear RGB (3,) of #rrggbb (IEC 61966-2-1)."""
    c = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) / 255.0
    return np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)


def lab(colour, vision):
    """CIE Lab (3,) under D65 of #rrggbb, as a vision sees it."""
    share = _XYZ @ np.clip(vision @ linear(colour), 0.0, 1.0) / _XYZ.sum(axis=1)
    x, y, z = np.where(share > 216 / 24389, np.cbrt(share), (24389 / 27 * share + 16) / 116)
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


def test_lab_is_what_published_colours_have():
    np.testing.assert_allclose(lab("#ffffff", VISION["common"]), [100.0, 0.0, 0.0], atol=0.05)
    np.testing.assert_allclose(lab("#ff0000", VISION["common"]), [53.24, 80.09, 67.20], atol=0.05)


@pytest.mark.parametrize("vision", VISION)
@pytest.mark.parametrize("page", ["light", "dark"])
def test_any_two_lines_are_told_apart_with_any_colour_vision(page, vision):
    seen = {name: lab(getattr(role, page), VISION[vision]) for name, role in ROLES.items()}
    near = {}
    for one, other in itertools.combinations(ROLES, 2):
        least = SAME_DASH if ROLES[one].dash == ROLES[other].dash else APART
        distance = float(np.linalg.norm(seen[one] - seen[other]))
        if distance < least:
            near[one, other] = round(distance, 1)
    assert near == {}


def test_nothing_that_is_laid_over_what_was_measured_looks_like_it_and_no_two_of_many_look_alike():
    many = model_roles([0] * 8)
    assert "measured" not in model_roles([0, 1] * 10) and len(set(many)) == 8
    assert len(set(RUNS)) == len(RUNS)
    # Two solid lines in one plot are what was measured and one of these.
    assert {name for name, role in ROLES.items() if not role.dash} == {"measured", "augmented", "input"}
