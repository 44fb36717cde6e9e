"""The models in the simulated plant: scenario 1 once more in lockstep, laid over its recording.

Three models of the stage in question: the lab's as it was, the same structure re-estimated, and the augmented
one. The step from the second to the third is the found physics' own; the step from the first to the second is
the re-estimation's.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from haptic_teleop_control.recording import read_recording
from haptic_teleop_control.robots import STAGES
from haptic_teleop_sim.lockstep import load_scenario, record_scenario
from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.diagnosis.inputs.uses import with_command
from haptic_teleop_sysid.discovery.campaign import scenario_content, with_plant, without_wall, write_files
from haptic_teleop_sysid.recordings.dataset import load_dataset
from haptic_teleop_sysid.report import Panel, Plot, Series
from haptic_teleop_sysid.runs.comparison_pictures import percent_text, within
from haptic_teleop_sysid.simulation.fit import choose_windows, fit_percent, simulated_fit
from haptic_teleop_sysid.verification.pictures import stage_picture
from haptic_teleop_sysid.verification.run import Run, agreement, examine

LAB, REFITTED, AUGMENTED = "lab", "re-estimated", "augmented"
_ROLES = {LAB: "given", REFITTED: "re-estimated", AUGMENTED: "augmented"}
Fits = dict[str, float]


@dataclass(frozen=True)
class Overlay:
    """fits: model -> signal -> fit in percent to the recorded scenario, counted from the command's onset.
    picture: the runs of all models over the recording's. notes: what was different.
    """

    fits: dict[str, Fits]
    picture: Plot
    notes: list[str]


def simulate_scenario1(
    stage: str, models: Mapping[str, Model], others: Mapping[str, Model], recording: Path, folder: Path
) -> Overlay:
    """Run scenario 1 with each of `models` of `stage` (by LAB, REFITTED, AUGMENTED) and compare.

    others: the lab's models of the stages. recording: of the scenario with the real robot. In `folder` stay
    the parameter files, the models and the simulated recordings, to be run and looked at again.
    """
    real = examine(read_recording(recording), "recording")
    notes, runs = [], {}
    for name, model in models.items():
        content = scenario_content()
        if any((e.effect, e.location) == ("hard_stop", model.location("arm")) for e in model.effects):
            content = without_wall(content, stage)
            notes.append(f"the {name} model has a stop at the arm itself, so it was run without the wall")
        files = {one: f"{name}_{one}" for one in STAGES}
        plants = {files[one]: model if one == stage else others[one] for one in STAGES}
        named = {one: f"{file}.yaml" for one, file in files.items()}
        write_files(folder, {name: with_plant(content, "sfj_sim", named, 1, disturbed=False)}, plants)
        scenario = load_scenario(folder / f"{name}.yaml")
        result = record_scenario(scenario, folder / name)
        notes += [
            f"the {name} model ran away in {count} samples and was put back to rest"
            for what, count in result.counts.items()
            if what == "sfj diverged"
        ]
        runs[name] = examine(read_recording(folder / name), name)
    fits = {name: _fits(real, run, stage) for name, run in runs.items()}
    return Overlay(fits, runs_picture(real, runs, stage), notes)


def _fits(real: Run, simulated: Run, stage: str) -> Fits:
    """Those that `verify` compares, and the current: where the loop keeps the motion right in spite of what
    is missing, the current is what betrays it."""
    fits = dict(agreement(real, simulated).get(stage, {}))
    one, other = real.stages[stage], simulated.stages[stage]
    time, own = one.time - real.onset, other.time - simulated.onset
    common = (time >= own[0]) & (time <= own[-1])
    if fits:
        fits["current"] = fit_percent(one.current[common], np.interp(time[common], own, other.current))
    return fits


def runs_picture(real: Run, runs: Mapping[str, Run], stage: str) -> Plot:
    """The ``runs`` with each model (by LAB, REFITTED, AUGMENTED) over the recorded one."""
    return stage_picture(
        [real, *runs.values()],
        stage,
        ["recorded", *runs],
        remove_delay=True,
        roles=["measured", *(_ROLES[name] for name in runs)],
    )


def open_loop(models: Mapping[str, Model], recording: Path) -> tuple[dict[str, Fits], Plot]:
    """model -> signal -> simulated fit in percent on an acquisition, and a picture of the positions.

    Driven by the command, as the diagnosis was, over the same windows for all models, those of the
    re-estimated one.
    """
    first = models[REFITTED]
    data = with_command(load_dataset(read_recording(recording), first, recording.name, True))
    windows = choose_windows(first, data)
    fits = {name: simulated_fit(model, data, windows) for name, model in models.items()}
    measured, panels = data.signals(), []
    for signal in measured:
        lines = [Series("recorded", data.time, measured[signal])]
        for name, role in _ROLES.items():
            values = within(fits[name].simulated[signal], measured[signal])
            lines.append(Series(name, data.time, values, role))
        told = ", ".join(f"{name} {percent_text(fits[name].percent[signal])} %" for name in _ROLES)
        panels.append(Panel(signal, data.units()[signal], lines, note=told))
    return {name: fit.percent for name, fit in fits.items()}, Plot(panels).with_difference()


def mean(fits: Fits) -> float:
    """Mean over the signals, percent; NaN without any."""
    return float(np.mean(list(fits.values()))) if fits else float("nan")
