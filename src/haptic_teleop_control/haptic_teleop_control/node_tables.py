"""The parameter tables of this package's nodes, without ROS: what a scenario file may say about them.

The nodes declare them; programs that know no ROS, such as the lockstep runner, read the same file by them.
"""

from __future__ import annotations

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
"""In the table of every control node and plant; of nodes in one process the highest one holds."""

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
    REALTIME_PRIORITY,
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
            REALTIME_PRIORITY,
            *laws.values(),  # scenario 1: the 2DSFJ as slave
            *MasterSide.parameters(AXES),  # and the Omni as master
            *OmniSlaveLaw.parameters(AXES),  # scenario 2: the Omni as slave
            *SfjMasterSide.parameters(STAGES),  # and the 2DSFJ as master
        ],
        brought=lambda stated: parameters_of_own_law(stated, STAGES),
    )


FORCE_CONTROLLER = _force_controller()

LINK = ParameterTable("link", [*LINK_OWN, REALTIME_PRIORITY])

SCENARIO = ParameterTable(
    "scenario",
    [
        Parameter("nodes", ["sfj_sim"], required=True, meaning="executables of the nodes, in order of start"),
        Parameter("processes", False, meaning="one process for each node instead of one for all"),
        Parameter("duration", 0.0, "s", 0.0, 86400.0, meaning="from start to stop; 0: until Ctrl-C"),
        Parameter("record", "", meaning="directory of the recording; empty for none"),
        Parameter("note", "", meaning="what the experiment is for; goes into the recording"),
    ],
)
"""The section `scenario:` of a scenario file: not a node, but what the command `scenario` reads."""
