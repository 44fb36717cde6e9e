"""Tables of the documentation's site in a real browser: nothing of them is cut off on screens and on paper.

Chromium comes from the system's packages; where it is missing, these tests are skipped.
"""

import shutil
import sys
from pathlib import Path

import pytest

DOCS = Path(__file__).resolve().parents[2] / "docs"
sys.path.insert(0, str(DOCS / "_ext"))

playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
pytest.importorskip("sphinx", reason="sphinx is not installed")
pytest.importorskip("rclpy", reason="needs ROS 2: `make setup`, or source an installation")
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
pytestmark = [
    pytest.mark.long,  # the whole site is built
    pytest.mark.skipif(
        CHROMIUM is None, reason="no chromium: apt-get install chromium, then these tests run"
    ),
]
#: Width of the text on A4 with the margins of the site's style sheet, CSS pixels.
A4 = round((210 - 30) / 25.4 * 96)
SETTINGS = """
import sys
sys.path.insert(0, {extensions!r})
extensions = ["myst_parser", "stacked_tables"]
html_theme, html_static_path, html_css_files = "furo", [{static!r}], ["site.css"]
highlight_language, myst_heading_anchors = "none", 4
"""


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The written pages and the generated ones with tables, in the theme and style of the site."""
    import reference_pages
    from sphinx.cmd.build import build_main

    source, built = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("site")
    settings = SETTINGS.format(extensions=str(DOCS / "_ext"), static=str(DOCS / "_static"))
    (source / "conf.py").write_text(settings, encoding="utf-8")
    pages = {page.name: page.read_text(encoding="utf-8") for page in DOCS.glob("*.md")}
    pages |= {Path(name).name: text for name, text in reference_pages.node_pages().items()}
    pages |= {"faults.md": reference_pages.faults_page(), "commands.md": reference_pages.commands_page()}
    for name, text in pages.items():
        (source / name).write_text(text, encoding="utf-8")
    # Links to what is left out here are the concern of `make docs`.
    assert build_main(["-Q", "-b", "html", str(source), str(built)]) == 0
    return built


@pytest.fixture(scope="module")
def view():
    with playwright.sync_playwright() as started:
        # As root, which a container's tests often are, chromium has no sandbox of its own.
        browser = started.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox", "--disable-gpu"])
        yield browser.new_page()
        browser.close()


#: Cells and lines of output that reach beyond their box or the window, and a page that scrolls sideways.
CUT = """() => {
  const window_ = document.documentElement.clientWidth;
  const out = [];
  for (const e of document.querySelectorAll("article th, article td")) {
    if (!e.getClientRects().length) continue;
    const range = document.createRange();
    range.selectNodeContents(e);
    const reaches = Math.max(e.getBoundingClientRect().right, range.getBoundingClientRect().right);
    const box = (e.closest(".table-wrapper") || e.closest("article")).getBoundingClientRect();
    if (reaches > Math.min(box.right, window_) + 1) out.push(e.textContent.slice(0, 60));
  }
  for (const e of document.querySelectorAll("article .highlight-text pre"))
    if (e.scrollWidth > e.clientWidth + 1) out.push(e.textContent.slice(0, 60));
  const page = document.documentElement.scrollWidth - window_;
  return page > 0 ? [...out, `the page, by ${page} px`] : out;
}"""


VIEWS = [(420, "screen"), (800, "screen"), (900, "screen"), (1100, "screen"), (1280, "screen"), (A4, "print")]
NAMES = {"force_controller", "faults", "commands", "blind_benchmark"}


@pytest.fixture(scope="module")
def cut(site, view):
    """What is cut off, by page and view. Each page is opened once: that takes longer than to look at it."""
    found = {}
    for page in sorted(site.glob("*.html")):
        view.goto(page.as_uri())
        for width, media in VIEWS:
            view.set_viewport_size({"width": width, "height": 900})
            view.emulate_media(media=media)
            found[page.stem, width, media] = view.evaluate(CUT)
    return found


@pytest.mark.parametrize(("width", "media"), VIEWS)
def test_no_table_is_cut_off(cut, width, media):
    seen = {page: out for (page, *where), out in cut.items() if where == [width, media]}
    assert seen.keys() >= NAMES
    assert {page: out for page, out in seen.items() if out} == {}


def test_a_narrow_screen_has_the_heading_of_a_column_at_each_cell(site, view):
    view.set_viewport_size({"width": 420, "height": 900})
    view.emulate_media(media="screen")
    view.goto((site / "effects.html").as_uri())
    told = view.evaluate(
        "[...document.querySelectorAll('table.labelled tbody tr:first-child td:not(:first-child)')]"
        ".map(e => [e.dataset.label, getComputedStyle(e, '::before').content])"
    )
    labelled = [(label, shown) for label, shown in told if label]
    assert len(labelled) == 8 and all(shown == f'"{label}: "' for label, shown in labelled)
