"""Pages of the commands in a browser: nothing of them is cut off on screens and on paper, or illegible in the
dark."""

import json
import tarfile
import tempfile
from pathlib import Path

import numpy as np
import pytest
from joint_recordings import TRUTH, excitation, joint_recording, response
from measured_pages import A4, BROKEN_WORDS, CONTRASTS, FITS, LONG, WIDTHS, opened, unfolded
from page_audit import audited, walked
from scenario_recordings import Made, scenario

from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sysid.blind import command as blind
from haptic_teleop_sysid.blind.page import blind_page
from haptic_teleop_sysid.discovery.conclusion import _files
from haptic_teleop_sysid.discovery.outcome import Judgement
from haptic_teleop_sysid.discovery.overlay import AUGMENTED, LAB, REFITTED, runs_picture
from haptic_teleop_sysid.discovery.page import discovery_page
from haptic_teleop_sysid.report import Panel, Plot, Series
from haptic_teleop_sysid.runs.comparison import compare
from haptic_teleop_sysid.runs.comparison_pictures import comparison_pictures
from haptic_teleop_sysid.runs.comparison_report import comparison_page
from haptic_teleop_sysid.verification.overlay_report import Overlays
from haptic_teleop_sysid.verification.page import verification_page
from haptic_teleop_sysid.verification.pictures import stage_picture
from haptic_teleop_sysid.verification.run import examine

MODELS = (LAB, REFITTED, AUGMENTED)
SIGNALS = {"position": "rad", "velocity": "rad/s"}


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


def discovered():
    """The page of a discovery that names what was hidden, and a hard stop beside it."""
    droops = (0.05, 0.2, 0.1, 0.06)
    runs = [examine(scenario(Made(release=4.0, duration=5.0, droop=d)), "run") for d in droops]
    labels, roles = ["recorded", *MODELS], ["measured", "given", "re-estimated", "augmented"]
    scenario1 = runs_picture(runs[0], dict(zip(MODELS, runs[1:], strict=True)), "stage1")
    time = np.arange(2500) * 2e-3
    lines = [
        Series(name, time, size * np.sin(4.0 * time), role)
        for name, size, role in zip(labels, (1.0, 0.6, 0.8, 0.99), roles, strict=True)
    ]
    assert {f"{name}: motor" for name in labels} < {line.label for line in scenario1.legend()}
    note = "lab 37.5 %, re-estimated 43.8 %, augmented 99.1 %"
    units = {f"stage1_{p}.{s}": u for p in ("motor", "arm") for s, u in SIGNALS.items()}
    validation = Plot([Panel(name, unit, lines, note=note) for name, unit in units.items()])
    hidden = {"effect": "position_dependent_friction", "location": "stage1_motor"}
    hidden["parameters"] = {"amplitude": 0.1234, "wavelength": 0.5, "phase": -1.2}
    found = {"amplitude": {"value": 0.1219, "std": 0.003, "unit": "N*m"}}
    other = {"effect": "encoder_eccentricity", "location": "stage1_motor_encoder", "confidence": 0.1}
    said = [dict(hidden, parameters=found, confidence=0.9, alternatives=[other] * 3)]
    said.append({"effect": "hard_stop", "location": "stage1_arm", "parameters": {}, "confidence": 0.5})
    said[1]["alternatives"] = []
    names = [f"{one['effect']} @ {one['location']}" for one in said]
    diagnosis = {"verdict": "ambiguous", "findings": said}
    signals = ("motor_position", "arm_position", "motor_velocity", "environment_torque", "current")
    parts = {"scenario1": signals, "validation": units}
    content = {
        "seed": 1, "plant": "mujoco_sim", "mode": "lockstep", "digest": "5f" * 32, "files": _files(),
        "label": {"truth": [hidden]}, "notes": ["holes in the recording for validation, left out: 1"],
        "fits": {p: {m: dict.fromkeys(names, 90.0) for m in MODELS} for p, names in parts.items()},
    }  # fmt: skip
    judgement = Judgement("right", names[1:], [], diagnosis, {"said": names})
    return discovery_page(content, judgement, scenario1, validation.with_difference())


def benchmarked():
    """The page of the latest blind benchmark, as if a diagnosis had failed, and with a baseline."""
    archive = max((Path(__file__).parents[2] / "docs" / "blind").glob("seed_*.tar.xz"))
    with tarfile.open(archive) as packed, tempfile.TemporaryDirectory() as folder:
        wanted = json.load(packed.extractfile("plan.json"))
        asked = ",".join(f"{kind}={number}" for kind, number in wanted["cases"].items())
        arguments = ["--seed", str(wanted["seed"]), "--cases", asked, "--archive", str(archive), "--partial"]
        assert blind.main([*arguments, "--only", "score", "--output", folder]) == 0
        result = json.loads(Path(folder, "blind.json").read_text())
    result["summary"]["failed"] = [f"case0001: {LONG} cannot be read"]
    rate = {"rate": 0.5, "hits": 40, "of": 80}
    row = {"false_alarms": rate, "first_name": rate, "pairs": rate, "seconds": 1.5}
    result["baselines"] = {"sparse regression of the residual": row}
    return blind_page(result)


@pytest.fixture(scope="module", params=[verified, compared, discovered, benchmarked])
def report(request, tmp_path_factory):
    return request.param().write(tmp_path_factory.mktemp("report") / "report.html")


def test_the_pages_of_the_commands_fit_screens_and_paper_and_are_legible_in_the_dark(browser, report):
    """Each page is opened once: that takes longer than to look at it."""
    page, wrong = opened(
        browser, report, alive=False, color_scheme="dark", viewport={"width": 420, "height": 900}
    )
    unfolded(page)
    assert len(page.inner_text(".conclusion").split()) > 5
    heights = page.evaluate(
        "[...document.querySelectorAll('.fixed svg text')].map(t => t.getBoundingClientRect().height)"
    )
    assert min(heights, default=99.0) >= 8.0  # pixels; pictures scroll rather than shrink
    for width in WIDTHS:
        page.set_viewport_size({"width": width, "height": 900})
        assert page.evaluate(FITS) == {"page": 0, "out": []}, width
    contrasts = page.evaluate(CONTRASTS)
    assert len(contrasts) > 15
    assert {text: ratio for text, ratio in contrasts.items() if ratio < 4.5} == {}
    assert audited(page) == [] and walked(page) == []
    page.emulate_media(media="print")
    page.set_viewport_size({"width": A4, "height": 1000})
    assert page.evaluate(FITS)["page"] == 0
    cut = page.evaluate("[...document.querySelectorAll('table')].map(t => t.getBoundingClientRect().right)")
    assert len(cut) >= 3 and max(cut) <= A4 + 1
    assert page.evaluate(BROKEN_WORDS) == []
    assert wrong == []
    page.close()
