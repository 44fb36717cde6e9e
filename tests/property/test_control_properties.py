"""What must hold for every input of the pure control side, tried on generated ones."""

from __future__ import annotations

import math
from dataclasses import fields

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.filters import VelocityFilter
from haptic_teleop_control.laws import AugmentedErrorGains, AugmentedErrorLaw, MasterSettings, MasterSide
from haptic_teleop_control.parameters import Parameter, ParameterTable
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
)

DT = 0.002
reproducible = settings(deadline=None, derandomize=True, max_examples=150)

anything = st.floats(allow_nan=True, allow_infinity=True, width=64)
plausible = st.floats(-3.0, 3.0)
amplitude = st.floats(-2.0, 2.0)
on = st.booleans()


def rows(element, n=2):
    return st.lists(st.lists(st.lists(element, min_size=n, max_size=n), min_size=4, max_size=4), max_size=12)


@st.composite
def signals(draw):
    carriers = {
        "step": Step(draw(on), draw(amplitude)),
        "frequency_sweep": FrequencySweep(
            draw(on),
            draw(amplitude),
            draw(st.floats(0.01, 100.0)),
            draw(st.floats(0.01, 100.0)),
            draw(st.floats(0.1, 100.0)),
            draw(st.sampled_from(["linear", "logarithmic"])),
            draw(st.sampled_from(["repeat", "hold"])),
        ),
        "square": Square(draw(on), draw(amplitude), draw(st.floats(0.1, 50.0))),
        "triangle": Triangle(draw(on), draw(amplitude), draw(st.floats(0.1, 50.0))),
        "multisine": Multisine(
            draw(on), draw(st.floats(0.0, 1.0)), 4.0, 0.25, 8.0, draw(st.integers(0, 3)), 2
        ),
        "steps": Steps(draw(on), (0.0, 1.0, 2.5), tuple(draw(st.lists(amplitude, min_size=3, max_size=3)))),
    }
    swept = any(carrier.enabled for carrier in carriers.values()) and draw(on)
    return SignalSettings(
        enabled=draw(st.sampled_from([True, True, True, False])),
        delay=draw(st.floats(0.0, 10.0)),
        duration=draw(st.one_of(st.just(math.inf), st.floats(0.01, 50.0))),
        offset=draw(amplitude),
        saturation=draw(st.one_of(st.just(math.inf), st.floats(1e-3, 5.0))),
        amplitude_sweep=AmplitudeSweep(swept, draw(st.floats(0.01, 10.0))),
        **carriers,
    )


@reproducible
@given(signals(), signals(), st.lists(st.one_of(st.floats(-5.0, 200.0), anything), max_size=20))
def test_a_signal_is_the_same_alone_and_in_a_series_finite_and_within_its_saturation(one, two, times):
    generator = SignalGenerator({"stage1": one, "stage2": two}, rate=500.0)
    together = generator.series(times)
    assert together.shape == (len(times), 2)
    assert np.isfinite(together).all()
    for t, row in zip(times, together, strict=True):
        assert np.array_equal(generator.value(t), row)
        for value, signal in zip(row, (one, two), strict=True):
            assert abs(value) <= signal.saturation
            if not (signal.enabled and t >= signal.delay):
                assert value == 0.0
            if t - signal.delay >= signal.duration:
                assert value == 0.0


@reproducible
@given(signals(), signals())
def test_settings_survive_the_way_through_parameters(one, two):
    assert settings_from(mapping_from({"stage1": one, "stage2": two})) == {"stage1": one, "stage2": two}


@reproducible
@given(
    st.dictionaries(
        st.sampled_from(sorted(mapping_from({"stage1": SignalSettings()}))),
        st.one_of(
            anything,
            st.integers(),
            st.text(max_size=5),
            st.booleans(),
            st.none(),
            st.lists(anything, max_size=3),
        ),
        max_size=4,
    )
)
def test_any_signal_parameters_are_either_used_or_refused_in_one_sentence_with_the_file(mapping):
    try:
        settings_from(mapping, source="some.yaml")
    except ConfigurationError as error:
        assert str(error).startswith("some.yaml: ") and "stage1." in str(error) and "\n" not in str(error)


@reproducible
@given(rows(st.one_of(anything, plausible)))
def test_the_current_is_finite_and_within_its_limit_for_every_input(inputs):
    law = AugmentedErrorLaw([AugmentedErrorGains.for_stage(stage) for stage in ("stage1", "stage2")], DT)
    for row in inputs:
        current = law.step(*row)
        assert np.isfinite(current).all()
        assert abs(current[0]) <= 0.94 and abs(current[1]) <= 1.2
        assert np.isfinite(law.state).all()


@reproducible
@given(rows(plausible))
def test_the_integral_only_moves_with_the_error_and_never_further_than_the_limit_allows(inputs):
    gains = [AugmentedErrorGains.for_stage(stage) for stage in ("stage1", "stage2")]
    law = AugmentedErrorLaw(gains, DT)
    for row in inputs:
        before = law.state[:, 0]
        law.step(*row)
        moved = law.state[:, 0] - before
        s = law.augmented_error
        assert (moved * s >= 0.0).all()
        for i, g in enumerate(gains):
            # A difference of two integrals is rounded like the larger one.
            rounding = 4.0 * np.spacing(max(abs(before[i]), abs(law.state[i, 0])))
            assert abs(moved[i]) <= g.ki * abs(s[i]) * DT * (1 + 1e-9) + rounding
            # Where it moved, the current that it asks for is not beyond the limit on the side it moved to.
            wanted = g.kpm / g.stiffness * (g.kp * s[i] + law.state[i, 0]) - g.kdm * row[3][i]
            if moved[i] != 0.0:
                assert math.copysign(1.0, moved[i]) * wanted <= g.current_limit * (1 + 1e-9)


@reproducible
@given(rows(st.one_of(anything, plausible)), st.floats(0.0, 0.446), st.floats(0.0, 100.0))
def test_the_device_torque_is_finite_and_within_its_limit_for_every_input(inputs, limit, gain):
    master = MasterSide(
        [MasterSettings(feedback_gain=gain, feedback_cutoff_hz=20.0, torque_limit=limit)] * 2, DT
    )
    for row in inputs:
        desired, device = master.step(row[0], row[1])
        assert np.isfinite(desired).all() and np.isfinite(device).all()
        assert (np.abs(device) <= limit).all()
        assert np.isfinite(master.state).all()


@reproducible
@given(st.lists(st.one_of(plausible, anything), max_size=30))
def test_the_velocity_filter_recovers_from_anything(samples):
    filter_ = VelocityFilter(1, DT)
    for sample in samples:
        velocity = filter_.step([sample])[0]
        assert math.isfinite(sample) or math.isnan(velocity)
    filter_.reset(0.0)
    assert filter_.step([0.0])[0] == 0.0


@reproducible
@given(st.floats(-100.0, 100.0), st.floats(-5.0, 5.0), st.floats(1e-4, 0.05))
def test_a_ramp_gives_its_slope_for_every_start_slope_and_sampling_time(start, slope, dt):
    filter_ = VelocityFilter(1, dt)
    filter_.reset(start, slope)
    for k in range(1, 30):
        assert math.isclose(filter_.step([start + slope * k * dt])[0], slope, rel_tol=1e-6, abs_tol=1e-6)


@reproducible
@given(
    st.one_of(anything, st.integers(), st.text(max_size=4), st.booleans(), st.lists(st.floats(), max_size=2))
)
def test_a_checked_number_is_a_finite_float_in_its_range(value):
    table = ParameterTable("n", [Parameter("x", 1.0, above=0.0, maximum=2.0)])
    try:
        checked = table.check({"x": value})["x"]
    except ConfigurationError:
        return
    assert type(checked) is float and 0.0 < checked <= 2.0 and checked == value


def test_the_generated_signals_cover_every_component():
    names = {entry.name for entry in fields(SignalSettings)}
    assert names == {
        "enabled", "delay", "duration", "offset", "saturation", "step", "amplitude_sweep", "frequency_sweep",
        "square", "triangle", "multisine", "steps",
    }  # fmt: skip
