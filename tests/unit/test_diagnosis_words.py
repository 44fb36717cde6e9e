"""What a diagnosis says: sentences, settings, version."""

import importlib.metadata
import math
from dataclasses import replace

import pytest
from diagnosis_rigs import MODEL, explanation, fit_of, joint_record

from haptic_teleop_sim.effects import EFFECTS, locations
from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid import results
from haptic_teleop_sysid.diagnosis.decision.finding import finding
from haptic_teleop_sysid.diagnosis.decision.search.decide import Choice
from haptic_teleop_sysid.diagnosis.decision.words import because
from haptic_teleop_sysid.diagnosis.hypotheses.explanation import Explanation
from haptic_teleop_sysid.diagnosis.inputs.scales import recording_scales
from haptic_teleop_sysid.diagnosis.report.experiment import menu
from haptic_teleop_sysid.diagnosis.report.page_lead import parameter_text
from haptic_teleop_sysid.diagnosis.report.summary import finding_number
from haptic_teleop_sysid.report import unit_text


def test_the_sentence_has_the_numbers_of_the_final_model_and_none_of_the_smoothing():
    found = explanation("coulomb_friction", 300.0, 200.0, torque=0.1, contact_angle=2e-5)
    fitted = Effect("coulomb_friction", "stage1_motor", {"torque": 0.12, "contact_angle": 2e-5})
    text = because(Choice(found, 1.0), fitted)
    assert "torque 0.12 N*m" in text
    assert "contact_angle" not in text


def test_a_ratio_says_what_it_is_a_share_of():
    found = explanation("friction_drift", 300.0, 200.0, change=-0.06, time_constant=50.0)
    text = because(Choice(found, 1.0), found.effect)
    assert "change -0.06 of the friction, time_constant 50 s" in text


SIZED = {name: entry for name, entry in EFFECTS.items() if entry.parameters}


@pytest.mark.parametrize("entry", SIZED.values(), ids=SIZED)
def test_text_page_and_json_write_a_unit_behind_every_number_of_every_effect(entry):
    parameters = {p.name: p.typical or p.default or 1.0 for p in entry.parameters}
    effect = Effect(entry.name, f"stage1_{locations(entry.name, MODEL.structure)[0]}", parameters)
    found = Explanation(fit_of(MODEL.with_effects(effect)), 300.0, 200.0, True, 0)
    made = finding(Choice(found, 1.0), found.fit, {})
    shown = [p for p in entry.parameters if p.reported(parameters[p.name])]
    assert list(made["parameters"]) == [p.name for p in shown]
    sentence = because(Choice(found, 1.0), effect)
    for p in shown:
        number = made["parameters"][p.name]
        assert len(p.unit) > 0 and p.unit != "1", p.name
        assert number["unit"] == p.unit  # in diagnosis.json
        assert f"{p.name} {parameters[p.name]:.4g} {p.unit}" in sentence
        assert parameter_text(number).endswith(f" {unit_text(p.unit)}")  # on the page
        assert finding_number(p.name, number).endswith(f" {unit_text(p.unit)}")  # in the terminal


def test_a_gain_beside_a_believed_stiffness_may_be_the_stiffness():
    effect = Effect("gain_error", "stage1_actuator", {"gain": 1.05})
    texts = []
    for fixed in ((), ("stiffness",)):
        fit = fit_of(replace(MODEL, fixed=fixed).with_effects(effect))
        texts.append(because(Choice(Explanation(fit, 300.0, 200.0, True, 0), 1.0), effect))
    assert "stiffness" not in texts[0]
    assert "a stiffness that is believed" in texts[1]


def test_suggested_settings_are_short_and_within_the_limits():
    scales = recording_scales(MODEL, [joint_record(3, seconds=2.0)])
    for option in menu(MODEL, scales, 0.002):
        limit = option["signal.saturation"]
        for name, value in option.items():
            if isinstance(value, float):
                assert len(f"{value:.12g}".replace(".", "").strip("0")) <= 4, (name, value)
            if name.endswith((".rms", ".amplitude")):
                assert 0.0 < value <= limit
        assert limit <= 0.5 * (1 + 1e-12)
        assert option["rate"] == pytest.approx(500.0)


def test_the_version_of_the_sources_is_said_where_nothing_is_installed(monkeypatch):
    def missing(name):
        raise importlib.metadata.PackageNotFoundError(name)

    monkeypatch.setattr(importlib.metadata, "version", missing)
    version, what = results.tool_version().split(" ", 1)
    assert what == "(sources)"
    assert math.prod(int(part) >= 0 for part in version.split("."))
    monkeypatch.setattr(results, "__file__", "/nowhere/at/all/results.py")
    assert results.tool_version() == "unknown"
