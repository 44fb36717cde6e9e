"""A model in the words of other simulators: MJCF (`mjcf.py`), URDF (`urdf.py`), one Python file
(`python_file.py`); what each can say, and with what in place of the rest, is in `mjcf_rules.py` and
`urdf_rules.py`."""

from .mjcf import mjcf_export
from .python_file import python_export
from .target import Exported, Saying, replaced
from .urdf import urdf_export

__all__ = ["Exported", "Saying", "mjcf_export", "python_export", "replaced", "urdf_export"]
