"""The inverse dynamics' say on motions that were integrated here, step by step, by other equations."""

import math
from dataclasses import replace

import numpy as np
import pytest
import scipy
from stepped_machines import DT, RIGID, bent_spring, drive, pendulum, record, swing, two_masses

from haptic_teleop_sim.effects import EFFECTS
from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.band import motion_band
from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.effect_variables import turning
from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.group_search import search_groups
from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.groups import Search
from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.motion import banded, standing
from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.regression import equations
from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.terms import Hypothesis
from haptic_teleop_sysid.diagnosis.hypotheses.candidates import family
from haptic_teleop_sysid.diagnosis.inputs.scales import recording_scales
from haptic_teleop_sysid.estimation.records import Record


def asked(model: Model, here: Record, there: Record):
    return search_groups(model, [here], [there], recording_scales(model, [here]))


def best(found):
    """The group that gains most by each further effect."""
    kept = found.structure
    for level in found.levels:
        if level[0].gain > kept.gain + 6.0 * (len(level[0].effects) - len(kept.effects)):
            kept = level[0]
    return kept


def named(group) -> dict[str, Effect]:
    return {e.effect: e for e in group.effects}


def test_gravity_and_dry_friction_are_found_together_with_the_parameters():
    found = asked(RIGID, *(pendulum(s, coulomb=0.3, weight=2.0) for s in (0, 1)))
    effects = named(best(found))
    assert set(effects) == {"gravity", "coulomb_friction"}
    assert effects["gravity"].parameters["torque"] == pytest.approx(2.0, rel=0.05)
    assert effects["coulomb_friction"].parameters["torque"] == pytest.approx(0.3, rel=0.15)
    assert best(found).model.parameters["motor_inertia"] == pytest.approx(0.14, rel=0.05)
    assert best(found).explained > 0.8 * found.recoverable


def test_nothing_is_found_where_nothing_is_missing():
    found = asked(RIGID, *(pendulum(s) for s in (0, 1)))
    assert not best(found).effects
    assert best(found).model.parameters["motor_inertia"] == pytest.approx(0.14, rel=0.02)
    assert best(found).model.parameters["motor_damping"] == pytest.approx(0.35, rel=0.05)


def test_a_friction_that_differs_between_directions_is_told_by_both_sizes():
    found = asked(RIGID, *(pendulum(s, coulomb=0.4, offset=0.1) for s in (0, 1)))
    effects = named(found.levels[0][0])
    assert set(effects) == {"asymmetric_friction"}
    # Friction of 0.4 and a push of 0.1 forward: 0.3 against the one direction, 0.5 against the other.
    assert effects["asymmetric_friction"].parameters["positive"] == pytest.approx(0.3, rel=0.1)
    assert effects["asymmetric_friction"].parameters["negative"] == pytest.approx(0.5, rel=0.1)
    # The two of which it is made are as good.
    assert set(named(found.levels[1][0])) == {"coulomb_friction", "constant_torque"}


def test_each_two_effects_are_tried_together_however_little_either_gains_alone(monkeypatch):
    """Friction and drag of a wheel that turns one way look like viscous damping; neither shows alone."""
    asked_for, left_over = set(), Search.left_over

    def noted(self, terms):
        names = [h.entry.name for h in terms if isinstance(h, Hypothesis)]
        asked_for.add(frozenset(names) if len(names) == len(terms) else frozenset())
        return left_over(self, terms)

    monkeypatch.setattr(Search, "left_over", noted)
    asked(RIGID, *(pendulum(s, coulomb=0.3) for s in (0, 1)))
    alone = {name for names in asked_for if len(names) == 1 for name in names}
    forms = [{"coulomb_friction", "quadratic_drag"}, {"gravity", "gain_drift"}, {"hard_stop", "actuator_lag"}]
    assert len(alone) > 12 and all(two <= alone and frozenset(two) in asked_for for two in forms)
    missing = {(a, b) for a in alone for b in alone - family(a) if frozenset({a, b}) not in asked_for}
    assert not missing


def test_a_joint_that_stands_still_says_nothing_of_its_friction():
    """Between two moves dry friction holds a torque that no balance knows."""

    def made(seed: int) -> Record:
        one = pendulum(seed, coulomb=0.4)
        n = len(one) // 2
        rest = np.arange(n)
        stuck = np.column_stack([np.full(n, one.measured[-1, 0])] * 2)
        held = 0.3 * np.sin(2.0 * np.pi * rest / 700.0)  # less than friction holds
        return replace(
            one,
            input=np.concatenate([one.input, held]),
            measured=np.vstack([one.measured, stuck if one.measured.shape[1] == 2 else stuck[:, :1]]),
            exogenous=np.concatenate([one.exogenous, np.zeros((n, *one.exogenous.shape[1:]))]),
        )

    recordings = made(0), made(1)
    motion = banded(recordings[0], True, 3.0)
    last = motion.time[motion.kept[-1]] - recordings[0].start
    assert last < len(recordings[0]) * 2 / 3 * recordings[0].dt
    found = asked(RIGID, *recordings)
    plain = next(g for g in found.levels[0] if "coulomb_friction" in named(g))
    assert named(plain)["coulomb_friction"].parameters["torque"] == pytest.approx(0.4, rel=0.1)
    assert plain.explained > 0.9


def test_a_rest_that_is_short_beside_the_cut_off_says_nothing_either_and_a_slow_turn_does():
    period = 100.0
    time = np.arange(2000) / period
    turning = np.sin(2.0 * np.pi * time / 80.0)  # slow for 0.5 periods at its turn
    resting = np.where((time > 8.0) & (time < 9.5), 1e-4, 1.0)
    both = [np.column_stack([one, one]) for one in (turning, resting)]
    assert not standing(both[0], period).any()
    assert standing(both[1], period).sum() == round(1.5 * period) - 1
    assert not standing(both[1], 2.0 * period).any()


def test_what_the_others_of_a_group_say_as_well_is_no_effect_beside_them():
    """One way, friction, a constant torque and damping at one speed are one and the same."""

    def made(seed: int) -> Record:
        torque = 3.0 + 0.002 * drive(seed, 1.0)
        return record(torque, swing(torque, 0.14, 0.35, 0.4, 0.0, 0.0, 0.0, 0.0)[:, None], 1e-5)

    def told_apart(records: list[Record], *names: str) -> bool:
        sizes = {"coulomb_friction": 0.4, "constant_torque": 0.1}
        effects = [Effect(name, "j_motor", {"torque": sizes[name]}) for name in names]
        group = tuple(Hypothesis.resized(effect, "motor") for effect in effects)
        return asked(RIGID, *records).folds.told_apart(group)

    both = [pendulum(s, coulomb=0.4, offset=0.1) for s in (0, 1)]
    assert told_apart(both, "coulomb_friction", "constant_torque")
    one_way = [made(0), made(1)]
    assert not told_apart(one_way, "coulomb_friction")
    assert not told_apart(one_way, "coulomb_friction", "constant_torque")


def test_a_torque_that_no_effect_describes_is_recoverable_and_not_explained():
    hanging = RIGID.with_effects(Effect("gravity", "j_motor", {"torque": 4.0}))
    # Viscous friction that grows and falls with the angle.
    found = asked(hanging, *(pendulum(s, swirl=0.3, weight=4.0) for s in (0, 1)))
    assert found.recoverable > 0.8
    assert found.free_curves[0].quantities == ("motor angle", "motor velocity")
    plain = Hypothesis.of(Effect("coulomb_friction", "j_motor", {"torque": 0.3}), "motor")
    assert found.folds.adequacies((plain,))[0] < 0.5


def test_what_follows_a_quantity_does_not_speak_against_a_torque_that_follows_none():
    hanging = RIGID.with_effects(Effect("gravity", "j_motor", {"torque": 4.0}))
    found = asked(hanging, *(pendulum(s, swirl=0.3, weight=4.0, offset=0.15) for s in (0, 1)))
    push = Hypothesis.of(Effect("constant_torque", "j_motor", {"torque": 0.15}), "motor")
    assert found.recoverable > 0.8, "much else is missing"
    assert found.folds.adequacies((push,)) == [1.0]


def test_a_late_input_is_found_beside_what_acts_as_well_and_hides_it():
    """A torque that lags behind the motion pushes like a negative damping, and hides friction."""
    model, late = RIGID, 10

    def made(seed: int) -> Record:
        one = pendulum(seed, coulomb=0.3, weight=2.0)
        early = np.append(one.input[late:], np.full(late, one.input[-1]))  # recorded before it acts
        return replace(one, input=early)

    recordings = made(0), made(1)
    found = asked(model, *recordings)
    effects = {e.effect: e.values for e in best(found).effects}
    assert set(effects) in ({"gravity", "coulomb_friction", n} for n in ("input_delay", "actuator_lag"))
    (time,) = (v for n in ("input_delay", "actuator_lag") if n in effects for v in effects[n].values())
    assert time == pytest.approx(late * recordings[0].dt, rel=0.2)
    assert effects["coulomb_friction"]["torque"] == pytest.approx(0.3, rel=0.15)


def acts_late(seed: int, lag: float = 0.0, delay: float = 0.0, **more: float) -> Record:
    """A pendulum that is driven by what lags behind its input, or comes later."""
    torque, late = drive(seed, 2.0 + 0.5 * seed), round(delay / DT)
    keeps = math.exp(-DT / lag) if lag else 0.0
    acts = scipy.signal.lfilter([1.0 - keeps], [1.0, -keeps], torque)
    acts = np.concatenate([np.zeros(late), acts[: len(acts) - late]])
    parts = {"coulomb": 0.0, "weight": 0.0, "offset": 0.0, "detent": 0.0, "swirl": 0.0} | more
    own = tuple(parts[n] for n in ("coulomb", "weight", "offset", "detent", "swirl"))
    return record(torque, swing(acts, 0.14, 0.35, *own)[:, None], 1e-5)


@pytest.mark.parametrize("weight", [0.0, 2.0])
@pytest.mark.parametrize("lag", [0.06, 0.15, 0.3])
def test_a_lag_that_smooths_most_of_the_input_is_found(lag, weight):
    """A rotor that takes a fifth of a second to turn faster drives with half of what is asked of it."""
    found = best(asked(RIGID, *(acts_late(s, lag=lag, weight=weight) for s in (0, 1))))
    effects = named(found)
    assert set(effects) == ({"actuator_lag", "gravity"} if weight else {"actuator_lag"})
    assert effects["actuator_lag"].parameters["time_constant"] == pytest.approx(lag, rel=0.04)
    assert found.model.parameters["motor_inertia"] == pytest.approx(0.14, rel=0.04)


def test_a_lag_is_found_beside_friction_with_an_error_of_its_size():
    found = best(asked(RIGID, *(acts_late(s, lag=0.15, coulomb=0.3) for s in (0, 1))))
    name = next(n for n in found.std if n.endswith("actuator_lag.time_constant"))
    error = found.std[name]
    assert named(found)["actuator_lag"].parameters["time_constant"] == pytest.approx(0.15, abs=3.0 * error)
    assert 0.001 < error < 0.015


@pytest.mark.parametrize("delay", [0.03, 0.09, 0.17])
def test_a_delay_is_found_between_the_sizes_that_are_tried(delay):
    effects = named(best(asked(RIGID, *(acts_late(s, delay=delay) for s in (0, 1)))))
    assert set(effects) == {"input_delay"}
    assert effects["input_delay"].parameters["delay"] == pytest.approx(delay, rel=0.04)


def test_a_delay_next_to_the_longest_is_found():
    assert "input_delay" in named(best(asked(RIGID, *(acts_late(s, delay=0.2475) for s in (0, 1)))))


@pytest.mark.parametrize("coulomb", [0.3, 0.9, 1.5])
def test_dry_friction_alone_is_no_late_actuator(coulomb):
    """It takes away a part of the inertia, and so would a lag, with an inertia that falls."""
    found = best(asked(RIGID, *(pendulum(s, coulomb=coulomb) for s in (0, 1))))
    assert all(e.entry.kind == "friction" for e in found.effects) and found.effects


def test_sizes_are_those_that_leave_least():
    found = asked(RIGID, *(acts_late(s, lag=0.3, weight=2.0) for s in (0, 1)))
    lag, *others = sorted(best(found).hypotheses, key=lambda h: h.entry.name)
    (size,) = (value for _, value in lag.shape)
    least = found.kinds.left_over((lag, *others))
    for factor in (0.95, 1.05):
        other = replace(lag, shape=(("time_constant", factor * size),))
        assert found.kinds.left_over((other, *others)) > least


def test_a_lag_of_a_flexible_joint_is_found():
    torques = [drive(s, 1.0) for s in (0, 1)]
    keeps = math.exp(-DT / 0.08)
    records = []
    for torque in torques:
        acts = scipy.signal.lfilter([1.0 - keeps], [1.0, -keeps], torque)
        records.append(record(torque, two_masses(acts, 9.0, (0.05, 0.1), (0.08, 0.05), 0.0), 1e-6))
    values = {"torque_constant": 1.0, "motor_inertia": 0.05, "motor_damping": 0.1, "stiffness": 9.0}
    parameters = {**values, "arm_inertia": 0.08, "arm_damping": 0.05}
    found = asked(Model("generic", "j", "flexible_joint", parameters, fixed=("torque_constant",)), *records)
    effects = named(best(found))
    assert effects["actuator_lag"].parameters["time_constant"] == pytest.approx(0.08, rel=0.1)


def test_a_friction_that_is_hardly_asymmetric_does_not_bar_what_it_is_and_the_delay_beside_it():
    """A sixth more in one direction is too little for the name. Two numbers say it, those of a plain friction
    and of a constant torque as well; with them the delay has to be found all the same."""
    late = 10

    def made(seed: int) -> Record:
        one = pendulum(seed, coulomb=0.4, offset=0.03)
        return replace(one, input=np.append(one.input[late:], np.full(late, one.input[-1])))

    found = asked(RIGID, made(0), made(1))
    names = {e.effect for e in best(found).effects}
    assert names in ({"coulomb_friction", "constant_torque", n} for n in ("input_delay", "actuator_lag"))


def test_torques_that_cancel_each_other_are_no_two_effects():
    """A gravity and a constant, each two hundred times what drives the joint, would give the curve of a bent
    spring together."""
    torques = [drive(seed, 0.24) for seed in (0, 1)]
    found = asked(RIGID, *(record(t, bent_spring(t, 0.14, 0.35)[:, None], 1e-7) for t in torques))
    largest = 4.0 * np.sqrt(np.mean(torques[0] ** 2))
    effects = [e for level in found.levels for group in level for e in group.effects]
    assert "spring_to_ground" in {e.effect for e in effects}
    assert all(abs(e.values["torque"]) < largest for e in effects if e.effect == "constant_torque")


def test_the_largest_torque_of_a_group_is_that_of_its_largest_effect():
    told = pendulum(0, coulomb=0.3)
    sides = equations(RIGID, [told], 8.0)
    forms = [
        Hypothesis.of(Effect(name, "j_motor", {"torque": 1.0}), "motor")
        for name in ("constant_torque", "coulomb_friction")
    ]
    values = np.array([0.14, 0.35, 5.0, -0.2])
    assert sides.largest(forms, values) == pytest.approx(5.0, rel=1e-3)
    assert sides.largest(forms[1:], values[[0, 1, 3]]) == pytest.approx(0.19, abs=0.02)
    assert np.sqrt(np.mean(sides.driven**2)) == pytest.approx(np.sqrt(np.mean(told.input**2)), rel=0.05)


def test_what_takes_all_of_the_input_away_is_no_explanation_of_it():
    found = asked(RIGID, *(pendulum(s, weight=2.0) for s in (0, 1)))
    assert best(found).effects[0].effect == "gravity"
    effects = [e for group in found.levels[0] for e in group.effects]
    assert all(e.values["time_constant"] < 1.0 for e in effects if e.effect == "actuator_lag")


@pytest.mark.parametrize(("ratio", "share"), [(0.2, 1.0), (0.5, 0.79), (1.0, 1 / 16), (2.0, 1 / 17**4)])
def test_of_a_ripple_the_band_sees_what_its_filter_leaves_at_that_speed(ratio, share):
    """At constant speed a ripple is a sine in time, and a Butterworth low pass of order 2, forward and
    backward and that twice, leaves 1 / (1 + (f / cutoff)^4)^2 of its height."""
    speed, cutoff = 2.0, 4.0
    angles = speed * DT * np.arange(10_000)
    moved = equations(RIGID, [record(np.zeros(10_000), angles[:, None])], cutoff)
    order = 2 * math.pi * ratio * cutoff / speed
    ripple = EFFECTS["torque_ripple"]
    tried = Hypothesis(ripple, "j_motor", "motor", (("order", order),), ("amplitude",), "phase")
    assert moved.seen(tried) == pytest.approx(share, rel=0.02, abs=1e-4)


def test_what_lies_outside_the_band_is_no_explanation_of_what_is_in_it():
    """Of orders that are too high only accidents remain in the band, and one of a hundred follows the
    scatter: beside a real pendulum's friction such an order was named with 45 %."""
    recordings = [pendulum(s, coulomb=0.3, weight=2.0) for s in (0, 1)]
    found = asked(RIGID, *recordings)
    sides = [equations(RIGID, [one], found.cutoff) for one in recordings]
    tried = {h for level in found.levels for group in level for h in group.hypotheses}
    assert {h.entry.name for h in tried} > {"gravity", "torque_ripple"}
    assert all(max(side.seen(h) for side in sides) > 0.2 for h in tried if h.entry.kind != "input")


@pytest.mark.parametrize("steps", [500, 2000])
def test_the_band_of_a_motion_does_not_depend_on_how_coarse_the_encoder_is(steps):
    one = pendulum(0)
    travel = float(np.ptp(one.measured[:, 0]))
    coarse = replace(one, measured=travel / steps * np.rint(one.measured * steps / travel))
    assert motion_band([coarse]) == pytest.approx(motion_band([one]), rel=0.1)


def test_a_short_stretch_between_two_holes_changes_neither_the_band_nor_what_is_found():
    """Of 250 samples a filter of the long one's band sees little but the ends."""
    long, other = pendulum(0, coulomb=0.3), pendulum(1, coulomb=0.3)
    short = replace(
        long, input=long.input[900:1150], measured=long.measured[900:1150], exogenous=long.exogenous[900:1150]
    )
    cutoff = motion_band([long, other])
    assert motion_band([long, short, other]) == pytest.approx(cutoff, rel=0.05)
    assert len(equations(RIGID, [long, short], cutoff).motions) == 1
    assert len(equations(RIGID, [short], cutoff).motions) == 1
    scales = recording_scales(RIGID, [long])
    found = [search_groups(RIGID, learn, [other], scales) for learn in ([long], [long, short])]
    named = [g.effects[0] for one in found for g in one.levels[0]]
    torques = [e.values["torque"] for e in named if e.effect == "coulomb_friction"]
    assert torques[1] == pytest.approx(torques[0], rel=0.02)


def test_friction_at_the_arm_of_an_elastic_joint_is_found_there_with_stiffness_free_or_not():
    def made(seed: int) -> Record:
        torque = drive(seed, 2.0 + 0.5 * seed)
        return record(torque, two_masses(torque, 40.0, (0.1, 1.0), (0.15, 0.02), 0.15), 2e-5)

    recordings = made(0), made(1)
    for fixed in (("torque_constant",), ("torque_constant", "stiffness")):
        parameters = {"torque_constant": 1.0, "stiffness": 40.0, "motor_inertia": 0.12, "motor_damping": 0.8}
        parameters |= {"arm_inertia": 0.12, "arm_damping": 0.05}
        found = asked(Model("generic", "j", "flexible_joint", parameters, fixed=fixed), *recordings)
        effect = best(found).effects[0]
        assert (effect.effect, effect.location) == ("coulomb_friction", "j_arm")
        assert effect.parameters["torque"] == pytest.approx(0.15, rel=0.2)
        assert best(found).model.parameters["arm_inertia"] == pytest.approx(0.15, rel=0.1)
        assert best(found).model.parameters["stiffness"] == pytest.approx(40.0, rel=0.2)


def test_columns_are_the_equation_filtered_whether_they_are_shared_between_shapes_or_not():
    """Against the equation itself, written here, at some orders of a friction that varies along the angle."""
    told = pendulum(0, coulomb=0.3)
    motion = banded(told, True, 8.0)
    top = np.max(np.abs(motion.velocity[:, 0]))
    sign = np.tanh(motion.velocity[:, 0] / (0.02 * top))
    for order in (1.0, 2.0, 5.0):
        form = Hypothesis(
            EFFECTS["position_dependent_friction"],
            "j_motor",
            "motor",
            (("order", order),),
            ("torque", "amplitude"),
            "phase",
        )
        wave = [np.ones(len(sign)), *(f(order * motion.angle[:, 0]) for f in (np.sin, np.cos))]
        torques = np.column_stack([-one * sign for one in wave])
        whole, columns = form.whole_and_columns(motion, RIGID)
        assert whole == pytest.approx(torques[motion.kept], abs=1e-12)
        assert columns == pytest.approx(motion.filtered(torques, times=2), abs=1e-9)


def test_readings_that_are_missing_do_not_count():
    whole = pendulum(0, coulomb=0.3)
    measured = whole.measured.copy()
    measured[3000:3400] = np.nan
    holed = Record("holed", DT, whole.input, measured, whole.exogenous, whole.resolution)
    cutoff = motion_band([whole])
    full, part = (banded(r, True, cutoff) for r in (whole, holed))
    lost = set(full.kept) - set(part.kept)
    step = round(full.dt / DT)
    assert lost and all(2900 < k * step < 3500 for k in lost)
    found = asked(RIGID, holed, pendulum(1, coulomb=0.3))
    plain = next(g for g in found.levels[0] if g.effects[0].effect == "coulomb_friction")
    assert plain.effects[0].parameters["torque"] == pytest.approx(0.3, rel=0.1)


def test_an_encoder_that_is_read_at_every_third_row_of_its_log_counts():
    whole = pendulum(0, coulomb=0.4)
    seldom = np.where(np.arange(len(whole))[:, None] % 3 == 0, whole.measured, np.nan)
    stepped = replace(whole, measured=seldom)
    assert len(banded(stepped, True, 4.0).kept) == len(banded(whole, True, 4.0).kept)
    found = []
    for one in (whole, stepped):
        level = asked(RIGID, one, pendulum(1, coulomb=0.4)).levels[0]
        found += [g.effects[0] for g in level if g.effects[0].effect == "coulomb_friction"]
    assert found[1].values["torque"] == pytest.approx(found[0].values["torque"], rel=0.02)
    # A hole of half a period does not.
    seldom[3000:3060] = np.nan
    assert len(banded(replace(whole, measured=seldom), True, 4.0).kept) < len(banded(whole, True, 4.0).kept)


def test_the_memory_of_a_direction_turns_over_its_displacement():
    position = np.concatenate([np.linspace(0.0, 1.0, 1001), np.linspace(1.0, 0.0, 1001)])
    direction = turning(position, 0.1)
    assert direction[1000] == pytest.approx(1.0, abs=1e-4)
    # 0.1 rad after the reversal: from +1 towards -1 by 1 - 1/e.
    assert direction[1101] == pytest.approx(-1.0 + 2.0 * math.exp(-1.0), abs=0.02)


def test_a_model_of_which_everything_is_known_has_its_effects_found_all_the_same():
    known = Model(
        "generic",
        "j",
        "rigid_body",
        {"torque_constant": 1.0, "motor_inertia": 0.14, "motor_damping": 0.35},
        fixed=("torque_constant", "motor_inertia", "motor_damping"),
    )
    found = asked(known, *(pendulum(s, weight=2.0) for s in (0, 1)))
    assert best(found).effects[0].effect == "gravity"
    assert best(found).effects[0].parameters["torque"] == pytest.approx(2.0, rel=0.03)


def test_what_an_actuator_makes_of_the_input_is_a_torque_at_the_motor():
    zone = Effect("dead_zone", "j_actuator", {"width": 0.1})
    for made in (Hypothesis.of, Hypothesis.resized):
        assert made(zone, RIGID.place(zone.location)).place == "motor"


def test_a_size_at_which_nothing_was_evaluated_is_no_size():
    """Where an effect is not linear in its size it is tried at some sizes, and what is between them counts:
    nothing is said of a gain that falls to less than half."""

    def made(seed: int) -> Record:
        one = pendulum(seed, weight=2.0)
        time = one.start + one.dt * np.arange(len(one))
        gain = 1.0 - 0.6 * (1.0 - np.exp(-time / (0.4 * len(one) * one.dt)))
        return replace(one, input=one.input / gain)

    found = asked(RIGID, made(0), made(1))
    assert best(found).effects
    assert not any(e.effect == "gain_drift" for level in found.levels for g in level for e in g.effects)


def cogging(seed, order=31.0, seconds=12.0):
    """A motor that turns at about a revolution a second, driven against a torque that varies ``order`` times
    per revolution: its speed swings at some 31 Hz, far above what else moves."""
    luck = np.random.default_rng(seed)
    fine, inertia, damping, size = 10, 2e-4, 0.02, 0.15
    q, v, dt = 0.0, 6.3, 0.001
    angle, torque = np.empty(round(seconds / dt)), np.empty(round(seconds / dt))
    for k in range(len(angle)):
        wanted = 6.3 + 0.6 * np.sin(0.7 * k * dt + seed)
        angle[k], torque[k] = q, 0.02 * 6.3 + 0.05 * (wanted - v) + 0.002 * luck.standard_normal()
        for _ in range(fine):
            v += dt / fine * (torque[k] + size * np.sin(order * q) - damping * v) / inertia
            q += dt / fine * v
    measured = np.column_stack([1e-4 * np.round(angle / 1e-4), np.full(len(angle), np.nan)])
    return Record("made here", dt, torque, measured, np.zeros(len(angle)), (1e-4, 1e-4))


def test_a_motor_that_cogs_is_seen_in_the_band_of_its_cogging():
    learn, judge = [cogging(0)], [cogging(1)]
    model = RIGID.with_values({"motor_inertia": 2.4e-4, "motor_damping": 0.016})
    assert motion_band([*learn, *judge]) > 31.0
    said = search_groups(model, learn, judge, recording_scales(model, learn))
    best = said.levels[0][0]
    (effect,) = best.effects
    assert (effect.effect, effect.values["order"]) == ("torque_ripple", 31.0)
    assert effect.values["amplitude"] == pytest.approx(0.15, rel=0.15)
    # Readings that scatter by more than a line does are no motion.
    assert motion_band([replace(r, resolution=(0.05, 0.05)) for r in learn]) < 20.0


@pytest.mark.parametrize("size", [0.01, 0.03])
def test_readings_that_wander_do_not_widen_the_band(size):
    """A resolver wanders by more than a step of the encoder, the more the slower: no line of that stands out
    from what is about it. An axis of a robot that moves below 1 Hz was asked up to 85 Hz."""
    one = pendulum(0)
    walk = np.cumsum(np.random.default_rng(4).standard_normal(len(one)))
    wander = scipy.signal.sosfiltfilt(scipy.signal.butter(2, 4.0, "high", fs=1.0 / DT, output="sos"), walk)
    read = one.measured + np.array([size / np.std(wander), 0.0]) * wander[:, None]
    assert motion_band([replace(one, measured=read)]) == pytest.approx(motion_band([one]), rel=0.1)
