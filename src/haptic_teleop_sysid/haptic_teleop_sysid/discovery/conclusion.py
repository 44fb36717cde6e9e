"""The last steps of a discovery: the found model in the simulated plant, and the report."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path
from typing import Any

from haptic_teleop_sim.model import Model, load_model
from haptic_teleop_sysid.discovery import campaign
from haptic_teleop_sysid.discovery.drawing import Drawn
from haptic_teleop_sysid.discovery.outcome import Judgement
from haptic_teleop_sysid.discovery.overlay import AUGMENTED, LAB, REFITTED, open_loop, simulate_scenario1
from haptic_teleop_sysid.discovery.page import discovery_page
from haptic_teleop_sysid.discovery.steps import Settings, Steps
from haptic_teleop_sysid.report import save_png
from haptic_teleop_sysid.results import tool_version, write_json

RESULT = "discover.json"
CASE, OPENED, SIMULATED, LABEL = "case", "opened", "simulated", "label.json"


def simulate_and_report(
    steps: Steps,
    settings: Settings,
    output: Path,
    drawn: Drawn,
    label: dict[str, Any],
    digest: str,
    judgement: Judgement,
    notes: list[str],
    began: float,
) -> dict[str, Any]:
    """Simulate, compare and report into `output`, when diagnosis and label lie there; return the content of
    discover.json. began: `time.perf_counter` when the chain did."""
    stage, case = drawn.stage, output / CASE
    with steps.step("scenario 1 with the lab's, the re-estimated and the augmented model in the plant"):
        models = _models(drawn.lab[stage], case, judgement)
        (output / SIMULATED).mkdir()
        recording = output / campaign.SCENARIO_RUN
        overlay = simulate_scenario1(stage, models, drawn.lab, recording, output / SIMULATED)
        validation, picture = open_loop(models, case / "validation")
    with steps.step("writing the report"):
        content = {
            "schema": 1,
            "seed": settings.seed,
            "plant": label["plant"],
            "mode": "lockstep" if settings.lockstep else "ROS 2 graph",
            "digest": digest,
            "label": label,
            "verdict": judgement.diagnosis["verdict"],
            "said": judgement.score["said"],
            "stated": judgement.score["stated"],
            "outcome": judgement.outcome,
            "right": judgement.right,
            "sentence": judgement.sentence,
            "not_hidden": judgement.beside,
            "parameters": judgement.parameters,
            "fits": {"scenario1": overlay.fits, "validation": validation},
            "notes": [*notes, *_kept(judgement.diagnosis), *overlay.notes],
            "diagnosis": judgement.diagnosis,
            "files": _files(),
            "runtime_s": round(time.perf_counter() - began, 1),
            "version": tool_version(),
        }
        save_png(overlay.picture, output / "scenario1.png")
        save_png(picture, output / "validation.png")
        discovery_page(content, judgement, overlay.picture, picture).write(output / "report.html")
        write_json(output / RESULT, content)
    return content


def _models(lab: Model, case: Path, judgement: Judgement) -> dict[str, Model]:
    found = case / "diagnosis" / "augmented_model.yaml"
    refitted = lab.with_values(judgement.diagnosis["baseline_parameters"])
    return {LAB: lab, REFITTED: replace(refitted, source="re-estimated"), AUGMENTED: load_model(found)}


def _kept(diagnosis: dict[str, Any]) -> list[str]:
    """A note where the diagnosis kept the lab's model, because nothing it found simulates as well."""
    if diagnosis.get("augmented_model", {}).get("holds") != "given":
        return []
    return [
        "neither the re-estimated model nor what was found simulates the validation as well as the lab's "
        "model does, so the diagnosis kept that: the augmented model is the lab's"
    ]


def _files() -> dict[str, str]:
    diagnosis = f"{CASE}/diagnosis"
    return {
        "what diagnose was given": f"{CASE}/model.yaml, {CASE}/estimation, {CASE}/validation",
        "the diagnosis' own report": f"{diagnosis}/report.html",
        "the augmented model": f"{diagnosis}/augmented_model.yaml",
        "the opened label": LABEL,
        "the robot and its experiments, to be run again": f"{OPENED}/",
        "scenario 1 as recorded": campaign.SCENARIO_RUN,
        "scenario 1 as simulated, and its files": f"{SIMULATED}/",
    }
