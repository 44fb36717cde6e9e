"""The page is one file, escapes what it is told, and its pictures take the page's colours."""

import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_sysid.report import Page, Panel, Series, inline_svg, save_png, stacked_panels
from haptic_teleop_sysid.report.output import claim_output_directory, numbered_output_directory
from haptic_teleop_sysid.report.pictures import thinned

HOSTILE = '<script>alert("1")</script>'
TIME = np.linspace(0.0, 1.0, 50)


def picture(label="line"):
    return stacked_panels([Panel("panel", "rad", [Series(label, TIME, TIME), Series("other", TIME, -TIME)])])


def test_every_text_is_escaped():
    page = Page(HOSTILE, HOSTILE)
    page.verdict("good", HOSTILE)
    page.key_figure(HOSTILE, HOSTILE, HOSTILE)
    section = page.section(HOSTILE, HOSTILE)
    section.table([HOSTILE], [[HOSTILE]], HOSTILE)
    section.picture(picture(HOSTILE), HOSTILE)
    html = page.render()
    assert "<script" not in html
    assert html.count("&lt;script&gt;") >= 11


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
    assert "var(--s1)" in svg
    assert "var(--ink)" in svg
    assert "#1c2431" not in svg


def test_page_and_file_show_a_picture_in_the_one_layout_that_keeps_its_labels_inside(tmp_path, monkeypatch):
    figure = picture()
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


def test_thinning_keeps_the_extremes_and_the_ends():
    time = np.arange(100_000) * 1e-3
    value = np.random.default_rng(3).normal(size=time.size)
    value[43_210], value[77_777] = 50.0, -60.0
    thin_time, thin_value = thinned(time, value)
    assert len(thin_time) < 2_000
    assert (thin_value.max(), thin_value.min()) == (50.0, -60.0)
    assert (thin_time[0], thin_time[-1]) == (time[0], time[-1])
    assert np.all(np.diff(thin_time) > 0)


def test_a_gap_stays_a_gap_when_thinned():
    time = np.arange(10_000) * 1e-3
    value = np.where((time > 4.0) & (time < 6.0), np.nan, 1.0)
    thin_time, thin_value = thinned(time, value)
    inside = (thin_time > 4.1) & (thin_time < 5.9)
    assert np.isnan(thin_value[inside]).all()
    assert inside.any()


def test_numbers_in_tables_are_set_right():
    page = Page("t")
    page.section("s").table(["name", "value"], [["a", "-1.5"], ["b", "–"]])
    assert page.render().count('<td class="number">') == 2


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
