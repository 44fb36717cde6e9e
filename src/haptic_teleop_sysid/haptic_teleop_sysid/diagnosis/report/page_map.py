"""The section of the page that shows the torque measured in place of a name, and the law that it suggests."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from haptic_teleop_sim.effects import MEASURED
from haptic_teleop_sim.effects.torque_map_file import torque_map
from haptic_teleop_sysid.recordings.parameter_units import Units
from haptic_teleop_sysid.report import Page, unit_text
from haptic_teleop_sysid.report.pictures import COLOUR, blank, styled

from ..evidence.residual import UNITS

if TYPE_CHECKING:  # importing matplotlib takes half a second
    from matplotlib.figure import Figure

#: Standard errors to either side of a curve.
_BAND = 2.0
#: Whose colour it has: the map is what the augmented model holds.
_ROLE = "augmented"


def map_section(page: Page, content: dict[str, Any], units: Units) -> None:
    """Add the section; nothing where the diagnosis found a name, or nothing at all, or no torque is
    missing."""
    found = content[MEASURED.name]
    if found is None or content.get("reading_error") is not None:
        return
    section = page.section("A measured torque in place of a name")
    section.text(f"{found['what'][0].upper()}{found['what'][1:]}.")
    if not found["added"]:
        if (instead := content.get("stand_in")) is not None:
            section.text(f"Instead {instead['what']}.")
        return
    section.picture(map_picture(found, units), "torque by what it depends on, with its uncertainty")
    law = found.get("law")
    if law is not None:
        section.text(f"{law['what'][0].upper()}{law['what'][1:]}.")


def map_picture(found: dict[str, Any], units: Units) -> Figure:
    """The curve with a band of two standard errors, or the surface; ``found``: `MeasuredMap.content`."""
    table, colour = torque_map(found["parameters"]), COLOUR[_ROLE]
    labels = [f"{name} ({unit_text(units.restated(UNITS[name]))})" for name in found["depends_on"]]
    force = f"torque at {found['location']} ({unit_text(units.force)})"
    with styled():
        figure = blank(7.2, 3.2)
        axes = figure.subplots()
        dense = [np.linspace(k[0], k[-1], 200) for k in table.knots]
        axes.set_xlabel(labels[0])
        if len(dense) == 1:
            knots, band = np.array(table.knots[0]), table.band()
            if band is not None:
                low, high = (table.table() + s * _BAND * band for s in (-1.0, 1.0))
                axes.fill_between(knots, low, high, color=colour, alpha=0.2, label="± 2 standard errors")
            axes.plot(dense[0], table.at(dense[0]), color=colour)
            axes.plot(knots, table.table(), "o", color=colour, markersize=3, label="knots")
            axes.set_ylabel(force)
            axes.legend()
            return figure
        surface = table.at(*np.meshgrid(*dense, indexing="ij"))
        most = float(np.max(np.abs(surface))) or 1.0
        drawn = axes.pcolormesh(*dense, surface.T, cmap="RdBu_r", vmin=-most, vmax=most, shading="auto")
        axes.set_ylabel(labels[1])
        band = table.band()
        if band is not None:
            axes.set_title(f"standard error up to {float(np.max(band)):.2g}", fontsize="medium")
        figure.colorbar(drawn, ax=axes, label=force)
    return figure
