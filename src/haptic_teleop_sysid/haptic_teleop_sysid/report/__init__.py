"""HTML reports: one self-contained page that reads on screen, in the dark and on paper.

`Page` collects a title, verdict lines, key figures, sections with text, tables and pictures, and writes one
file that needs nothing else: style and pictures are inside. Every text that comes from outside (file names,
joint names, notes) is escaped. `pictures` makes the matplotlib figures in the page's colours, `output` finds
the directory that a run may write to.
"""

from haptic_teleop_sysid.report.output import claim_output_directory, claimed, numbered_output_directory
from haptic_teleop_sysid.report.page import Link, Page, Section
from haptic_teleop_sysid.report.pictures import Panel, Series, histogram, inline_svg, save_png, stacked_panels

__all__ = [
    "Link",
    "Page",
    "Panel",
    "Section",
    "Series",
    "claim_output_directory",
    "claimed",
    "histogram",
    "inline_svg",
    "numbered_output_directory",
    "save_png",
    "stacked_panels",
]
