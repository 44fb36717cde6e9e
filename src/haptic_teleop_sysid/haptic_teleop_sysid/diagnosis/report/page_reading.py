"""The section of the page that shows what an encoder reads wrong over the angle."""

from __future__ import annotations

from typing import Any

import numpy as np

from haptic_teleop_sysid.recordings.parameter_units import Units
from haptic_teleop_sysid.report import Page, Panel, Plot, Series, unit_text


def reading_section(page: Page, content: dict[str, Any], units: Units) -> None:
    """Add the section; nothing where no error of the readings was drawn."""
    found = content.get("reading_error")  # none in results of earlier versions
    if found is None:
        return
    unit = unit_text(units.restated(found["unit"]))
    line = Series("error", np.array(found["reading"]), np.array(found["error"]), "augmented")
    section = page.section("What the encoder reads wrong")
    section.plot(
        Plot([Panel(f"Error of {found['location']}", unit, [line], (0.0,), x_label=f"reading ({unit})")]),
        "what the encoder reads more than the angle, over what it reads",
    )
    if found["fit"] is not None:
        section.text(f"{found['fit']['what'][0].upper()}{found['fit']['what'][1:]}.")
    section.text(
        f"It explains {100 * found['explained']:.0f} % of what is missing on recordings to which it was not "
        f"fitted, the best free curve {max(100 * found['by_torque'], 0.0):.0f} %. A scale and an "
        "offset of the encoder are not in it: of a rigid joint nobody can tell them from an inertia and a "
        "zero."
    )
