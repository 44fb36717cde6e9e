"""The page is one file, escapes what it is told, says first what matters, and its pictures take the page's
colours."""

import json
import re
import xml.etree.ElementTree as ElementTree
from html.parser import HTMLParser

import numpy as np
import pytest
from matplotlib.layout_engine import ConstrainedLayoutEngine

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_sysid.report import Page, Panel, Plot, Series, histogram, inline_svg, save_png, still
from haptic_teleop_sysid.report.output import claim_output_directory, numbered_output_directory

HOSTILE = '<script>alert("1")</script>'
TIME = np.linspace(0.0, 1.0, 50)


def plot(label="line"):
    return Plot([Panel("panel", "rad", [Series(label, TIME, TIME), Series("other", TIME, -TIME, "given")])])


def picture(label="line"):
    return still(plot(label))


class Scripts(HTMLParser):
    """The scripts of a page as (type, text)."""

    def __init__(self, html):
        super().__init__()
        self.found, self.inside = [], False
        self.feed(html)

    def handle_starttag(self, tag, attributes):
        self.inside = tag == "script"
        if self.inside:
            self.found.append([dict(attributes).get("type", ""), ""])

    def handle_endtag(self, tag):
        self.inside = self.inside and tag != "script"

    def handle_data(self, data):
        if self.inside:
            self.found[-1][1] += data


def test_every_text_is_escaped_and_no_text_becomes_a_script():
    page = Page(HOSTILE, HOSTILE)
    page.conclude("good", HOSTILE, HOSTILE)
    page.verdict("fair", HOSTILE + "!")
    page.key_figure(HOSTILE, HOSTILE, HOSTILE)
    section = page.section(HOSTILE, HOSTILE)
    section.table([HOSTILE], [[HOSTILE]], HOSTILE)
    section.picture(picture(HOSTILE), HOSTILE)
    section.plot(plot(HOSTILE), HOSTILE)
    section.commands([(HOSTILE, HOSTILE)])
    html = page.render()
    assert html.count("&lt;script&gt;") >= 15
    own = Scripts(html).found
    assert [kind for kind, _ in own] == ["application/json", "application/gzip+base64", ""]
    assert all("alert(" not in text for kind, text in own if kind != "application/json")
    assert HOSTILE not in html
    assert HOSTILE in json.dumps(json.loads(own[0][1])["response"]["document"]).replace('\\"', '"')


def test_a_page_says_first_what_happened_and_what_to_do_and_folds_away_what_is_good():
    page = Page("t")
    page.conclude("bad", "It failed.", "mend it.")
    page.verdict("good", "Something went well.")
    page.verdict("fair", "Something is odd.")
    page.verdict("bad", "It failed.")  # the conclusion says so already
    html = page.render()
    order = [html.index(text) for text in ("It failed.", "mend it.", "Something is odd.", "<details>")]
    assert order == sorted(order) and html.index("Something went well.") > html.index("<details>")
    assert html.count("It failed.") == 1


def test_without_bokeh_pages_have_still_pictures(monkeypatch):
    monkeypatch.setattr("haptic_teleop_sysid.report.page.available", lambda: False)
    page = Page("t")
    page.section("s").plot(plot(), "caption")
    html = page.render()
    assert html.count('<svg role="img" aria-label="caption"') == 1 and "application/json" not in html


def test_without_a_conclusion_the_worst_verdict_stands_first():
    page = Page("t")
    page.verdict("good", "A good one.")
    page.verdict("bad", "A bad one.")
    html = page.render()
    assert 0 < html.index("A bad one.") < html.index("A good one.")
    assert '<p class="conclusion bad">' in html


def test_the_contents_lead_to_every_section():
    page = Page("t")
    for title in ("one", "two", "three"):
        page.section(title, "text", folded=title == "two")
    html = page.render()
    wanted = re.findall(r'<a href="#(\w+)">(\w+)</a>', html)
    assert [title for _, title in wanted] == ["one", "two", "three"]
    assert all(html.count(f'id="{place}"') == 1 for place, _ in wanted)


def test_a_page_reaches_for_nothing_outside_itself():
    page = Page("t")
    page.section("s").plot(plot(), "caption").picture(picture(), "caption")
    html = page.render()
    assert "default-src 'none'" in html
    assert not re.search(r'<(?:link|img|iframe)|\bsrc=|href="(?!#)|url\((?!#)|@import', html)


def test_pictures_are_well_formed_and_their_identifiers_do_not_collide():
    first, second = inline_svg(picture(), "a"), inline_svg(picture(), "b")
    identifiers = []
    for svg in (first, second):
        root = ElementTree.fromstring(svg)
        own = {element.get("id") for element in root.iter() if element.get("id")}
        used = {
            value[1:]
            for element in root.iter()
            for key, value in element.attrib.items()
            if key.endswith("href") and value.startswith("#")
        }
        assert used <= own
        identifiers.append(own)
    assert not identifiers[0] & identifiers[1]


def test_pictures_bear_no_fixed_ink_so_that_they_are_legible_in_the_dark():
    svg = inline_svg(picture(), "a")
    assert "var(--given)" in svg and "var(--measured)" in svg
    assert "var(--ink)" in svg
    assert not re.search(r"#(?:1c243[12]|c95500)", svg)


def test_page_and_file_show_a_picture_in_the_one_layout_that_keeps_its_labels_inside(tmp_path, monkeypatch):
    figure = histogram([("one", TIME), ("other", TIME)], "time (s)", 1.0)
    layouts = []
    execute = type(figure.get_layout_engine()).execute
    monkeypatch.setattr(
        type(figure.get_layout_engine()), "execute", lambda *given: layouts.append(execute(*given))
    )
    before = figure.axes[0].get_position().bounds
    inline_svg(figure, "a")
    laid_out = figure.axes[0].get_position().bounds
    save_png(figure, tmp_path / "a.png")
    assert len(layouts) == 1
    assert figure.axes[0].get_position().bounds == laid_out != before
    box = figure.get_tightbbox()  # inches
    assert box.x0 >= 0.0 and box.y0 >= 0.0 and box.x1 <= 10.0 and box.y1 <= figure.get_figheight()


def test_a_plot_is_laid_out_once_for_page_and_file_and_as_if_each_had_done_so(tmp_path, monkeypatch):
    layouts = []
    execute = ConstrainedLayoutEngine.execute
    monkeypatch.setattr(
        ConstrainedLayoutEngine, "execute", lambda *given: layouts.append(execute(*given))
    )
    shown = plot()
    save_png(shown, tmp_path / "a.png")
    svg = inline_svg(still(shown, 100), "a")
    assert len(layouts) == 1
    assert svg == inline_svg(still(plot(), 100), "a")
    assert len(layouts) == 2, "another plot has another layout"


def test_numbers_in_tables_are_set_right():
    page = Page("t")
    page.section("s").table(["name", "value"], [["a", "-1.5"], ["b", "–"]])
    assert page.render().count('<td class="number">') == 2
    assert page.render().count('<th scope="row">') == 2


def test_a_directory_with_a_result_is_taken_only_when_asked(tmp_path):
    (tmp_path / "r.json").write_text("{}")
    with pytest.raises(ConfigurationError, match="--overwrite"):
        claim_output_directory(tmp_path, "r.json")
    assert claim_output_directory(tmp_path, "r.json", overwrite=True) == tmp_path
    assert claim_output_directory(tmp_path, "other.json") == tmp_path
    with pytest.raises(ConfigurationError, match="--output"):
        claim_output_directory(tmp_path / "r.json", "r.json")


def test_numbered_directories_follow_each_other(tmp_path):
    wanted = tmp_path / "demo"
    names = []
    for _ in range(3):
        directory = numbered_output_directory(wanted)
        (directory / "file").touch()
        names.append(directory.name)
    assert names == ["demo", "demo-2", "demo-3"]
    (tmp_path / "file").touch()
    with pytest.raises(ConfigurationError, match="is a file: choose another --output"):
        numbered_output_directory(tmp_path / "file")
