"""From the effects' equations to compiled-ready Python source: value, exact derivatives, rates of own states.

Only run when no compiled kernel for the present effects is cached (see ``build.py``); that is why sympy is
imported here and nowhere on the way of a running node.
"""

from __future__ import annotations

import sympy as sp
from sympy.printing.pycode import PythonCodePrinter

from ..effects import EFFECTS, EffectEntry
from ..effects.symbols import VARIABLES, namespaces

#: Derivatives come in this order, then those by the effect's parameters.
DERIVATIVE_ORDER = (
    "position",
    "velocity",
    "deflection",
    "stiffness",
    "state0",
    "state1",
    "direction",
    "input",
    "deflection_rate",
)
_ARGUMENTS = (
    "position, velocity, deflection, stiffness, time, exogenous, input, deflection_rate, state0, state1, "
    "direction, p, k"
)
DYNAMIC_KINDS = ("torque", "friction", "friction_factor", "inertia", "relative_inertia")
#: What an inertia may depend on: its velocity-squared torque is that of an angle alone.
_OF_INERTIA = ("position", "time")


def dynamic_entries() -> list[EffectEntry]:
    """Effects inside the equations of motion; the place in this list is the code by which they are called."""
    return [e for e in EFFECTS.values() if e.kind in DYNAMIC_KINDS]


def output_entries() -> list[EffectEntry]:
    """Effects that map an angle to an encoder's reading."""
    return [e for e in EFFECTS.values() if e.kind == "output"]


def input_entries() -> list[EffectEntry]:
    """Effects between commanded and acting torque."""
    return [e for e in EFFECTS.values() if e.kind == "input"]


class _Printer(PythonCodePrinter):
    def __init__(self) -> None:
        super().__init__({"fully_qualified_modules": True, "user_functions": {}})

    def _print_tanh(self, expr):
        return f"tanh({self._print(expr.args[0])})"

    def _print_Sech(self, expr):
        return f"sech({self._print(expr.args[0])})"

    def _print_Heaviside(self, expr):
        return f"(1.0 if ({self._print(expr.args[0])}) > 0.0 else 0.0)"

    def _print_Side(self, expr):
        return f"(1.0 if ({self._print(expr.args[0])}) >= 0.0 else -1.0)"

    def _print_sign(self, e):
        return f"math.copysign(1.0, {self._print(e.args[0])})"

    def _print_Max(self, expr):
        return f"max({', '.join(self._print(a) for a in expr.args)})"

    def _print_Min(self, expr):
        return f"min({', '.join(self._print(a) for a in expr.args)})"

    def _print_Integer(self, expr):
        return f"{int(expr)}.0"

    def _print_Pow(self, expr, rational=False):
        base, exponent = expr.args
        if exponent.is_Integer and 2 <= int(exponent) <= 4:
            return "(" + " * ".join([f"({self._print(base)})"] * int(exponent)) + ")"
        if exponent.is_Integer and int(exponent) == -1:
            return f"(1.0 / ({self._print(base)}))"
        return super()._print_Pow(expr, rational=rational)


def _function(name: str, entry: EffectEntry, expression: sp.Expr, derivatives: bool) -> str:
    """Source of one function: the value, or the value and all derivatives into ``g``."""
    printer = _Printer()
    targets = [expression]
    wanted: list[int] = []
    if derivatives:
        by = [sp.Symbol(v, real=True) for v in DERIVATIVE_ORDER]
        by += [sp.Symbol(f"p_{n}", real=True) for n in entry.parameter_names]
        for i, symbol in enumerate(by):
            d = sp.diff(expression, symbol)
            if d != 0:
                targets.append(d)
                wanted.append(i)
    common, reduced = sp.cse(targets, symbols=sp.numbered_symbols("c"), list=True)
    values = [printer.doprint(value) for value in reduced]
    lines = [f"def {name}({_ARGUMENTS}{', g' if derivatives else ''}):"]
    lines += [f"    p_{n} = p[k + {i}]" for i, n in enumerate(entry.parameter_names)]
    lines += [f"    {symbol} = {printer.doprint(value)}" for symbol, value in common]
    if derivatives:
        lines += [
            f"    g[{i}] = 0.0"
            for i in range(len(DERIVATIVE_ORDER) + len(entry.parameters))
            if i not in wanted
        ]
        lines += [f"    g[{i}] = {value}" for i, value in zip(wanted, values[1:], strict=True)]
    lines.append(f"    return {values[0]}")
    return "@inner\n" + "\n".join(lines) + "\n"


def _expression(entry: EffectEntry, function) -> sp.Expr:
    variables, parameters = namespaces(entry.parameter_names)
    return sp.sympify(function(variables, parameters))


def _used(expression: sp.Expr) -> set[str]:
    return {str(symbol) for symbol in expression.free_symbols} & set(VARIABLES)


def _slope(entry: EffectEntry, expression: sp.Expr) -> sp.Expr:
    """Derivative of an inertia by the angle of its location; 0 for what is none."""
    if entry.kind not in ("inertia", "relative_inertia"):
        return sp.Integer(0)
    wrong = _used(expression) - set(_OF_INERTIA)
    assert not wrong, f"the inertia {entry.name} must not depend on {wrong}"
    return sp.diff(expression, sp.Symbol("position", real=True))


def effect_source(entry: EffectEntry, derivatives: bool = False) -> str:
    """Source of ``<name>_value``, or ``<name>_value_derivatives``, of an effect that has an equation."""
    name = f"{entry.name}_value{'_derivatives' if derivatives else ''}"
    return _function(name, entry, _expression(entry, entry.equation), derivatives)


def slope_source(entry: EffectEntry) -> str:
    """Source of ``<name>_slope``, the derivative of an inertia by its angle; "" where it does not depend on
    it."""
    slope = _slope(entry, _expression(entry, entry.equation))
    return "" if slope == 0 else _function(f"{entry.name}_slope", entry, slope, False)


def rate_source(entry: EffectEntry, number: int) -> str:
    """Source of ``<name>_state_rate<number>``, the rate of one of an effect's own states."""
    name = f"{entry.name}_state_rate{number}"
    return _function(name, entry, _expression(entry, entry.rates[number]), False)


def _dispatch(name: str, calls: list[tuple[int, str]], arguments: str) -> str:
    lines = ["@inner", f"def {name}(code, {arguments}):"]
    for code, function in calls:
        lines += [f"    if code == {code}:", f"        return {function}({arguments})"]
    lines.append("    return 0.0")
    return "\n".join(lines) + "\n"


def dispatch_source() -> str:
    """Source of ``value``, ``state_rate``, ``slope`` (of an inertia by its angle) and ``reading``, each also
    with ``_derivatives``, which call an effect by its code, and of ``actuate``."""
    assert set(VARIABLES) >= set(DERIVATIVE_ORDER)
    parts: list[str] = []
    tables: dict[str, list[tuple[int, str]]] = {
        n: []
        for n in (
            "value",
            "value_derivatives",
            "state_rate",
            "state_rate_derivatives",
            "slope",
            "slope_derivatives",
            "reading",
            "reading_derivatives",
            "actuate",
        )
    }
    for code, entry in enumerate(dynamic_entries()):
        if entry.compiled is not None:
            for table, function in zip(("value", "value_derivatives"), entry.compiled, strict=True):
                name = f"{entry.name}_{table}"
                parts.append(f"from {function.__module__} import {function.__name__} as {name}\n")
                tables[table].append((code, name))
            continue
        expression = _expression(entry, entry.equation)
        for table, derivatives in (("value", False), ("value_derivatives", True)):
            parts.append(_function(f"{entry.name}_{table}", entry, expression, derivatives))
            tables[table].append((code, f"{entry.name}_{table}"))
        slope = _slope(entry, expression)
        if slope != 0:
            for table, derivatives in (("slope", False), ("slope_derivatives", True)):
                parts.append(_function(f"{entry.name}_{table}", entry, slope, derivatives))
                tables[table].append((code, f"{entry.name}_{table}"))
        for i, rate in enumerate(entry.rates):
            expression = _expression(entry, rate)
            wrong = _used(expression) & {"input", "deflection_rate"}
            assert not wrong, f"the rates of {entry.name} must not depend on {wrong}"
            for table, derivatives in (("state_rate", False), ("state_rate_derivatives", True)):
                parts.append(_function(f"{entry.name}_{table}{i}", entry, expression, derivatives))
                tables[table].append((2 * code + i, f"{entry.name}_{table}{i}"))
    for code, entry in enumerate(output_entries()):
        expression = _expression(entry, entry.equation)
        for table, derivatives in (("reading", False), ("reading_derivatives", True)):
            parts.append(_function(f"{entry.name}_{table}", entry, expression, derivatives))
            tables[table].append((code, f"{entry.name}_{table}"))
    for code, entry in enumerate(input_entries()):
        step = entry.step
        assert step is not None, f"the input effect {entry.name} has no step function"
        parts.append(f"from {step.__module__} import {step.__name__} as {entry.name}_actuate\n")
        tables["actuate"].append((code, f"{entry.name}_actuate"))
    for name, calls in tables.items():
        arguments = _ARGUMENTS + (", g" if name.endswith("derivatives") else "")
        if name == "actuate":
            arguments = "torque, time, dt, p, k, z, o"
        parts.append(_dispatch(name, calls, arguments))
    return "\n\n".join(parts)
