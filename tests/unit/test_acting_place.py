"""Where in a flexible joint something acts, without its name: by the one equation that does not contain it.

The machine is stepped here; what acts has no form that the project knows."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numba import njit
from stepped_machines import DT, ELASTIC, FINE, RIGID, drive, record

from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.diagnosis.decision.adequacy import Adequacy
from haptic_teleop_sysid.diagnosis.decision.name_tests.place import (
    at_its_place,
    at_the_map,
    beside_findings,
    holds_better,
    misplaced,
)
from haptic_teleop_sysid.diagnosis.decision.search.decide import Choice
from haptic_teleop_sysid.diagnosis.decision.search.rounds import SearchResult
from haptic_teleop_sysid.diagnosis.decision.unknown import drive_friction
from haptic_teleop_sysid.diagnosis.decision.unknown.at_reversals import Turning
from haptic_teleop_sysid.diagnosis.decision.unknown.drive_friction import with_drive_friction
from haptic_teleop_sysid.diagnosis.decision.verdict import Verdict
from haptic_teleop_sysid.diagnosis.evidence.acting_place import ActingPlace
from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.arm_response import ArmResponse
from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.parity import (
    parity_residuals,
    torque_at_the_motor,
)
from haptic_teleop_sysid.diagnosis.evidence.measured_map import MeasuredMap, no_torque
from haptic_teleop_sysid.diagnosis.evidence.residual import Condition
from haptic_teleop_sysid.diagnosis.hypotheses.explanation import Explanation
from haptic_teleop_sysid.diagnosis.inputs.scales import recording_scales
from haptic_teleop_sysid.estimation.whole_fit import fit_whole, noise_starts

STIFFNESS, MOTOR, ARM = 20.0, (0.06, 0.3), (0.1, 0.1)
CUTOFF = 8.0
"""Hz, some times the frequencies of the drive."""


@njit
def stepped(torque, motor, arm, joint, coulomb):
    """Angles (n, 2) of two masses on a spring with torques at three places, at FINE steps a sample."""
    q, h, found = np.zeros(4), DT / FINE, np.empty((len(torque), 2))
    for k in range(len(torque)):
        found[k, 0], found[k, 1] = q[0], q[1]
        for i in range(k * FINE, (k + 1) * FINE):
            spring = STIFFNESS * (q[0] - q[1]) + joint[i]
            rub = coulomb * np.tanh(q[2] / 1e-3)
            q[2] += h * (torque[k] - MOTOR[1] * q[2] - spring - rub + motor[i]) / MOTOR[0]
            q[3] += h * (spring - ARM[1] * q[3] + arm[i]) / ARM[0]
            q[0] += h * q[2]
            q[1] += h * q[3]
    return found


def machine(seed, place=None, coulomb=0.0, size=0.5, misread=0.0):
    """A record of that machine; an unknown signal, 0.5 N·m or 0.02 rad, acts at ``place``, and the arm's
    encoder has noise of ``misread`` rad, rms."""
    torque, luck = drive(seed, 2.0), np.random.default_rng(100 + seed)
    time = DT / FINE * np.arange(len(torque) * FINE)
    waves = [np.sin(2 * np.pi * (f * time + luck.uniform())) for f in (0.31, 0.83, 1.9)]
    signal = size * np.sum(waves, axis=0) / np.sqrt(1.5)
    acting = [signal if name == place else np.zeros(len(time)) for name in ("motor", "arm", "joint")]
    found = stepped(torque, *acting, coulomb)
    for column, encoder in enumerate(("motor_encoder", "arm_encoder")):
        if encoder == place:
            found[:, column] += 0.04 * signal[::FINE]
    found[:, 1] += misread * luck.normal(size=len(found))
    return record(torque, found, 1e-5)


@pytest.fixture(scope="module")
def machines():
    known = {}

    def of(*key, **more):
        name = (key, *more.items())
        if name not in known:
            known[name] = [machine(seed, *key, **more) for seed in (0, 1)]
        return known[name]

    return of


@pytest.mark.parametrize("place", ["motor", "arm", "joint", "arm_encoder", "motor_encoder"])
def test_the_equation_without_the_unknown_signal_holds_and_no_other(machines, place):
    left = parity_residuals(ELASTIC, machines(place), CUTOFF)
    others = [value for name, value in left.items() if name != place]
    assert 5.0 * left[place] < min(others), left


def test_beside_a_friction_at_the_motor_it_holds_once_that_is_allowed_for(machines):
    records = machines("arm_encoder", coulomb=0.3)  # which is smoothed, and sticks less than dry friction
    alone = parity_residuals(ELASTIC, records, CUTOFF)
    beside = parity_residuals(ELASTIC, records, CUTOFF, [friction("motor")])
    assert beside["arm_encoder"] < 0.5 * alone["arm_encoder"]
    assert min(beside, key=lambda place: beside[place]) == "arm_encoder", beside


@pytest.mark.parametrize(
    ("encoder", "place", "elsewhere"),
    [
        ("arm_encoder", "arm", True),
        ("arm_encoder", "joint", True),
        ("motor_encoder", "arm", False),  # a spring at the arm takes a fifth of what that equation leaves
        ("motor_encoder", "joint", True),
    ],
)
def test_a_torque_behind_the_motor_is_no_error_of_an_encoder(machines, encoder, place, elsewhere):
    acting = ActingPlace(ELASTIC, machines(encoder), CUTOFF)
    assert acting.places == (encoder,)
    alone, beside = (acting.left(known)[encoder] for known in ((), [spring(place)]))
    assert beside < 2.0 * alone
    assert acting.elsewhere(spring(place)) is elsewhere


@pytest.mark.parametrize("place", ["motor", "arm", "joint"])
def test_a_known_torque_takes_no_error_of_the_arms_encoder_for_itself(place):
    """What is known to act behind the spring stands in the equations without an encoder, too."""
    torque = drive(0, 2.0)
    angles = stepped(torque, *[np.zeros(len(torque) * FINE)] * 3, 0.0)
    wave = 0.02 * np.sin(2 * np.pi * 0.7 * DT * np.arange(len(torque)))
    records = [record(torque, angles + np.column_stack([0.0 * wave, wave]), 1e-5)]
    bare, known = (parity_residuals(ELASTIC, records, CUTOFF, k) for k in ((), [spring(place)]))
    assert known["arm_encoder"] <= 1.1 * bare["arm_encoder"]
    assert min(known, key=lambda one: known[one]) == "arm_encoder"


def test_where_the_arm_was_hardly_read_nothing_is_said(machines):
    (one, _) = machines("arm")
    unread = replace(one, measured=np.column_stack([one.measured[:, 0], np.full(len(one), np.nan)]))
    assert ActingPlace.of(ELASTIC, [unread], CUTOFF) is None
    assert ActingPlace.of(ELASTIC, [unread, one], CUTOFF).places == ("arm",)
    assert ActingPlace.of(RIGID, [one], CUTOFF) is None
    scale = Effect("encoder_scale", "j_arm_encoder", {"scale": 1.1})
    assert ActingPlace.of(ELASTIC.with_effects(scale), [one], CUTOFF) is None, "it cannot be allowed for"
    for still in (replace(one, input=0.0 * one.input), replace(one, input=np.nan * one.input)):
        acting = ActingPlace(ELASTIC, [still], CUTOFF)
        assert acting.left() == {} and not acting.places and not acting.elsewhere(friction("motor"))
        assert acting.explained([friction("motor")]) == 1.0


@pytest.mark.parametrize("place", ["joint", "arm_encoder", "motor_encoder"])
def test_holes_of_an_encoder_are_no_error_of_it(machines, place):
    records = []
    for one in machines(place):
        measured = one.measured.copy()
        for start in range(1000, len(one), 3000):
            measured[start : start + 150, 1] = np.nan
        records.append(replace(one, measured=measured))
    left = parity_residuals(ELASTIC, records, CUTOFF)
    assert min(left, key=lambda one: left[one]) == place
    assert ActingPlace(ELASTIC, records, CUTOFF).places == (place,)


def test_two_unknown_signals_at_two_places_are_at_none(machines):
    acting = ActingPlace(ELASTIC, machines("arm", coulomb=0.5), CUTOFF)
    assert not acting.places and not acting.elsewhere(friction("joint"))


def test_what_acts_at_the_motor_alone_says_nothing_of_names_elsewhere(machines):
    """Some random torque acts there on every machine."""
    assert ActingPlace(ELASTIC, machines("motor"), CUTOFF).places == ()


FOLLOWED = (("deflection", 0.9), ("arm angle", 0.5), ("motor velocity", 0.6))


def friction(place):
    return Effect("coulomb_friction", f"j_{place}", {"torque": 0.1})


def spring(place):
    name = {"joint": "hardening_spring"}.get(place, "spring_to_ground")
    sizes = {"joint": {"cubic": 3.0}}.get(place, {"stiffness": 0.3, "rest": 0.0})
    return Effect(name, f"j_{place}", sizes)


def found(records, *effects):
    baseline = fit_whole(ELASTIC, noise_starts(ELASTIC, records)[1], records, iterations=3)
    fits = [replace(baseline, model=ELASTIC.with_effects(*effects[: i + 1])) for i in range(len(effects))]
    choices = tuple(Choice(Explanation(fit, 90.0, 50.0, True, i), 0.9) for i, fit in enumerate(fits))
    return SearchResult(baseline, fits[-1], choices, (), recording_scales(ELASTIC, records))


def test_a_name_where_nothing_acts_is_given_up_and_one_at_the_place_stays(machines):
    records = machines("arm")
    acting = ActingPlace(ELASTIC, records, CUTOFF)
    assert acting.places == ("arm",)
    result, doubt = misplaced(found(records, spring("arm"), spring("joint")), acting, records)
    assert [c.chosen.effect.location for c in result.choices] == ["j_arm"] and doubt is None
    assert "all that is missing acts at j_arm" in result.given_up[0].why
    assert [e.location for e in result.final.model.effects] == ["j_arm"]
    result, doubt = misplaced(found(records, spring("joint")), acting, records)
    assert not result.choices and "hardening_spring at j_joint" in doubt.why


def test_a_friction_that_is_there_stays_beside_it_and_explains_little(machines):
    records = machines("arm", coulomb=0.05)
    acting = ActingPlace(ELASTIC, records, CUTOFF)
    result, doubt = misplaced(found(records, friction("motor")), acting, records)
    assert acting.places == ("arm",) and len(result.choices) == 1 and doubt is None
    share = acting.explained([friction("motor")])
    assert share < 0.3 and Adequacy(0.9, 0.9, True, share).much_is_left
    assert not Adequacy(0.9, 0.9, True).much_is_left


def test_an_unknown_is_told_at_the_place_whose_equation_holds(machines):
    acting = ActingPlace(ELASTIC, machines("arm_encoder"), CUTOFF)

    def told(place, kind="unknown"):
        where = [{"equation": f"j_{place}", "share": 0.9, "condition": "time", "intervals": []}]
        remaining = [Condition("j_motor", n, "", share, np.zeros(1), np.zeros(1)) for n, share in FOLLOWED]
        verdict = Verdict(kind, where, [], remaining, [])
        found, misread = at_its_place(verdict, beside_findings(verdict, acting))
        return found.where[0]["equation"], found.where[0]["condition"], misread

    here = ("j_arm_encoder", "arm angle", "j_arm_encoder")
    assert told("joint") == told("motor") == told("actuator") == here
    assert told("arm_encoder") == ("j_arm_encoder", "time", None)
    assert told("joint", "identified") == ("j_joint", "time", None)
    assert "error of j_arm_encoder" in no_torque("j_arm_encoder").why


def at(place):
    where = [{"equation": f"j_{place}", "share": 0.9, "condition": "time", "intervals": []}]
    return Verdict("unknown", where, [], [], [])


@pytest.mark.parametrize(
    ("given_up", "told"),
    [("joint", "j_joint"), ("arm", "j_motor"), (None, "j_motor")],
)
def test_a_name_that_was_given_up_and_the_equations_together_tell_the_place(given_up, told):
    acting = SimpleNamespace(model=ELASTIC, bare={"motor": 0.02, "arm": 0.1, "joint": 0.01})
    effect = given_up and friction(given_up)
    assert at_its_place(at("motor"), acting, effect)[0].where[0]["equation"] == told
    near = SimpleNamespace(model=ELASTIC, bare={"motor": 0.0202, "arm": 0.1, "joint": 0.02})
    assert at_its_place(at("motor"), near, effect)[0].where[0]["equation"] == "j_motor"


def test_an_error_of_an_encoder_takes_more_than_a_name_that_was_given_up():
    acting = SimpleNamespace(model=ELASTIC, bare={"motor": 0.02, "joint": 0.1, "arm_encoder": 0.01})
    late = Effect("sensor_delay", "j_arm_encoder", {"delay": 0.01})
    assert at_its_place(at("motor"), acting, late) == (at("motor"), None)


@pytest.mark.parametrize(
    ("place", "quantities", "closed", "told"),
    [
        ("arm", ("arm angle",), 0.82, ("j_arm", "arm angle")),
        ("arm", ("arm angle",), 0.42, ("j_joint", "time")),
        ("motor", ("input torque",), 0.82, ("j_joint", "time")),  # the input's is the actuator's
        ("joint", ("deflection",), 0.82, ("j_joint", "time")),
    ],
)
def test_a_map_that_takes_most_of_the_error_away_tells_the_place(place, quantities, closed, told):
    mapped = MeasuredMap("drawn", friction(place), explained=0.99, closed=closed, quantities=quantities)
    where = at_the_map(at("joint"), mapped, None).where[0]
    assert (where["equation"], where["condition"]) == told
    none = MeasuredMap("none was drawn")
    assert at_the_map(at("joint"), none, None) == at("joint")


@pytest.mark.parametrize(("holds", "told"), [("arm", "j_arm"), ("motor", "j_joint"), (None, "j_arm")])
def test_a_map_tells_the_place_only_where_no_other_equation_stands_out(holds, told):
    left = {"motor": 0.1, "arm": 0.1, "joint": 0.1} | ({holds: 0.01} if holds else {})
    mapped = MeasuredMap("drawn", friction("arm"), explained=0.99, closed=0.8, quantities=("arm angle",))
    acting = SimpleNamespace(model=ELASTIC, bare=left)
    assert at_the_map(at("joint"), mapped, acting).where[0]["equation"] == told


@pytest.mark.parametrize(("explained", "told"), [(0.99, "j_arm"), (0.5, "j_joint")])
def test_a_map_against_its_own_equation_must_explain_nearly_all(explained, told):
    """A spring that creeps is drawn over the arm's angle by half; a detent of the arm by all of it."""
    acting = SimpleNamespace(model=ELASTIC, bare={"motor": 0.008, "arm": 0.12, "joint": 0.01})
    mapped = MeasuredMap("drawn", friction("arm"), explained=explained, closed=0.8, quantities=("arm angle",))
    assert at_the_map(at("joint"), mapped, acting).where[0]["equation"] == told


@pytest.mark.parametrize(("size", "moves"), [(0.5, True), (0.1, False)])
def test_random_torque_at_the_motor_takes_nothing_from_the_arm(machines, size, moves):
    acting = ActingPlace(ELASTIC, machines("motor", size=size), CUTOFF)
    where = [{"equation": "j_arm", "share": 0.9, "condition": "time", "intervals": []}]
    found, _ = at_its_place(Verdict("unknown", where, [], [], []), acting)
    assert found.where[0]["equation"] == ("j_motor" if moves else "j_arm")


@pytest.mark.parametrize("place", ["arm", "joint", "arm_encoder"])
@pytest.mark.parametrize("coulomb", [0.3, 0.0])
def test_friction_of_the_drive_is_told_with_its_size_whatever_acts_behind_it(machines, place, coulomb):
    kinds = [[one] for one in machines(place, coulomb=coulomb)]
    acting = ActingPlace(ELASTIC, [*kinds[0], *kinds[1]], CUTOFF)
    fit = found(kinds[0], friction("motor")).baseline
    where = [{"equation": f"j_{place}", "share": 0.9, "condition": "time", "intervals": []}]
    verdict = Verdict("unknown", where, [], [], [])
    told = with_drive_friction(verdict, acting, kinds, fit, Turning()).findings
    assert [(f["effect"], f["location"]) for f in told] == [("coulomb_friction", "j_motor")] * (coulomb > 0)
    for one in told:
        assert one["parameters"]["torque"]["value"] == pytest.approx(coulomb, rel=0.02)
        assert one["confidence"] == 0.69 and f"does not contain j_{place}" in one["because"]
        again = replace(verdict, findings=told)
        assert with_drive_friction(again, acting, kinds, fit, Turning()) is again
        excluded = Turning(smooth=frozenset({("coulomb_friction", "j_motor")}))
        assert with_drive_friction(verdict, acting, kinds, fit, excluded) is verdict


@pytest.mark.parametrize(("small", "told"), [(0.006, True), (0.02, False)])
def test_friction_of_the_drive_may_be_small_beside_what_drives_one_kind(machines, monkeypatch, small, told):
    """It took 0.6 % of the input's torque off what a chirp leaves, and 7 % of what small motions leave."""
    kinds = [[one] for one in machines("joint", coulomb=0.3)]
    acting = ActingPlace(ELASTIC, [*kinds[0], *kinds[1]], CUTOFF)
    fit = found(kinds[0], friction("motor")).baseline
    where = [{"equation": "j_joint", "share": 0.9, "condition": "time", "intervals": []}]
    verdict = Verdict("unknown", where, [], [], [])
    large = 0.075 if told else small
    asked = iter([(0.3, 0.1 * large, large), (0.3, 0.1 * small, small)])
    monkeypatch.setattr(drive_friction, "torque_at_the_motor", lambda *arguments: next(asked))
    assert bool(with_drive_friction(verdict, acting, kinds, fit, Turning()).findings) is told


def test_friction_of_the_drive_is_told_where_it_is_not_clear_what_acts_behind_it(machines):
    """A noisy reading of an arm on which something acts, as a strain gauge on a beam gives it."""
    kinds = [[one] for one in machines("arm", coulomb=0.3, size=0.05, misread=0.02)]
    acting = ActingPlace(ELASTIC, [*kinds[0], *kinds[1]], CUTOFF)
    assert holds_better(replace(acting, beside=(acting.dry_friction,))) is None
    fit = found(kinds[0], friction("motor")).baseline
    where = [{"equation": "j_arm", "share": 0.9, "condition": "time", "intervals": []}]
    verdict = Verdict("unknown", where, [], [], [])
    (told,) = with_drive_friction(verdict, acting, kinds, fit, Turning()).findings
    assert told["parameters"]["torque"]["value"] == pytest.approx(0.3, rel=0.1)


def test_the_arm_follows_as_its_equation_says():
    arm, dt = ArmResponse(200.0, 1.0, 1e-3), 1e-3
    time = dt * np.arange(20_000)
    wave = np.sin(2 * np.pi * 1.3 * time)
    s = 2j * np.pi * 1.3
    steady = np.imag(200.0 / (s * s + s + 200.0) * np.exp(s * time))
    assert arm(wave)[15_000:] == pytest.approx(steady[15_000:], abs=2e-3)
    own = arm.by_itself(2000)
    swing = np.exp(-0.5 * time[:2000]) * np.cos(np.sqrt(200.0 - 0.25) * time[:2000])
    assert own @ np.linalg.lstsq(own[:200], swing[:200], rcond=None)[0] == pytest.approx(swing, abs=1e-6)


def test_a_gain_that_no_equation_asks_for_is_given_up_where_all_acts_at_the_arm(machines):
    acting = ActingPlace(ELASTIC, machines("arm"), CUTOFF)
    gain = Effect("gain_error", "j_actuator", {"gain": 0.8})
    assert acting.elsewhere(gain)
    assert acting.explained([gain]) < 0.1


@pytest.mark.parametrize("named", [True, False])
def test_beside_friction_of_the_drive_a_name_where_nothing_acts_is_given_up(machines, named):
    """Friction is in all equations but the arm's: none holds before it is allowed for."""
    records = machines("arm", coulomb=0.5)
    acting = ActingPlace(ELASTIC, records, CUTOFF)
    assert not acting.places
    gain = Effect("gain_error", "j_actuator", {"gain": 0.8})
    names = [friction("motor"), gain] if named else [gain]
    result, doubt = misplaced(found(records, *names), acting, records)
    assert [c.chosen.effect.effect for c in result.choices] == ["coulomb_friction"] * named
    assert (doubt is None) == named
    assert acting.explained([gain]) < 0.1
    shares = [acting.explained([friction("motor"), *more]) for more in ((), (spring("arm"),))]
    assert all(0.0 < share < 0.5 for share in shares), "much acts at the arm that has no name"


def test_friction_alone_is_no_place_of_something_unknown(machines):
    acting = ActingPlace(ELASTIC, machines(coulomb=0.5), CUTOFF)
    assert not acting.clear_beside([]).places
    assert acting.explained([friction("motor")]) == 1.0


@given(st.lists(st.sampled_from([0.0005, 0.002, 0.004, 0.011, 0.03, 0.06, 0.4]), min_size=5, max_size=5))
def test_the_places_are_the_same_whether_or_not_encoders_are_asked_last(left):
    places = ["motor", "arm", "joint", "motor_encoder", "arm_encoder"]
    whole = dict(zip(places, left, strict=True))
    acting = ActingPlace(ELASTIC, (), CUTOFF)
    for asked in (), ("motor_encoder", "arm_encoder"):
        acting._known[(), asked, ()] = {place: whole[place] for place in [*places[:3], *asked]}
    least = sorted(whole.values())
    gaps = [k for k in range(1, 5) if least[k] > max(2.5 * least[k - 1], 0.01)]
    holding = {p for p in places if whole[p] < least[gaps[0]]} if gaps else set()
    if "motor" in holding or ("arm" in holding and len(holding) > 1):
        holding = set()
    assert set(acting.places) == holding
    assert not holding or whole[acting.places[0]] == least[0]
    assert len(acting.content(False)["left"]) == 3 and len(acting.content(True)["left"]) == 5


@pytest.mark.parametrize("place", ["arm", "joint", "arm_encoder"])
def test_recordings_on_which_nothing_slides_want_no_friction(machines, place):
    dry = Effect("coulomb_friction", "j_motor", {"torque": 1.0})
    still = [replace(r, measured=np.zeros_like(r.measured)) for r in machines("motor")]
    assert torque_at_the_motor(ELASTIC, still, CUTOFF, dry, place) is None


def test_an_unknown_beside_friction_without_a_name_is_told_at_its_place(machines):
    acting = ActingPlace(ELASTIC, machines("arm_encoder", coulomb=0.3), CUTOFF)
    where = [{"equation": "j_motor", "share": 0.9, "condition": "time", "intervals": []}]
    verdict = Verdict("unknown", where, [], [], [])
    beside = beside_findings(verdict, acting)
    assert beside.content(False)["beside"] == ["coulomb_friction at j_motor"]
    assert at_its_place(verdict, beside)[1] == "j_arm_encoder"
