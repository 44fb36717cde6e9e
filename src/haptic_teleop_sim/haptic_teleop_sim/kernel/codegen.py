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
#: What an effect adds to stiffness and damping at a state.
_STEEP = ("stiffness_here", "damping_here")
#: Whether it has such a law.
_IS_STEEP = "is_steep"
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
    lines = [f"def {name}({_ARGUMENTS}{', g' if derivatives else ''}):"]
    lines += [f"    {line}" for line in _body(entry, expression, derivatives, "c")]
    return "@inner\n" + "\n".join(lines) + "\n"


def _body(entry: EffectEntry, expression: sp.Expr, derivatives: bool, common_name: str) -> list[str]:
    """Lines of such a function; what several of its terms share is called ``common_name`` and a number."""
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
    common, reduced = sp.cse(targets, symbols=sp.numbered_symbols(common_name), list=True)
    values = [printer.doprint(value) for value in reduced]
    lines = [f"p_{n} = p[k + {i}]" for i, n in enumerate(entry.parameter_names)]
    lines += [f"{symbol} = {printer.doprint(value)}" for symbol, value in common]
    if derivatives:
        lines += [
            f"g[{i}] = 0.0"
            for i in range(len(DERIVATIVE_ORDER) + len(entry.parameters))
            if i not in wanted
        ]
        lines += [f"g[{i}] = {value}" for i, value in zip(wanted, values[1:], strict=True)]
    lines.append(f"return {values[0]}")
    return lines


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


def steepness_sources(entry: EffectEntry) -> dict[str, str]:
    """Sources of ``<name>_stiffness_here`` and ``<name>_damping_here`` (see `EffectEntry.steepness`), by
    name; empty where what the effect adds has a bound."""
    names = [f"{entry.name}_{table}" for table in _STEEP]
    pairs = zip(names, entry.steepness or (), strict=False)
    return {name: _function(name, entry, _expression(entry, steep), False) for name, steep in pairs}


#: Kinds that scale what the others add; the sensitivities ask these and the others at different places.
_SCALING = ("friction_factor", "inertia", "relative_inertia")
_OF_ALL = ("value", "scale", "state_rate", "slope", "reading")
#: Tables whose functions also write derivatives into ``g``.
_WITH_DERIVATIVES = ("torque_derivatives", "scale_derivatives", "state_rate_derivatives", "slope_derivatives",
                     "reading_derivatives")  # fmt: skip


def _dispatch(name: str, branches: list[tuple[int, list[str]]], arguments: str) -> str:
    # One function with all equations: as a function each of them would take a tenth of a second to compile.
    lines = ["@inner", f"def {name}(code, {arguments}):"]
    for code, body in branches:
        lines += [f"    if code == {code}:", *(f"        {line}" for line in body)]
    lines.append("    return 0.0")
    return "\n".join(lines) + "\n"


def dispatch_source() -> str:
    """Source of the functions that hold the equations of all effects by their codes: ``value``, ``scale`` (of
    factors and inertias alone), ``state_rate``, ``slope`` (of an inertia by its angle) and ``reading``, each
    also with ``_derivatives`` (for ``value`` those of ``scale`` and of what it leaves, ``torque``),
    ``is_steep``, ``stiffness_here`` and ``damping_here`` (see `EffectEntry.steepness`), and ``actuate``."""
    assert set(VARIABLES) >= set(DERIVATIVE_ORDER)
    parts = [f"MAP = {next(i for i, e in enumerate(dynamic_entries()) if e.tabulated)}\n"]
    tables: dict[str, list[tuple[int, list[str]]]] = {
        n: [] for n in (*_OF_ALL, _IS_STEEP, *_STEEP, *_WITH_DERIVATIVES, "actuate")
    }

    def write(table: str, code: int, entry: EffectEntry, expression: sp.Expr) -> None:
        # Names of an effect's own, because a name has one type in all of a function.
        tables[table].append((code, _body(entry, expression, table in _WITH_DERIVATIVES, f"c{code}_")))

    for code, entry in enumerate(dynamic_entries()):
        scaling = entry.kind in _SCALING
        by_all = "scale_derivatives" if scaling else "torque_derivatives"
        if entry.compiled is not None:
            assert not scaling, f"{entry.name}: what scales must have an equation"
            for table, function in zip(("value", by_all), entry.compiled, strict=True):
                name = f"{entry.name}_{table}"
                parts.append(f"from {function.__module__} import {function.__name__} as {name}\n")
                arguments = _arguments(table)
                tables[table].append((code, [f"return {name}({arguments})"]))
            continue
        expression = _expression(entry, entry.equation)
        for table in ("value", "scale", by_all) if scaling else ("value", by_all):
            write(table, code, entry, expression)
        slope = _slope(entry, expression)
        if slope != 0:
            for table in ("slope", "slope_derivatives"):
                write(table, code, entry, slope)
        if entry.steepness is not None:
            tables[_IS_STEEP].append((code, ["return 1.0"]))
            for table, steep in zip(_STEEP, entry.steepness, strict=True):
                write(table, code, entry, _expression(entry, steep))
        for i, rate in enumerate(entry.rates):
            expression = _expression(entry, rate)
            wrong = _used(expression) & {"input", "deflection_rate"}
            assert not wrong, f"the rates of {entry.name} must not depend on {wrong}"
            for table in ("state_rate", "state_rate_derivatives"):
                write(table, 2 * code + i, entry, expression)
    for code, entry in enumerate(output_entries()):
        for table in ("reading", "reading_derivatives"):
            write(table, code, entry, _expression(entry, entry.equation))
    for code, entry in enumerate(input_entries()):
        step = entry.step
        assert step is not None, f"the input effect {entry.name} has no step function"
        name = f"{entry.name}_actuate"
        parts.append(f"from {step.__module__} import {step.__name__} as {name}\n")
        tables["actuate"].append((code, [f"return {name}({_arguments('actuate')})"]))
    parts += [_dispatch(name, branches, _arguments(name)) for name, branches in tables.items()]
    return "\n\n".join(parts)


def _arguments(table: str) -> str:
    if table == "actuate":
        return "torque, time, dt, p, k, z, o"
    if table == _IS_STEEP:
        return "p, k"
    return _ARGUMENTS + (", g" if table in _WITH_DERIVATIVES else "")
