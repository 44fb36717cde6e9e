"""Where the configuration files of the project lie: in the working tree, or as installed."""

from __future__ import annotations

import os
import sys
from pathlib import Path

from haptic_teleop_control.errors import ConfigurationError

SCENARIO = "scenario1_sim.yaml"


def find_scenario(name: str = SCENARIO) -> Path:
    """Return the path of a configuration file of the project: of the working tree, or as installed.

    Raises ConfigurationError naming the places looked at.
    """
    here = Path(__file__).resolve()
    prefixes = [Path(entry) for entry in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if entry]
    places = [
        Path.cwd() / "config",
        *(parent / "config" for parent in here.parents[3:5]),
        *(prefix / "share" / "haptic_teleop_control" / "config" for prefix in (*prefixes, Path(sys.prefix))),
    ]
    for place in places:
        if (place / name).is_file():
            return place / name
    looked = ", ".join(str(place) for place in dict.fromkeys(places))
    raise ConfigurationError(
        f"{name} is in none of {looked}: start from the project's folder, or give --scenario."
    )
