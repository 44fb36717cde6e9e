"""The vocabulary of effects as this generator plants it: what is drawn, and which slots of the physics it
fills."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

Parameters = dict[str, float]
Slots = dict[str, float]


@dataclass(frozen=True)
class Scene:
    """What a draw needs to know of the undisturbed experiment: the stage and how it moves without an effect.

    torque: rms of the motor torque, N·m; current: its peak, A; speed: rms, rad/s; low, high: travel of the
    joint concerned, rad; deflection: rms, rad; load: rms of the arm's inertia torque, N·m.
    """

    torque_constant: float
    stiffness: float
    arm_inertia: float
    arm_damping: float
    torque: float
    current: float
    speed: float
    low: float
    high: float
    deflection: float
    load: float
    duration: float

    @property
    def travel(self) -> float:
        """Travel of the joint concerned, rad."""
        return self.high - self.low


Draw = Callable[[np.random.Generator, Scene], Parameters]
Place = Callable[[Parameters, str, Scene], Slots]


@dataclass(frozen=True)
class Kind:
    """One effect: where it may sit, how its parameters are drawn at size 1, what grows with the size, where
    the numbers go.

    `grow`: parameters proportional to the size; None: `resize` says how. `scored`: parameters whose estimate
    is judged, the first is the size. `hidden_by_sense`: whether the current sense may or may not see it.
    """

    effect: str
    parts: tuple[str, ...]
    draw: Draw
    place: Place
    grow: tuple[str, ...]
    scored: tuple[str, ...]
    resize: Callable[[Parameters, float, Scene], Parameters] | None = None
    most: float = 1e3
    sense: bool = False
    needs_other: bool = False
    tags: tuple[str, ...] = field(default=())

    def sized(self, parameters: Parameters, size: float, scene: Scene) -> Parameters:
        """Return `parameters`, drawn at size 1, at `size`."""
        if self.resize is not None:
            return self.resize(parameters, size, scene)
        return {k: v * size if k in self.grow else v for k, v in parameters.items()}


def _side(part: str) -> str:
    return "m_" if part.startswith("motor") else "a_"


def _share(rng: np.random.Generator, scene: Scene) -> float:
    return 0.1 * scene.torque


def _friction(part: str, level: float, bristle: float, **more: float) -> Slots:
    s = _side(part)
    return {
        s + "fric_pos": level,
        s + "fric_neg": level,
        s + "bristle": bristle,
        **{s + k: v for k, v in more.items()},
    }


_THIN = 6e-5  # rad; a bristle this short is a few counts of the drive's encoder: no presliding to be seen


def _stribeck(p: Parameters, part: str, scene: Scene) -> Slots:
    ratio = p["breakaway"] / p["coulomb"] - 1.0
    return _friction(
        part,
        p["coulomb"],
        _THIN,
        break_ratio=ratio,
        break_velocity=p["velocity"],
        break_shape=p.get("shape", 2.0),
    )


def _asymmetric(p: Parameters, part: str, scene: Scene) -> Slots:
    s = _side(part)
    return {s + "fric_pos": p["positive"], s + "fric_neg": p["negative"], s + "bristle": _THIN}


def _position_friction(p: Parameters, part: str, scene: Scene) -> Slots:
    return _friction(
        part,
        p["torque"],
        _THIN,
        fric_amp=p["amplitude"] / p["torque"],
        fric_order=p["order"],
        fric_phase=p["phase"],
    )


def _draw_stribeck(rng: np.random.Generator, scene: Scene) -> Parameters:
    level = _share(rng, scene)
    return {
        "coulomb": level,
        "breakaway": level * rng.uniform(1.6, 2.6),
        "velocity": scene.speed * rng.uniform(0.08, 0.35),
    }


def _draw_position_friction(rng: np.random.Generator, scene: Scene) -> Parameters:
    level = _share(rng, scene)
    return {
        "torque": level,
        "amplitude": level * rng.uniform(0.5, 0.9),
        "order": float(rng.integers(2, 8)) * max(1.0, round(2.0 / scene.travel)),
        "phase": rng.uniform(-math.pi, math.pi),
    }


def _draw_inertia(rng: np.random.Generator, scene: Scene) -> Parameters:
    order = float(rng.integers(1, 4)) * min(max(1.0, round(2.0 / scene.travel)), 4.0)
    return {"amplitude": 0.03, "order": order, "phase": rng.uniform(-math.pi, math.pi)}


def _draw_speed_limit(rng: np.random.Generator, scene: Scene) -> Parameters:
    # Before the sense, whose current shows what is left; and by its slope alone, without which it saturates.
    peak = scene.torque_constant * scene.current
    return {"limit": peak * rng.uniform(1.0, 1.15), "slope": 0.03 * peak / scene.speed}


def _draw_presliding(rng: np.random.Generator, scene: Scene) -> Parameters:
    level = _share(rng, scene)
    return {"torque": level, "stiffness": level / (scene.travel * rng.uniform(0.01, 0.05))}


def _draw_stop(rng: np.random.Generator, scene: Scene) -> Parameters:
    side = -1.0 if rng.random() < 0.3 else 1.0
    return {
        "angle": side,
        "stiffness": scene.arm_inertia * (2 * math.pi * rng.uniform(5.0, 15.0)) ** 2 + 10 * scene.stiffness,
    }


def _resize_stop(p: Parameters, size: float, scene: Scene) -> Parameters:
    reach = scene.high if p["angle"] > 0 else -scene.low
    return {**p, "angle": math.copysign(max(reach * (1.0 - 0.05 * size), 0.02 * scene.travel), p["angle"])}


def _resize_limit(p: Parameters, size: float, scene: Scene) -> Parameters:
    return {"limit": scene.torque_constant * scene.current * max(1.0 - 0.02 * size, 0.15)}


def _resize_gain(name: str) -> Callable[[Parameters, float, Scene], Parameters]:
    return lambda p, size, scene: {name: 1.0 + (p[name] - 1.0) * size}


def _mode(p: Parameters, part: str, scene: Scene) -> Slots:
    stiffness = p["inertia"] * (2 * math.pi * p["frequency"]) ** 2
    damping = 0.04 * math.sqrt(stiffness * p["inertia"])
    return {"mode_stiffness": stiffness, "mode_inertia": p["inertia"], "mode_damping": damping}


def _sided(**names: str) -> Place:
    return lambda p, part, scene: {_side(part) + slot: p[key] for slot, key in names.items()}


def _plain(**names: str) -> Place:
    return lambda p, part, scene: {slot: p[key] for slot, key in names.items()}


def _sign(rng: np.random.Generator) -> float:
    return -1.0 if rng.random() < 0.5 else 1.0


MA = ("motor", "arm")
ENCODERS = ("motor_encoder", "arm_encoder")
KINDS: tuple[Kind, ...] = (
    Kind(
        "coulomb_friction",
        MA,
        lambda r, s: {"torque": _share(r, s)},
        lambda p, w, s: _friction(w, p["torque"], _THIN),
        ("torque",),
        ("torque",),
    ),
    Kind(
        "stribeck_friction",
        MA,
        _draw_stribeck,
        _stribeck,
        ("coulomb", "breakaway"),
        ("coulomb", "breakaway"),
    ),
    Kind(
        "asymmetric_friction",
        MA,
        lambda r, s: {"positive": _share(r, s) * r.uniform(0.4, 0.7), "negative": _share(r, s)},
        _asymmetric,
        ("positive", "negative"),
        ("positive", "negative"),
    ),
    Kind(
        "presliding_friction",
        MA,
        _draw_presliding,
        lambda p, w, s: _friction(w, p["torque"], p["torque"] / p["stiffness"]),
        ("torque", "stiffness"),
        ("torque",),
    ),
    Kind(
        "quadratic_drag",
        MA,
        lambda r, s: {"coefficient": _share(r, s) / s.speed**2},
        _sided(drag="coefficient"),
        ("coefficient",),
        ("coefficient",),
    ),
    Kind(
        "position_dependent_friction",
        MA,
        _draw_position_friction,
        _position_friction,
        ("torque", "amplitude"),
        ("torque", "amplitude"),
    ),
    Kind(
        "friction_drift",
        MA,
        lambda r, s: {"change": _sign(r) * r.uniform(0.2, 0.4), "time_constant": r.uniform(4.0, 15.0)},
        _sided(visc_change="change", visc_time="time_constant"),
        ("change",),
        ("change",),
        most=2.35,  # damping that falls by more than itself drives the joint
    ),
    Kind(
        "load_dependent_friction",
        ("motor",),
        lambda r, s: {"coefficient": 0.2},
        lambda p, w, s: {"load_coefficient": p["coefficient"], "load_bristle": _THIN},
        ("coefficient",),
        ("coefficient",),
        most=20.0,
    ),
    Kind(
        "gravity",
        ("arm",),
        lambda r, s: {"torque": _share(r, s), "phase": r.uniform(-1.2, 1.2)},
        _sided(grav="torque", grav_phase="phase"),
        ("torque",),
        ("torque",),
    ),
    Kind(
        "spring_to_ground",
        MA,
        lambda r, s: {"stiffness": _share(r, s) / s.travel * 2, "rest": r.uniform(-0.3, 0.3) * s.travel},
        _sided(ground="stiffness", ground_rest="rest"),
        ("stiffness",),
        ("stiffness",),
    ),
    Kind(
        "constant_torque",
        MA,
        lambda r, s: {"torque": _sign(r) * _share(r, s) * 0.3},
        _sided(constant="torque"),
        ("torque",),
        ("torque",),
    ),
    Kind(
        "torque_ripple",
        ("motor",),
        lambda r, s: {
            "amplitude": _share(r, s),
            "order": float(r.integers(4, 40)) * max(1.0, round(1.0 / s.travel)),
            "phase": r.uniform(-math.pi, math.pi),
        },
        _plain(ripple="amplitude", ripple_order="order", ripple_phase="phase"),
        ("amplitude",),
        ("amplitude",),
    ),
    Kind(
        "backlash",
        ("joint",),
        lambda r, s: {"width": 0.2 * s.deflection},
        # The faces' damping goes with the gap: else a vanishing gap would still damp the joint.
        lambda p, w, s: {
            "gap": p["width"],
            "gap_damping": 0.01
            * math.sqrt(s.stiffness * s.arm_inertia)
            * min(1.0, p["width"] / (0.02 * s.deflection)),
        },
        ("width",),
        ("width",),
    ),
    Kind(
        "hardening_spring",
        ("joint",),
        lambda r, s: {"cubic": (1.0 if r.random() < 0.7 else -0.3) * 0.1 * s.stiffness / s.deflection**2},
        _plain(cubic="cubic"),
        ("cubic",),
        ("cubic",),
    ),
    Kind(
        "hysteresis",
        ("joint",),
        lambda r, s: {
            "torque": 0.1 * s.stiffness * s.deflection,
            "deflection": s.deflection * r.uniform(0.1, 0.4),
            "shape": r.uniform(1.0, 2.0),
        },
        _plain(hyst_torque="torque", hyst_yield="deflection", hyst_shape="shape"),
        ("torque",),
        ("torque",),
    ),
    Kind(
        "joint_damping",
        ("joint",),
        lambda r, s: {"coefficient": 0.05 * math.sqrt(s.stiffness * s.arm_inertia)},
        _plain(joint_damping="coefficient"),
        ("coefficient",),
        ("coefficient",),
    ),
    Kind(
        "input_delay",
        ("actuator",),
        lambda r, s: {"delay": 0.006},
        _plain(delay="delay"),
        ("delay",),
        ("delay",),
        most=10.0,
        sense=True,
    ),
    Kind(
        "actuator_lag",
        ("actuator",),
        lambda r, s: {"time_constant": 0.008},
        _plain(lag="time_constant"),
        ("time_constant",),
        ("time_constant",),
        most=15.0,
        sense=True,
    ),
    Kind(
        "torque_saturation",
        ("actuator",),
        lambda r, s: {"limit": 0.0},
        lambda p, w, s: {"limit": p["limit"] / s.torque_constant},
        (),
        ("limit",),
        _resize_limit,
        45.0,
        True,
    ),
    Kind("torque_speed_limit", ("actuator",), _draw_speed_limit,
         lambda p, w, s: {f"speed_{key}": p[key] / s.torque_constant for key in ("limit", "slope")},
         ("slope",), ("slope",), most=20.0),
    Kind(
        "dead_zone",
        ("actuator",),
        lambda r, s: {"width": 0.05 * s.torque_constant * s.current},
        lambda p, w, s: {"dead": p["width"] / s.torque_constant},
        ("width",),
        ("width",),
        most=12.0,
        sense=True,
    ),
    Kind(
        "gain_error",
        ("actuator",),
        lambda r, s: {"gain": 1.0 + _sign(r) * 0.05},
        lambda p, w, s: {"gain_error": p["gain"] - 1.0},
        (),
        ("gain",),
        _resize_gain("gain"),
        8.0,
        tags=("known torque constant",),
    ),
    Kind(
        "gain_drift",
        ("actuator",),
        lambda r, s: {"change": _sign(r) * 0.15, "time_constant": r.uniform(4.0, 15.0)},
        _plain(gain_change="change", gain_time="time_constant"),
        ("change",),
        ("change",),
        most=4.0,
    ),
    Kind(
        "inertial_coupling",
        ("arm",),
        lambda r, s: {"coefficient": 0.1 * s.arm_inertia},
        _plain(coupling="coefficient"),
        ("coefficient",),
        ("coefficient",),
        needs_other=True,
    ),
    Kind(
        "extra_flexible_mode",
        ("arm",),
        lambda r, s: {
            "frequency": r.uniform(1.0, 3.0) * math.sqrt(s.stiffness / s.arm_inertia) / (2 * math.pi),
            "inertia": 0.1 * s.arm_inertia,
        },
        _mode,
        ("inertia",),
        ("inertia", "frequency"),
        most=20.0,
    ),
    Kind(
        "payload_change",
        ("arm",),
        lambda r, s: {"time": r.uniform(0.3, 0.65) * s.duration, "inertia": 0.1 * s.arm_inertia},
        _plain(payload="inertia", payload_time="time"),
        ("inertia",),
        ("inertia", "time"),
        most=20.0,
    ),
    Kind("angle_dependent_inertia", ("arm",), _draw_inertia,
         _plain(inertia_amp="amplitude", inertia_order="order", inertia_phase="phase"),
         ("amplitude",), ("amplitude",), most=25.0),
    Kind(
        "hard_stop",
        ("arm", "motor"),
        _draw_stop,
        lambda p, w, s: {
            _side(w) + "stop_angle": p["angle"],
            _side(w) + "stop_stiffness": p["stiffness"],
            _side(w) + "stop_damping": 0.3 * math.sqrt(p["stiffness"] * s.arm_inertia),
        },
        (),
        ("angle",),
        _resize_stop,
        18.0,
    ),
    Kind(
        "encoder_eccentricity",
        ENCODERS,
        lambda r, s: {
            "amplitude": 0.003,
            "order": float(r.integers(1, 7)) * max(1.0, round(1.0 / s.travel)),
            "phase": r.uniform(-math.pi, math.pi),
        },
        _sided(ecc_amp="amplitude", ecc_order="order", ecc_phase="phase"),
        ("amplitude",),
        ("amplitude",),
        most=20.0,
    ),
    Kind(
        "encoder_scale",
        ENCODERS,
        lambda r, s: {"scale": 1.0 + _sign(r) * 0.01},
        lambda p, w, s: {_side(w) + "scale": p["scale"] - 1.0},
        (),
        ("scale",),
        _resize_gain("scale"),
        15.0,
    ),
    Kind(
        "sensor_delay",
        ENCODERS,
        lambda r, s: {"delay": 0.006},
        _sided(sensor_delay="delay"),
        ("delay",),
        ("delay",),
        most=8.0,
    ),
    Kind(
        "channel_skew",
        (*ENCODERS, "actuator"),
        lambda r, s: {"delay": _sign(r) * 0.006},
        lambda p, w, s: {},
        ("delay",),
        ("delay",),
        most=8.0,
    ),
)
BY_NAME = {kind.effect: kind for kind in KINDS}
PLACES: tuple[tuple[str, str], ...] = tuple((kind.effect, part) for kind in KINDS for part in kind.parts)
"""Every effect at every place of a flexible joint."""
