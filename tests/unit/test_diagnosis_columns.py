"""Three models side by side: their numbers, what moved, what is at a bound, and what is worse than the
user's."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from identification_plants import STAGE, stage_recording

from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.diagnosis.evidence.proof import MODELS, PARTS, Proof
from haptic_teleop_sysid.diagnosis.inputs.scales import within_reach
from haptic_teleop_sysid.diagnosis.report.belonging import apart
from haptic_teleop_sysid.diagnosis.report.beside_given import (
    beside_given,
    handed_on,
    with_numerical_held,
    worse_than_given,
)
from haptic_teleop_sysid.diagnosis.report.columns import (
    Number,
    at_bounds,
    column,
    errors_of,
    moved,
    with_bounds,
)
from haptic_teleop_sysid.diagnosis.report.summary import moved_sentence, percent
from haptic_teleop_sysid.diagnosis.usable import records_of
from haptic_teleop_sysid.estimation.whole_fit import fit_from_scratch
from haptic_teleop_sysid.recordings.dataset import load_dataset
from haptic_teleop_sysid.simulation.fit import SimulatedFit
from haptic_teleop_sysid.simulation.windows import Windows

#: What the lab believes: a drive inertia that is a fifth too small, the rest right.
GIVEN = STAGE.with_values({"motor_inertia": 0.8 * STAGE.parameters["motor_inertia"]})


def records(seed, truth=STAGE):
    return records_of([load_dataset(stage_recording(truth, seed=seed, seconds=8.0), STAGE)])


@pytest.fixture(scope="module")
def fitted():
    """A fit from GIVEN, and other recordings of the same machine."""
    return fit_from_scratch(GIVEN, records(1), limits=within_reach(GIVEN)), records(2)


def test_what_is_off_is_told_with_its_error_and_what_is_right_is_not(fitted):
    fit, others = fitted
    numbers = column(fit.model, GIVEN, fit, errors_of(fit, others))
    found = {m["parameter"]: m for m in moved(GIVEN, numbers)}
    assert "motor_inertia" in found
    inertia = found["motor_inertia"]
    assert abs(inertia["value"] - STAGE.parameters["motor_inertia"]) < 4.0 * inertia["std"]
    assert inertia["std"] < 0.05 * inertia["value"]
    assert inertia["change"] == pytest.approx(0.25, abs=0.05)
    assert found.keys() <= {"motor_inertia", "arm_damping"}  # of which these recordings know little
    assert numbers["stiffness"].std is None  # was held
    assert numbers["stiffness"].change == 0.0
    sentence = moved_sentence({"parameters_moved": list(found.values()), "verdict": "no_mismatch"})
    assert sentence.startswith("Your parameters are off, no physics is missing: ")
    assert "motor inertia 0.0508 -> 0.06" in sentence and "± " in sentence


@pytest.mark.parametrize(
    ("given", "told"),
    [(97.7, "None of your parameters is off"), (74.4, "hold one"), (-np.inf, "better (-100.0 -> 97.8 %)")],
)
def test_a_fit_that_rises_with_no_parameter_off_asks_for_one_that_is_known(given, told):
    """With nothing held all torques may grow alike: none of the parameters is off beyond its uncertainty, and
    the re-estimated ones simulate far better."""
    content = {
        "parameters_moved": [],
        "verdict": "no_mismatch",
        "augmented_model": {"holds": "baseline"},
        "fit": {
            "given": {"validation": {"motor.velocity": given, "arm.velocity": np.nan}},
            "baseline": {"validation": {"motor.velocity": 97.8, "arm.velocity": 97.8}},
        },
    }
    assert told in moved_sentence(content)


def test_other_recordings_that_want_another_size_widen_the_error(fitted):
    fit, others = fitted
    heavier = STAGE.with_values({"motor_inertia": 1.3 * STAGE.parameters["motor_inertia"]})
    same, other = errors_of(fit, others), errors_of(fit, records(2, heavier))
    assert other["motor_inertia"] > 5.0 * same["motor_inertia"]
    apart = 0.3 * STAGE.parameters["motor_inertia"] / np.sqrt(2.0)
    assert other["motor_inertia"] == pytest.approx(apart, rel=0.4)


def test_an_effect_of_the_given_model_that_changed_its_size_is_told_like_any_parameter():
    """Friction that has grown since the model was made."""
    torque = "stage1_motor.coulomb_friction.torque"
    given = STAGE.with_effects(Effect("coulomb_friction", "stage1_motor", {"torque": 0.3}))
    numbers = dict.fromkeys(given.parameter_values(), Number(1.0, "1", None, None))
    numbers[torque] = Number(0.45, "N*m", 0.001, 0.5)
    (found,) = moved(given, numbers)
    assert (found["parameter"], found["given"], found["value"]) == (torque, 0.3, 0.45)
    without = {name: number for name, number in numbers.items() if name != torque}
    assert moved(given, without) == []  # gave way to another form of friction, which is a finding


def test_a_gain_and_all_that_it_scales_are_not_determined():
    free = replace(GIVEN, fixed=())
    fit = fit_from_scratch(free, records(1))
    numbers = column(fit.model, free, fit, errors_of(fit, records(2)))
    assert all(numbers[name].std is None for name in ("torque_constant", "stiffness", "motor_inertia"))
    assert moved(free, numbers) == []


def test_a_parameter_at_a_bound_is_said_so_and_has_no_error():
    heavy = STAGE.with_values({"motor_inertia": 20.0 * STAGE.parameters["motor_inertia"]})
    fit = fit_from_scratch(heavy, records(1), limits=within_reach(heavy))
    assert at_bounds(fit, heavy)["motor_inertia"] == "lowest"
    number = column(fit.model, heavy, fit, errors_of(fit, records(2)))["motor_inertia"]
    assert number.bound == "lowest"
    assert number.std is None
    assert number.value == pytest.approx(heavy.parameters["motor_inertia"] / 8.0)


def test_a_finding_says_that_its_parameter_is_at_a_bound():
    rubs = Effect("coulomb_friction", "stage1_motor", {"torque": 0.0})
    fit = replace(fit_from_scratch(GIVEN, records(1)), free=("stage1_motor.coulomb_friction.torque",))
    fit = replace(fit, model=GIVEN.with_effects(rubs))
    numbers = column(fit.model, GIVEN, fit)
    told = {"effect": rubs.effect, "location": rubs.location, "parameters": {"torque": {"value": 0.0}}}
    assert with_bounds([told], numbers)[0]["parameters"]["torque"] == {"value": 0.0, "at_bound": "lowest"}


def proof(validation, test=None):
    """A proof whose models fit one signal so, in percent; the models differ by their inertia."""
    windows = Windows(((0, 10),), None, "")
    models = {
        name: STAGE.with_values({"motor_inertia": value})
        for name, value in (("given", 0.06), ("baseline", 0.07), ("augmented", 0.08))
    }

    def fits(percents):
        return tuple(SimulatedFit(p, {}, {}, windows, np.zeros((1, 4))) for p in percents)

    def part(values, name):
        return fits([{"angle": values[name], "speed": 90.0}] if values else [])

    found = {
        name: {"estimation": fits([]), "validation": part(validation, name), "test": part(test, name)}
        for name in models
    }
    data = {p: tuple(f for f in found["given"][p]) for p in ("estimation", "validation", "test")}
    return Proof(models, data, found)  # type: ignore[arg-type]


def fits_of(given, baseline, augmented):
    return {"given": given, "baseline": baseline, "augmented": augmented}


@pytest.mark.parametrize(
    ("fits", "held", "worse"),
    [
        ((50.0, 60.0, 90.0), "augmented", []),
        ((50.0, 40.0, 90.0), "augmented", ["baseline"]),
        ((50.0, 60.0, 40.0), "baseline", ["augmented"]),
        ((50.0, 40.0, 45.0), "given", ["augmented", "baseline"]),
        ((50.0, -np.inf, 45.0), "given", ["augmented", "baseline"]),
        ((50.0, 50.0, 49.1), "augmented", []),
        ((50.0, 50.0, 48.9), "baseline", ["augmented"]),  # by 0.55 in the mean of both signals
    ],
)
def test_what_is_written_is_no_worse_than_the_user_s_own_model(fits, held, worse):
    one = proof(fits_of(*fits))
    name, model = handed_on(one)
    assert (name, model) == (held, one.models[held])
    assert [w.model for w in worse_than_given(one, "validation")] == worse
    told = beside_given(one)
    assert told["augmented_model"]["holds"] == held
    assert (told["worse_than_given"] is None) == (not worse)


def followed(**percents):
    """A proof whose every model fits one velocity by ``percents``: one recording of each part."""
    windows = Windows(((0, 10),), None, "")
    data = {part: (SimpleNamespace(name=part),) if part in percents else () for part in PARTS}

    def fits(part):
        one = {"j_motor.velocity": percents.get(part), "j_motor.position": -500.0}
        return tuple(SimulatedFit(one, {}, {}, windows, np.zeros((1, 4))) for _ in data[part])

    return Proof({}, data, {model: {part: fits(part) for part in PARTS} for model in MODELS})  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("fits", "names"),
    [
        ({"estimation": 80.0, "validation": 20.0}, None),  # poor, and the same machine
        ({"estimation": 80.0, "validation": -900.0}, ["validation"]),
        ({"estimation": 80.0, "validation": 60.0, "test": -np.inf}, ["test"]),
        ({"estimation": 80.0, "validation": 4.0}, ["validation"]),  # degrees for radians, and a small inertia
        ({"estimation": 80.0, "validation": np.nan}, None),
        ({"estimation": 40.0, "validation": -900.0}, None),  # no model follows anything: physics is missing
    ],
)
def test_recordings_that_no_model_follows_beside_others_that_one_does_are_told(fits, names):
    found = apart(followed(**fits))
    assert (None if found is None else found["recordings"]) == names
    if found is not None:
        assert "see whether they have the units" in found["remedy"]
        assert "are followed with 80 %" in found["what"]


def test_a_test_shows_what_is_worse_and_has_no_say_in_what_is_written():
    one = proof(fits_of(50.0, 60.0, 90.0), fits_of(80.0, 82.0, 70.0))
    told = beside_given(one)
    assert told["augmented_model"]["holds"] == "augmented"
    assert told["worse_than_given"]["recordings"] == "test"
    assert told["worse_than_given"]["models"].keys() == {"augmented"}
    assert told["worse_than_given"]["models"]["augmented"]["given"] == pytest.approx(85.0)
    assert told["worse_than_given"]["models"]["augmented"]["fit"] == pytest.approx(80.0)
    sentence = told["worse_than_given"]["sentence"]
    assert sentence.startswith("Worse than your own model on the test recordings: the augmented model (80.0 ")


def test_a_re_estimated_model_that_is_worse_beside_a_better_one_is_told_with_it():
    sentence = beside_given(proof(fits_of(50.0, 40.0, 90.0)))["worse_than_given"]["sentence"]
    assert "your structure, re-estimated (65.0 instead of 70.0 % over all signals)" in sentence
    assert "but not with what was found (90.0 %)" in sentence


def test_a_single_signal_that_is_worse_is_named_though_the_mean_is_better():
    one = proof(fits_of(50.0, 50.0, 90.0))
    speed = replace(one.fits["augmented"]["validation"][0], percent={"angle": 90.0, "speed": 80.0})
    one.fits["augmented"]["validation"] = (speed,)
    sentence = beside_given(one)["worse_than_given"]["sentence"]
    assert "in one signal of the validation recordings" in sentence
    assert "speed 80.0 instead of 90.0 %" in sentence
    assert handed_on(one)[0] == "augmented"


def test_fits_are_printed_whatever_they_are():
    assert [percent(p) for p in (97.35, -20.0, float("-inf"), float("nan"), None)] == [
        *("97.3", "-20.0", "< -1000", "none", "none")
    ]


def test_what_only_the_arithmetic_needs_is_held_in_the_model_that_is_handed_on():
    """A later estimate could not find anew how far a contact gives."""
    friction = Effect("coulomb_friction", "stage1_motor", {"torque": 0.2, "contact_angle": 3e-6})
    wider = with_numerical_held(replace(STAGE, effects=(friction,), fixed=("stiffness",)))
    assert wider.fixed == ("stiffness", "stage1_motor.coulomb_friction.contact_angle")
    assert "stage1_motor.coulomb_friction.torque" in wider.free_parameters()
    assert with_numerical_held(wider) == wider
