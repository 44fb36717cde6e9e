"""The compiled core: see ``integrator.py`` (equations), ``codegen.py`` (effects), ``pack.py``, ``build.py``.
"""

from .build import kernel, stepping
from .cache_folder import cache_directory
from .free_simulation import nearest_starts, respond
from .pack import Packed, pack
from .predict import INITIAL, Prediction, predict
from .simulate import Trajectory, acting_torque, simulate

__all__ = [
    "INITIAL",
    "Packed",
    "Prediction",
    "Trajectory",
    "acting_torque",
    "cache_directory",
    "kernel",
    "nearest_starts",
    "pack",
    "predict",
    "respond",
    "simulate",
    "stepping",
]
