"""docs/add_an_effect.md: its entry, added as it stands, is an effect like any other."""

import re
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from stepped_machines import DT, RIGID, drive, record

from haptic_teleop_sim.effects import EFFECTS, EffectEntry, EffectParameter, locations
from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.group_search import search_groups
from haptic_teleop_sysid.diagnosis.inputs.scales import recording_scales

PAGE = Path(__file__).resolve().parents[2] / "docs" / "add_an_effect.md"
DRAG = 0.25


@pytest.fixture
def added(monkeypatch):
    """The page's entry, among the effects."""
    (text,) = re.findall(r"^```python\n(.*?)^```$", PAGE.read_text(encoding="utf-8"), re.M | re.S)
    names = {"EffectEntry": EffectEntry, "EffectParameter": EffectParameter}
    exec(text, names)  # our own page
    (entry,) = [value for value in names.values() if isinstance(value, EffectEntry)]
    monkeypatch.setitem(EFFECTS, entry.name, entry)
    return entry


def dragged(seed):
    """A mass with viscous damping and a drag that grows with the cube of its speed."""
    torque = drive(seed, 2.0 + 0.5 * seed)
    t = DT * np.arange(len(torque))

    def rates(at, state):
        acting = torque[min(int(at / DT + 1e-9), len(torque) - 1)]
        return [state[1], (acting - 0.35 * state[1] - DRAG * state[1] ** 3) / 0.14]

    found = solve_ivp(rates, (0.0, t[-1]), [0.0, 0.0], t_eval=t, max_step=DT, rtol=1e-7, atol=1e-9)
    return record(torque, found.y[:1].T, 1e-5)


@pytest.mark.long
def test_the_entry_is_found_by_the_inverse_dynamics_without_a_word_about_it_anywhere_else(added):
    assert locations(added.name, "rigid_body") == ("motor",)
    recordings = [dragged(seed) for seed in (0, 1)]
    scales = recording_scales(RIGID, recordings)
    found = search_groups(RIGID, recordings[:1], recordings[1:], scales)
    (effect,) = found.levels[0][0].effects
    assert (effect.effect, effect.location) == (added.name, "j_motor")
    assert effect.parameters["coefficient"] == pytest.approx(DRAG, rel=0.05)
