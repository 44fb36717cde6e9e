"""The catalogue of effects from their registry: equation, parameters, where each may sit, a picture."""

import math
from html import escape

import sympy
from effect_pictures import draw, sizes

from haptic_teleop_sim.effects import EFFECTS
from haptic_teleop_sim.effects.symbols import namespaces

LEAD = """\
# Effects

Physics beyond the structure of a model: what `effects:` of a [model file](../file_formats.md) names and
what `diagnose` finds. Picture, and equation where there is one, are computed from the same entry that
simulation, estimation and diagnosis use.

| sign | is |
|---|---|
| q, q̇ | angle and velocity of the place where the effect sits; at the joint: motor minus arm |
| δ, k | deflection (motor minus arm) and stiffness of the joint |
| σ | direction of the motion, from −1 to 1; after a reversal it changes over a small displacement |
| t, a | time since the start; acceleration of the other stage's arm |
| x₀, x₁ | internal states of the effect |
| side(x), input | 1 for x ≥ 0, otherwise −1; torque of the actuator, N·m |
| τ | torque added, positive in the direction of the angle; at the joint: to the torque from motor to arm |

In the pictures the place of the effect swings as a sine of 1 rad (at the joint 0.05 rad) with a period of
2 s. The values used stand below each.

"""
ENTRY = """\
{level} {name}

{sentence} Sits at {where}.{note}

{equation}

{parameters}

![{alt}](effects/{name}.svg)

{shown}

"""
TABLE = """\
| parameter | unit | range | meaning |
|---|---|---|---|
"""
TABULATED = (
    "Its parameters `variable`, `knots`, `torque` and `torque_std`: "
    "[a map](../diagnosis.md#physics-without-a-name)."
)
SAME = " It is identifiable only where `{}` is fixed: free, the two cannot be told apart."
NEVER = """\
## Effects that are never named

A diagnosis does not give these names: where one of them explains most, the verdict is `unknown`.

"""
MEMORY = "dσ/dt = (q̇ − |q̇| σ) / D with D = {}."
GIVES = {"direction": "`contact_angle`", "displacement": "`{1}`", "ratio": "`{0}` / `{1}`"}
NUISANCE = " It belongs to how a recording was taken and is never reported as missing physics."
SYMBOLS = {
    "position": "q", "velocity": "q̇", "deflection": "δ", "stiffness": "k", "time": "t", "exogenous": "a",
    "state0": "x₀", "state1": "x₁", "direction": "σ",
}  # fmt: skip
ROOT = sympy.Symbol("√e", positive=True)
"""For the number that sympy makes of it, in front of exp(−x²/2)."""
LEFT = {
    "torque": "τ", "friction": "τ", "friction_factor": "factor", "inertia": "ΔJ", "relative_inertia": "ΔJ/J",
    "output": "reading",
}  # fmt: skip


def effects_page(folder):
    """The page; its pictures are written into folder/effects."""
    (folder / "effects").mkdir(exist_ok=True)
    text = [LEAD]
    # The never named last; sorted() keeps the order of the others.
    for entry in sorted(EFFECTS.values(), key=_never_named):
        if _never_named(entry) and NEVER not in text:
            text.append(NEVER)
        draw(entry, folder / "effects" / f"{entry.name}.svg")
        rows = []
        for p in entry.parameters:
            default = "" if p.default is None else f"; default {p.default:g}"
            unit = p.unit.replace("*", "·").replace("^2", "²").replace("^3", "³")
            rows.append(f"| `{p.name}` | {unit} | {_range(p)} | {p.meaning}{default} |")
        drawn = ", ".join(f"{name} {value:.3g}" for name, value in sizes(entry).items())
        text.append(
            ENTRY.format(
                level="###" if _never_named(entry) else "##",
                name=entry.name,
                sentence=f"{entry.sentence[0].upper()}{entry.sentence[1:]}.",
                where=", ".join(f"`{place}`" for place in entry.where),
                note=_note(entry),
                equation="\n\n".join(filter(None, [_equation(entry), _memory(entry)])),
                parameters=TABLE + "\n".join(rows) if rows else TABULATED,
                alt=entry.sentence,
                shown=f"*Drawn with {drawn}.*" if drawn else "",
            )
        )
    return "".join(text)


def _note(entry):
    same = SAME.format(entry.same_as) if entry.same_as else ""
    needs = f" It needs {entry.needs}." if entry.needs else ""
    return same + needs + (NUISANCE if entry.nuisance else "")


def _never_named(entry):
    return entry.unnamed or entry.tabulated


def _memory(entry):
    """How the direction σ follows the motion, where the effect depends on it."""
    return MEMORY.format(GIVES[entry.memory].format(*entry.parameter_names)) if entry.memory else ""


def _range(p):
    lowest, highest = (f"{bound:g}" if abs(bound) != float("inf") else "" for bound in (p.minimum, p.maximum))
    if lowest and highest:
        return f"{lowest} to {highest}"
    return f"from {lowest}" if lowest else (f"to {highest}" if highest else "any")


def _lines(expression):
    """The terms of a sum that is too long for a line of a page, else the expression alone."""
    return sympy.Add.make_args(sympy.expand_mul(expression)) if len(str(expression)) > 150 else (expression,)


def _equation(entry):
    """The equation as MathML, which browsers show without a script."""
    if entry.equation is None:
        return ""
    s, p = namespaces(entry.parameter_names)
    names = {sympy.Symbol(n, real=True): sympy.Symbol(sign, real=True) for n, sign in SYMBOLS.items()}
    names |= {sympy.Symbol(f"p_{n}", real=True): sympy.Symbol(n) for n in entry.parameter_names}
    sides = [(LEFT[entry.kind], entry.equation(s, p))]
    sides += [(f"d{SYMBOLS[f'state{i}']}/dt", rate(s, p)) for i, rate in enumerate(entry.rates)]
    made = []
    for left, right in sides:
        right = sympy.sympify(right).subs(names)
        sizes_of_root = {sympy.Float(s * math.sqrt(math.e)): s * ROOT for s in (1, -1)}
        for index, term in enumerate(_lines(right.xreplace(sizes_of_root))):
            minus = index > 0 and term.could_extract_minus_sign()
            inner = sympy.mathml(-term if minus else term, printer="presentation", mul_symbol="dot")
            sign = "−" if minus else "+"
            lead = f"<mo>{sign}</mo>" if index else f"<mtext>{escape(left)}</mtext><mo>=</mo>"
            made.append(f"<p><math display='block'><mrow>{lead}{inner}</mrow></math></p>")
    return "\n".join(["```{raw} html", *made, "```"])
