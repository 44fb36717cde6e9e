"""Diagnosis knows no effect by name: what it knows of one stands in that effect's entry."""

import ast
import re
from pathlib import Path

import pytest

import haptic_teleop_sim.effects as effects
import haptic_teleop_sysid.diagnosis as diagnosis
from haptic_teleop_sim.effects import EFFECTS
from haptic_teleop_sim.effects.parameter import CONTACT

FOLDER = Path(diagnosis.__file__).parent
NAMED = re.compile(rf"\b({'|'.join((*EFFECTS, *(p.name for p in CONTACT)))})\b")
#: Of the effects' package, what says nothing of a particular one.
OPEN = {"", "entry", "parameter", "hypothesis", "on_arrays", "symbols", "torque_map", "torque_map_file"}


def named(source: str) -> list[str]:
    """The effects, and parameters of a contact, in the strings of a source text, docstrings aside, and the
    modules of particular effects that it imports."""
    tree = ast.parse(source)
    owners = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
    bodies = [node.body for node in ast.walk(tree) if isinstance(node, owners)]
    # A string that is a statement is a docstring, of a constant, too.
    told = {id(s.value) for body in bodies for s in body if isinstance(s, ast.Expr)}
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in told:
            found += [m[0] for m in NAMED.finditer(node.value)]
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("haptic_teleop_sim.effects"):
            module = (node.module or "").removeprefix("haptic_teleop_sim.effects").lstrip(".")
            found += [] if module in OPEN else [module]
            if not module:
                # `from haptic_teleop_sim.effects import friction` is the module of that name.
                found += [a.name for a in node.names if a.name.islower() and a.name not in effects.__all__]
    return found


@pytest.mark.parametrize("path", sorted(FOLDER.rglob("*.py")), ids=lambda p: str(p.relative_to(FOLDER)))
def test_no_module_of_the_diagnosis_names_an_effect(path):
    assert named(path.read_text()) == []


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        ('"""Of gravity."""\nx = 1', []),
        ('x = "gravity"', ["gravity"]),
        ('x = f"{1} at the backlash of it"', ["backlash"]),
        ('x = {"stage1_motor.coulomb_friction.contact_angle": 1}', ["coulomb_friction", "contact_angle"]),
        ("from haptic_teleop_sim.effects.friction import COULOMB", ["friction"]),
        ("from haptic_teleop_sim.effects import friction", ["friction"]),
        ("from haptic_teleop_sim.effects import EFFECTS, effect_entry", []),
    ],
)
def test_the_search_for_names_finds_them(source, expected):
    assert named(source) == expected


def test_what_an_entry_says_of_others_is_in_the_table():
    """Names in entries are names of entries, at places that these have."""
    for entry in EFFECTS.values():
        said = [entry.form_of, entry.companion, *(name for name, _ in entry.separated)]
        said += [] if entry.refinement is None else [entry.refinement.of]
        assert {name for name in said if name} <= set(EFFECTS), entry.name
        for other in entry.equivalents:
            assert set(other.at) <= set(entry.where)
            assert set(other.at) <= set(EFFECTS[other.effect].where)
        assert {place for place, _ in entry.condition_at} <= set(entry.where)
        assert entry.nuisance or entry.condition, f"{entry.name} does not say what it depends on"
