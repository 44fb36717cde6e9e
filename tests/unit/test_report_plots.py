"""What a plot shows: peaks survive thinning, noise is not blown up, differences are differences, one colour
means one thing; and how numbers and units are written."""

import base64
import gzip
import itertools
import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from bokeh.models import Range1d
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from haptic_teleop_sysid.recordings.small_motion import at_rest, hardly_moving, judged, spread
from haptic_teleop_sysid.report import (
    Band,
    Page,
    Panel,
    Plot,
    Series,
    error_text,
    rounded,
    still,
    unit_text,
    units_in,
    with_error,
)
from haptic_teleop_sysid.report.live import _figure, live, packed_script
from haptic_teleop_sysid.report.plot import log_ticks, thinned
from haptic_teleop_sysid.report.roles import ROLES, model_roles
from haptic_teleop_sysid.report.samples import DRAWN, Packed, kept_words, pack, pack_all
from haptic_teleop_sysid.report.section import Block, foldable, looks_numeric, prose

MEGABYTE = 1_000_000
TIME = np.arange(5000) * 1e-3
values = st.one_of(st.floats(-1e6, 1e6, width=32), st.just(float("nan")))


@settings(max_examples=200)
@given(arrays(np.float64, st.integers(5, 400), elements=values), st.integers(4, 60))
def test_thinning_loses_no_peak_and_keeps_order_and_ends(value, points):
    time = np.arange(len(value), dtype=float)
    thin_time, thin_value = thinned(time, value, points)
    assert len(thin_time) <= points + 4
    assert np.all(np.diff(thin_time) > 0) and (thin_time[0], thin_time[-1]) == (time[0], time[-1])
    assert set(thin_time) <= set(time)
    if np.isfinite(value).any():
        assert np.nanmax(thin_value) == np.nanmax(value) and np.nanmin(thin_value) == np.nanmin(value)
    else:
        assert np.isnan(thin_value).all()


def test_a_gap_stays_a_gap_when_thinned():
    value = np.where((TIME > 2.0) & (TIME < 3.0), np.nan, 1.0)
    thin_time, thin_value = thinned(TIME, value, 200)
    inside = (thin_time > 2.1) & (thin_time < 2.9)
    assert np.isnan(thin_value[inside]).all() and inside.any()


def test_a_page_of_many_long_lines_stays_below_three_megabytes_and_a_million_samples_keep_their_peak():
    rng = np.random.default_rng(4)
    page = Page("large")
    section = page.section("s")
    for number in range(3):
        # Noise: nothing can be thinned away without being seen, nor compressed.
        count = 1_000_000 if number == 0 else 20_000
        noise, time = rng.normal(size=count), np.arange(count) * 1e-3
        noise[count - 3] = 40.0  # in what a division by bins leaves over
        noise[count // 3] = -50.0
        lines = [Series(role, time, noise, role) for role in itertools.islice(ROLES, 8)]
        section.plot(Plot([Panel("p", "rad", lines)]).with_difference(), "caption")
    assert len(page.render().encode()) < 3 * MEGABYTE
    views = [(block.plot, block.plot.panels, False) for block in section.blocks]
    for (plot, panels, _), packed in zip(views, pack_all(views, taken=1_000_000), strict=True):
        assert 600 <= packed.kept <= packed.count == len(panels[0].series[0].value)
        data = [unpacked(packed, 0, place) for place in range(8)]
        assert [(y.min(), y.max()) for _, y in data] == [(pytest.approx(-50.0), pytest.approx(40.0))] * 8
        assert {"bytes", "lines"} == set(live(plot, panels, "p", packed)["samples"])


def unpacked(packed, panel, place):
    """Times and values of a packed line, as the page's script reads them."""
    raw = gzip.decompress(base64.b64decode(packed.bytes_))
    line = packed.lines[panel, place]
    n, at = line["n"], line["at"]

    def numbers(at, order):
        words = np.frombuffer(raw, np.uint8, 2 * n, at).astype(np.int64)
        found = (words[:n] << 8) | words[n:]
        for _ in range(order):
            found = np.cumsum(found)
        return found

    steps = numbers(at, line["order"]) % 65_536
    value = np.where(steps > 16_382, np.nan, line["low"] + steps * (line["high"] - line["low"]) / 16_382)
    if "period" not in line:
        return np.frombuffer(raw, "<f4", n, at + 2 * n).astype(float), value
    index = numbers(at + 2 * n, 1) if line.get("jumps") else np.arange(n)
    return line["start"] + line["period"] * index, value


@settings(max_examples=100)
@given(
    arrays(np.float64, st.integers(DRAWN + 1, DRAWN + 300), elements=values),
    st.sampled_from([700, 10_000]),
    st.booleans(),
)
def test_packed_samples_are_those_of_the_line(value, points, even):
    time = 3.0 + 0.002 * np.arange(len(value))
    if not even:
        time = np.float32(time + 0.0005 * np.sin(np.arange(len(value)))).astype(float)
    panel = Panel("p", "rad", [Series("x", time, value)])
    found_time, found = unpacked(pack(Plot([panel]), [panel], points), 0, 0)
    thin_time, thin = thinned(time, value, points)
    np.testing.assert_allclose(found_time, thin_time, atol=1e-6)
    finite = thin[np.isfinite(thin)]
    step = (np.ptp(finite) if len(finite) else 0.0) / 16_382
    np.testing.assert_allclose(found, thin, atol=0.51 * step + 1e-9, equal_nan=True)


def test_a_minute_at_500_hertz_is_kept_whole_and_it_is_said_how_many_samples_a_point_stands_for():
    time = 0.002 * np.arange(30_000)
    lines = [Series(role, time, np.sin(60.0 * time + k), role) for k, role in enumerate(list(ROLES)[:4])]
    views = [(plot := Plot([Panel("p", "rad", lines)] * 4), plot.panels, False)]
    (packed,) = pack_all(views, taken=1_200_000)
    assert packed.kept == packed.count == 30_000
    assert kept_words(packed).endswith("zoomed in, every sample.") and "30000 samples" in kept_words(packed)
    assert "the least and greatest of each 10 samples" in kept_words(Packed("", {}, 30_000, 6_000))
    assert kept_words(Packed()) == ""


def drawn(document, column="y"):
    """The values that a Bokeh document draws, line by line, decoded from its JSON."""
    found = []

    def seek(content):
        if isinstance(content, dict):
            entries = dict(content["entries"]) if content.get("type") == "map" else {}
            if column in entries:
                raw = gzip.decompress(base64.b64decode(entries[column]["array"]["data"]))
                found.append(np.frombuffer(raw, entries[column]["dtype"]))
            content = list(content.values())
        if isinstance(content, (list, tuple)):
            for each in content:
                seek(each)

    seek(document)
    return found


def test_noise_of_a_nanonewtonmetre_is_a_flat_line_and_motion_fills_its_axis():
    quiet = Panel("p", "N·m", [Series("", TIME, 1e-9 * np.sin(TIME))])
    low, high = quiet.limits()
    assert quiet.flat and high - low >= 1e-3
    assert still(Plot([quiet])).axes[0].get_ylim() == (low, high)
    loud = Panel("p", "N·m", [Series("", TIME, np.sin(TIME))])
    low, high = loud.limits()
    assert not loud.flat and 2.0 < high - low < 2.4


def test_the_residual_view_is_what_was_measured_less_what_was_simulated():
    measured, model = np.sin(TIME), 0.5 * np.sin(TIME)
    lines = [
        Series("measured", TIME, measured),
        Series("model", TIME, model, "given"),
        Series("Td", TIME, measured, "reference"),  # what was asked for is no simulation
    ]
    driven = Panel("input", "A", [Series("input", TIME, TIME, "input")])  # nothing to compare
    (found,) = Plot([Panel("p", "rad", lines), driven]).with_difference().difference
    (line,) = found.series
    assert line.role == "given"
    np.testing.assert_allclose(line.value, measured - model)


def test_no_two_meanings_look_alike_not_even_without_colour_and_each_stands_out_on_its_ground():
    styles = {(role.dash, role.width) for role in ROLES.values()}
    assert len(styles) == len(ROLES)
    for ground, colour in (("#ffffff", "light"), ("#14181f", "dark")):
        colours = [getattr(role, colour) for role in ROLES.values()]
        assert len(set(colours)) == len(colours)
        assert min(contrast(c, ground) for c in colours) >= 3.0


def linear(colour):
    """Linear RGB (3,) of #rrggbb (IEC 61966-2-1)."""
    c = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) / 255.0
    return np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)


def contrast(one, other):
    """Ratio of contrast (WCAG 2.2)."""
    a, b = sorted(float(np.array([0.2126, 0.7152, 0.0722]) @ linear(c)) for c in (one, other))
    return (b + 0.05) / (a + 0.05)


def test_a_model_has_the_colour_of_what_its_file_says_whatever_its_place_in_the_command():
    told = {"augmented": (1, "augmented"), "given": (0, None), "re-estimated": (0, "re-estimated")}
    for order in itertools.permutations(told):
        effects, said = zip(*(told[name] for name in order), strict=True)
        assert model_roles(effects, said) == list(order)
    # Without a word of theirs, effects tell.
    assert model_roles([0, 2]) == ["given", "augmented"] and model_roles([2, 0]) == ["augmented", "given"]
    assert model_roles([1, 1]) == ["given", "third"]
    assert model_roles([0, 0], ["re-estimated", "re-estimated"]) == ["re-estimated", "third"]
    assert len(set(model_roles([0, 1, 1, 0, 2]))) == 5


def test_the_picture_of_the_first_hour_has_the_colours_of_the_pages():
    picture = (Path(__file__).parents[2] / "docs" / "first_hour.svg").read_text()
    drawn = set(re.findall(r"stroke: (#[0-9a-f]{6}); stroke-width: 0.9;", picture))
    assert ROLES["measured"].light in drawn  # thin, as on every page
    assert all(ROLES[role].light in picture for role in ("given", "augmented"))


def test_the_script_that_travels_inside_is_bokeh():
    text = gzip.decompress(base64.b64decode(packed_script())).decode()
    assert "embed_items" in text and len(packed_script()) < 0.6 * MEGABYTE


@pytest.mark.parametrize(
    ("value", "std", "unit", "text"),
    [
        (0.41234, 0.0101, "N*m", "0.412 ± 0.010 N·m"),
        (0.41234, None, "N*m*s/rad", "0.4123 N·m·s/rad"),
        (1234.5, 61.3, "kg*m^2", "1234 ± 61 kg·m²"),
        (0.003013, 9.3e-5, "rad", "0.003013 ± 0.000093 rad"),
        (2.0, float("nan"), "1", "2"),
        (3.0, 0.0, "", "3"),
        (-0.0001, 0.5, "rad", "0.00 ± 0.50 rad"),
    ],
)
def test_a_number_ends_where_its_error_begins(value, std, unit, text):
    assert with_error(value, std, unit) == text


def test_a_hyphen_before_a_number_becomes_a_minus_and_in_names_dates_and_exponents_it_stays():
    text = "-6.1 % of (-3) and ± -.5; 2026-11-25, run-3, a/-3, --seed, 1e-09, 0.2-0.3"
    assert units_in(text) == "−6.1 % of (−3) and ± −.5; 2026-11-25, run-3, a/-3, --seed, 1e-09, 0.2-0.3"


def test_the_ends_of_a_narrow_interval_are_told_apart():
    for value, std in ((0.17, 3.7e-7), (1.7e-6, 3.7e-10), (1.7e8, 20.0)):
        low, high = (float(rounded(end, std)) for end in (value - 2.0 * std, value + 2.0 * std))
        assert high - low == pytest.approx(4.0 * std, rel=0.1)
    assert rounded(0.1700003, 3.7e-7) == "0.17000030"


@pytest.mark.parametrize(
    ("std", "text"), [(60.0, "60"), (61.3, "61"), (0.0123, "0.012"), (4.4, "4.4"), (2e6, "2e+06")]
)
def test_standard_errors_are_told_without_an_exponent_where_that_can_be_read(std, text):
    assert error_text(std) == text


def test_units_are_written_in_one_way():
    assert unit_text("N*m/rad^3") == "N·m/rad³" and unit_text("1") == ""
    assert units_in("torque 0.4 N*m, inertia 2 kg*m^2, 3 N*m*s/rad.") == (
        "torque 0.4 N·m, inertia 2 kg·m², 3 N·m·s/rad."
    )
    for untouched in ("a*b", "N*mass", "s*time", "x_N*m_y", "recordings/m/s2"):
        assert units_in(untouched) == untouched


def moving(motor, arm):
    """A data set whose motor and arm swing so far (rad), slowly."""
    swing = np.sin(2.0 * np.pi * TIME)
    return SimpleNamespace(
        signals=lambda: {"motor.position": motor * swing, "arm.position": arm * swing},
        units=lambda: {"motor.position": "rad", "arm.position": "rad"},
    )


def test_a_fit_of_three_milliradians_of_motion_is_no_alarm_unless_that_is_all_the_motion_there_is():
    fits = {"motor.position": 97.0, "arm.position": -32.0}
    assert hardly_moving([moving(0.4, 0.0015)]) == {"arm.position"}
    assert judged(fits, hardly_moving([moving(0.4, 0.0015)])) == {"motor.position": 97.0}
    assert hardly_moving([moving(0.4, 0.0015), moving(0.4, 0.1)]) == set()
    assert hardly_moving([moving(0.001, 0.0015)]) == set()
    assert at_rest([moving(0.001, 0.0015)]) and not at_rest([moving(0.4, 0.0015)])
    assert judged(fits, set(fits)) == fits
    assert spread(np.array([np.nan, 1.0, 3.0])) == pytest.approx(2.0, rel=0.02)
    assert spread(np.full(3, np.nan)) == 0.0


def test_the_velocity_of_a_motion_that_hardly_moves_is_left_out_like_its_position():
    swing = 0.0015 * np.sin(40.0 * TIME)
    signals = {"a.position": swing, "a.velocity": 0.06 * np.cos(40.0 * TIME), "m.position": 100.0 * swing}
    units = {"a.position": "rad", "a.velocity": "rad/s", "m.position": "rad"}
    here = SimpleNamespace(signals=lambda: signals, units=lambda: units)
    assert hardly_moving([here]) == {"a.position", "a.velocity"}
    del signals["m.position"]
    assert at_rest([here]) and hardly_moving([here]) == set()


def test_to_go_left_is_earlier_over_time_only():
    line = [Series("x", TIME, TIME)]
    page = Page("t")
    page.section("s").plot(Plot([Panel("p", "rad", line)]))
    assert 'aria-label="Earlier"' in page.render() and 'aria-label="Left"' not in page.render()
    page = Page("t")
    page.section("s").plot(Plot([Panel("p", "N·m", line, x_label="deflection (rad)")]))
    assert 'aria-label="Left"' in page.render() and 'aria-label="Earlier"' not in page.render()


def test_an_axis_reaches_as_far_as_the_errors_and_the_band_do():
    time, value = np.arange(3.0), np.array([1.0, 2.0, np.nan])
    line = Series("x", time, value, marks=True, line=False, error=np.array([0.5, np.nan, 1.0]))
    low, high = Panel("p", "N", [line]).limits()
    assert low < 0.5 and 2.0 < high < 2.2
    band = Band("limits", time[:2], np.array([-3.0, -3.0]), np.array([4.0, 4.0]))
    low, high = Panel("p", "N", [line], band=band).limits()
    assert low < -3.0 and high > 4.0
    low, high = Panel("p", "N", [Series("x", time, np.array([1e-4, 1e-2, 1.0]))], logarithmic=True).limits()
    assert 0.0 < low < 1e-4 and 1.0 < high < 3.0


def test_dates_keep_their_seconds_and_too_many_names_are_not_told():
    time = 1.767e9 + np.arange(100.0)
    line = Series("x", time, time, marks=True, line=False)
    plot = Plot([Panel("p", "N", [line])], names=["a"] * 100, dated=True)
    found = live(plot, plot.panels, "p", Packed())
    assert found["dated"] and len(found["names"]) == 100
    (milliseconds,) = drawn(found["document"], "x")
    assert milliseconds == pytest.approx(1000.0 * time, abs=0.5)  # single precision leaves two minutes
    many = Plot(plot.panels, names=["a"] * (DRAWN + 1), dated=True)
    assert live(many, many.panels, "p", Packed())["names"] == []
    three = ["one", "two", "three"]
    few = Plot([Panel("p", "N", [Series("x", np.arange(1.0, 4.0), np.ones(3))])], names=three)
    (axis,) = still(few).axes
    assert [t.get_text() for t in axis.get_xticklabels()] == three


def test_two_lines_of_one_meaning_stand_once_in_a_legend():
    time = np.array([0.0, 1.0])
    ends = [Series("limit", time, np.full(2, end), "alarm") for end in (-1.0, 1.0)]
    plot = Plot([Panel("Current", "A", [Series("current", time, time), *ends])])
    legend = still(plot).axes[0].get_legend()
    assert legend is not None
    assert [text.get_text() for text in legend.get_texts()] == ["current", "limit"]
    assert [line.label for line in plot.legend()] == ["current", "limit"]


def test_a_logarithmic_axis_has_round_numbers_and_at_least_two_of_them_in_sight():
    for low, high in ((0.01, 0.24), (0.003, 0.022), (0.9, 4.0), (1e-6, 1e3)):
        seen = [tick for tick in log_ticks(low, high) if low <= tick <= high]
        assert 2 <= len(seen) <= 10 and all(f"{tick:e}"[0] in "125" for tick in seen)


def test_names_that_begin_with_digits_are_no_numbers_and_head_their_rows():
    names = Block("table", header=("rank", "recording"), rows=(("1", "037_week_01"), ("2", "2dsfj")))
    assert names.numeric() == [True, False] and names.heads() == 1
    numbers = ("3", "1e-05", "57.5 %", "-0.3", "± 0.1", "0.8 rad", ".5", "nan", "3,", "12 (of 30)", "(3/4)")
    for number in (*numbers, "≥ 2"):
        assert looks_numeric(number), number
    for name in ("037_week", "2026-11-25 09:00", "1.2.3", "3x", "nano", "–"):
        assert not looks_numeric(name), name


def test_a_sentence_keeps_options_and_dates_whole_and_shows_what_is_typed_as_code():
    html = str(prose("On 2026-11-25 09:00 give `x <y>` as --validation, not a--b or 2026-11-25T09-00."))
    assert '<span class="whole">2026-11-25 09:00</span>' in html
    assert '<span class="whole">--validation</span>' in html and "a--b" in html
    assert "<code>x &lt;y&gt;</code>" in html and html.count("<span") == 2
    assert '<span class="whole">0.139 %</span>' in str(foldable("grew by 0.139 %"))
    for whole in ("≥ 90 %", "80–97 %", "4.12–5.00", "12.1–13.4 s", "2e-05", "−2.3e-05 … 1.7", "8.39 … 6.58"):
        assert f'<span class="whole">{whole}</span>' in str(foldable(f"about {whole} of it"))


def test_a_law_lies_on_the_dots_that_it_explains():
    dots = Series("missing", TIME[:40], TIME[:40], marks=True, line=False)
    panel = Panel("p", "N·m", [dots, Series("the named law", TIME[:40], TIME[:40], "reference")])
    (axis,) = still(Plot([panel])).axes
    drawn = {line.get_label(): line.get_zorder() for line in axis.lines}
    assert drawn["missing"] < drawn["the named law"]
    figure, _ = _figure(panel, Range1d(start=0.0, end=1.0), "x", True, {})
    assert [type(one.glyph).__name__ for one in figure.renderers] == ["Scatter", "Line"]
