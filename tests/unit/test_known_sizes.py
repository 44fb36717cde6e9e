"""Effects of which nobody knows how much there is are left out of what the inverse dynamics name."""

from dataclasses import replace
from types import SimpleNamespace

import pytest
from identification_plants import STAGE

from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.diagnosis.decision.second_method.known_sizes import with_known_sizes
from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.searched_groups import Group
from haptic_teleop_sysid.diagnosis.evidence.second_method import JudgedGroup, SecondMethod

FRICTION = Effect("coulomb_friction", "stage1_motor", {"torque": 1.4})
CONSTANT = Effect("constant_torque", "stage1_motor", {"torque": 0.015})
SEARCHED = SimpleNamespace(
    levels=(), folds=SimpleNamespace(explained=lambda hypotheses: 0.1 * len(hypotheses))
)


def second_method(*effects, std):
    named = {f"stage1_motor.{name}.torque": error for name, error in std.items()}
    hypotheses = tuple(SimpleNamespace(entry=e.entry, location=e.location) for e in effects)
    group = Group(STAGE.with_effects(*effects), hypotheses, 10.0, 80.0, 0.9, {"motor_inertia": 0.1, **named})
    return SecondMethod(JudgedGroup(group, 12.0, (0.2, 0.3)), (), SEARCHED)


def kept(before, sized=lambda judged: judged):
    found = with_known_sizes(before, sized, lambda model: (0.4, 0.5)).chosen
    return [e.effect for e in found.group.effects], found


@pytest.mark.parametrize(
    ("errors", "names"),
    [
        ((0.1, 0.005), ["coulomb_friction", "constant_torque"]),
        ((0.1, 0.05), ["coulomb_friction"]),
        ((2.0, 0.005), ["constant_torque"]),
        ((9.0, 0.05), ["constant_torque"]),  # both are unknown: one is left, to be said with its confidence
    ],
)
def test_what_is_not_known_to_be_there_is_left_out(errors, names):
    std = dict(zip(("coulomb_friction", "constant_torque"), errors, strict=True))
    assert kept(second_method(FRICTION, CONSTANT, std=std))[0] == names


def test_what_is_left_is_run_and_judged_by_itself():
    before = second_method(FRICTION, CONSTANT, std={"coulomb_friction": 0.1, "constant_torque": 0.05})
    names, found = kept(before)
    assert names == ["coulomb_friction"] == [h.entry.name for h in found.group.hypotheses]
    assert [e.effect for e in found.group.model.effects] == ["coulomb_friction"]
    assert found.errors == (0.4, 0.5) and found.group.explained == 0.1
    assert [*found.group.std] == ["motor_inertia", "stage1_motor.coulomb_friction.torque"]
    # Sizes are found anew without it.
    counted = []
    kept(before, lambda judged: counted.append(len(judged.group.effects)) or judged)
    assert counted == [2, 1]


def group_of(*effects, torque_error=0.1):
    return second_method(
        *effects, std={"coulomb_friction": torque_error, "constant_torque": 0.1}
    ).chosen.group


def test_a_form_that_is_not_known_is_told_plainly():
    rippled = Effect(
        "position_dependent_friction",
        "stage1_motor",
        {"torque": 1.4, "amplitude": 1.2, "order": 2.0, "phase": 0.0},
    )
    weight = Effect("constant_torque", "stage1_motor", {"torque": 0.5})
    plain, strange = (
        group_of(weight, FRICTION),
        replace(group_of(weight, Effect("gravity", "stage1_motor", {"torque": 9.0})), gain=1.0),
    )
    before = second_method(weight, rippled, std={"constant_torque": 0.02})
    head = "stage1_motor.position_dependent_friction."
    before.chosen.group.std.update({head + "torque": 9.0, head + "amplitude": 9.0})
    found = replace(before, searched=SimpleNamespace(levels=((strange, plain),), folds=SEARCHED.folds))
    assert kept(found)[0] == ["constant_torque", "coulomb_friction"]
    # Where nobody found the plain one beside the same others, it is left out.
    assert kept(replace(before, searched=SimpleNamespace(levels=((strange,),), folds=SEARCHED.folds)))[0] == [
        "constant_torque"
    ]


@pytest.mark.parametrize(
    ("gain", "names", "weights"),
    [
        (8.0, ["coulomb_friction", "constant_torque"], [pytest.approx(1.0)]),
        (1.0, ["coulomb_friction"], [0.6, 0.4]),
    ],
)
def test_what_is_known_of_a_spring_that_hardly_pulls_more_is_told_as_a_constant_torque(gain, names, weights):
    spring = Effect("spring_to_ground", "stage1_motor", {"stiffness": 3e-6, "rest": -296.0})
    before = second_method(FRICTION, spring, std={"coulomb_friction": 0.1})
    before.chosen.group.std["stage1_motor.spring_to_ground.stiffness"] = 3e-6
    other = second_method(FRICTION, CONSTANT, std={"coulomb_friction": 0.1, "constant_torque": 0.001}).chosen
    other = replace(other, group=replace(other.group, gain=gain))
    found = replace(before, rivals=((before.chosen, 0.6), (other, 0.4)))
    assert kept(found)[0] == names
    # Sizing makes another group of the same names.
    after = with_known_sizes(found, lambda h: replace(h, group=replace(h.group)), lambda model: (0.4, 0.5))
    assert [weight for _, weight in after.rivals] == weights


def test_sizes_that_free_runs_do_not_know_stay_those_of_the_torques():
    before = second_method(FRICTION, CONSTANT, std={"coulomb_friction": 0.1, "constant_torque": 0.002})

    def sized(judged, error):
        larger = judged.group.model.with_values({"stage1_motor.coulomb_friction.torque": 2.0})
        std = {**judged.group.std, "stage1_motor.coulomb_friction.torque": error}
        return replace(judged, group=replace(judged.group, model=larger, std=std))

    for error, torque in ((0.2, 2.0), (2.0, 1.4)):
        names, found = kept(before, lambda judged, e=error: sized(judged, e))
        assert names == ["coulomb_friction", "constant_torque"]
        assert found.group.effects[0].values["torque"] == torque


def test_a_size_that_only_free_runs_know_is_theirs():
    before = second_method(FRICTION, std={"coulomb_friction": 5.0})

    def sized(judged):
        larger = judged.group.model.with_values({"stage1_motor.coulomb_friction.torque": 2.0})
        std = {**judged.group.std, "stage1_motor.coulomb_friction.torque": 0.1}
        return replace(judged, group=replace(judged.group, model=larger, std=std))

    assert kept(before, sized)[1].group.effects[0].values["torque"] == 2.0
