"""The unit of a power density: the square of the input's unit, and not of its last factor."""

from types import SimpleNamespace

import numpy as np
import pytest

from haptic_teleop_sysid.runs.dataset_pictures import spectrum_picture


@pytest.mark.parametrize(("unit", "told"), [("A", "A²/Hz"), ("N*m", "(N·m)²/Hz"), ("N·m", "(N·m)²/Hz")])
def test_the_input_of_a_spectrum_has_the_square_of_its_whole_unit(unit, told):
    frequency = np.linspace(0.0, 10.0, 20)
    one = SimpleNamespace(
        frequency=frequency, input_spectrum=frequency, response_spectrum=frequency, band=(1.0, 2.0)
    )
    assert spectrum_picture(one, unit).panels[0].title == f"input, dB re 1 {told}"
