"""The scales of a recording, by which the size of an effect is judged large or small."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from haptic_teleop_sim.effects import EFFECTS
from haptic_teleop_sim.effects.hypothesis import Recorded
from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.estimation.records import Record
from haptic_teleop_sysid.recordings.motion import finite


@dataclass(frozen=True)
class Scales:
    """Typical sizes in SI units: ``size`` by the names of ``EffectParameter.scale``; ``lowest`` and
    ``highest`` angle of motor and arm, rad; ``dt``, s; ``resolution`` of both encoders, rad; ``pushed``: how
    far the rms torque moves motor and arm from rest in a sample, twice that, rad; ``both_ways``: of the way
    that each went in one direction the share that it went in the other; ``orders``: cycles per revolution up
    to which the samples of motor and arm lie densely enough; ``torque_constant``: N·m/A, by which ``size``
    has torques of the recorded input.
    """

    size: dict[str, float]
    lowest: tuple[float, float]
    highest: tuple[float, float]
    dt: float
    resolution: tuple[float, float]
    pushed: tuple[float, float] = (0.0, 0.0)
    both_ways: tuple[float, float] = (1.0, 1.0)
    orders: tuple[float, float] = (0.0, 0.0)
    torque_constant: float = 1.0

    def driven(self, model: Model) -> Scales:
        """The scales with the input's torques as ``model`` has them: a structure without a saturation makes
        up for it by a third of the torque constant."""
        constant = float(model.parameters["torque_constant"])
        factor = constant / self.torque_constant
        size = {name: v * factor if name in _OF_THE_INPUT else v for name, v in self.size.items()}
        return replace(self, size=size, torque_constant=constant)

    def span(self, channel: int) -> float:
        """How far motor (0) or arm (1) moved, rad."""
        return self.highest[channel] - self.lowest[channel]

    def at(self, location: str) -> Recorded:
        """What the recordings are like where an effect sits: at the arm, or else by the motor's angle."""
        channel = 1 if "_arm" in location else 0
        return Recorded(
            self.size,
            self.lowest[channel],
            self.highest[channel],
            self.dt,
            self.resolution[channel],
            max(self.resolution),
            self.contacts(channel)[1],
            self.both_ways[channel],
        )

    def contacts(self, channel: int) -> tuple[float, float]:
        """Displacements, rad, within which the contact of dry friction at motor (0) or arm (1) gives: shares
        of the travel (CONTACTS), and up to a step of the encoder, within which nothing shows; not so little
        that the joint on it swings faster than STIFFEST."""
        travel = self.span(channel) or self.span(0) or 1.0
        step = self.resolution[channel] if self.span(channel) > 0.0 else 0.0
        most = max(CONTACTS[1] * travel, step)
        return min(max(CONTACTS[0] * travel, self.pushed[channel] / STIFFEST**2), 0.1 * most), most

    def contact_starts(self, channel: int) -> tuple[float, ...]:
        """Displacements, rad, from which a contact is fitted: CONTACT_STARTS of the travel, closer together
        where a contact may not give that little."""
        least, most = self.contacts(channel)
        travel = self.span(channel) or self.span(0) or 1.0
        first, *_, last = CONTACT_STARTS
        low, high = max(first * travel, 2.0 * least), max(last * travel, 0.2 * most)
        return tuple(float(angle) for angle in np.geomspace(min(low, high), high, len(CONTACT_STARTS)))


#: Sizes that are in proportion to the torque of the recorded input.
_OF_THE_INPUT = ("torque", "peak", "torque_per_angle", "peak_per_speed", "drag", "steep")
#: Cycles per sample up to which samples show an order, at nine tenths of them.
RESOLVED = 0.25
#: Share of its top speed from which a joint counts as moving.
MOVES = 0.02
#: Factor by which a machine may differ from what its owner believes.
REACH = 8.0
#: Shares of the travel within which the contact of dry friction gives; from the larger one on it bears its
#: own name, and the smaller is far below any encoder's step.
CONTACTS = (1e-6, 1e-3)
#: Radians per sample at which a joint may swing on a contact that bears the rms torque: six times what its
#: samples can show. What is stiffer costs the simulation more steps and looks the same.
STIFFEST = 20.0
#: Shares of the travel over which dry friction may turn round: which of them is no finding, but a wrong one
#: biases its torque and makes other forms of friction look better than the true one.
CONTACT_STARTS = (2e-6, 2e-5, 2e-4)


def within_reach(lab: Model, scales: Scales | None = None) -> dict[str, tuple[float, float]]:
    """Bounds of the structure's parameters around what the lab believes, and of contacts by the ``scales`` of
    the recordings (none without them).

    Without them a joint whose effect is missing from the model can be fitted by a motor that does not answer
    its input at all, and a disturbance that happens to do the same.
    """
    limits = {}
    for name, value in lab.parameters.items():
        low = 0.0 if name.endswith("damping") else value / REACH
        limits[name] = (low, np.inf if name == "arm_damping" else REACH * value)
    for channel, place in enumerate(("motor",) if lab.rigid else ("motor", "arm")):
        if scales is None:
            break
        least, most = scales.contacts(channel)
        for name, entry in EFFECTS.items():
            if entry.contact:
                parameter = f"{lab.location(place)}.{name}.{entry.contact}"
                # A model that states another one is taken at its word.
                stated = lab.parameter_values().get(parameter, least)
                limits[parameter] = (min(least, stated), max(most, stated))
    return {name: (low, high if high > low else np.inf) for name, (low, high) in limits.items()}


def bridged(angle: np.ndarray) -> np.ndarray:
    """The angle (n,), where a reading is missing on the straight line between its neighbours; zero where
    there is none at all."""
    return finite(angle, None) if np.any(np.isfinite(angle)) else np.zeros(len(angle))


def velocity_of(angle: np.ndarray, dt: float) -> np.ndarray:
    """Velocity (n,) by a local quadratic over some 30 ms, rad/s; missing readings are `bridged`."""
    q = bridged(angle)
    length = min(max(5, 2 * int(0.015 / dt) + 1), (len(q) - 1) // 2 * 2 + 1)
    return np.asarray(scipy.signal.savgol_filter(q, length, 2, deriv=1, delta=dt), dtype=float)


def recording_scales(model: Model, records: Sequence[Record]) -> Scales:
    """Scales of recordings for a model: rms torque, largest angle and deflection, rms velocity, and so on."""
    torque = peak = velocity = fastest = deflection = duration = 0.0
    for r in records:
        torque = max(torque, model.parameters["torque_constant"] * float(np.sqrt(np.mean(r.input**2))))
        peak = max(peak, model.parameters["torque_constant"] * float(np.max(np.abs(r.input))))
        speed = np.abs(velocity_of(r.measured[:, 0], r.dt))
        velocity = max(velocity, float(np.sqrt(np.mean(speed**2))))
        fastest = max(fastest, float(np.max(speed, initial=0.0)))
        if not model.rigid:
            bent = np.abs(r.measured[:, 0] - r.measured[:, 1])
            deflection = max(deflection, float(np.max(bent[np.isfinite(bent)], initial=0.0)))
        duration = max(duration, len(r) * r.dt)
    lowest, highest = [], []
    for channel in (0, 1):
        values = np.concatenate([r.measured[:, channel] for r in records])
        good = values[np.isfinite(values)]
        lowest.append(float(good.min()) if len(good) else 0.0)
        highest.append(float(good.max()) if len(good) else 0.0)
    angle = max(abs(v) for v in (*lowest, *highest, 1e-9))
    p = model.parameters
    torque, velocity, deflection = max(torque, 1e-12), max(velocity, 1e-9), max(deflection, 1e-9)
    stiffness = float(p.get("stiffness", torque / angle))
    size = {
        "torque": torque,
        "peak": max(peak, 1e-12),
        "angle": angle,
        "deflection": deflection,
        "velocity": velocity,
        "stiffness": stiffness,
        "torque_per_angle": torque / angle,
        "damping": max(float(p["motor_damping"]), 0.1 * torque / velocity),
        "inertia": float(p.get("arm_inertia", p["motor_inertia"])),
        "drag": 0.3 * torque / velocity**2,
        "cubic": stiffness / deflection**2,
        "fastest": max(fastest, velocity),
        "peak_per_speed": max(peak, 1e-12) / max(fastest, velocity),
        "steep": 0.2 * torque / velocity**3,
        "duration": duration,
        "furthest": angle,
        "one": 1.0,
    }
    resolution, dt = records[0].resolution, records[0].dt
    inertias = (float(p.get(f"{axis}_inertia", p["motor_inertia"])) for axis in ("motor", "arm"))
    motor, arm = (torque / inertia * dt**2 for inertia in inertias)
    travel = (lowest[0], lowest[1]), (highest[0], highest[1])
    ways, orders = ((one(records, 0), one(records, 1)) for one in (_both_ways, highest_order))
    return Scales(
        size, *travel, dt, resolution, (motor, arm), ways, orders, float(p["torque_constant"])
    )


def highest_order(records: Sequence[Record], channel: int) -> float:
    """The highest order, cycles per revolution, for which the samples of motor (0) or arm (1) lie densely
    enough; 0 where the angle was not measured."""
    steps = np.abs(np.concatenate([np.diff(r.measured[:, channel]) for r in records]))
    steps = steps[np.isfinite(steps)]
    return 2.0 * math.pi * RESOLVED / max(float(np.quantile(steps, 0.9)), 1e-12) if len(steps) else 0.0


def _both_ways(records: Sequence[Record], channel: int) -> float:
    """Of the way that motor (0) or arm (1) goes in one direction the share that it goes in the other, 0 to 1,
    while it is faster than MOVES of its top speed; 1 where it was not measured."""
    speeds = [velocity_of(r.measured[:, channel], r.dt) for r in records]
    fastest = max(float(np.max(np.abs(v), initial=0.0)) for v in speeds)
    if fastest == 0.0:
        return 1.0
    ways = [
        sum(r.dt * float(np.sum(v[side * v > MOVES * fastest])) for r, v in zip(records, speeds, strict=True))
        for side in (1.0, -1.0)
    ]
    less, more = sorted(map(abs, ways))
    return less / more
