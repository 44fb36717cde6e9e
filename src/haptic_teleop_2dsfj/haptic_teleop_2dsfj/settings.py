"""All settings of the driver, and the parameters that the node declares of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from haptic_teleop_2dsfj.amplifier import Amplifier
from haptic_teleop_2dsfj.board_settings import BoardSettings
from haptic_teleop_2dsfj.local_board import EMULATED
from haptic_teleop_2dsfj.remote.settings import RemoteSettings
from haptic_teleop_2dsfj.stage_settings import StageSettings, check_hardware_maximum
from haptic_teleop_2dsfj.supervisor import SupervisorSettings
from haptic_teleop_control.device_watch import DEVICE_TIMEOUT
from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.node_tables import NODE_PARAMETERS
from haptic_teleop_control.parameters import Parameter, ParameterTable
from haptic_teleop_control.quantities import from_parameters, parameters_of
from haptic_teleop_control.robots import (
    JOINT_ENCODER_GEARING,
    STAGES,
    VELOCITY_FILTER_CUTOFF_HZ,
    VELOCITY_FILTER_DAMPING,
)

DEVICES = ("hardware", "emulated", "replay")

RAMP_TIME = 0.2
"""s, as the Omni's torque and the controller's output after engaging."""


@dataclass(frozen=True)
class SfjDriverSettings:
    """Raises ConfigurationError when a current limit is above what the motor carries."""

    board: BoardSettings = field(default_factory=BoardSettings)
    amplifier: Amplifier = field(default_factory=Amplifier)
    supervisor: SupervisorSettings = field(default_factory=SupervisorSettings)
    stages: tuple[StageSettings, StageSettings] = field(
        default_factory=lambda: (StageSettings.nominal("stage1"), StageSettings.nominal("stage2"))
    )
    joint_gearing: float = JOINT_ENCODER_GEARING
    cutoff_hz: float = VELOCITY_FILTER_CUTOFF_HZ
    damping: float = VELOCITY_FILTER_DAMPING
    ramp_time: float = RAMP_TIME
    limit_switches: bool = True
    switch_debounce: int = 10

    def __post_init__(self) -> None:
        for name, stage in zip(STAGES, self.stages, strict=True):
            check_hardware_maximum(name, stage)

    @classmethod
    def from_parameters(cls, values: Mapping[str, Any], source: str = "parameters") -> SfjDriverSettings:
        """From flat parameters, checked against TABLE. Raises ConfigurationError naming source and key."""
        checked = TABLE.check(values, source)
        try:
            first, second = (from_parameters(StageSettings, checked, f"{stage}.") for stage in STAGES)
            return cls(
                board=from_parameters(BoardSettings, checked),
                amplifier=from_parameters(Amplifier, checked),
                supervisor=from_parameters(SupervisorSettings, checked, "supervisor."),
                stages=(first, second),
                joint_gearing=checked["joint_encoder.gearing"],
                cutoff_hz=checked["velocity_filter.cutoff_hz"],
                damping=checked["velocity_filter.damping"],
                ramp_time=checked["ramp_time"],
                limit_switches=checked["limit_switches.enabled"],
                switch_debounce=checked["limit_switches.debounce"],
            )
        except ConfigurationError as error:
            raise ConfigurationError(f"{source}: {error}") from error


def _table() -> ParameterTable:
    replay = "capture to replay with device: replay, relative to the parameter file"
    found = [
        Parameter(
            "device", "hardware", choices=DEVICES, meaning="board, emulated board, or captured session"
        ),
        Parameter(
            "timeout", 0.05, "s", 0.005, 0.2, meaning="age of a command at which the current goes to zero"
        ),
        Parameter(
            "answer_wait",
            1.0e-3,
            "s",
            0.0,
            0.1,
            meaning="time to wait for the answer to a state before the write",
        ),
        Parameter(
            "ramp_time", RAMP_TIME, "s", 0.0, 5.0, meaning="from zero to full current after a start or reset"
        ),
        Parameter("capture", "", meaning="file for the raw packets of the session; empty: none"),
        Parameter("replay.file", "", meaning=replay),
        *EMULATED,
        *parameters_of(RemoteSettings(), "remote.", runtime=False),
        DEVICE_TIMEOUT,
        *NODE_PARAMETERS,
        *parameters_of(BoardSettings(), runtime=False),
        *parameters_of(Amplifier(), runtime=False),
        *parameters_of(SupervisorSettings(), "supervisor.", runtime=False),
        Parameter(
            "joint_encoder.gearing",
            JOINT_ENCODER_GEARING,
            above=0.0,
            meaning="turns of the encoder per turn of the joint",
        ),
        Parameter(
            "velocity_filter.cutoff_hz",
            VELOCITY_FILTER_CUTOFF_HZ,
            "Hz",
            above=0.0,
            meaning="of the velocity filter",
        ),
        Parameter(
            "velocity_filter.damping", VELOCITY_FILTER_DAMPING, above=0.0, meaning="of the velocity filter"
        ),
        Parameter(
            "limit_switches.enabled",
            True,
            meaning="stop at the ends of the range; false only to look for a cable",
        ),
        Parameter(
            "limit_switches.debounce",
            10,
            minimum=1,
            maximum=1000,
            meaning="samples after which a switch counts as released",
        ),
    ]
    for stage in STAGES:
        found += parameters_of(StageSettings.nominal(stage), f"{stage}.", runtime=False)
    return ParameterTable("sfj_driver", found)


TABLE = _table()
"""Parameters of the node `sfj_driver`, and of its replay."""
