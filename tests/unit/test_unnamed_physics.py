"""Two effects found by name, and physics without one: measured as a map, its law suggested. The recordings
are those of an integrator of the tests' own."""

import ast
import math
import types
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from own_joint import DT, TRUTH
from own_joint_records import LAB, errors_of, records

import haptic_teleop_sim.effects
from haptic_teleop_sim.kernel import simulate
from haptic_teleop_sim.kernel.codegen import effect_source
from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.diagnosis.decision.search.rounds import search
from haptic_teleop_sysid.diagnosis.evidence.measured_map import measured_map
from haptic_teleop_sysid.diagnosis.evidence.suggested_law import of_map
from haptic_teleop_sysid.diagnosis.evidence.suggested_law.entry_file import law_words
from haptic_teleop_sysid.diagnosis.inputs.scales import recording_scales, within_reach
from haptic_teleop_sysid.diagnosis.report.page_map import map_picture
from haptic_teleop_sysid.estimation.records import Record
from haptic_teleop_sysid.estimation.whole_fit import fit_from_scratch
from haptic_teleop_sysid.recordings.parameter_units import Units


def baseline(learn):
    return fit_from_scratch(LAB, learn, limits=within_reach(LAB, recording_scales(LAB, learn)))


@pytest.mark.long
@pytest.mark.parametrize(
    ("law", "numbers", "effect", "place", "true"),
    [
        (1, (0.3, 2.0, 0.6), "angle_dependent_inertia", "arm",
         {"amplitude": 0.3, "order": 2.0, "phase": 0.6}),
        (2, (4.0, 0.8), "torque_speed_limit", "actuator", {"limit": 4.0, "slope": 0.8}),
    ],
)  # fmt: skip
def test_an_effect_is_found_by_name_with_its_sizes(law, numbers, effect, place, true):
    learn, judge = records(law, *numbers, seconds=7.0)
    result = search(LAB, baseline(learn), learn, judge)
    found = [c.chosen.effect for c in result.choices]
    assert [(e.effect, e.location) for e in found] == [(effect, f"stage1_{place}")]
    assert found[0].parameters == pytest.approx(true, rel=0.03)
    structure = {n: result.final.model.parameters[n] for n in TRUTH}
    assert structure == pytest.approx(TRUTH, rel=0.03)


@pytest.mark.long
def test_neither_is_found_where_nothing_is_hidden():
    learn, judge = records(0, seconds=7.0)
    assert search(LAB, baseline(learn), learn, judge).choices == ()


def measured(law, *numbers, **options):
    learn, judge = records(law, *numbers, **options)
    return measured_map(baseline(learn), LAB, learn, judge, errors_of(learn, judge))


def bump(q):
    x = (q - 0.25) / 0.2
    return -0.3 * x * math.exp(0.5 - 0.5 * x * x)


@pytest.mark.parametrize(
    ("law", "numbers", "place", "variable", "torque", "closed"),
    [
        (3, (0.3, 0.25, 0.2), "arm", "angle", bump, 0.6),
        (4, (0.25,), "motor", "velocity", lambda v: -0.25 * v**3, 0.85),
        (5, (1.2, 0.3), "arm", "angle", lambda q: -1.2 * (q - 0.3) ** 3, 0.8),
        (9, (0.3, 0.2), "arm", "velocity", lambda v: -0.12 * v / (0.04 + v * v), 0.8),
    ],
    ids=["detent", "cubic drag", "cubic spring", "eddy-current brake"],
)
def test_physics_without_a_name_is_measured_and_its_law_suggested(
    law, numbers, place, variable, torque, closed
):
    found = measured(law, *numbers)
    assert found.effect is not None, found.why
    assert found.effect.location == f"stage1_{place}"
    assert found.effect.table.variables == (variable,)
    assert found.closed > closed
    # The suggested entry, added by hand as its text says, gives the torque that was hidden.
    text = found.content()["law"]["entry"]
    ast.parse(text)
    module = types.ModuleType("haptic_teleop_sim.effects.suggested")
    module.__package__ = haptic_teleop_sim.effects.__name__
    exec(compile(text, "suggested", "exec"), module.__dict__)
    entry = module.SUGGESTED
    assert entry.where == (place,)
    assert "def suggested" in effect_source(entry)
    sizes = types.SimpleNamespace(**{p.name: p.typical for p in entry.parameters})
    at = np.linspace(-0.5, 0.8, 27)
    seen = types.SimpleNamespace(position=at, velocity=at, **haptic_teleop_sim.effects.on_arrays.NUMERIC)
    true = np.array([torque(x) for x in at])
    assert entry.equation(seen, sizes) == pytest.approx(true, abs=0.03 * np.max(np.abs(true)))


@pytest.mark.parametrize(
    ("law", "numbers", "over", "amplitude", "closed"),
    [(7, (4.0,), ("velocity", "deflection"), 1.0, 0.6), (8, (0.4, 3.0), ("angle", "deflection"), 2.0, 0.5)],
    ids=["stiffer with speed", "stiffness over a turn"],
)
def test_a_torque_of_the_joint_that_follows_the_motor_is_measured(law, numbers, over, amplitude, closed):
    found = measured(law, *numbers, amplitude=amplitude)
    assert found.effect is not None, found.why
    assert found.effect.location == "stage1_joint"
    assert found.effect.table.variables == over
    assert found.closed > closed
    if law == 8:  # of all turns alike, also where no motion went
        table = found.effect.table
        at = np.linspace(-3.0, 3.0, 50)
        there = table.at(at, np.full(50, 0.1))
        assert there == pytest.approx(table.at(at + 2.0 * np.pi, np.full(50, 0.1)), abs=1e-9)
        assert "in a turn" in found.why


def test_the_band_is_wide_where_no_motion_went():
    table = measured(5, 1.2, 0.3).effect.table
    middle = len(table.torque) // 2
    assert max(table.torque_std[0], table.torque_std[-1]) > 3.0 * table.torque_std[middle]
    assert table.torque_std[middle] < 0.1


def test_a_joint_that_creeps_is_no_map():
    found = measured(6, 1.5, 0.6)
    assert found.effect is None
    assert found.fit is None
    assert "memory" in found.why or "follows" in found.why
    assert found.content()["added"] is False


def test_a_map_that_makes_other_recordings_worse_is_not_put_in():
    learn, judge = records(3, 0.3, 0.25, 0.2)
    base = baseline(learn)
    found = measured_map(base, LAB, learn, judge, lambda model: (0.5, 0.5 if model == base.model else 0.6))
    assert found.effect is None
    assert "no map was added" in found.why


def test_a_model_that_has_a_map_gets_no_second_one():
    learn, judge = records(4, 0.25)
    with_one = measured(4, 0.25)
    again = measured_map(with_one.fit, replace(LAB), learn, judge, errors_of(learn, judge))
    assert again.effect is None
    assert "already" in again.why


@pytest.mark.parametrize(
    "parameters",
    [
        {"variable": "angle", "knots": [-1.0, 0.0, 1.0], "torque": [0.1, 0.0, 0.3], "torque_std": [0.1] * 3},
        {"variable": ["angle", "velocity"], "knots": [[0.0, 1.0], [0.0, 2.0, 3.0]],
         "torque": [[0.0, 1.0, 2.0], [1.0, 0.0, 2.0]]},
    ],
)  # fmt: skip
def test_the_page_draws_a_curve_and_a_surface_with_their_quantities(parameters):
    names = ["arm angle", "arm velocity"][: 2 if isinstance(parameters["variable"], list) else 1]
    figure = map_picture(
        {"parameters": parameters, "location": "stage1_arm", "depends_on": names}, Units("m", "N")
    )
    texts = [text for axes in figure.axes for text in (axes.get_xlabel(), axes.get_ylabel())]
    assert "arm angle (m)" in texts
    assert any("torque at stage1_arm (N)" in text for text in texts)
    assert ("arm velocity (m/s)" in texts) == isinstance(parameters["variable"], list)
    assert bool(figure.axes[0].get_legend()) == ("torque_std" in parameters)


def swinging(seed):
    """A rigid body of 0.2 kg*m^2 with drag of power 1.5, pushed by sines."""
    rng = np.random.default_rng(seed)
    time = DT * np.arange(3000)
    push = sum(0.8 * np.sin(2.0 * np.pi * (f * time + rng.uniform())) for f in (0.2, 0.5, 1.1, 1.9))
    steps, q, v, seen = 20, 0.0, 0.0, []
    for torque in push.tolist():
        seen.append(q)
        for _ in range(steps):
            q += 0.5 * DT / steps * v
            v += DT / steps * (torque - 0.1 * v - 0.4 * math.copysign(abs(v) ** 1.5, v)) / 0.2
            q += 0.5 * DT / steps * v
    angle = np.round(np.array(seen) / 1e-4) * 1e-4
    measured = np.column_stack([angle, np.full(len(angle), np.nan)])
    return Record("swinging", DT, push, measured, np.zeros(len(angle)), (1e-4, 1e-4), at_rest=True)


def test_a_rigid_body_s_drag_is_measured_and_its_power_suggested():
    parameters = {"torque_constant": 1.0, "motor_inertia": 0.22, "motor_damping": 0.12}
    lab = Model("generic", "j", "rigid_body", parameters, fixed=("torque_constant",))
    learn, judge = [swinging(1)], [swinging(2)]
    base = fit_from_scratch(lab, learn, limits=within_reach(lab, recording_scales(lab, learn)))

    def errors(model):
        shown = [simulate(model, r.input, DT).states[:, 0] - r.measured[:, 0] for r in (learn[0], judge[0])]
        sizes = [float(np.std(r.measured[:, 0])) for r in (learn[0], judge[0])]
        return tuple(float(np.std(s)) / size for s, size in zip(shown, sizes, strict=True))

    found = measured_map(base, lab, learn, judge, errors)
    assert found.effect is not None, found.why
    assert found.effect.location == "j_motor"
    assert found.effect.table.variables == ("velocity",)
    assert [term.text for term in found.law.terms] == ["s.velocity * s.sqrt(s.abs(s.velocity))"]
    assert found.law.coefficients == pytest.approx([-0.4], rel=0.02)


def test_where_a_map_explains_nothing_of_all_equations_no_law_of_it_is_suggested(monkeypatch):
    """Four fifths of less than nothing would be less than any law explains."""
    found = []
    monkeypatch.setattr(of_map, "library", lambda *args: [])
    monkeypatch.setattr(of_map, "sparse_law", lambda search, products: SimpleNamespace(explained=found[0]))
    motion = SimpleNamespace(angle=np.zeros((9, 2)), velocity=np.zeros((9, 2)))
    latent = SimpleNamespace(place="motor", quantities=("motor angle",))
    effect = SimpleNamespace(location="j", table=SimpleNamespace(variables=("angle",)))
    for share, law, suggested in (
        (-0.2, -0.15, False),
        (0.5, 0.45, True),
        (0.5, 0.3, False),
        (-0.2, 0.1, False),
    ):
        found[:] = [law]
        sides = [SimpleNamespace(side=SimpleNamespace(motions=[motion]))]
        search = SimpleNamespace(sides=sides, model=None, explained=lambda terms, share=share: share)
        assert (of_map.law_of(search, latent, effect) is not None) is suggested


@pytest.mark.parametrize(
    ("place", "words"),
    [
        ("arm", "torque = -5.3 * abs(angle) * sign(velocity) +2"),
        ("joint", "torque = -5.3 * abs(deflection) * sign(deflection_rate) +2"),
    ],
)
def test_a_law_is_told_in_the_words_of_a_model_file(place, words):
    """At the joint these are those of the deflection: its `angle` and `velocity` are the motor's."""
    terms = (
        SimpleNamespace(place=place, text="s.abs(s.position) * s.direction", factors=()),
        SimpleNamespace(place=place, text="1", factors=()),
    )
    assert law_words(SimpleNamespace(terms=terms, coefficients=(-5.3, 2.0))) == words
