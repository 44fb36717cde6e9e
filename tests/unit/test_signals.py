"""Artificial commands against scipy's waveforms, a Fourier transform, and compositions written out here."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import signal

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.signals import (
    AmplitudeSweep,
    FrequencySweep,
    Multisine,
    SignalGenerator,
    SignalSettings,
    Square,
    Step,
    Steps,
    Triangle,
    mapping_from,
    settings_from,
    signal_table,
)
from haptic_teleop_control.signals.multisine import crest_factor, multisine_coefficients

TIMES = np.arange(0, 60.0, 0.002)


def series(times=TIMES, rate=500.0, **settings):
    return SignalGenerator({"stage1": SignalSettings(enabled=True, **settings)}, rate=rate).series(times)[
        :, 0
    ]


def test_a_step_is_zero_before_its_delay_and_from_the_end_of_its_duration_on():
    times = np.array([0.0, 1.4999, 1.5, 3.0, 3.4999, 3.5, 100.0])
    values = series(times, step=Step(True, 0.06), delay=1.5, duration=2.0)
    assert values.tolist() == [0.0, 0.0, 0.06, 0.06, 0.06, 0.0, 0.0]


def test_an_unlimited_step_never_ends():
    assert series([1e9], step=Step(True, 0.06)).tolist() == [0.06]


def test_a_disabled_stage_and_disabled_components_give_zero():
    full = SignalSettings(enabled=False, step=Step(True, 1.0), offset=0.5)
    generator = SignalGenerator(
        {"stage1": full, "stage2": SignalSettings(enabled=True, step=Step(False, 1.0))}
    )
    assert not generator.series(TIMES).any()


def test_the_amplitude_sweep_of_a_step_passes_zero_every_half_period():
    # The thesis' example (3.2.3): 0.1 Hz means a zero crossing every 5 s.
    values = series(step=Step(True, 0.4), amplitude_sweep=AmplitudeSweep(True, 0.1))
    np.testing.assert_allclose(values, 0.4 * np.sin(0.2 * math.pi * TIMES), atol=1e-12)
    assert np.allclose(values[::2500], 0.0, atol=1e-12)


@pytest.mark.parametrize("law", ["linear", "logarithmic"])
@pytest.mark.parametrize(("start", "end"), [(0.1, 5.0), (5.0, 0.1), (2.0, 2.0)])
def test_the_frequency_sweep_is_scipys_chirp(law, start, end):
    times = np.arange(0, 20.0, 0.002)
    values = series(times, frequency_sweep=FrequencySweep(True, 0.3, start, end, 20.0, law))
    method = {"linear": "linear", "logarithmic": "logarithmic"}[law]
    np.testing.assert_allclose(
        values, 0.3 * signal.chirp(times, start, 20.0, end, method, phi=-90), atol=1e-9
    )


@pytest.mark.parametrize("law", ["linear", "logarithmic"])
def test_after_a_sweep_the_frequency_is_held_or_the_sweep_begins_again_without_a_jump_of_phase(law):
    held = series(frequency_sweep=FrequencySweep(True, 1.0, 0.13, 4.7, 20.0, law, "hold"))
    repeated = series(frequency_sweep=FrequencySweep(True, 1.0, 0.13, 4.7, 20.0, law, "repeat"))
    for values in (held, repeated):
        assert np.max(np.abs(np.diff(values))) <= 2 * math.pi * 4.7 * 0.002
    # A pure sine at f obeys x(t+h) + x(t-h) = 2 cos(2 pi f h) x(t).
    tail = held[TIMES > 20.01]
    np.testing.assert_allclose(
        tail[2:] + tail[:-2], 2 * math.cos(2 * math.pi * 4.7 * 0.002) * tail[1:-1], atol=1e-9
    )

    def cycles(times):
        if law == "linear":
            return 0.13 * times + 0.5 * (4.7 - 0.13) * times**2 / 20.0
        return 0.13 * 20.0 / math.log(4.7 / 0.13) * ((4.7 / 0.13) ** (times / 20.0) - 1)

    expected = np.sin(2 * math.pi * (2 * cycles(20.0) + cycles(TIMES[20_000:] - 40.0)))
    np.testing.assert_allclose(repeated[20_000:], expected, atol=1e-8)


def test_square_and_triangle_are_scipys():
    off_edges = TIMES + 1e-4  # neither definition owns the instant of an edge
    phase = 2 * math.pi * off_edges / 4.0
    np.testing.assert_array_equal(
        series(off_edges, square=Square(True, 0.2, 4.0)), 0.2 * signal.square(phase)
    )
    expected = 0.2 * signal.sawtooth(phase + math.pi / 2, 0.5)
    np.testing.assert_allclose(series(off_edges, triangle=Triangle(True, 0.2, 4.0)), expected, atol=1e-12)


def test_steps_hold_each_level_from_its_time_on_and_begin_after_the_delay():
    steps = Steps(True, (0.5, 2.0, 7.0), (0.06, 0.1, -0.06))
    times = [0.0, 1.49, 1.5, 2.99, 3.0, 7.99, 8.0, 50.0]
    assert series(times, steps=steps, delay=1.0).tolist() == [0.0, 0.0, 0.06, 0.06, 0.1, 0.1, -0.06, -0.06]


def test_components_add_up_are_modulated_together_then_offset_then_saturated():
    values = series(
        step=Step(True, 0.1),
        triangle=Triangle(True, 0.3, 8.0),
        frequency_sweep=FrequencySweep(True, 0.2, 0.5, 3.0, 60.0),
        amplitude_sweep=AmplitudeSweep(True, 0.05),
        offset=0.05,
        saturation=0.25,
        delay=2.0,
        duration=50.0,
    )
    tau = TIMES - 2.0
    carriers = 0.1 + 0.3 * signal.sawtooth(2 * math.pi * tau / 8.0 + math.pi / 2, 0.5)
    carriers += 0.2 * signal.chirp(tau, 0.5, 60.0, 3.0, phi=-90)
    expected = np.clip(0.05 + np.sin(2 * math.pi * 0.05 * tau) * carriers, -0.25, 0.25)
    inside = (TIMES >= 2.0) & (TIMES < 52.0)
    np.testing.assert_allclose(values, np.where(inside, expected, 0.0), atol=1e-9)
    assert values.max() == 0.25 and values.min() == -0.25


def test_the_multisine_has_its_rms_in_equal_lines_at_odd_harmonics_of_its_band_and_nowhere_else():
    settings = Multisine(True, rms=0.2, period=8.0, f_min=0.5, f_max=6.0, seed=4)
    times = np.arange(4000) * 0.002 + 8.0  # the second period
    values = series(times, multisine=settings)
    lines = np.abs(np.fft.rfft(values)) / 2000
    excited = np.arange(5, 48, 2)  # odd multiples of 1/8 Hz from 0.5 Hz (the 4th) to 6 Hz (the 48th)
    assert list(settings.harmonics()) == excited.tolist()
    np.testing.assert_allclose(lines[excited], 0.2 * math.sqrt(2 / len(excited)), rtol=1e-9)
    assert np.max(np.delete(lines, excited)) < 1e-12
    assert np.sqrt(np.mean(values**2)) == pytest.approx(0.2, rel=1e-9)


def test_the_multisine_repeats_after_its_period_and_differs_by_seed():
    one = Multisine(True, 0.2, 8.0, 0.5, 6.0, seed=1)
    times = np.arange(4000) * 0.002
    first = series(times, multisine=one)
    np.testing.assert_allclose(series(times + 8000.0, multisine=one), first, atol=1e-9)
    other = series(times, multisine=Multisine(True, 0.2, 8.0, 0.5, 6.0, seed=2))
    assert np.max(np.abs(first - other)) > 0.1


def test_more_tries_never_raise_the_crest_factor_and_fifty_lower_it():
    def crest(tries):
        settings = Multisine(True, 0.2, 10.0, 0.1, 10.0, seed=3, tries=tries)
        times = np.arange(50_000) / 5000.0
        values = series(times, multisine=settings)
        measured = np.max(np.abs(values)) / np.sqrt(np.mean(values**2))
        own = crest_factor(np.array(multisine_coefficients(settings)), settings.harmonics())
        assert measured == pytest.approx(own, rel=0.02)
        return own

    crests = [crest(tries) for tries in (1, 5, 50, 200)]
    assert crests == sorted(crests, reverse=True)
    assert crests[2] < crests[0]


def test_a_time_that_is_not_finite_gives_zero():
    assert series([math.nan, math.inf, -math.inf], step=Step(True, 1.0), offset=1.0).tolist() == [
        0.0,
        0.0,
        0.0,
    ]


def test_parameters_describe_the_same_signal_as_settings_and_survive_the_round_trip():
    mapping = {
        "kind": "effort",
        "rate": 1000,
        "stage1.enabled": True,
        "stage1.delay": 2,
        "stage1.step.enabled": True,
        "stage1.step.amplitude": 0.5,
        "stage2.enabled": True,
        "stage2.steps.enabled": True,
        "stage2.steps.times": [0.0, 5],
        "stage2.steps.levels": [0.1, -0.1],
        "topic": "of another parameter of the node",
    }
    generator = SignalGenerator.from_parameters(mapping)
    assert (generator.kind, generator.unit, generator.rate) == ("effort", "N·m", 1000.0)
    assert generator.settings["stage1"] == SignalSettings(enabled=True, delay=2.0, step=Step(True, 0.5))
    assert generator.settings["stage2"].steps == Steps(True, (0.0, 5.0), (0.1, -0.1))
    again = SignalGenerator.from_parameters(generator.to_parameters())
    assert again.settings == generator.settings and again.kind == "effort"
    assert settings_from(mapping_from(generator.settings)) == generator.settings


def test_every_signal_parameter_may_change_while_the_node_runs():
    table = signal_table(stages=("a", "b"))
    assert {p.name for p in table if not p.runtime} == {"kind", "rate"}
    assert {p.name.split(".", 1)[1] for p in table if p.name.startswith("a.")} == {
        p.name.split(".", 1)[1] for p in table if p.name.startswith("b.")
    }
    assert set(table.defaults()) == {
        "kind",
        "rate",
        *mapping_from({"a": SignalSettings(), "b": SignalSettings()}),
    }


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"stage1.step.amplitud": 1.0}, ["stage1.step.amplitud", "did you mean stage1.step.amplitude?"]),
        ({"stage1.saturation": 0.0}, ["stage1.saturation", "0 < value"]),
        ({"stage1.duration": -1.0}, ["stage1.duration"]),
        ({"stage1.delay": math.inf}, ["stage1.delay", "finite"]),
        ({"stage1.step.amplitude": math.nan}, ["stage1.step.amplitude", "finite"]),
        ({"stage1.frequency_sweep.law": "log"}, ["law", "linear | logarithmic"]),
        (
            {"stage1.frequency_sweep.enabled": True, "stage1.frequency_sweep.f_end": 250.0},
            ["stage1.frequency_sweep", "250 Hz", "500 samples", "raise rate"],
        ),
        (
            {
                "stage1.frequency_sweep.enabled": True,
                "stage1.frequency_sweep.f_end": 249.0,
                "stage1.amplitude_sweep.enabled": True,
                "stage1.amplitude_sweep.frequency": 1.0,
            },
            ["stage1.frequency_sweep", "250 Hz"],
        ),
        (
            {
                "stage1.frequency_sweep.enabled": True,
                "stage1.frequency_sweep.f_start": 0.0,
                "stage1.frequency_sweep.law": "logarithmic",
            },
            ["stage1.frequency_sweep.f_start", "logarithmic"],
        ),
        ({"stage1.amplitude_sweep.enabled": True}, ["stage1.amplitude_sweep.enabled", "nothing"]),
        (
            {
                "stage1.multisine.enabled": True,
                "stage1.multisine.f_min": 0.21,
                "stage1.multisine.f_max": 0.29,
            },
            ["stage1.multisine", "lengthen period"],
        ),
        (
            {"stage1.multisine.enabled": True, "stage1.multisine.period": 1e9},
            ["stage1.multisine", "2000 harmonics"],
        ),
        ({"rate": 15.0, "stage1.multisine.enabled": True}, ["stage1.multisine", "10 Hz"]),
        (
            {"stage1.steps.enabled": True, "stage1.steps.times": [0.0, 1.0]},
            ["stage1.steps.levels", "1 elements", "steps.times 2"],
        ),
        (
            {
                "stage1.steps.enabled": True,
                "stage1.steps.times": [1.0, 1.0],
                "stage1.steps.levels": [1.0, 2.0],
            },
            ["stage1.steps.times", "do not increase"],
        ),
        ({"kind": "current"}, ["kind", "position | effort"]),
    ],
)
def test_settings_that_cannot_be_generated_are_refused_by_file_and_key(changes, words):
    with pytest.raises(ConfigurationError) as caught:
        settings_from({"stage1.enabled": True, **changes}, source="signals.yaml")
    for word in ["signals.yaml", *words]:
        assert word in str(caught.value)


def test_what_is_not_enabled_may_be_unfinished():
    unfinished = {
        "stage1.frequency_sweep.f_end": 1000.0,
        "stage1.steps.times": [0.0, 1.0],
        "stage1.amplitude_sweep.enabled": True,
    }
    settings_from(unfinished)


def test_the_end_is_that_of_the_last_enabled_stage():
    one = SignalSettings(enabled=True, delay=1.0, duration=4.0)
    assert SignalGenerator({"a": one, "b": SignalSettings()}).end == 5.0
    assert SignalGenerator({"a": one, "b": SignalSettings(enabled=True)}).end == math.inf
    assert SignalGenerator({"a": SignalSettings()}).end == 0.0


def test_the_preview_is_a_picture_that_names_each_stage(tmp_path):
    generator = SignalGenerator(
        {
            "shoulder": SignalSettings(enabled=True, step=Step(True, 0.1), saturation=0.2),
            "elbow": SignalSettings(),
        }
    )
    png = generator.preview(tmp_path / "signal.png")
    assert png.read_bytes().startswith(b"\x89PNG\r\n\x1a\n")
    svg = generator.preview(tmp_path / "signal.svg", span=2.0).read_text(encoding="utf-8")
    for text in ("shoulder", "elbow (not enabled)", "position / rad", "time / s"):
        assert text in svg
    with pytest.raises(ConfigurationError, match=r"\.png or a \.svg"):
        generator.preview(tmp_path / "signal.txt")
    with pytest.raises(ConfigurationError, match="cannot be written"):
        generator.preview(tmp_path / "none" / "signal.png")


def test_a_generator_needs_a_stage_a_known_kind_and_a_rate_that_carries_it():
    stage = SignalSettings(enabled=True, square=Square(True, 1.0, 0.1))
    for arguments, word in [
        (({},), "no stage"),
        (({"a": stage}, "speed"), "position | effort"),
        (({"a": stage}, "effort", 0.0), "rate"),
        (({"a": stage}, "effort", 15.0), "a.square"),
    ]:
        with pytest.raises(ConfigurationError) as caught:
            SignalGenerator(*arguments)
        assert word in str(caught.value)
