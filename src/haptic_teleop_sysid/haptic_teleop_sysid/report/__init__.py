"""HTML reports: one self-contained page that reads on screen, in the dark and on paper.

`Page` collects a title, the conclusion, verdict lines, key figures, and sections with text, tables, plots,
pictures and commands, and writes one file that needs nothing else and no network.  Every text that comes from
outside (file names, joint names, notes) is escaped.  `plot` says what a plot shows, `roles` in which colour
and dash; `live` makes it one to zoom and pan on (Bokeh), `pictures` one that stands still (matplotlib).
`numbers` writes numbers with their errors and units, `output` finds the directory that a run may write to.
"""

from haptic_teleop_sysid.report.numbers import (
    error_text,
    relative,
    rounded,
    unit_text,
    units_in,
    with_error,
)
from haptic_teleop_sysid.report.output import claim_output_directory, claimed, numbered_output_directory
from haptic_teleop_sysid.report.page import Page, Status
from haptic_teleop_sysid.report.pictures import histogram, inline_svg, save_png, still
from haptic_teleop_sysid.report.plot import Band, Panel, Plot, Series
from haptic_teleop_sysid.report.section import Link, Section

__all__ = [
    "Band",
    "Link",
    "Page",
    "Panel",
    "Plot",
    "Section",
    "Series",
    "Status",
    "claim_output_directory",
    "claimed",
    "error_text",
    "histogram",
    "inline_svg",
    "numbered_output_directory",
    "relative",
    "rounded",
    "save_png",
    "still",
    "unit_text",
    "units_in",
    "with_error",
]
