"""How the robot is wired to the board: channels, levels, rate and watchdog, each a ROS parameter."""

from __future__ import annotations

import math
from dataclasses import dataclass

from haptic_teleop_2dsfj.hil import HARDWARE_CLOCK_0
from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.quantities import check_quantities, quantity
from haptic_teleop_control.robots import SFJ_RATE_HZ


@dataclass(frozen=True)
class BoardSettings:
    """Defaults: Quanser's example for the sibling 2DSFL on a Q8; the joint encoders' channels are *assumed*.

    Raises ConfigurationError naming the field for a value outside its range or a channel named twice.
    """

    rate: float = quantity(
        SFJ_RATE_HZ, "Hz", "samples per second, kept by the board", minimum=10.0, maximum=2000.0
    )
    card_type: str = quantity(
        "q8",
        "",
        "board as Quanser names it, for example q8, q8_usb; remote: that of a board server",
        name="board.type",
    )
    card_identifier: str = quantity("0", "", "which of several boards", name="board.id")
    options: str = quantity(
        "",
        "",
        "the card's own options as Quanser writes them, for example update_rate=fast, which a q8_usb needs "
        "for 500 Hz; empty: none",
        name="board.options",
    )
    encoders: tuple[int, ...] = quantity(
        (0, 1, 2, 3),
        "",
        "channels: drive 1, drive 2, joint 1, joint 2",
        name="board.encoders",
        minimum=0,
        maximum=63,
        length=4,
    )
    senses: tuple[int, ...] = quantity(
        (2, 3),
        "",
        "analog inputs of the measured currents",
        name="board.current_sense",
        minimum=0,
        maximum=63,
        length=2,
    )
    outputs: tuple[int, ...] = quantity(
        (0, 1),
        "",
        "analog outputs of the commanded currents",
        name="board.current_command",
        minimum=0,
        maximum=63,
        length=2,
    )
    enables: tuple[int, ...] = quantity(
        (0, 1, 4),
        "",
        "digital outputs: enable 1, enable 2, master enable",
        name="board.enable",
        minimum=0,
        maximum=63,
        length=3,
    )
    enable_levels: tuple[int, ...] = quantity(
        (0, 0, 1),
        "",
        "levels of these lines that enable",
        name="board.enable_levels",
        minimum=0,
        maximum=1,
        length=3,
    )
    switches: tuple[int, ...] = quantity(
        (8, 9, 10, 11),
        "",
        "digital inputs: stage 1 max, min, stage 2 max, min",
        name="board.limit_switches",
        minimum=0,
        maximum=63,
        length=4,
    )
    range_volts: float = quantity(
        10.0, "V", "range of the analog lines either side", name="board.range", above=0.0
    )
    output_bits: int = quantity(
        12, "", "resolution of the analog outputs", name="board.output_bits", minimum=8, maximum=24
    )
    counter_bits: int = quantity(
        24, "", "width of the encoder counters", name="board.counter_bits", minimum=16, maximum=32
    )
    clock: int = quantity(
        HARDWARE_CLOCK_0,
        "",
        "number of the clock that paces the samples: 0 to 19 a hardware clock, -1 to -4 a system clock",
        name="board.clock",
        minimum=-4,
        maximum=19,
    )
    watchdog: float = quantity(
        0.02,
        "s",
        "time after which the board itself goes to 0 V if nobody reloads it",
        name="board.watchdog",
        minimum=0.005,
        maximum=0.2,
    )
    buffer: int = quantity(
        1,
        "",
        "samples that the board keeps for a late reader; 1: only the newest",
        name="board.buffer",
        minimum=1,
        maximum=1000,
    )

    def __post_init__(self) -> None:
        check_quantities(self)
        for name, channels in (
            ("board.encoders", self.encoders),
            ("board.current_sense", self.senses),
            ("board.current_command", self.outputs),
            ("board.enable and board.limit_switches", self.enables + self.switches),
        ):
            if len(set(channels)) < len(channels):
                raise ConfigurationError(
                    f"{name} names a channel twice: {list(channels)}; give each line its own."
                )
        if self.watchdog * self.rate < 2.0:
            raise ConfigurationError(
                f"board.watchdog is {self.watchdog:g} s, less than two samples at {self.rate:g} Hz; choose a "
                f"longer one, {2.0 / self.rate:g} s at least."
            )

    @property
    def dt(self) -> float:
        """s between two samples."""
        return 1.0 / self.rate

    @property
    def output_step(self) -> float:
        """V per step of the analog outputs."""
        return 2.0 * self.range_volts / 2**self.output_bits

    @property
    def highest_volts(self) -> float:
        """V, the largest output that the converter has on both sides."""
        return self.output_step * (math.floor(self.range_volts / self.output_step) - 1)
