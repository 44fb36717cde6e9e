"""Report pages in a real browser: what a reader sees at 420, 1280 and 1920 pixels, in the dark, on paper and
without scripts, measured.

Chromium comes from the system's packages (README.md); where it is missing, these tests are skipped.
"""

import numpy as np
import pytest
from measured_pages import (
    A4,
    BROKEN_WORDS,
    CONTRASTS,
    FITS,
    LONG,
    WATCHED,
    WIDTHS,
    opened,
    values_told,
)
from page_audit import audited, walked

from haptic_teleop_sysid.diagnosis.evidence.proof import MODELS
from haptic_teleop_sysid.diagnosis.report.page_columns import parameters
from haptic_teleop_sysid.report import Band, Page, Panel, Plot, Series, still


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    """A page with everything that pages have, and with what breaks them: long names, wide tables."""
    time = np.arange(3000) * 2e-3
    rng = np.random.default_rng(1)
    measured = np.sin(4.0 * time) + 0.02 * rng.normal(size=len(time))
    lines = [
        Series("measured", time, measured),
        Series("yours", time, 0.6 * np.sin(4.0 * time), "given"),
        Series("augmented", time, np.sin(4.0 * time), "augmented"),
    ]
    plot = Plot([Panel("speed", "rad/s", lines, spans=[(1.0, 2.0)]), Panel("again", "rad/s", lines)])
    page = Page(f"Diagnosis of {LONG}", LONG)
    page.conclude("good", f"Something is missing from {LONG}.", f"simulate with {LONG}.")
    for status in ("good", "fair", "bad", "plain"):
        page.verdict(status, f"{status}: {LONG}")
    page.key_figure("57.5 → 81.4 %", f"fit of {LONG}", "on other recordings")
    page.section("Response").plot(plot.with_difference(), f"Measured and simulated, {LONG}")
    header = ["recording", *(f"a column {n} (N·m)" for n in range(15))]
    row = [LONG, *(f"{n}.012345 ± 0.000123" for n in range(15))]
    page.section("Table").table(header, [row] * 3, "Many columns").table(["a", "b"], [["c", LONG]])
    fits = ["signal", "yours (%)", "re-estimated (%)", "augmented (%)", "moves by", "recordings"]
    signals = [f"stage1_{place}.{name}" for place in ("motor", "arm") for name in ("position", "velocity")]
    page.section("Fits").table(
        fits, [[s, "58.2", "93.8", "99.1", "0.822 rad", "other recordings, also used"] for s in signals]
    )
    page.section("Steps").commands([("Compare.", f"haptic-teleop compare --model {LONG} --bag {LONG}")])
    page.section("Details", "What is folded.", folded=True).picture(still(plot), "Standing still")
    return page.write(tmp_path_factory.mktemp("report") / "report.html")


@pytest.mark.parametrize("width", WIDTHS)
def test_no_page_scrolls_sideways_and_its_plots_are_large_enough_to_read(browser, report, width):
    page, wrong = opened(browser, report, viewport={"width": width, "height": 900})
    assert page.evaluate(FITS) == {"page": 0, "out": []}
    # The three models stand beside each other without scrolling.
    ends = page.evaluate(
        "[...document.querySelectorAll('[aria-label=Fits] th')].map(e => e.getBoundingClientRect().right)"
    )
    assert max(ends[:4]) <= width
    # A table that is too wide scrolls in its own box, which the keyboard reaches.
    boxes = page.evaluate("[...document.querySelectorAll('.scroll')].map(e => [e.tabIndex, e.clientWidth])")
    assert boxes and all(index == 0 and 0 < inner <= width for index, inner in boxes)
    plots = page.evaluate(
        "[...document.querySelectorAll('.canvas')].filter(e => e.offsetParent).map(e => "
        "[e.clientWidth, e.clientHeight])"
    )
    assert len(plots) == 2 and all(w > 0.6 * min(width, 1000) and h >= 150 for w, h in plots)
    text = page.evaluate("getComputedStyle(document.querySelector('.panel-title')).fontSize")
    assert float(text.removesuffix("px")) >= 12.0
    assert wrong == []
    page.close()


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_every_text_stands_out_from_its_ground_in_the_light_and_in_the_dark(browser, report, scheme):
    page, _ = opened(browser, report, color_scheme=scheme, viewport={"width": 1280, "height": 900})
    found = page.evaluate(CONTRASTS)
    assert len(found) > 15
    assert {name: ratio for name, ratio in found.items() if ratio < 4.5} == {}
    # The plots follow: what was measured is drawn in the colour that the page has for it.
    wanted = page.evaluate(
        "getComputedStyle(document.documentElement).getPropertyValue('--measured').trim()"
    )
    drawn = page.evaluate(
        "Bokeh.documents[0].roots()[0].renderers.find(r => r.name === 'measured').glyph.line_color.value"
    )
    assert drawn == wanted == {"light": "#1c2432", "dark": "#f0f3f7"}[scheme]
    page.close()


def test_one_zooms_by_keyboard_and_by_mouse_hides_lines_and_sees_the_difference(browser, report):
    page, wrong = opened(browser, report, **WATCHED)
    span = "(() => { const r = Bokeh.documents[0].roots()[0].x_range; return [r.start, r.end]; })()"
    low, high = page.evaluate(span)
    page.focus("button[data-do=in]")
    page.keyboard.press("Enter")
    inner = page.evaluate(span)
    assert inner[1] - inner[0] == pytest.approx(0.5 * (high - low))
    page.keyboard.press("Tab")
    page.wait_for_function("document.activeElement.dataset.do === 'out'")
    page.click("button[data-do=reset]")
    assert page.evaluate(span) == [low, high]
    page.locator(".canvas").first.scroll_into_view_if_needed()
    box = page.locator(".canvas").first.bounding_box()
    middle = box["y"] + 0.5 * box["height"]
    page.mouse.move(box["x"] + 0.4 * box["width"], middle - 30)
    page.wait_for_selector(".readout:has-text('augmented')")
    at, told = values_told(page.inner_text(".readout >> nth=0"))
    assert told["augmented"] == pytest.approx(np.sin(4.0 * at), abs=0.02)
    assert told["yours"] == pytest.approx(0.6 * told["augmented"], abs=0.02)
    page.mouse.down()
    page.wait_for_timeout(400)  # who hesitates zooms as well
    page.mouse.move(box["x"] + 0.6 * box["width"], middle + 30, steps=4)
    page.mouse.up()
    page.wait_for_function(f"({span})[1] < {high} - 0.2")
    assert page.evaluate("Bokeh.documents[0].roots()[1].x_range.end") == page.evaluate(span)[1]  # linked
    page.click("[data-line=yours]")
    shown = "Bokeh.documents[0].roots().map(p => p.renderers.find(r => r.name === 'yours').visible)"
    assert page.evaluate(shown) == [False, False]
    page.click("button[data-do=drag]")
    page.click("button[data-do=view]")
    page.wait_for_selector("[data-view=difference] canvas", state="attached")
    page.wait_for_function(
        "(() => { const seen = Bokeh.documents.at(-1).roots()[0]; return seen.toolbar.active_drag.type === "
        "'PanTool' && !seen.renderers.find(r => r.name === 'yours').visible; })()"
    )
    assert not page.is_visible("[data-view=response]") and page.is_visible("[data-view=difference]")
    assert wrong == []
    page.close()


def test_paper_shows_everything_and_cuts_no_table_off(browser, report):
    page, _ = opened(browser, report, viewport={"width": A4, "height": 1000}, color_scheme="dark")
    page.emulate_media(media="print")
    assert page.evaluate(FITS)["page"] == 0
    cut = page.evaluate(
        "[...document.querySelectorAll('table')].map(t => t.getBoundingClientRect().right)"
    )
    assert cut and max(cut) <= A4 + 1
    assert page.evaluate(BROKEN_WORDS) == []
    assert not page.is_visible("nav")  # nobody clicks on paper
    # The box of the summary may go on over the page, or the first page would be empty; its sentences do not.
    for part, breaks in ((".summary", "auto"), (".conclusion", "avoid")):
        assert page.evaluate(f"getComputedStyle(document.querySelector('{part}')).breakInside") == breaks
    assert not page.is_visible(".kept")  # nobody zooms on paper
    assert page.is_visible(".plot .still svg") and not page.is_visible(".live")
    grounds = page.evaluate("getComputedStyle(document.body).backgroundColor")
    assert grounds == "rgb(255, 255, 255)"  # also for somebody whose screen is dark
    pdf = page.pdf(format="A4")
    assert pdf.startswith(b"%PDF") and len(pdf) > 20_000
    page.close()


@pytest.fixture(scope="module")
def minute(tmp_path_factory):
    """A minute of a fast signal at 500 Hz, and a simulation that is told by a long name."""
    time = 2e-3 * np.arange(30_000)
    wave = np.sin(2.0 * np.pi * 10.0 * time)
    wave[20_003] = 3.0
    name = "a/model/with/a/long/name/augmented_model.yaml"
    lines = [Series("measured", time, wave), Series(name, time, 0.9 * wave, "augmented")]
    page = Page("Response")
    panels = [Panel(f"speed {k}", "rad/s", lines) for k in range(3)]
    page.section("Response").plot(Plot(panels).with_difference(), "A minute.")
    rows = [(f"parameter {k}", "2e-05", "1.234e-05 … 2.345e-05", "remark " * 12) for k in range(45)]
    page.section("Table").table(["name", "estimate", "95 % interval", "remark"], rows)
    return page.write(tmp_path_factory.mktemp("minute") / "report.html")


def test_zoomed_in_every_sample_of_a_minute_shows_and_seen_whole_no_peak_is_lost(browser, minute):
    page, wrong = opened(browser, minute, **WATCHED)
    drawn = """(() => { const s = Bokeh.documents[0].roots()[0].renderers.find(r => r.name === "measured");
      return ["x", "y"].map(c => Array.from(s.data_source.get_column(c))); })()"""
    time, value = page.evaluate(drawn)
    assert 1000 < len(time) < 2100 and max(value) == pytest.approx(3.0) and time[-1] == pytest.approx(59.998)
    page.evaluate("Bokeh.documents[0].roots()[0].x_range.setv({ start: 20.0, end: 21.2 })")
    page.wait_for_function(f"({drawn})[0].at(-1) < 22")
    time, value = map(np.array, page.evaluate(drawn))
    np.testing.assert_allclose(np.diff(time), 2e-3, atol=1e-9)
    assert (time[0], time[-1]) == (pytest.approx(20.0, abs=5e-3), pytest.approx(21.2, abs=5e-3))
    np.testing.assert_allclose(value, np.sin(2.0 * np.pi * 10.0 * time), atol=3e-4)
    assert "zoomed in, every sample" in page.inner_text("figcaption")
    page.click("button[data-do=reset]")
    page.wait_for_function(f"({drawn})[0].at(-1) > 59")
    assert minute.stat().st_size < 3_000_000 and wrong == []
    page.close()


@pytest.mark.parametrize("width", [420, 1280])
def test_nothing_moves_when_a_plot_tells_its_values(browser, minute, width):
    page, _ = opened(browser, minute, **WATCHED | {"viewport": {"width": width, "height": 900}})
    tops = """[...document.querySelectorAll(".canvas")].filter(e => e.offsetParent)
      .map(e => e.getBoundingClientRect().top + scrollY)"""
    page.locator(".canvas").first.scroll_into_view_if_needed()
    # Each readout has its room by then.
    seen = "[...document.querySelectorAll('.readout')].filter(e => e.offsetParent)"
    page.wait_for_function(f"{seen}.length && {seen}.every(e => e.style.minHeight)")
    before = page.evaluate(tops)
    box = page.locator(".canvas").first.bounding_box()
    for share in (0.3, 0.6, 0.9):
        page.mouse.move(box["x"] + share * box["width"], box["y"] + 60)
        page.wait_for_selector(".readout:has-text('measured')")
        assert page.evaluate(tops) == pytest.approx(before, abs=0.3)
    page.close()


def test_on_paper_no_number_or_interval_is_broken_and_no_last_line_has_its_own_page(browser, minute):
    page, _ = opened(browser, minute, **WATCHED | {"viewport": {"width": A4, "height": 1000}})
    page.emulate_media(media="print")
    heights = page.evaluate(
        "[...document.querySelectorAll('td:nth-child(2), td:nth-child(3)')].map(e => { const r = "
        "document.createRange(); r.selectNodeContents(e); return new Set([...r.getClientRects()]"
        ".map(b => Math.round(b.top))).size; })"
    )
    assert heights and set(heights) == {1}
    # When it was written stands at the top, or it would often have the last page for itself.
    assert page.is_visible(".printed") and not page.is_visible("footer")
    style = "getComputedStyle(document.querySelector('{}')).{}"
    assert page.evaluate(style.format("tbody tr:last-child", "breakBefore")) == "avoid"
    page.close()


def compared_parameters():
    """The parameters of a diagnosis, with an effect of a long name."""
    number = {"value": 0.41234, "std": 0.0101, "unit": "N*m*s/rad", "at_bound": None, "change": -0.061}
    own = dict.fromkeys(("torque_constant", "stiffness", "motor_damping"), number)
    found = own | {"stage1_motor.position_dependent_friction.amplitude": number}
    models = {name: {"parameters": own} for name in MODELS} | {"augmented": {"parameters": found}}
    what = {"what": "the structure with what was found"}
    page = Page("Diagnosis")
    parameters(page, {"models": models, "augmented_model": what, "verdict": "identified"})
    return page


def test_on_a_narrow_screen_the_augmented_parameters_are_in_sight_and_more_is_hinted_at(browser, tmp_path):
    report = compared_parameters().write(tmp_path / "report.html")
    page = browser.new_page(**WATCHED | {"viewport": {"width": 420, "height": 900}})
    page.goto(report.as_uri())
    page.wait_for_function("!document.querySelector('.more').hidden")
    right = page.evaluate(
        "[...document.querySelectorAll('th')].find(h => h.textContent === 'augmented')"
        ".getBoundingClientRect().right"
    )
    assert right <= 420
    page.set_viewport_size({"width": 1280, "height": 900})
    page.wait_for_function("document.querySelector('.more').hidden")
    page.close()


def test_without_scripts_the_still_pictures_stand_in_their_places(browser, report):
    page, _ = opened(browser, report, java_script_enabled=False, viewport={"width": 420, "height": 900})
    assert page.is_visible(".plot .still svg") and not page.is_visible(".tools")
    box = page.locator(".plot .still svg").first.bounding_box()
    assert box["width"] >= 500  # scrolls in its own box rather than shrinking to nothing
    page.close()


def test_a_screen_reader_finds_landmarks_headings_names_and_the_way_past_the_contents(browser, report):
    page, _ = opened(browser, report, **WATCHED)
    assert page.get_by_role("main").count() == page.get_by_role("navigation").count() == 1
    assert audited(page) == []
    page.keyboard.press("Tab")
    page.wait_for_function("document.activeElement.className === 'skip'")
    page.wait_for_function("document.querySelector('.skip').getBoundingClientRect().x >= 0")
    page.keyboard.press("Enter")
    page.wait_for_function("document.activeElement.id === 'report'")
    page.keyboard.press("Tab")
    page.wait_for_function("document.activeElement.closest('main > *')")
    page.wait_for_function("getComputedStyle(document.activeElement).outlineStyle === 'solid'")
    page.click("nav >> text=Details")  # a link opens what is folded
    page.wait_for_function("document.querySelector('#section5 details').open")
    page.focus("#section5 summary")
    page.keyboard.press("Enter")
    page.wait_for_function("!document.querySelector('#section5 details').open")
    page.keyboard.press("Space")
    page.wait_for_function("document.querySelector('#section5 details').open")
    assert audited(page) == []  # what was folded, too
    assert walked(page) == []
    page.close()


def test_many_recordings_are_a_plot_that_tells_which_one_it_is_under_the_mouse(browser, tmp_path):
    weeks = 1.767e9 + 7 * 86400.0 * np.arange(30.0)
    values = 0.2 + 0.01 * np.sin(weeks)
    line = Series("friction", weeks, values, marks=True, line=False, error=np.full(30, 0.01))
    out = Series("jumped out", weeks, np.where(weeks > weeks[-3], values, np.nan), "alarm", marks=True)
    band = Band("limits", weeks, np.full(30, 0.18), np.full(30, 0.22))
    names = [f"week{i:02d}" for i in range(30)]
    panels = [
        Panel("friction", "N·m", [line, out], guides=(0.2,), moments=(weeks[9],), band=band),
        Panel("error", "1", [Series("error", weeks, np.exp(values))], logarithmic=True),
    ]
    page = Page("Trend")
    page.section("Over time").plot(Plot(panels, "date (UTC)", names=names, dated=True), "Over time")
    path = page.write(tmp_path / "report.html")
    view, wrong = opened(browser, path, viewport={"width": 1280, "height": 900})
    box = view.query_selector(".canvas").bounding_box()
    # Between the axis and the end: the middle is halfway through the 30 weeks.
    view.mouse.move(box["x"] + 66 + 0.5 * (box["width"] - 78), box["y"] + 60)
    view.wait_for_selector(".readout:has-text('friction')")
    told = view.inner_text(".readout >> nth=0")
    assert told.startswith(("week14: ", "week15: "))
    # What has no number there is not told.
    assert "friction 0." in told and "jumped out" not in told and "limits" not in told
    view.focus(".canvas >> nth=1")
    view.keyboard.press("Home")
    assert view.inner_text(".said") == "week00: error " + f"{np.exp(values[0]):.4g}"
    assert wrong == []
    view.close()
