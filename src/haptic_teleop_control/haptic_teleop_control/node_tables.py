"""The parameter tables of this package's nodes, without ROS: what a scenario file may say about them.

The nodes declare them; programs that know no ROS, such as the lockstep runner, read the same file by them.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from haptic_teleop_control.laws import LAWS, MasterSide, parameters_of_own_law
from haptic_teleop_control.laws.omni_slave import OmniSlaveLaw
from haptic_teleop_control.laws.sfj_master import SfjMasterSide
from haptic_teleop_control.parameters import Parameter, ParameterTable
from haptic_teleop_control.robots import OMNI_RATE_HZ, PAIRS, SFJ_RATE_HZ, STAGES
from haptic_teleop_control.signals import signal_parameters
from haptic_teleop_control.teleoperation.settings import LINK as LINK_OWN
from haptic_teleop_control.teleoperation.settings import TELEOPERATION

AXES = tuple(PAIRS[stage] for stage in STAGES)
"""Axes of the Omni that are paired with the stages, in the stages' order."""

REALTIME_PRIORITY = Parameter(
    "realtime_priority",
    0,
    minimum=0,
    maximum=90,
    meaning="SCHED_FIFO priority of the whole process, where the system permits it; 0 for normal scheduling",
)
"""Of nodes in one process the highest one holds."""

USE_SIM_TIME = Parameter(
    "use_sim_time",
    False,
    meaning="simulated time, granted by time_coordinator tick by tick; simulated, emulated and replayed "
    "devices only",
)
"""ROS' own parameter. All nodes of a graph state it alike."""

NODE_PARAMETERS = (REALTIME_PRIORITY, USE_SIM_TIME)
"""In the table of every control node and plant; what is simulated knows nothing of them."""


def without_node_parameters(values: Mapping[str, Any]) -> dict[str, Any]:
    """`values` less `NODE_PARAMETERS`: those of the plant, experiment or law itself."""
    own = {entry.name for entry in NODE_PARAMETERS}
    return {name: value for name, value in values.items() if name not in own}

GENERATOR_OWN = (
    Parameter(
        "joints",
        list(AXES),
        length=len(STAGES),
        meaning="joints that the signals of stage1 and stage2 command",
    ),
    Parameter(
        "autostart", True, meaning="start the signal with the node; otherwise with the service ~/start"
    ),
    *NODE_PARAMETERS,
)
"""Parameters of the signal generator's node beside those of the signals."""

SIGNAL_GENERATOR = ParameterTable("signal_generator", [*GENERATOR_OWN, *signal_parameters(STAGES)])


def _force_controller() -> ParameterTable:
    laws = {entry.name: entry for law in LAWS.values() for entry in law.parameters(STAGES)}
    return ParameterTable(
        "force_controller",
        [
            *TELEOPERATION,
            Parameter(
                "law",
                "augmented_error",
                choices=tuple(LAWS),
                plugin=True,
                meaning="force law of the 2DSFJ as slave; one of your own by its module and name",
            ),
            Parameter(
                "slave_rate", SFJ_RATE_HZ, "Hz", 10.0, 1e4, runtime=True, meaning="rate of the slave's states"
            ),
            Parameter(
                "master_rate",
                OMNI_RATE_HZ,
                "Hz",
                10.0,
                1e4,
                runtime=True,
                meaning="rate of the master's states; the two rates are swapped with the roles",
            ),
            *NODE_PARAMETERS,
            *laws.values(),  # scenario 1: the 2DSFJ as slave
            *MasterSide.parameters(AXES),  # and the Omni as master
            *OmniSlaveLaw.parameters(AXES),  # scenario 2: the Omni as slave
            *SfjMasterSide.parameters(STAGES),  # and the 2DSFJ as master
        ],
        brought=lambda stated: parameters_of_own_law(stated, STAGES),
    )


FORCE_CONTROLLER = _force_controller()

LINK = ParameterTable("link", [*LINK_OWN, *NODE_PARAMETERS])

SCENARIO = ParameterTable(
    "scenario",
    [
        Parameter("nodes", ["sfj_sim"], required=True, meaning="executables of the nodes, in order of start"),
        Parameter(
            "real_time_factor",
            1.0,
            "",
            0.0,
            1000.0,
            meaning="with use_sim_time: simulated seconds per second, at most; 0: as fast as it goes",
        ),
        Parameter("processes", False, meaning="one process for each node instead of one for all"),
        Parameter("duration", 0.0, "s", 0.0, 86400.0, meaning="from start to stop; 0: until Ctrl-C"),
        Parameter(
            "end_after_fault",
            0.0,
            "s",
            0.0,
            3600.0,
            meaning="ends so long after the first fault, with exit status 1; 0: goes on, for a reset",
        ),
        Parameter("record", "", meaning="directory of the recording; empty for none"),
        Parameter("note", "", meaning="what the experiment is for; goes into the recording"),
    ],
)
"""The section `scenario:` of a scenario file: not a node, but what the command `scenario` reads."""

TIME_COORDINATOR = ParameterTable(
    "time_coordinator",
    [
        Parameter(
            "participants",
            ["sfj_sim", "omni_sim", "force_controller", "signal_generator"],
            meaning="nodes that must have joined before simulated time begins",
        ),
        Parameter(
            "real_time_factor",
            1.0,
            "",
            0.0,
            1000.0,
            runtime=True,
            meaning="simulated seconds per second, at most; 0: as fast as it goes",
        ),
        Parameter("duration", 0.0, "s", 0.0, 86400.0, meaning="simulated time after which it ends; 0: never"),
        Parameter("paused", False, meaning="begin paused; ~/resume or ~/step lets time run"),
        Parameter(
            "liveness",
            5.0,
            "s",
            0.2,
            60.0,
            meaning="silence of a node that owes something, by the wall, at which time is halted",
        ),
        *NODE_PARAMETERS,
    ],
)
