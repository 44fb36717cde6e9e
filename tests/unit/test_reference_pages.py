"""The documentation's reference pages say what the code says: nodes, faults, effects, modules."""

import re
import sys
from pathlib import Path

import numpy as np
import pytest
import sympy

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "docs" / "_ext"))

from effect_pictures import AMPLITUDE, DT, PERIOD, followed, response
from effects_page import SYMBOLS, effects_page
from plain_docstrings import to_rst

from haptic_teleop_sim.effects import EFFECTS
from haptic_teleop_sim.effects.symbols import namespaces
from haptic_teleop_sim.model import load_model
from haptic_teleop_sysid.commands.acquire import experiment_from

NAMED = re.compile(r"(?<![\w/.])(?:docs|config|tests|src|tools)/[\w/]+\.(?:\w+\.)?\w+")


@pytest.fixture(scope="module")
def pages():
    pytest.importorskip("rclpy", reason="needs ROS 2: `make setup`, or source an installation")
    import reference_pages

    return reference_pages


def drawn(name):
    known, result = response(EFFECTS[name])
    return known, result, known["time"] > PERIOD / 2  # the motion has set in


def test_every_fault_says_what_happened_and_what_to_do(pages):
    found = pages.faults()
    assert len(found) > 30
    assert {name for (name, sentence) in found if len(sentence.partition("; ")[2]) < 10} == set()


def test_each_node_has_a_page_with_all_its_parameters_and_faults(pages):
    made = pages.node_pages()
    for name, node in pages.nodes().items():
        text = made[f"nodes/{name}.md"]
        assert all(f"| `{entry.name}`<br>" in text for entry in node.TABLE)
        assert all(f"`{fault}`" in text for fault in node.FAULTS)
    assert {"sfj_driver", "omni_driver", "force_controller", "recorder"} <= set(pages.nodes())


@pytest.mark.parametrize(
    ("limits", "told"),
    [
        ("0 <= value <= 2", "0 to 2"), ("0 <= value", "from 0"), ("0 < value", "above 0"),
        ("0 < value <= 1", "above 0, to 1"), ("-1 <= value < 1", "from -1, below 1"), ("a | b", "a or b"),
        ("0 < value < 1", "above 0, below 1"), ("value <= 3", "to 3"),
    ],
)  # fmt: skip
def test_ranges_are_told_in_words(pages, limits, told):
    assert pages.in_words(limits) == told


def test_a_default_stands_on_the_page_as_one_writes_it(pages):
    text = pages.node_pages()["nodes/force_controller.md"]
    row = "| `timeout`<br>default `0.05` s | largest age of an input that is used<br>*0.005 to 0.2* |"
    assert row in text
    assert pages.yaml_text([True, float("inf"), "a"]) == "[true, .inf, a]"


def test_the_modules_of_the_programming_interface_are_there(pages):
    made = pages.api_pages()
    assert "api/haptic_teleop_control.laws.stage_law.md" in made and len(made) > 50


def test_dry_friction_opposes_the_velocity_with_its_torque():
    known, torque, moving = drawn("coulomb_friction")
    quick = moving & (np.abs(known["velocity"]) > 0.1)
    assert torque[quick] == pytest.approx(-0.2 * np.sign(known["velocity"][quick]), abs=1e-6)
    assert followed(EFFECTS["coulomb_friction"]) == "velocity"


def test_hysteresis_runs_round_its_loop_and_a_drag_does_not():
    known, torque, moving = drawn("hysteresis")
    centre = moving & (np.abs(known["deflection"]) < 1e-3)
    rising = known["velocity"][centre] > 0
    assert torque[centre][rising].mean() - torque[centre][~rising].mean() > 0.15
    known, torque, _ = drawn("quadratic_drag")
    assert torque == pytest.approx(-0.02 * known["velocity"] * np.abs(known["velocity"]), rel=1e-6)


def test_a_lag_follows_as_a_first_order_system_and_a_late_sensor_by_its_delay():
    known, acting, _ = drawn("actuator_lag")
    omega, tau = 2 * np.pi / PERIOD, 0.02
    late = np.sin(omega * known["time"] - np.arctan(omega * tau)) / np.hypot(1.0, omega * tau)
    settled = known["time"] > 10 * tau
    assert np.abs(acting - late)[settled].max() < omega * 0.002  # held over samples of 2 ms
    known, error, moving = drawn("sensor_delay")
    truth = AMPLITUDE * (np.sin(omega * (known["time"] - 0.01)) - np.sin(omega * known["time"]))
    assert np.abs(error - truth)[moving].max() < 2 * DT


def test_a_flexible_mode_swings_at_its_frequency():
    known, torque, _ = drawn("extra_flexible_mode")
    # What the rigid part of the added inertia asks for is slow; the rest is the mode, 4 Hz on a fixed arm.
    rest = torque - np.convolve(torque, np.ones(1250) / 1250, "same")
    spectrum = np.abs(np.fft.rfft(rest * np.hanning(len(rest))))
    assert np.fft.rfftfreq(len(rest), DT)[spectrum.argmax()] == pytest.approx(4.0, abs=0.3)


def test_docstrings_keep_their_names_and_layout_and_mean_nothing_else():
    made = "\n".join(to_rst(["Gives *a* of `f(x)`s, see x_.", "", "Layout:", "    one  two"]))
    assert "``f(x)``" in made and r"\*a\*" in made and r"x\_" in made
    assert "::\n\n        one  two" in made


def test_every_file_that_a_page_names_is_there():
    root = Path(__file__).resolve().parents[2]
    named = {
        (page.name, path)
        for page in (*root.glob("*.md"), *root.glob("docs/*.md"))
        if page.name != "CHANGELOG.md"
        for path in NAMED.findall(page.read_text())
    }
    assert len(named) > 60
    assert {(page, path) for page, path in named if not (root / path).exists()} == set()


def test_the_files_of_the_identification_example_are_read():
    examples = Path(__file__).resolve().parents[2] / "docs" / "examples" / "stage1"
    lab, friction = (load_model(examples / name) for name in ("lab.yaml", "friction.yaml"))
    assert lab.parameters == friction.parameters and len(friction.effects) == 1
    experiment, _ = experiment_from(examples / "check.yaml")
    assert experiment.joint == "stage1" and experiment.settings.multisine.rms == 0.16


def test_the_catalogue_says_what_an_effect_needs_to_be_seen(tmp_path):
    page = effects_page(tmp_path)
    needing = [entry for entry in EFFECTS.values() if entry.needs]
    assert {"torque_ripple", "torque_speed_limit"} <= {entry.name for entry in needing}
    for entry in needing:
        assert f"It needs {entry.needs}." in page


def test_every_sign_of_an_equation_is_a_parameter_or_in_the_table_of_signs(tmp_path):
    table = effects_page(tmp_path).partition("| sign | is |\n")[2].partition("\n\n")[0]
    signs = ", ".join(re.findall(r"^\| (.+?) \|", table, re.M)).replace("(x)", "").split(", ")
    known = {*signs, "sin", "cos", "tanh", "sech", "max", "min", "exp"}
    for entry in EFFECTS.values():
        s, p = namespaces(entry.parameter_names)
        made = [] if entry.equation is None else [sympy.sympify(entry.equation(s, p))]
        functions = {f.func.__name__.lower() for e in made for f in e.atoms(sympy.Function)} - {"abs"}
        symbols = {SYMBOLS.get(x.name, x.name) for e in made for x in e.free_symbols}
        symbols -= {f"p_{name}" for name in entry.parameter_names}
        assert {*functions, *symbols} - known == set(), entry.name


def test_the_equations_have_no_rounded_number(tmp_path):
    page = effects_page(tmp_path)
    assert re.findall(r"<mn>\d\.\d{5,}</mn>", page) == []
    detent = page.partition("### detent\n")[2]
    assert re.search(r"τ</mtext><mo>=</mo><mrow><mo>-</mo>.*<mi>&#8730;e</mi>", detent)


@pytest.mark.parametrize("name", ["sfj_driver", "omni_driver", "force_controller", "link", "acquisition"])
def test_the_meaning_of_a_parameter_begins_with_what_it_is(pages, name):
    dangling = re.compile(r"(?:\w+ which|without) ")
    assert [p.name for p in pages.nodes()[name].TABLE if dangling.match(p.meaning)] == []


def test_the_meaning_of_a_parameter_of_the_board_server_begins_with_what_it_is():
    from haptic_teleop_2dsfj.remote.server_settings import TABLE

    assert [p.name for p in TABLE if re.match(r"(?:\w+ which|without) ", p.meaning)] == []
