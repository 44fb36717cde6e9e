"""The fine search along an order, a frequency or an angle, the currents' own evidence, and physics without a
name.  Recordings come from an integrator of the tests."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_rigs import DT, MODEL, coupled, explanation, joint_record

from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.diagnosis.decision.finding import finding
from haptic_teleop_sysid.diagnosis.decision.name_tests.doubt import doubted
from haptic_teleop_sysid.diagnosis.decision.search.decide import choose
from haptic_teleop_sysid.diagnosis.decision.search.explore import explore
from haptic_teleop_sysid.diagnosis.decision.search.rounds import SearchResult
from haptic_teleop_sysid.diagnosis.decision.verdict import decide_verdict
from haptic_teleop_sysid.diagnosis.decision.where import condition_of
from haptic_teleop_sysid.diagnosis.decision.words import called
from haptic_teleop_sysid.diagnosis.evidence.actuator import joined
from haptic_teleop_sysid.diagnosis.evidence.residual import shares
from haptic_teleop_sysid.diagnosis.evidence.shown_by_current import Shown, shown_by_current
from haptic_teleop_sysid.diagnosis.hypotheses.candidates import candidates
from haptic_teleop_sysid.diagnosis.inputs.scales import recording_scales
from haptic_teleop_sysid.diagnosis.starts import shortlist
from haptic_teleop_sysid.diagnosis.starts.answers import Answers
from haptic_teleop_sysid.diagnosis.starts.scan import both, scan
from haptic_teleop_sysid.diagnosis.starts.screen import screen
from haptic_teleop_sysid.estimation.whole_fit import fit_from_scratch, fit_whole
from haptic_teleop_sysid.recordings.dataset import DataSet


def scanned(**torques):
    record = joint_record(3, **torques)
    fit = fit_from_scratch(MODEL, [record])
    scales = recording_scales(MODEL, [record])
    return scan(fit, [record], scales), scales


def test_a_ripple_of_any_order_is_found_between_the_grid_points():
    found, scales = scanned(motor_torque=lambda q: 0.02 * np.sin(57.0 * q + 0.4))
    best = found["torque_ripple", "stage1_motor"][0]
    assert best == pytest.approx(57.0, abs=np.pi / 2 / scales.span(0))


@pytest.mark.parametrize("order", [57.0, 140.0])
def test_the_orders_of_a_long_recording_are_found_on_fewer_samples(order, monkeypatch):
    """Low ones on a thinned recording, those that are too fast for it on the whole one."""
    record = joint_record(3, motor_torque=lambda q: 0.03 * np.sin(order * q + 0.4))
    fit, scales = fit_from_scratch(MODEL, [record]), recording_scales(MODEL, [record])
    filtered = []
    gains = Answers.gains
    monkeypatch.setattr(
        Answers,
        "gains",
        lambda self, *rest: filtered.append((self.records[0].dt, len(rest[-1]))) or gains(self, *rest),
    )
    monkeypatch.setattr("haptic_teleop_sysid.estimation.records.ENOUGH_SAMPLES", len(record) // 2)
    found = scan(fit, [record], scales)
    assert found["torque_ripple", "stage1_motor"][0] == pytest.approx(order, abs=np.pi / 2 / scales.span(0))
    thinned, whole = (sum(n for dt, n in filtered if dt == step) for step in (2 * DT, DT))
    assert thinned > 100 and whole > 100


@pytest.mark.long
def test_a_long_recording_is_searched_on_fewer_samples_and_judged_on_all(monkeypatch):
    records = [
        joint_record(seed, seconds=10.0, rms=rms, motor_torque=_wavy) for seed, rms in ((3, 0.25), (4, 0.35))
    ]
    fit, scales = fit_from_scratch(MODEL, records[:1]), recording_scales(MODEL, records[:1])
    _, whole = explore(fit, MODEL, records[:1], records[1:], scales)
    used = []
    screening = shortlist.screen
    monkeypatch.setattr(
        shortlist, "screen", lambda f, r, e, *rest: used.append(r[0].dt) or screening(f, r, e, *rest)
    )
    monkeypatch.setattr("haptic_teleop_sysid.estimation.records.ENOUGH_SAMPLES", len(records[0]) // 2)
    _, thinned = explore(fit, MODEL, records[:1], records[1:], scales)
    assert set(used) == {2 * DT}
    assert thinned[0].effect.effect == whole[0].effect.effect == "torque_ripple"
    assert thinned[0].gain == pytest.approx(whole[0].gain, abs=1.0)
    assert thinned[0].held_out == pytest.approx(whole[0].held_out, abs=1.0)
    assert thinned[0].effect.parameters == pytest.approx(whole[0].effect.parameters, rel=1e-3, abs=1e-3)


def _wavy(angle):
    return 0.03 * np.sin(9.0 * angle + 0.4)


def test_a_stop_is_found_where_it_is():
    low = recording_scales(MODEL, [joint_record(3)]).lowest[1]
    at = 0.8 * low
    found, _ = scanned(arm_torque=lambda q: -20.0 * min(q - at, 0.0))
    assert any(v == pytest.approx(at, abs=0.06 * abs(low)) for v in found["hard_stop", "stage1_arm"])


def test_two_scans_are_joined_without_repetition():
    key = ("torque_ripple", "stage1_motor")
    assert both({key: [3.0, 5.0]}, {key: [5.0, 7.0]}) == {key: [3.0, 5.0, 7.0]}


# what the measured current shows


def current_data(seed, respond, noise=0.002):
    """A data set whose measured current is ``respond`` (of a command in fine steps) and noise."""
    rng = np.random.default_rng(seed)
    n, parts = 4000, 20
    command = np.repeat(rng.uniform(-0.5, 0.5, n // 10), 10)
    fine = np.repeat(command, parts)
    sensed = respond(fine, DT / parts).reshape(n, parts).mean(axis=1) + noise * rng.standard_normal(n) + 0.01
    zero = np.zeros(n)
    return DataSet(
        "made", "sfj", "stage1", DT, sensed, "A", "measured effort", zero, zero, zero, zero, command
    )


def lagging(current, h):
    out, value = np.empty_like(current), 0.0
    for i, u in enumerate(current):
        value += (u - value) * (1.0 - np.exp(-h / 0.003))
        out[i] = value
    return out


def late(current, h):
    steps = round(0.0013 / h)
    return np.concatenate([np.zeros(steps), current[:-steps]])


def limited(current, h):
    return np.clip(current, -0.4, 0.4)


def hardly_dead(current, h):
    return np.sign(current) * np.maximum(np.abs(current) - 0.0012, 0.0)


@pytest.mark.parametrize(
    ("respond", "effect", "parameter", "value"),
    [
        (lagging, "actuator_lag", "time_constant", 0.003),
        (late, "input_delay", "delay", 0.0013),
        (limited, "torque_saturation", "limit", 0.4 * MODEL.parameters["torque_constant"]),
        # Below the smallest start.
        (hardly_dead, "dead_zone", "width", 0.0012 * MODEL.parameters["torque_constant"]),
    ],
)
def test_the_currents_tell_what_the_amplifier_does(respond, effect, parameter, value):
    found = shown_by_current(MODEL, [current_data(1, respond)], [current_data(2, respond)])
    best = next(s for s in found if s.effect.effect != "channel_skew")
    assert best.effect.effect == effect
    assert best.effect.parameters[parameter] == pytest.approx(value, rel=0.03)
    assert abs(best.effect.parameters[parameter] - value) < 5.0 * best.std + 0.02 * value


@pytest.mark.parametrize("samples", [18, -43])
def test_a_stamp_far_off_shows_where_a_lively_command_is_like_nothing_but_itself(samples):
    rng = np.random.default_rng(7)

    def stamped(seed):
        command = 0.3 * np.random.default_rng(seed).standard_normal(4000)
        sensed = np.roll(command, samples) + 0.002 * rng.standard_normal(4000)
        zero = np.zeros(4000)
        return DataSet(
            "made", "sfj", "stage1", DT, sensed, "A", "measured effort", zero, zero, zero, zero, command
        )

    found = shown_by_current(MODEL, [stamped(1)], [stamped(2)])
    assert found[0].effect.effect == "channel_skew" or samples > 0
    skew = next(s for s in found if s.effect.effect == "channel_skew")
    assert skew.effect.parameters["delay"] == pytest.approx(samples * DT, abs=0.01 * DT)


def test_the_first_samples_that_are_judged_answer_commands_that_are_not():
    """A smooth command that is large where judging begins: a step there, of the tool's own making, made of
    every delay a lag."""

    def smooth(seed):
        rng = np.random.default_rng(seed)
        n, steps, t = 4000, 19, 2 * np.pi * np.arange(4000) * DT
        command = 0.2 * sum(np.cos(f * t + p) for f, p in ((0.3, 0.0), (1.1, 0.3 * seed)))
        fine = np.repeat(command, 20)
        late = np.concatenate([np.zeros(steps), fine[:-steps]]).reshape(n, 20).mean(axis=1)
        zero = np.zeros(n)
        sensed = late + 0.0005 * rng.standard_normal(n)
        return DataSet(
            "made", "sfj", "stage1", DT, sensed, "A", "measured effort", zero, zero, zero, zero, command
        )

    found = shown_by_current(MODEL, [smooth(1)], [smooth(2)])
    shown = {s.effect.effect: s for s in found}
    assert shown["input_delay"].effect.parameters["delay"] == pytest.approx(0.95 * DT, rel=0.02)
    assert shown["input_delay"].gain > shown["actuator_lag"].gain - 1.0


def test_a_late_stamp_and_a_late_torque_look_alike_to_the_currents():
    found = shown_by_current(MODEL, [current_data(1, late)], [current_data(2, late)])
    gains = {s.effect.effect: s.gain for s in found}
    assert gains["channel_skew"] == pytest.approx(gains["input_delay"], abs=1.0)


def test_a_sense_with_noise_and_offset_shows_nothing():
    same = [current_data(seed, lambda current, h: current) for seed in (1, 2)]
    assert shown_by_current(MODEL, same[:1], same[1:]) == []


@pytest.mark.parametrize("sample", [-1, 1500])
def test_a_single_reading_far_off_is_no_stamp_that_is_wrong(sample):
    """The last command of an experiment, which no measured current answers, had been a skew of 0.04 ms."""
    same = [current_data(seed, lambda current, h: current) for seed in (1, 2)]
    command = np.array(same[0].commanded_input)
    command[sample] += 3.0
    assert shown_by_current(MODEL, [replace(same[0], commanded_input=command)], same[1:]) == []


@pytest.mark.parametrize("step", [1e-3, 2e-4])
def test_a_sense_that_is_cut_off_towards_zero_is_no_dead_band(step):
    same = [current_data(seed, lambda current, h: current, noise=0.0) for seed in (1, 2)]
    cut = [replace(d, input=np.trunc(np.asarray(d.input) / step) * step) for d in same]
    shown = shown_by_current(MODEL, cut[:1], cut[1:])
    assert "dead_zone" not in {s.effect.effect for s in shown}


def test_a_lag_that_does_not_matter_is_not_material_however_exact_the_currents_are():
    """4 us at a sample of 2 ms are seen by a sense without noise."""

    records = [coupled(joint_record(seed)) for seed in (1, 2)]
    fit = fit_from_scratch(MODEL, records[:1])
    scales = recording_scales(MODEL, records[:1])
    quick = [Effect("input_delay", "stage1_actuator", {"delay": 4e-6})]
    quick.append(Effect("channel_skew", "stage1_actuator", {"delay": 4e-6}))
    shown = [Shown(effect, 1e-7, 600.0, 600.0, lambda value: 600.0) for effect in quick]
    found = joined(fit, MODEL, [], shown, records[:1], records[1:], scales, {})
    assert {e.effect.effect for e in found} == {"input_delay", "channel_skew"}
    assert not any(e.material for e in found)


def test_without_a_measured_current_nothing_is_said():
    data = replace(current_data(1, late), input_source="commanded effort")
    assert shown_by_current(MODEL, [data], [data]) == []


# physics without a name


def test_a_name_that_explains_clearly_less_is_not_given():
    steep = explanation("steep_drag", 300.0, 300.0, coefficient=1.0)
    near = explanation("quadratic_drag", 200.0, 150.0, coefficient=1.0)
    choice = choose([steep, near], 0.0, False)
    assert choice.unnamed
    assert choice.chosen is steep


def test_a_name_that_explains_nearly_as_much_is_given():
    steep = explanation("steep_drag", 300.0, 300.0, coefficient=1.0)
    near = explanation("quadratic_drag", 297.0, 298.0, coefficient=1.0)
    choice = choose([steep, near], 0.0, False)
    assert choice.chosen is near
    assert not choice.ambiguous


def test_physics_without_a_name_alone_yields_no_name():
    weak = explanation("creep", 5.0, 5.0, place="joint", stiffness=1.0, time_constant=1.0)
    assert choose([weak], 0.0, False) is None
    strong = explanation("creep", 300.0, 300.0, place="joint", stiffness=1.0, time_constant=1.0)
    choice = choose([strong], 0.0, False)
    assert choice.unnamed
    assert choice.others == ()
    assert called(choice.chosen.effect) == f"something without a name ({strong.effect.entry.sentence})"


def test_a_shifted_stamp_of_the_command_shows_when_the_input_changes():
    before = ()
    for effect in ("channel_skew", "input_delay"):
        assert condition_of(MODEL, effect, "stage1_actuator", before) == "changes of the input"
    assert condition_of(MODEL, "channel_skew", "stage1_arm_encoder", before) == "velocity"


def test_the_verdict_is_unknown_and_says_what_it_looks_like():
    records = [coupled(joint_record(seed)) for seed in (1, 2)]
    fit = fit_from_scratch(MODEL, records[:1])
    found = explanation("steep_drag", 300.0, 300.0, place="arm", coefficient=0.1)
    choice = choose([found], 0.0, False)
    result = SearchResult(fit, fit, (), (found,), recording_scales(MODEL, records[:1]), choice)
    result, doubt, stand = doubted(result, records[:1], records[1:], lambda model: (90.0,), lambda *_: True)
    verdict = decide_verdict(result, records[:1], records[1:], doubt, stand.spread)
    assert verdict.kind == "unknown"
    assert verdict.findings == []
    # The explanation was made up and takes nothing away: the place is that of the torque that is missing.
    place = max((found := shares(fit, records[:1])), key=found.get)
    assert verdict.where[0]["equation"] == f"stage1_{place}"
    assert "square of the speed" in doubt.why


@pytest.mark.parametrize(
    ("effect", "place", "parameters"),
    [
        ("torque_saturation", "actuator", {"limit": 2.0}),
        ("coulomb_friction", "motor", {"torque": 0.05}),
        ("encoder_scale", "arm_encoder", {"scale": 1.01}),
    ],
)
def test_an_uncertainty_is_a_number_that_grows_with_the_departure_from_none(effect, place, parameters):
    found = explanation(effect, 300.0, 300.0, place=place, **parameters)
    told = finding(choose([found], 0.0, False), found.fit, {})
    (name,) = parameters
    departure = {"limit": 2.0, "torque": 0.05, "scale": 0.01}[name]
    assert told["parameters"][name]["std"] == pytest.approx(0.015 * departure)


def test_nobody_is_surer_of_a_rival_than_of_what_is_named_before_it():
    found = explanation("coulomb_friction", 300.0, 300.0, torque=0.05)
    rival = explanation("coulomb_friction", 299.0, 299.0, place="arm", torque=0.05)
    choice = choose([found, rival], 0.0, False)
    assert choice.others
    unsure = {f"{found.effect.location}.coulomb_friction.torque": 0.2}
    told = finding(choice, found.fit, unsure)
    assert told["confidence"] < 0.3
    assert told["alternatives"][0]["confidence"] == told["confidence"]
    assert f"({100 * told['confidence']:.0f} %)" in told["because"]


def test_what_a_value_promises_is_what_least_squares_gain_beside_the_structure():
    record = joint_record(3, motor_torque=lambda q: 0.02 * np.sin(57.0 * q + 0.4))
    fit = fit_from_scratch(MODEL, [record])
    answers = Answers(fit, [record])
    random = np.random.default_rng(2)
    stacked = random.standard_normal((len(answers.left), 6)) + 0.1 * answers.left[:, None]
    stacked[:, 5] = answers.structure @ np.arange(1.0, answers.structure.shape[1] + 1.0)  # nothing of its own
    found = answers._promised([stacked], 3)
    for k in range(3):
        pair = stacked[:, 2 * k : 2 * k + (1 if k == 2 else 2)]
        together = np.column_stack([answers.structure, pair])
        left = answers.left - together @ np.linalg.lstsq(together, answers.left, rcond=None)[0]
        gained = 0.5 * (answers.left @ answers.left - left @ left)
        assert found[k] == pytest.approx(gained, rel=1e-6)


class Dahl:
    """A contact whose torque builds up over a displacement (Dahl, 1968), as a function of the angle."""

    def __init__(self, torque, gives):
        self.torque, self.gives, self.angle, self.borne = torque, gives, 0.0, 0.0

    def __call__(self, angle):
        moved = angle - self.angle
        self.borne += (np.sign(moved) * self.torque - self.borne) * abs(moved) / self.gives
        self.angle = angle
        return -self.borne


def test_a_weak_contact_that_gives_far_is_screened_at_how_far_it_gives():
    """At the stiffness of a stronger contact a weak one is a shape of its own: one that gave over 0.06 rad
    promised 1.6 of 23 nats."""
    record = joint_record(3, motor_torque=Dahl(0.003, 0.06))
    fit = fit_from_scratch(MODEL, [record])
    scales = recording_scales(MODEL, [record])
    starts = [e for e in candidates(MODEL, [record], scales) if e.effect == "presliding_friction"]
    best = screen(fit, [record], [e for e in starts if e.location == "stage1_motor"])[0]
    given, found = best.start.parameters, best.effect.parameters
    assert found["torque"] / found["stiffness"] == pytest.approx(given["torque"] / given["stiffness"])
    assert found["torque"] == pytest.approx(0.003, rel=0.5)
    whole = fit_whole(MODEL.with_effects(best.effect), fit.noise, [record])
    assert best.gain > 20.0
    assert whole.log_likelihood - fit.log_likelihood > 50.0
    assert whole.model.effects[-1].parameters["torque"] == pytest.approx(0.003, rel=0.2)


def test_a_model_whose_parameters_are_all_believed_is_screened_as_well():
    record = joint_record(3, motor_torque=lambda q: 0.05 * np.sin(3.0 * q))
    trusted = replace(MODEL, fixed=tuple(MODEL.parameters))
    fit = fit_from_scratch(trusted, [record])
    assert fit.free == ()
    effects = [Effect("torque_ripple", "stage1_motor", {"amplitude": 0.0, "order": 3.0, "phase": 0.0})]
    (found,) = screen(fit, [record], effects)
    assert found.gain > 50.0
