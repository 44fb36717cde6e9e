"""The values of a plot with the keyboard alone, and what of it a screen reader hears."""

import numpy as np
import pytest
from measured_pages import WATCHED, opened, values_told
from page_audit import audited, walked

from haptic_teleop_sysid.report import Page, Panel, Plot, Series

STEP = 0.01  # s
TIME = STEP * np.arange(200)
WAVE = np.sin(4.0 * TIME)
VIEW = "Bokeh.documents[0].roots().map(p => [p.x_range.start, p.x_range.end])"
CURSORS = """Bokeh.documents[0].roots().map(p => p.center.find(m => m.name === "cursor"))
  .map(c => c.visible ? c.location : null)"""


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    """A page with one plot of two panels, in radians and in newton metres."""
    lines = [Series("measured", TIME, WAVE), Series("simulated", TIME, 0.6 * WAVE, "given")]
    plot = Plot([Panel("angle", "rad", lines), Panel("torque", "N·m", lines)])
    page = Page("Response")
    page.section("Response").plot(plot.with_difference(), "Measured and simulated")
    return page.write(tmp_path_factory.mktemp("keys") / "report.html")


@pytest.fixture(scope="module")
def opened_page(browser, report):
    page, wrong = opened(browser, report, **WATCHED)
    yield page
    assert wrong == []


@pytest.fixture
def page(opened_page):
    """The page as it was opened, with the focus on its first plot, reached by the Tab key alone."""
    opened_page.focus(".skip")
    for _ in range(30):
        opened_page.keyboard.press("Tab")
        if opened_page.evaluate("document.activeElement.matches('.canvas')"):
            break
    opened_page.keyboard.press("Escape")
    return opened_page


def heard(page, *keys):
    """What is read out after these keys."""
    for key in keys:
        page.keyboard.press(key)
    return page.inner_text(".said")


def test_a_plot_is_a_stop_of_the_tab_key_which_shows_and_says_what_to_do(page):
    focus = page.evaluate(
        "(() => { const e = document.activeElement, s = getComputedStyle(e); "
        "return [e.id, e.ariaLabel, s.outlineStyle, parseFloat(s.outlineWidth)]; })()"
    )
    assert focus[0].endswith("response-0") and focus[2] == "solid" and focus[3] >= 2
    assert focus[1].startswith("angle.") and "arrow keys read the values" in focus[1]
    page.keyboard.press("Shift+Tab")
    page.keyboard.press("Tab")
    assert "← →" in page.inner_text(".readout >> nth=0")
    assert page.evaluate("document.querySelector('.said').ariaLive") == "polite"
    assert page.get_by_role("application").count() == 2
    assert audited(page) == [] and walked(page) == []


def test_arrow_keys_go_through_the_samples_and_each_is_read_out_with_its_units(page):
    assert heard(page, "ArrowRight") == "t = 0.00 s: measured 0.000 rad, simulated 0.000 rad"
    for number in (1, 2, 3):
        at, told = values_told(heard(page, "ArrowRight"))
        assert at == pytest.approx(number * STEP)
        assert told == pytest.approx({"measured": WAVE[number], "simulated": 0.6 * WAVE[number]}, abs=6e-4)
    assert values_told(heard(page, "ArrowLeft"))[0] == pytest.approx(2 * STEP)
    at, told = values_told(heard(page, "PageDown"))
    assert at == pytest.approx(0.1 * TIME[-1] + 2 * STEP, abs=2 * STEP)
    assert heard(page, "End").startswith("t = 1.99 s: measured 0.994 rad, ")
    assert heard(page, "ArrowRight").startswith("t = 1.99 s: ")
    assert heard(page, "Home", "ArrowLeft").startswith("t = 0.00 s: ")
    at, told = values_told(heard(page, "End", "PageUp", "PageUp"))
    assert told["measured"] == pytest.approx(np.sin(4.0 * at), abs=6e-4)


def test_the_cursor_stands_in_all_panels_and_what_is_seen_is_what_is_heard(page):
    said = heard(page, "ArrowRight", "PageDown")
    assert page.evaluate(CURSORS) == pytest.approx([values_told(said)[0]] * 2, abs=1e-6)
    assert page.inner_text(".readout >> nth=0") == said
    assert page.inner_text(".readout >> nth=1") == said.replace(" rad", " N·m")
    page.click("[data-line=simulated]")
    page.focus(".canvas")
    assert "measured" in heard(page, "ArrowRight") and "simulated" not in heard(page, "ArrowRight")
    page.click("[data-line=simulated]")


def test_plus_and_minus_zoom_at_the_cursor_and_zero_and_escape_show_everything(page):
    (whole, _) = page.evaluate(VIEW)
    heard(page, "ArrowRight", "PageDown", "PageDown", "+", "+")
    (low, high), other = page.evaluate(VIEW)
    assert high - low == pytest.approx(0.25 * (whole[1] - whole[0])) and other == [low, high]
    assert low < page.evaluate(CURSORS)[0] < high
    page.keyboard.press("-")
    assert np.ptp(page.evaluate(VIEW)[0]) == pytest.approx(2.0 * (high - low))
    for key in ("0", "Escape"):
        heard(page, "End", "+")
        assert page.evaluate(CURSORS)[0] is not None and page.evaluate(VIEW)[0] != whole
        assert heard(page, key) == "everything"
        assert page.evaluate(VIEW) == [whole, whole] and page.evaluate(CURSORS) == [None, None]


def test_what_is_in_view_follows_the_cursor(page):
    heard(page, "ArrowRight", "+", "+", "End")
    low, high = page.evaluate(VIEW)[0]
    assert low < TIME[-1] < high


def test_the_browsers_own_keys_stay_its_own(page):
    told = page.evaluate(
        "['ArrowLeft', '+', 'ArrowDown', 'Tab'].map((key, i) => document.activeElement.dispatchEvent("
        "new KeyboardEvent('keydown', { key, ctrlKey: i < 2, bubbles: true, cancelable: true })))"
    )
    assert told == [True] * 4 and page.evaluate(CURSORS) == [None, None]


def test_without_scripts_a_plot_is_its_still_picture_and_no_stop_of_the_tab_key(browser, report):
    page, _ = opened(browser, report, java_script_enabled=False, viewport={"width": 420, "height": 900})
    assert page.is_visible(".still svg")
    assert not page.is_visible(".canvas") and not page.is_visible(".said")
    for _ in range(5):
        page.keyboard.press("Tab")
        assert page.locator(".canvas:focus").count() == 0
    page.close()
    assert report.stat().st_size < 3_000_000


def test_the_difference_has_its_own_cursor(page):
    page.click("button[data-do=view]")
    page.wait_for_selector("[data-view=difference] canvas", state="attached")
    page.focus("[data-view=difference] .canvas")
    at, told = values_told(heard(page, "End"))
    assert at == pytest.approx(1.99) and told == pytest.approx({"simulated": 0.4 * WAVE[-1]}, abs=6e-4)
    page.click("button[data-do=view]")
