"""All settings of the driver, and the parameters that the node declares of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from haptic_teleop_control.device_watch import DEVICE_TIMEOUT
from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.node_tables import NODE_PARAMETERS
from haptic_teleop_control.omni_compensation import COMPENSATION, PREFIX, CompensationSettings
from haptic_teleop_control.parameters import Parameter, ParameterTable
from haptic_teleop_control.quantities import check_quantities, from_parameters, parameters_of, quantity
from haptic_teleop_control.robots import (
    OMNI_RATE_HZ,
    VELOCITY_FILTER_CUTOFF_HZ,
    VELOCITY_FILTER_DAMPING,
)
from haptic_teleop_omni.axis_map import PREFIX as MAP_PREFIX
from haptic_teleop_omni.axis_map import AxisMap
from haptic_teleop_omni.calibration import METHODS
from haptic_teleop_omni.device_errors import ERROR_FAULTS
from haptic_teleop_omni.torque_budget import TorqueLimits
from haptic_teleop_omni.transports.openhaptics import OpenHapticsSettings

DEVICES = ("hardware", "emulated", "replay")
TRANSPORTS = ("openhaptics", "hid")
"""To a real device."""

FAULTS = {
    "device_lost": "the Omni does not answer; check its cable and its power, then reset",
    "silent": "no report has come for too long; check the cable and what else uses the device",
    "malformed_report": "reports do not fit the layout; check the parameter layout",
    "frozen_counter": "the device repeats the same report, or sends old ones; switch it off and on",
    "counter_restart": "the device began to count its reports anew, so its angles may have changed; reset, "
    "then calibrate it again",
    "layout_not_confirmed": "device, layout or axis map differs from the confirmed one, so no torque is "
    "sent; run `haptic-teleop doctor --omni`, or correct layout_confirmed_for",
    "calibration_lost": "the vendor's library no longer knows the angles; reset, then put the stylus into "
    "its inkwell",
    "over_speed": "an axis moved faster than a hand can; check the encoders and the layout's scale, reset, "
    "then calibrate it again",
    **ERROR_FAULTS,
}
"""Faults of the driver, with the sentence for the log."""


@dataclass(frozen=True)
class OmniDriverSettings:
    """Raises ConfigurationError naming the field for a value outside its range."""

    limits: TorqueLimits = field(default_factory=TorqueLimits)
    compensation: CompensationSettings = field(default_factory=CompensationSettings)
    axis_map: AxisMap = field(default_factory=AxisMap)
    layout_confirmed_for: str = quantity(
        "", "", "device and layout that somebody has seen agree, as the driver's first line spells it"
    )
    confirmations: str = quantity(
        "", "", "file of what `doctor --omni` has confirmed; empty: the user's own"
    )
    rate: float = quantity(
        OMNI_RATE_HZ, "Hz", "reports per second of the device", minimum=10.0, maximum=2000.0
    )
    patience: float = quantity(
        0.02,
        "s",
        "time without a report after which the torque goes off",
        name="silence",
        minimum=0.002,
        maximum=0.2,
    )
    highest_speed: float = quantity(40.0, "rad/s", "speed at which the torque goes off", above=0.0)
    bad_reports: int = quantity(
        3, "", "malformed or repeated reports in a row that are a fault", minimum=1, maximum=1000
    )
    calibration_method: str = quantity(
        "dock",
        "",
        "dock: in the inkwell; button: neutral pose and button 1; start: known at the start",
        name="calibration.method",
        choices=METHODS,
    )
    calibration_angles: tuple[float, ...] = quantity(
        (0.0, 0.0, 0.0),
        "rad",
        "angles about neutral in that pose: x, y, z",
        name="calibration.angles",
        minimum=-3.2,
        maximum=3.2,
        length=3,
    )
    calibration_hold: float = quantity(
        0.2,
        "s",
        "time for which the device must rest in that pose",
        name="calibration.hold",
        minimum=0.0,
        maximum=10.0,
    )
    cutoff_hz: float = quantity(
        VELOCITY_FILTER_CUTOFF_HZ, "Hz", "of the velocity filter", name="velocity_filter.cutoff_hz", above=0.0
    )
    damping: float = quantity(
        VELOCITY_FILTER_DAMPING, "", "of the velocity filter", name="velocity_filter.damping", above=0.0
    )

    def __post_init__(self) -> None:
        check_quantities(self)

    @classmethod
    def from_parameters(cls, values: Mapping[str, Any], source: str = "parameters") -> OmniDriverSettings:
        """From flat parameters, checked against TABLE. Raises ConfigurationError naming source and key."""
        checked = TABLE.check(values, source)
        try:
            limits = from_parameters(TorqueLimits, checked, "torque.")
            compensation = from_parameters(CompensationSettings, checked, PREFIX)
            axis_map = from_parameters(AxisMap, checked, MAP_PREFIX)
            return from_parameters(
                cls, checked, limits=limits, compensation=compensation, axis_map=axis_map
            )
        except ConfigurationError as error:
            raise ConfigurationError(f"{source}: {error}") from error


def _table() -> ParameterTable:
    transport = "to a real device: the vendor's HD library, or hidapi (whose layouts are not published)"
    replay = "capture to replay with device: replay, relative to the parameter file"
    layout = "of the reports: a name of the package or a YAML file; empty: that of device and transport"
    plant = "factory of the plant behind the emulated Omni: module:object"
    file = "parameter file whose section omni_sim describes that plant; empty: its defaults"
    docked = "time for which the emulated stylus rests in its inkwell after the start"
    return ParameterTable(
        "omni_driver",
        [
            Parameter(
                "device",
                "hardware",
                choices=DEVICES,
                meaning="a real device, an emulated one, or a captured session",
            ),
            Parameter("transport", "openhaptics", choices=TRANSPORTS, meaning=transport),
            Parameter(
                "timeout", 0.05, "s", 0.005, 0.2, meaning="age of a command at which the torque goes to zero"
            ),
            Parameter("answer_wait", 3.0e-4, "s", 0.0, 0.1, meaning="time to wait for the answer to a state"),
            Parameter("capture", "", meaning="file for the raw packets of the session; empty: none"),
            Parameter("replay.file", "", meaning=replay),
            Parameter("layout", "", meaning=layout),
            Parameter("hid.vendor", 0x2988, minimum=0, maximum=0xFFFF, meaning="USB vendor number"),
            Parameter("hid.product", 0x0304, minimum=0, maximum=0xFFFF, meaning="USB product number"),
            Parameter("hid.serial", "", meaning="serial number, where there are several devices"),
            Parameter("emulated.plant", "haptic_teleop_sim.emulation:omni_plant", meaning=plant),
            Parameter("emulated.file", "", meaning=file),
            Parameter("emulated.docked_time", 0.5, "s", 0.0, 3600.0, meaning=docked),
            DEVICE_TIMEOUT,
            *NODE_PARAMETERS,
            *parameters_of(OmniDriverSettings(), runtime=False),
            *parameters_of(TorqueLimits(), "torque.", runtime=False),
            *parameters_of(OpenHapticsSettings(), MAP_PREFIX, runtime=False),
            *parameters_of(AxisMap(), MAP_PREFIX, runtime=False),
            *COMPENSATION,
        ],
    )


TABLE = _table()
"""Parameters of the node `omni_driver`, and of its replay."""
