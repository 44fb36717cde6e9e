"""The steps of one discovery, in order, each with a line of progress; what one leaves the next one needs."""

from __future__ import annotations

import json
import secrets
import shutil
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from haptic_teleop_control.errors import HapticTeleopError
from haptic_teleop_control.robots import SFJ_RATE_HZ, STAGES
from haptic_teleop_sim.model import Model, load_model, model_from_mapping
from haptic_teleop_sysid.blind.runner import FRONT_DOOR, diagnose
from haptic_teleop_sysid.blind.sealing import open_labels, seal
from haptic_teleop_sysid.discovery import campaign
from haptic_teleop_sysid.discovery.drawing import Drawn, draw
from haptic_teleop_sysid.discovery.outcome import Judgement, judge
from haptic_teleop_sysid.discovery.overlay import AUGMENTED, LAB, REFITTED, open_loop, simulate_scenario1
from haptic_teleop_sysid.discovery.page import discovery_page
from haptic_teleop_sysid.report import save_png
from haptic_teleop_sysid.results import tool_version, write_json

RESULT = "discover.json"
CASE, OPENED, SIMULATED, LABEL = "case", "opened", "simulated", "label.json"
TIMEOUT = 1800.0
"""s after which a diagnosis has failed."""
STEPS = 8
Say = Callable[[str], None]


class StepFailed(Exception):
    """A step did not do what the next one needs; the message says which and why."""


@dataclass(frozen=True)
class Settings:
    """seed: of the draw. plant: the node of the real robot, or None: MuJoCo where it can express the drawn
    effect. mujoco: whether MuJoCo may be used. lockstep: no ROS, no clock. seconds: length of an acquisition.
    """

    seed: int
    plant: str | None
    mujoco: bool
    lockstep: bool
    seconds: float


class _Steps:
    """Counts the steps, says what begins, and gives an error the name of its step."""

    def __init__(self, say: Say) -> None:
        self._say, self._number = say, 0

    @contextmanager
    def step(self, title: str) -> Iterator[None]:
        self._number += 1
        self._say(f"[{self._number}/{STEPS}] {title}")
        try:
            yield
        except (HapticTeleopError, OSError) as error:
            raise StepFailed(f"{title}: {error}") from error


def discover(settings: Settings, output: Path, say: Say) -> dict[str, Any]:
    """Run the whole chain into the directory `output`; return the content of discover.json.

    Raises StepFailed when a step fails. A diagnosis that is wrong is none.
    """
    began = time.perf_counter()
    steps, secret = _Steps(say), secrets.token_hex(32)
    case, recording = output / CASE, output / campaign.SCENARIO_RUN
    with steps.step("drawing a robot and sealing what is hidden in it"):
        case.mkdir()
        inputs, limits = campaign.planned(settings.seconds)
        only = settings.plant == "mujoco_sim"
        drawn = draw(settings.seed, inputs, limits, 1.0 / SFJ_RATE_HZ, only)
        plant = settings.plant or ("mujoco_sim" if settings.mujoco and drawn.in_mujoco else "sfj_sim")
        label = drawn.label(secrets.token_hex(16), settings.seed, plant)
        digest = seal(label, output, secret)
        drawn.lab[drawn.stage].save(case / "model.yaml")
        say(f"      label sealed, SHA-256 {digest}")
    contents = _contents(drawn, plant, settings)
    with tempfile.TemporaryDirectory(prefix="discover-") as secret_place:
        folder = Path(secret_place)
        campaign.write_files(folder, contents, drawn.models)
        _record(steps, settings, plant, folder, case, recording, say)
    with steps.step("diagnosing, in a process of its own, with two recordings and the lab's model"):
        notes, command = [], FRONT_DOOR
        for which in campaign.ACQUISITIONS:
            # A machine that is busy with other things loses states; the other samples are as good as ever.
            if count := campaign.holes(case / which):
                notes.append(f"holes in the recording for {which}, left out: {count}")
                say(f"      {notes[-1]}")
                command = (*FRONT_DOOR, "--allow-gaps")
        ran = diagnose(case, command, TIMEOUT)
        if ran["status"] != "0":
            words = f": {ran['message']}" if ran["message"] else ""
            raise StepFailed(f"diagnose ended with exit status {ran['status']}{words}")
        say(f"      verdict reached after {ran['seconds']:.0f} s")
    with steps.step("opening the label"):
        opened = open_labels(output, secret, [], digest)
        (output / LABEL).write_text(json.dumps(opened, sort_keys=True))  # the very text of the digest
        (output / OPENED).mkdir()
        revealed = {stage: model_from_mapping(one, "the label") for stage, one in opened["models"].items()}
        campaign.write_files(output / OPENED, contents, revealed)
        judgement = judge(opened, case)
        hidden = opened["truth"][0]
        if "baseline_parameters" not in judgement.diagnosis:
            reason = judgement.diagnosis.get("message", "it states no baseline_parameters")
            raise StepFailed(f"diagnosis.json cannot be used: {reason}")
        say(f"      hidden: {hidden['effect']} @ {hidden['location']}; {judgement.sentence}")
    return _simulate_and_report(steps, settings, output, drawn, opened, digest, judgement, notes, began)


def _contents(drawn: Drawn, plant: str, settings: Settings) -> dict[str, campaign.Content]:
    files = {stage: f"{stage}.yaml" for stage in STAGES}
    found = {}
    for number, which in enumerate(campaign.ACQUISITIONS, start=1):
        content = campaign.acquisition_content(drawn.stage, which, settings.seconds)
        found[which] = campaign.with_plant(content, plant, files, 10 * settings.seed + number)
    content = campaign.scenario_content()
    found[campaign.SCENARIO_RUN] = campaign.with_plant(content, plant, files, 10 * settings.seed + 3)
    return found


def _record(
    steps: _Steps, settings: Settings, plant: str, folder: Path, case: Path, recording: Path, say: Say
) -> None:
    how = "in lockstep" if settings.lockstep else "in the ROS 2 graph"

    def attempt(what: str, run: Callable[[], int], target: Path) -> None:
        status = run()
        if status and not settings.lockstep:
            # In real time a machine that is busy elsewhere may stop the nodes; that proves nothing.
            say(f"      ended with exit status {status}; once more")
            shutil.rmtree(target, ignore_errors=True)
            status = run()
        if status or not target.is_dir():
            raise StepFailed(f"{what} ended with exit status {status}")

    for which in campaign.ACQUISITIONS:
        with steps.step(f"acquisition for {which}, {settings.seconds:g} s open loop, {how}, by {plant}"):
            file, target = folder / f"{which}.yaml", case / which
            run = partial(campaign.run_acquisition, file, target, settings.lockstep)
            attempt(f"the acquisition for {which}", run, target)
    with steps.step(f"scenario 1, force control with contact, {how}, by {plant}"):
        file = folder / f"{campaign.SCENARIO_RUN}.yaml"
        run = partial(campaign.run_scenario1, file, plant, recording, settings.lockstep)
        attempt("scenario 1", run, recording)


def _simulate_and_report(
    steps: _Steps,
    settings: Settings,
    output: Path,
    drawn: Drawn,
    label: dict[str, Any],
    digest: str,
    judgement: Judgement,
    notes: list[str],
    began: float,
) -> dict[str, Any]:
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
            "notes": [*notes, *overlay.notes],
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
