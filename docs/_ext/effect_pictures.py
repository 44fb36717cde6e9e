"""What an effect does along a prescribed motion, computed from its entry alone: a picture of each.

The place of the effect swings as a sine. Its memory and own states follow the motion by the equations that
`entry.py` documents, in small steps; the result is drawn over the quantity that it follows.
"""

from types import SimpleNamespace

import matplotlib

matplotlib.use("svg")
import numpy as np
from matplotlib.figure import Figure

from haptic_teleop_sim.effects.on_arrays import NUMERIC
from haptic_teleop_sim.effects.symbols import namespaces
from haptic_teleop_sim.effects.torque_map_file import torque_map

PERIOD, DT, TURNS = 2.0, 2e-4, 2
AMPLITUDE, DEFLECTION, STIFFNESS, TORQUE = 1.0, 0.05, 4.0, 1.0
SCALES = {
    "torque": TORQUE, "peak": TORQUE, "angle": AMPLITUDE, "deflection": 2 * DEFLECTION, "velocity": 3.0,
    "stiffness": STIFFNESS, "torque_per_angle": 100.0, "damping": 0.5, "inertia": 0.1, "drag": 0.1,
    "steep": 0.03, "cubic": STIFFNESS / DEFLECTION**2, "duration": TURNS * PERIOD, "furthest": AMPLITUDE,
    "one": 1.0, "peak_per_speed": TORQUE / 3.0,
}  # fmt: skip
"""What a typical size is relative to (`EffectParameter.scale`) in these pictures."""
LABELS = {
    "time": "time / s", "position": "angle / rad", "velocity": "velocity / (rad/s)",
    "deflection": "deflection / rad", "input": "commanded torque / N·m",
    "other": "acceleration of the other arm / (rad/s²)",
}  # fmt: skip
RESULTS = {
    "torque": "torque added / N·m", "friction": "torque added / N·m", "friction_factor": "factor on friction",
    "inertia": "inertia added / kg·m²", "relative_inertia": "inertia added, relative",
    "input": "acting torque / N·m",
    "output": "error of the reading / rad",
    "skew": "error of the reading / rad",
}  # fmt: skip


MEASURED = {
    "variable": "angle",
    "knots": [-1.0, -0.6, -0.2, 0.2, 0.6, 1.0],
    "torque": [0.5, 0.1, 0.3, -0.1, -0.4, -0.2],
}
"""A curve as a recording may give it."""


def sizes(entry):
    """A typical value of each parameter, by name."""
    chosen = {}
    for p in entry.parameters:
        typical = p.default if p.default is not None else p.typical * SCALES[p.scale]
        chosen[p.name] = float(min(max(typical, p.minimum), p.maximum))
    return chosen


def followed(entry):
    """The quantity over which the effect is drawn: a key of LABELS."""
    if entry.tabulated:
        return "position"
    if entry.kind == "input":
        return "time" if entry.states or "time_constant" in entry.parameter_names else "input"
    if entry.equation is None:
        return "time"
    symbols, parameters = namespaces(entry.parameter_names)
    names = {str(s) for s in entry.equation(symbols, parameters).free_symbols}
    if entry.rates or "time" in names or not names & set(symbols.__dict__):
        return "time"
    if "exogenous" in names:
        return "other"
    if "position" in names:
        return "deflection" if "joint" in entry.where else "position"
    if "deflection" in names:
        return "deflection"
    if entry.memory in ("ratio", "displacement"):
        return "deflection" if "joint" in entry.where else "position"
    return "velocity"


def response(entry):
    """(quantities by LABELS' keys, result), arrays over time."""
    t = np.arange(0.0, TURNS * PERIOD, DT)
    swing = (DEFLECTION if "joint" in entry.where else AMPLITUDE) * np.sin(2 * np.pi * t / PERIOD)
    velocity = np.gradient(swing, DT)
    deflection = DEFLECTION * np.sin(2 * np.pi * t / PERIOD)
    torque = TORQUE * np.sin(2 * np.pi * t / PERIOD)
    other = 20.0 * np.sin(2 * np.pi * t / PERIOD)
    known = {"time": t, "position": swing, "velocity": velocity, "deflection": deflection, "input": torque,
             "other": other}  # fmt: skip
    values = sizes(entry)
    if entry.kind == "skew":
        delay = values[entry.parameter_names[0]]
        late = np.interp(t - delay, t, swing)
        return known, late - swing
    if entry.tabulated:
        return known, torque_map(MEASURED).at(swing)
    if entry.kind == "input":
        return known, _acting(entry, torque, t, list(values.values()))
    s = SimpleNamespace(position=swing, velocity=velocity, deflection=deflection, stiffness=STIFFNESS,
                        time=t, exogenous=other, input=torque, **NUMERIC)  # fmt: skip
    p = SimpleNamespace(**values)
    s.direction = _direction(entry, values, swing, velocity)
    s.state0, s.state1 = _states(entry, s, p, len(t))
    result = np.broadcast_to(np.asarray(entry.equation(s, p), dtype=float), t.shape)
    return known, result - swing if entry.kind == "output" else result


def _acting(entry, torque, t, values):
    """The acting torque: as at 500 Hz, held over each sample."""
    step, dt, memory = getattr(entry.step, "py_func", entry.step), 0.002, np.zeros(max(1, entry.states))
    every = round(dt / DT)
    acting = [
        step(u, at, dt, values, 0, memory, 0) for u, at in zip(torque[::every], t[::every], strict=True)
    ]
    return np.repeat(acting, every)[: len(t)]


def _direction(entry, values, position, velocity):
    """The memory that follows the direction of motion (entry.py; Dahl 1968)."""
    if entry.memory == "direction" and values.get("smoothing", 0.0) > 0.0:
        return np.tanh(velocity / values["smoothing"])
    numbers = list(values.values())
    width = {
        "": 1.0, "direction": values.get("contact_angle", 1.0), "displacement": numbers[1 % len(numbers)],
        "ratio": numbers[0] / (numbers[1 % len(numbers)] or 1.0),
    }[entry.memory]  # fmt: skip
    direction, now = np.zeros_like(position), 0.0
    for k, moved in enumerate(np.diff(position, prepend=position[0])):
        towards = np.sign(moved)
        now = towards + (now - towards) * np.exp(-abs(moved) / width) if moved else now
        direction[k] = now
    return direction


def _states(entry, s, p, n):
    """Own states by explicit Euler steps of DT."""
    states = np.zeros((2, n))
    for k in range(n - 1 if entry.rates else 0):
        now = SimpleNamespace(**{name: value[k] if isinstance(value, np.ndarray) else value
                                 for name, value in vars(s).items()})  # fmt: skip
        now.state0, now.state1 = states[:, k]
        for i, rate in enumerate(entry.rates):
            states[i, k + 1] = states[i, k] + DT * rate(now, p)
    return states


def draw(entry, path):
    """Write the picture of an effect as SVG."""
    known, result = response(entry)
    over = followed(entry)
    figure = Figure(figsize=(4.6, 2.6), layout="constrained")
    axis = figure.add_subplot()
    axis.axhline(0.0, color="0.75", linewidth=0.8)
    if entry.kind == "input":
        axis.plot(known[over], known["input"], color="0.6", linestyle="--", linewidth=1.0, label="commanded")
    # The first half period is how the motion sets in, of interest over time only.
    shown = slice(0 if over == "time" else round(PERIOD / 2 / DT), None, 5)
    axis.plot(known[over][shown], result[shown], color="#0072B2", linewidth=1.6, label="acting")
    if entry.kind == "input":
        axis.legend(frameon=False, fontsize=8)
    axis.set_xlabel(LABELS[over])
    axis.set_ylabel(RESULTS[entry.kind])
    axis.spines[["top", "right"]].set_visible(False)
    figure.savefig(path, metadata={"Date": None})
