"""Settings of an artificial command, one stage each (thesis 2.5), checked when they are made.

The command of a stage at tau = t - delay, inside its duration, and zero outside, is

    clip(offset + sweep(tau) * (sum of the enabled carriers)(tau), -saturation, +saturation)

where sweep(tau) = sin(2 pi f tau) when the amplitude sweep is enabled, 1 otherwise, and the carriers are
step, frequency sweep, square, triangle, multisine and steps. So an enabled step with the amplitude sweep is
the thesis' amplitude sweep, and a frequency sweep with it is its amplitude-modulated chirp. Amplitudes are in
rad for a position, N·m for an effort.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.quantities import check_quantities, quantity

CARRIERS = ("step", "frequency_sweep", "square", "triangle", "multisine", "steps")
"""Names of the components that are summed."""

SIGNAL_UNIT = "rad or N·m"
_ENABLED = "whether this component takes part"


class _Checked:
    """A component: its quantities are checked at construction, then what must hold between them."""

    enabled: bool

    def __post_init__(self) -> None:
        check_quantities(self)
        if self.enabled:
            self._check_together()

    def _check_together(self) -> None: ...

    def highest_frequency(self) -> float:
        """Hz, the highest that this component needs the sampling rate to carry."""
        return 0.0


@dataclass(frozen=True)
class Step(_Checked):
    """A constant from the start on."""

    enabled: bool = quantity(False, "", _ENABLED)
    amplitude: float = quantity(0.0, SIGNAL_UNIT, "height of the step")


@dataclass(frozen=True)
class AmplitudeSweep(_Checked):
    """Multiplies the carriers by sin(2 pi f tau): at 0.1 Hz they pass zero every 5 s."""

    enabled: bool = quantity(False, "", "whether the sum of all waves and steps is multiplied by a sine")
    frequency: float = quantity(
        0.1, "Hz", "frequency of the modulation; zero crossings twice a period", above=0.0
    )

    def highest_frequency(self) -> float:
        return self.frequency


@dataclass(frozen=True)
class FrequencySweep(_Checked):
    """A chirp, amplitude * sin(phase), whose frequency moves from f_start to f_end within sweep_time.

    linear: f = f_start + (f_end - f_start) tau / T. logarithmic: f = f_start (f_end / f_start)^(tau / T).
    Then it begins again (`repeat`, the phase goes on without a jump) or stays at f_end (`hold`).
    """

    enabled: bool = quantity(False, "", _ENABLED)
    amplitude: float = quantity(0.0, SIGNAL_UNIT, "amplitude of the sine")
    f_start: float = quantity(0.1, "Hz", "frequency at the start", minimum=0.0)
    f_end: float = quantity(5.0, "Hz", "frequency at the end of a sweep", minimum=0.0)
    sweep_time: float = quantity(20.0, "s", "duration of one sweep", above=0.0)
    law: str = quantity("linear", "", "how the frequency moves", choices=("linear", "logarithmic"))
    after: str = quantity("repeat", "", "what follows a sweep", choices=("repeat", "hold"))

    def _check_together(self) -> None:
        if self.law == "logarithmic":
            for name in ("f_start", "f_end"):
                if getattr(self, name) <= 0.0:
                    raise ConfigurationError(
                        f"frequency_sweep.{name} is 0 Hz in a logarithmic sweep; choose more, or law linear."
                    )

    def highest_frequency(self) -> float:
        return max(self.f_start, self.f_end)


@dataclass(frozen=True)
class Square(_Checked):
    """+amplitude in the first half of each period, -amplitude in the second."""

    enabled: bool = quantity(False, "", _ENABLED)
    amplitude: float = quantity(0.0, SIGNAL_UNIT, "height either side of zero")
    period: float = quantity(4.0, "s", "duration of one period", above=0.0)

    def highest_frequency(self) -> float:
        return 1.0 / self.period


@dataclass(frozen=True)
class Triangle(_Checked):
    """Zero, +amplitude, zero, -amplitude, zero at the quarters of each period, straight in between.

    Slow ones show friction: the speed is constant, 4 amplitude / period, but for its sign.
    """

    enabled: bool = quantity(False, "", _ENABLED)
    amplitude: float = quantity(0.0, SIGNAL_UNIT, "height of the peaks")
    period: float = quantity(20.0, "s", "duration of one period", above=0.0)

    def highest_frequency(self) -> float:
        return 1.0 / self.period


@dataclass(frozen=True)
class Multisine(_Checked):
    """Sines of equal amplitude and random phase at the odd multiples of 1/period from f_min to f_max.

    Odd harmonics only, because then an even nonlinearity of the plant shows at lines that were not excited.
    Of `tries` sets of phases drawn with `seed` the one with the lowest crest factor is taken.
    """

    enabled: bool = quantity(False, "", _ENABLED)
    rms: float = quantity(0.1, SIGNAL_UNIT, "root mean square of the multisine", minimum=0.0)
    period: float = quantity(10.0, "s", "duration of one period", above=0.0)
    f_min: float = quantity(0.1, "Hz", "lowest frequency", above=0.0)
    f_max: float = quantity(10.0, "Hz", "highest frequency", above=0.0)
    seed: int = quantity(1, "", "seed of the random phases", minimum=0)
    tries: int = quantity(50, "", "sets of phases tried for a low crest factor", minimum=1, maximum=500)

    def harmonics(self) -> range:
        """The odd multiples of 1/period inside f_min..f_max."""
        # The tolerance keeps a harmonic that lies on the limit but for rounding.
        first = max(1, math.ceil(self.f_min * self.period - 1e-9))
        last = math.floor(self.f_max * self.period + 1e-9)
        return range(first + (first + 1) % 2, last + 1, 2)

    def _check_together(self) -> None:
        count = len(self.harmonics()) if self.f_max * self.period < 1e6 else 10**6
        if count == 0:
            raise ConfigurationError(
                f"multisine has no odd multiple of 1/period = {1.0 / self.period:g} Hz from f_min "
                f"{self.f_min:g} Hz to f_max {self.f_max:g} Hz; lengthen period or widen f_min..f_max."
            )
        if count > 2000:
            raise ConfigurationError(
                "multisine has more than 2000 harmonics; shorten period or narrow f_min..f_max."
            )

    def highest_frequency(self) -> float:
        return self.f_max


@dataclass(frozen=True)
class Steps(_Checked):
    """Constant pieces: `levels[i]` from `times[i]` on; zero before the first. A contact and its release, for
    example."""

    enabled: bool = quantity(False, "", _ENABLED)
    times: tuple[float, ...] = quantity(
        (0.0,), "s", "start of each piece, after the delay, increasing", minimum=0.0
    )
    levels: tuple[float, ...] = quantity((0.0,), SIGNAL_UNIT, "level of each piece, as many as times")

    def _check_together(self) -> None:
        if len(self.times) != len(self.levels):
            raise ConfigurationError(
                f"steps.levels has {len(self.levels)} elements and steps.times {len(self.times)}; "
                "give as many of both."
            )
        if any(later <= earlier for earlier, later in zip(self.times, self.times[1:], strict=False)):
            raise ConfigurationError("steps.times do not increase; put them in order, each once.")


@dataclass(frozen=True)
class SignalSettings(_Checked):
    """The command of one stage. Raises ConfigurationError naming the key for anything that cannot be
    generated."""

    enabled: bool = quantity(False, "", "whether this stage is actuated")
    delay: float = quantity(0.0, "s", "time before the signal starts", minimum=0.0)
    duration: float = quantity(
        math.inf, "s", "duration of the signal after the delay; .inf for unlimited", above=0.0, infinite=True
    )
    offset: float = quantity(0.0, SIGNAL_UNIT, "constant that is added, after the amplitude sweep")
    saturation: float = quantity(
        math.inf, SIGNAL_UNIT, "largest absolute value; .inf for none", above=0.0, infinite=True
    )
    step: Step = field(default_factory=Step)
    amplitude_sweep: AmplitudeSweep = field(default_factory=AmplitudeSweep)
    frequency_sweep: FrequencySweep = field(default_factory=FrequencySweep)
    square: Square = field(default_factory=Square)
    triangle: Triangle = field(default_factory=Triangle)
    multisine: Multisine = field(default_factory=Multisine)
    steps: Steps = field(default_factory=Steps)

    def _check_together(self) -> None:
        if self.amplitude_sweep.enabled and not any(getattr(self, name).enabled for name in CARRIERS):
            raise ConfigurationError(
                "amplitude_sweep.enabled is true but nothing is there to modulate; "
                "enable step or another component."
            )

    def check_rate(self, rate: float) -> None:
        """Raises ConfigurationError when an enabled component needs half of `rate` (Hz) or more."""
        if not self.enabled:
            return
        sweep = self.amplitude_sweep.frequency if self.amplitude_sweep.enabled else 0.0
        for name in CARRIERS:
            component = getattr(self, name)
            # Modulation shifts every frequency of a carrier by its own.
            highest = component.highest_frequency() + sweep
            if component.enabled and highest >= 0.5 * rate:
                raise ConfigurationError(
                    f"{name} reaches {highest:g} Hz, but at {rate:g} samples per second a signal must "
                    f"stay below {0.5 * rate:g} Hz; lower its frequency or raise rate."
                )


COMPONENTS = tuple(
    entry.name for entry in fields(SignalSettings) if entry.name in (*CARRIERS, "amplitude_sweep")
)
"""Fields of SignalSettings that are components, in order."""
