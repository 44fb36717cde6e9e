"""From physics without a name to an effect with one, on three kinds: diagnose, add the suggested entry to a
copy of the packages, diagnose the same recordings with that copy again.

    python tests/studies/suggested_laws.py DIR [WORD]      # WORD: kinds that have it in their name

Prints for each kind the law, the mean simulated fit of the validation recording (re-estimated, with the map,
with the added effect), and what the second diagnosis finds. Recordings: `tests/unit/own_joint.py`.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import yaml

REPOSITORY = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(REPOSITORY / "tests/unit"))

from joint_recordings import filtered_velocity  # noqa: E402
from own_joint import DT, TRUTH, moved  # noqa: E402

from haptic_teleop_control.recording import JointStateSeries, write_recording  # noqa: E402

KINDS = {
    "detent at the arm": (3, 0.3, 0.25, 0.2),
    "cubic drag at the motor": (4, 0.25),
    "cubic spring at the arm": (5, 1.2, 0.3),
}
START, PARTS = 1_760_000_000_000_000_000, ("estimation", "validation")
JOINTS = ("stage1_motor", "stage1_arm", "stage2_motor", "stage2_arm")
WHERE = "haptic_teleop_sim/haptic_teleop_sim/effects"


def record(folder: Path, law: tuple[float, ...]) -> None:
    """Write both recordings and the lab's model."""
    for number, part in enumerate(PARTS):
        current, angles = moved(11 + number, *law, seconds=24.0)
        stamp = START + 10**11 * number + np.arange(len(current), dtype=np.int64) * round(DT * 1e9)
        position, velocity, effort = (np.zeros((len(current), 4)) for _ in range(3))
        position[:, :2] = angles
        for i in (0, 1):
            velocity[:, i] = filtered_velocity(angles[:, i], DT)
        constant = TRUTH["torque_constant"]
        effort[:, 0] = constant * np.concatenate([[0.0], current[:-1]])
        command = np.column_stack([constant * current, 0.0 * current])
        states = JointStateSeries(stamp, stamp, JOINTS, position, velocity, effort)
        commands = JointStateSeries(stamp, stamp, (JOINTS[0], JOINTS[2]), effort=command)
        topics = {"/sfj/joint_states": states, "/sfj/effort_command": commands}
        write_recording(folder / part, topics, experiment={"kind": "open loop, sines"})
    parameters = {n: v * (1.0 if n in ("torque_constant", "stiffness") else 1.08) for n, v in TRUTH.items()}
    model = {
        "haptic_teleop_model": 1, "robot": "sfj", "joint": "stage1", "structure": "flexible_joint",
        "parameters": parameters, "fixed": ["stiffness", "torque_constant"],
    }  # fmt: skip
    (folder / "model.yaml").write_text(yaml.safe_dump(model))


def diagnosed(folder: Path, sources: Path, name: str) -> dict:
    """Diagnose with the packages in ``sources``; the content of diagnosis.json."""
    front = [sys.executable, "-m", "haptic_teleop_control.front_door", "diagnose"]
    bags = [f"--{part}={folder / part}" for part in PARTS]
    paths = os.pathsep.join(str(p) for p in sorted(sources.iterdir()) if p.is_dir())
    command = [*front, f"--model={folder / 'model.yaml'}", *bags, f"--output={folder / name}", "--overwrite"]
    subprocess.run(command, check=True, env={**os.environ, "PYTHONPATH": paths}, stdout=subprocess.DEVNULL)
    return json.loads((folder / name / "diagnosis.json").read_text())


def with_entry(folder: Path, file: Path) -> Path:
    """A copy of the packages with the suggested entry added, as the file's text says."""
    sources = folder / "src"
    shutil.rmtree(sources, ignore_errors=True)
    shutil.copytree(REPOSITORY / "src", sources, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(file, sources / WHERE / file.name)
    registry = sources / WHERE / "registry.py"
    text = registry.read_text()
    registry.write_text(text.replace("sensor, torque_map", f"sensor, {file.stem}, torque_map"))
    return sources


def fit(content: dict, model: str) -> float:
    """Mean simulated fit of the validation recording, percent."""
    return float(np.mean(list(content["fit"][model]["validation"].values())))


def main() -> None:
    """Run the kinds that were asked for."""
    chosen = {kind: law for kind, law in KINDS.items() if "".join(sys.argv[2:3]) in kind}
    for kind, law in chosen.items():
        folder = Path(sys.argv[1]) / kind.replace(" ", "_")
        folder.mkdir(parents=True, exist_ok=True)
        record(folder, law)
        first = diagnosed(folder, REPOSITORY / "src", "first")
        found = first["torque_map"]["law"]
        second = diagnosed(folder, with_entry(folder, folder / "first" / found["file"]), "second")
        named = [(f["effect"], f["location"], f["confidence"]) for f in second["findings"]]
        print(f"{kind}: {first['verdict']}, {found['formula']}")
        fits = fit(first, "baseline"), fit(first, "augmented"), fit(second, "augmented")
        print("  validation {:.1f} -> map {:.1f} -> effect {:.1f} %".format(*fits), end="; ")
        print(f"then {second['verdict']} {named}", flush=True)


if __name__ == "__main__":
    main()
