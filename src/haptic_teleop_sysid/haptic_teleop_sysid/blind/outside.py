"""Physics that the table of effects does not have: what `diagnose` must call unknown, not misname."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_sysid.blind.effects import Kind, Parameters, Scene

Array = NDArray[np.float64]


def _nothing(parameters: Parameters, part: str, scene: Scene) -> dict[str, float]:
    return {}


def _prefix(part: str) -> str:
    return "m_" if part == "motor" else "a_"


KINDS: tuple[Kind, ...] = (
    Kind(
        "viscous_friction_of_angle",
        ("motor",),
        lambda r, s: {"change": 0.3, "order": float(r.integers(3, 9)) * max(1.0, round(1.0 / s.travel))},
        lambda p, w, s: {"m_visc_angle": p["change"], "m_visc_order": p["order"]},
        ("change",),
        ("change",),
        most=3.0,
    ),
    Kind(
        "creeping_spring",
        ("joint",),
        lambda r, s: {"stiffness": 0.2 * s.stiffness, "time_constant": r.uniform(0.1, 1.0)},
        lambda p, w, s: {"creep_stiffness": p["stiffness"], "creep_time": p["time_constant"]},
        ("stiffness",),
        ("stiffness",),
        most=10.0,
    ),
    Kind(
        "torque_dropouts",
        ("actuator",),
        lambda r, s: {"share": 0.5, "seed": float(r.integers(1 << 30)), "count": float(r.integers(5, 12))},
        _nothing,
        ("share",),
        ("share",),
        most=2.0,
    ),
    Kind(
        "quantised_current",
        ("actuator",),
        lambda r, s: {"step": 0.15 * s.current},
        lambda p, w, s: {"current_step": p["step"]},
        ("step",),
        ("step",),
        most=8.0,
    ),
    Kind(
        "friction_after_rest",
        ("motor", "arm"),
        lambda r, s: {"torque": 0.1 * s.torque, "growth": r.uniform(2.0, 4.0), "time": r.uniform(0.02, 0.1)},
        lambda p, w, s: {
            _prefix(w) + "fric_pos": p["torque"],
            _prefix(w) + "fric_neg": p["torque"],
            _prefix(w) + "bristle": 3e-3,
            _prefix(w) + "dwell_gain": p["growth"],
            _prefix(w) + "dwell_time": p["time"],
        },
        ("torque",),
        ("torque",),
    ),
    Kind(
        "torque_bursts",
        ("motor", "arm"),
        lambda r, s: {
            "torque": 0.3 * s.torque,
            "seed": float(r.integers(1 << 30)),
            "count": float(r.integers(4, 10)),
        },
        _nothing,
        ("torque",),
        ("torque",),
    ),
    Kind(
        "cubic_drag",
        ("motor", "arm"),
        lambda r, s: {"coefficient": 0.1 * s.torque / s.speed**3},
        lambda p, w, s: {_prefix(w) + "cubic_drag": p["coefficient"]},
        ("coefficient",),
        ("coefficient",),
    ),
    Kind(
        "cross_axis_friction",
        ("motor", "arm"),
        lambda r, s: {"coefficient": 0.2 * s.torque},
        lambda p, w, s: {_prefix(w) + "cross_fric": p["coefficient"]},
        ("coefficient",),
        ("coefficient",),
        needs_other=True,
    ),
    Kind(
        "detent",
        ("motor", "arm"),
        lambda r, s: {
            "torque": 0.2 * s.torque,
            "place": s.low + s.travel * r.uniform(0.3, 0.7),
            "width": s.travel * 0.05,
        },
        lambda p, w, s: {
            _prefix(w) + "detent": p["torque"],
            _prefix(w) + "detent_at": p["place"],
            _prefix(w) + "detent_width": p["width"],
        },
        ("torque",),
        ("torque",),
    ),
)
BY_NAME = {kind.effect: kind for kind in KINDS}


def gate_of(effect: str, part: str, parameters: Parameters, gate: Array, period: float) -> None:
    """Write what comes and goes with time into `gate` (n, 3): torque multiplier, torque on motor and arm.

    Dropouts lose a share of the torque for 50 to 300 ms; bursts are white noise below 40 Hz for 0.2 to 0.8 s.
    """
    if effect not in ("torque_dropouts", "torque_bursts"):
        return
    rng = np.random.default_rng(int(parameters["seed"]))
    n = len(gate)
    for _ in range(int(parameters["count"])):
        start = int(rng.integers(int(0.05 * n), int(0.95 * n)))
        if effect == "torque_dropouts":
            length = int(rng.uniform(0.05, 0.3) / period)
            gate[start : start + length, 0] = 1.0 - min(parameters["share"], 1.0)
        else:
            length = int(rng.uniform(0.2, 0.8) / period)
            smooth = max(1, round(0.0125 / period))
            noise = np.convolve(rng.standard_normal(length + smooth - 1), np.ones(smooth), "valid")
            piece = gate[start : start + length, 1 if part == "motor" else 2]
            piece += parameters["torque"] * noise[: len(piece)] / np.sqrt(smooth)
