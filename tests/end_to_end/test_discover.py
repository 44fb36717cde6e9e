"""`discover` from outside, with the real diagnosis: a spring that the lab does not know of, in lockstep."""

import hashlib
import json
import subprocess
import sys

import numpy as np
import pytest

from haptic_teleop_sim.model import load_model

pytestmark = pytest.mark.no_graph


@pytest.mark.long
@pytest.mark.timeout(400)  # a cold cache compiles in three processes
def test_a_concealed_spring_is_named_and_the_plant_simulates_scenario_1_better_with_it(tmp_path):
    output = tmp_path / "found"
    command = [sys.executable, "-m", "haptic_teleop_control.front_door", "discover", "--seed", "1"]
    done = subprocess.run(
        [*command, "--lockstep", "--seconds", "6", "--output", str(output)],
        capture_output=True, text=True, timeout=380,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    label = (output / "label.json").read_bytes()
    digest = hashlib.sha256(label).hexdigest()
    sealed, diagnosing = done.stderr.index(digest), done.stderr.index("diagnosing")
    assert sealed < diagnosing < done.stderr.index("hidden: spring_to_ground @ stage1_motor")
    (hidden,) = json.loads(label)["truth"]
    content = json.loads((output / "discover.json").read_text())
    assert content["outcome"] == "right"
    augmented = load_model(output / "case" / "diagnosis" / "augmented_model.yaml")
    spring = next(e for e in augmented.effects if e.location == hidden["location"])
    assert spring.effect == hidden["effect"]
    assert spring.values["stiffness"] == pytest.approx(hidden["parameters"]["stiffness"], rel=0.2)
    for part in ("scenario1", "validation"):
        fits = {name: np.mean(list(values.values())) for name, values in content["fits"][part].items()}
        assert fits["augmented"] > 90.0
        assert fits["augmented"] > max(fits["lab"], fits["re-estimated"]) + 5.0
