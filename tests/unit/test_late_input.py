"""An input that acts later than it is recorded, on a joint with friction and more."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from identification_plants import STAGE
from looped_machine import COULOMB, DT, looped
from stepped_machines import RIGID

from haptic_teleop_sim.effects import EFFECTS
from haptic_teleop_sim.kernel import simulate
from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.diagnosis.decision.name_tests.late_input import (
    Late,
    _steady,
    with_lateness,
)
from haptic_teleop_sysid.diagnosis.evidence.lateness import Along, is_lateness
from haptic_teleop_sysid.diagnosis.inputs.on_time import delayed, on_time
from haptic_teleop_sysid.diagnosis.late_recordings import explained_on_time
from haptic_teleop_sysid.diagnosis.run import diagnose

LATE = 8


def lateness(content):
    return [f for f in content["findings"] if is_lateness(EFFECTS[f["effect"]])]


@pytest.fixture(scope="module")
def late():
    return diagnose(RIGID, [looped(1, LATE, 1.0)], [looped(2, LATE, 0.8)])


def test_it_is_found_beside_the_friction_that_hides_it(late):
    _, verdict, _, content = late
    (found,) = lateness(content)
    size = found["parameters"]["delay"]
    assert size["value"] == pytest.approx(LATE * DT, abs=0.25 * DT)
    assert abs(size["value"] - LATE * DT) < 3.0 * size["std"]
    frictions = [f for f in content["findings"] if f is not found]
    assert [f["effect"] for f in frictions] == ["coulomb_friction"]
    assert frictions[0]["parameters"]["torque"]["value"] == pytest.approx(COULOMB, rel=0.15)
    assert verdict.kind == "ambiguous", "input and readings of a rigid joint are in one order in time"
    others = {(a["effect"], a["location"]) for a in found["alternatives"]}
    assert {("sensor_delay", "j_motor_encoder"), ("channel_skew", "j_actuator")} <= others
    assert "no recording of these channels can tell them apart" in content["next_experiment"]["why"]
    assert "expected to differ" not in content["next_experiment"]["why"]
    assert content["next_experiment"]["signal_generator"] == {}
    assert sum(row["share"] for row in verdict.where) == pytest.approx(1.0, abs=0.01)


def test_the_final_model_has_it_and_simulates_the_recordings_as_they_are(late):
    result, _, proof, content = late
    (found,) = lateness(content)
    (effect,) = (e for e in result.final.model.effects if is_lateness(e.entry))
    assert (effect.effect, effect.location) == (found["effect"], found["location"])
    numbers = content["models"]["augmented"]["parameters"]["j_actuator.input_delay.delay"]
    assert numbers["value"] == pytest.approx(LATE * DT, abs=0.25 * DT) and 0.0 < numbers["std"] < DT
    assert [d.input[0] for d in proof.parts["estimation"]] == [looped(1, LATE, 1.0).input[0]]
    assert not any(is_lateness(e.entry) for e in proof.models["baseline"].effects)
    better = proof.mean("augmented", "validation") - proof.mean("baseline", "validation")
    bare = result.final.model.without(effect.effect, effect.location)
    assert better > 0.0
    assert proof.mean("augmented", "validation") > np.mean(
        [max(p, -100.0) for p in _fits(bare, proof)]
    ), "without the lateness the same names simulate worse"


def _fits(model, proof):
    from haptic_teleop_sysid.simulation.fit import simulated_fit

    (data,), (fit,) = proof.parts["validation"], proof.fits["baseline"]["validation"]
    return list(simulated_fit(model, data, fit.windows).percent.values())


def test_where_the_input_is_on_time_none_is_found():
    content = diagnose(RIGID, [looped(1, 0, 1.0)], [looped(2, 0, 0.8)])[3]
    assert not lateness(content)


@given(st.floats(-6.0, 6.0), st.floats(-6.0, 6.0))
def test_moves_add_up_on_a_straight_line(one, other):
    line = np.arange(60.0)
    both = delayed(delayed(line, one), other)
    np.testing.assert_allclose(both[20:40], line[20:40] - one - other, atol=1e-9)


@pytest.mark.parametrize("samples", [3.0, 4.4])
def test_an_input_on_time_is_what_acts_with_a_delay(samples):
    data = looped(3, 0, 1.0, seconds=4.0)
    late = Effect("input_delay", "j_actuator", {"delay": samples * DT})
    torque = data.input - data.input[0]
    with_delay = simulate(RIGID.with_effects(late), torque, DT).motor_position
    moved = on_time(replace(data, input=torque), samples * DT)
    np.testing.assert_allclose(simulate(RIGID, moved.input, DT).motor_position, with_delay, atol=5e-5)


@pytest.mark.parametrize(("share", "steady"), [(0.82, True), (0.78, False)])
def test_a_size_that_differs_from_stretch_to_stretch_is_no_lateness(share, steady):
    """One size for all gains a share of what each stretch gains by its own."""
    own = np.full(8, 20.0)
    assert _steady(Along(np.full(8, 5.0), own, share * own)) is steady


@pytest.mark.parametrize(("loss", "steady"), [(5.5, True), (6.5, False)])
def test_stretches_that_lose_by_it_object_together(loss, steady):
    """Two stretches lose; all of them gain 122 by sizes of their own."""
    own, shared = np.full(8, 20.0), np.full(8, 19.8)
    own[6:], shared[6:] = 1.0, -loss
    assert _steady(Along(np.full(8, 5.0), own, shared)) is steady


def test_what_came_in_a_hole_is_not_known_later_either():
    data = looped(3, 0, 1.0, seconds=4.0)
    valid, torque = data.valid.copy(), data.input.copy()
    valid[100:110], torque[105] = False, np.nan
    moved = on_time(replace(data, valid=valid, input=torque), 3.0 * DT)
    assert np.flatnonzero(~moved.valid).tolist() == list(range(100, 113))
    assert np.flatnonzero(np.isnan(moved.input)).tolist() == [108]


def test_a_model_that_has_a_delay_and_a_joint_that_flexes_are_not_asked():
    late = Effect("input_delay", "j_actuator", {"delay": 0.01})
    data = ([looped(1, 0, 1.0, seconds=4.0)], [looped(2, 0, 1.0, seconds=4.0)])
    for model in (RIGID.with_effects(late), STAGE):
        assert explained_on_time(model, data, None, (), pytest.fail) is None
    measured = [replace(d, commanded_input=d.input) for d in data[0]]
    assert explained_on_time(RIGID, (measured, data[1]), None, (), pytest.fail) is None


def test_a_stand_in_keeps_no_lateness_of_its_own(late):
    result, verdict = late[0], late[1]
    (choice,) = (c for c in result.choices if is_lateness(c.chosen.effect.entry))
    again = with_lateness(Late(choice, LATE * DT), verdict, result, result.baseline)[1].final
    assert [e for e in again.model.effects if is_lateness(e.entry)] == [choice.chosen.effect]
    assert len(again.free) == len(result.final.free) == len(again.information)
