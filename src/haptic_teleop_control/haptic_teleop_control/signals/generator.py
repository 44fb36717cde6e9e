"""The signal generator: commands of all stages as a pure function of time."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.robots import SFJ_RATE_HZ, STAGES
from haptic_teleop_control.signals import table
from haptic_teleop_control.signals.kernel import evaluate, evaluate_series, pack
from haptic_teleop_control.signals.settings import SignalSettings

Array = NDArray[np.float64]


class SignalGenerator:
    """Commands of the stages in `settings`, in its order.

    settings: stage name -> SignalSettings. kind: "position" (rad) or "effort" (N·m). rate: samples per
    second, Hz. It holds no state: the same time gives the same value. Raises ConfigurationError for an
    unknown kind and for a frequency that `rate` cannot carry.
    """

    def __init__(
        self, settings: Mapping[str, SignalSettings], kind: str = "position", rate: float = SFJ_RATE_HZ
    ) -> None:
        if not settings:
            raise ConfigurationError("signal generator: no stage; give the settings of at least one.")
        if kind not in table.KINDS:
            raise ConfigurationError(f"signal generator: kind is {kind!r}; choose {' | '.join(table.KINDS)}.")
        if not (math.isfinite(rate) and rate > 0.0):
            raise ConfigurationError(f"signal generator: rate is {rate}; choose a finite number above 0 Hz.")
        self.settings = dict(settings)
        self.kind = kind
        self.rate = float(rate)
        for stage, signal in self.settings.items():
            try:
                signal.check_rate(self.rate)
            except ConfigurationError as error:
                raise ConfigurationError(f"{stage}.{error}") from error
        self._packed = pack(list(self.settings.values()))
        evaluate(0.0, *self._packed)  # compiles now, not in the loop

    @classmethod
    def from_parameters(
        cls, mapping: Mapping[str, Any], stages: Sequence[str] = STAGES, source: str = "parameters"
    ) -> Self:
        """The generator that flat parameters describe, `kind` and `rate` included; errors as
        `signals.settings_from`."""
        settings = table.settings_from(mapping, stages, source)
        values = table.signal_table(stages=stages).defaults() | dict(mapping)
        return cls(settings, values["kind"], values["rate"])

    def to_parameters(self) -> dict[str, Any]:
        """Flat parameters that give this generator again."""
        return {"kind": self.kind, "rate": self.rate, **table.mapping_from(self.settings)}

    @property
    def stages(self) -> tuple[str, ...]:
        return tuple(self.settings)

    @property
    def unit(self) -> str:
        """Unit of the commands."""
        return table.KINDS[self.kind]

    @property
    def end(self) -> float:
        """s, when the last enabled stage has ended: infinite when one is unlimited, 0 when none is
        enabled."""
        return max((s.delay + s.duration for s in self.settings.values() if s.enabled), default=0.0)

    def value(self, t: float) -> Array:
        """Commands (stages,) at time t, s. Zero before a stage's delay and from the end of its duration
        on."""
        return evaluate(float(t), *self._packed)

    def series(self, t: ArrayLike) -> Array:
        """Commands (time, stages) at the times t (time,), s; equal to `value` at each of them, bit by bit."""
        times = np.array(t, dtype=np.float64).reshape(-1)
        return evaluate_series(times, *self._packed)

    def preview(self, path: str | Path, span: float | None = None) -> Path:
        """Draw all stages over `span` seconds (default: until the end, 100 s at most) to a .png or .svg file.

        Returns the path. Raises ConfigurationError for another suffix or a place that cannot be written.
        """
        from haptic_teleop_control.signals import preview  # matplotlib takes long to import

        times = preview.times_to_draw(self.end, self.rate, span)
        label = f"{self.kind} / {self.unit}"
        return preview.draw(Path(path), times, self.series(times), self.settings, label)
