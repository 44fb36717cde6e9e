"""The namespaces in which effects write their equations, and the helpers they may use, as symbols for the
kernel; `on_arrays.py` has the same helpers for arrays."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import sympy as sp

VARIABLES = (
    "position",
    "velocity",
    "deflection",
    "stiffness",
    "time",
    "exogenous",
    "input",
    "deflection_rate",
    "state0",
    "state1",
    "direction",
)


class Side(sp.Function):
    """+1 for x >= 0, -1 below; its derivative counts as zero (a stop does not change sides)."""

    nargs = 1
    is_real = True

    def fdiff(self, argindex: int = 1) -> sp.Expr:
        return sp.Integer(0)


class Sech(sp.Function):
    """Hyperbolic secant; its derivative is written so that nothing overflows far from zero."""

    nargs = 1
    is_real = True

    def fdiff(self, argindex: int = 1) -> sp.Expr:
        return -sp.tanh(self.args[0]) * self


def positive_part(x: sp.Expr) -> sp.Expr:
    """max(x, 0)."""
    return sp.Max(x, 0)


def dead_band(x: sp.Expr, width: sp.Expr) -> sp.Expr:
    """``x`` less a gap of full width ``width`` about zero."""
    return sp.Max(x - width / 2, 0) + sp.Min(x + width / 2, 0)


SYMBOLIC: dict[str, Any] = {
    "side": Side,
    "positive_part": positive_part,
    "dead_band": dead_band,
    "sin": sp.sin,
    "cos": sp.cos,
    "exp": sp.exp,
    "tanh": sp.tanh,
    "sech": Sech,
    "abs": sp.Abs,
    "sqrt": sp.sqrt,
    "pi": sp.pi,
}
"""Helpers on symbols, by the name that equations call them."""

def namespaces(parameter_names: tuple[str, ...]) -> tuple[SimpleNamespace, SimpleNamespace]:
    """Symbols for the variables (with helpers) and for an effect's own parameters, all real."""
    variables = SimpleNamespace(**{name: sp.Symbol(name, real=True) for name in VARIABLES}, **SYMBOLIC)
    parameters = SimpleNamespace(**{name: sp.Symbol(f"p_{name}", real=True) for name in parameter_names})
    return variables, parameters
