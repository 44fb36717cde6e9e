"""Pages of the commands in a browser: nothing of them is cut off on narrow screens and on paper."""

import pytest
from joint_recordings import TRUTH, excitation, joint_recording, response
from measured_pages import A4, FITS, LONG
from page_audit import audited
from scenario_recordings import Made, scenario

from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sysid.runs.comparison import compare
from haptic_teleop_sysid.runs.comparison_pictures import comparison_pictures
from haptic_teleop_sysid.runs.comparison_report import comparison_page
from haptic_teleop_sysid.verification.overlay_report import Overlays
from haptic_teleop_sysid.verification.page import verification_page
from haptic_teleop_sysid.verification.pictures import stage_picture
from haptic_teleop_sysid.verification.run import examine


def verified():
    """The page of two runs laid over each other."""
    runs = [examine(scenario(Made(release=4.0, duration=5.0)), name) for name in ("one", LONG)]
    pictures = {stage: stage_picture(runs, stage, ["one", LONG]) for stage in ("stage1", "stage2")}
    return verification_page(runs, ["one", LONG], {}, pictures, Overlays({}, {}, {}))


def compared():
    """The page of four models on one recording."""
    lab = Model("sfj", "stage1", "flexible_joint", TRUTH, fixed=("stiffness",))
    friction = Effect("coulomb_friction", "stage1_motor", {"torque": 0.1})
    current = excitation(190)  # too few for an analysis of residuals, which takes long
    models = {"lab.yaml": lab, f"{LONG}.yaml": lab.with_values({"motor_inertia": 0.1})}
    models |= {"augmented.yaml": lab.with_effects(friction), "fourth.yaml": lab}
    result = compare(models, {LONG: joint_recording(current, response(current))})
    return comparison_page(result, comparison_pictures(result))


@pytest.mark.parametrize("made", [verified, compared])
def test_the_pages_of_the_commands_fit_a_narrow_screen_and_a_sheet_of_paper(browser, made, tmp_path):
    report = made().write(tmp_path / "report.html")
    page = browser.new_page(viewport={"width": 420, "height": 900})
    page.goto(report.as_uri())
    assert page.evaluate(FITS) == {"page": 0, "out": []}
    assert audited(page) == []
    page.emulate_media(media="print")
    page.set_viewport_size({"width": A4, "height": 1000})
    assert page.evaluate(FITS)["page"] == 0
    cut = page.evaluate("[...document.querySelectorAll('table')].map(t => t.getBoundingClientRect().right)")
    assert len(cut) >= 3 and max(cut) <= A4 + 1
    page.close()
