"""One discovery from the draw to the report; what one step leaves the next one needs."""

from __future__ import annotations

import json
import secrets
import tempfile
import time
from pathlib import Path
from typing import Any

from haptic_teleop_control.robots import SFJ_RATE_HZ, STAGES
from haptic_teleop_sim.model import model_from_mapping
from haptic_teleop_sysid.blind.runner import FRONT_DOOR, diagnose
from haptic_teleop_sysid.blind.sealing import open_labels, seal
from haptic_teleop_sysid.discovery import campaign
from haptic_teleop_sysid.discovery.conclusion import CASE, LABEL, OPENED, simulate_and_report
from haptic_teleop_sysid.discovery.drawing import Drawn, draw
from haptic_teleop_sysid.discovery.outcome import judge
from haptic_teleop_sysid.discovery.steps import Live, Say, Settings, StepFailed, Steps, record

TIMEOUT = 1800.0
"""s after which a diagnosis has failed."""


def discover(settings: Settings, output: Path, say: Say, live: Live) -> dict[str, Any]:
    """Run the whole chain into the directory `output`; return the content of discover.json. live: for the
    diagnosis' lines of progress.

    Raises StepFailed when a step fails. A diagnosis that is wrong is none.
    """
    began = time.perf_counter()
    steps, secret = Steps(say), secrets.token_hex(32)
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
        record(steps, settings, plant, folder, case, recording)
    with steps.step("diagnosing, in a process of its own, with two recordings and the lab's model"):
        notes, command = [], FRONT_DOOR
        for which in campaign.ACQUISITIONS:
            # A machine that is busy with other things loses states; the other samples are as good as ever.
            if count := campaign.holes(case / which):
                notes.append(f"holes in the recording for {which}, left out: {count}")
                say(f"      {notes[-1]}")
                command = (*FRONT_DOOR, "--allow-gaps")
        with live() as tell:
            # Its progress alone: why it failed is told in the end.
            ran = diagnose(case, command, TIMEOUT, lambda s: tell(s) if s.startswith("diagnose: ") else None)
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
    return simulate_and_report(steps, settings, output, drawn, opened, digest, judgement, notes, began)


def _contents(drawn: Drawn, plant: str, settings: Settings) -> dict[str, campaign.Content]:
    files = {stage: f"{stage}.yaml" for stage in STAGES}
    found = {}
    for number, which in enumerate(campaign.ACQUISITIONS, start=1):
        content = campaign.acquisition_content(drawn.stage, which, settings.seconds)
        found[which] = campaign.with_plant(content, plant, files, 10 * settings.seed + number)
    content = campaign.scenario_content()
    found[campaign.SCENARIO_RUN] = campaign.with_plant(content, plant, files, 10 * settings.seed + 3)
    return found
