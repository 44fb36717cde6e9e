"""What people would otherwise do, on the same recordings: regressions on inverse dynamics and nested fits.

Every method knows the base structure and a library of the effects' usual forms, which is more than it would
know in practice. None of them locates sensors; names are compared without the location.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from haptic_teleop_sysid.blind.motion import Motion, read_motion
from haptic_teleop_sysid.blind.nested import nested_fits
from haptic_teleop_sysid.blind.summary import rate

Array = NDArray[np.float64]


def library(m: Motion) -> dict[str, list[tuple[Array, Array]]]:
    """Return {effect: columns}, each a pair: what it adds to the motor's and to the arm's equation."""
    zero = np.zeros_like(m.time)
    found: dict[str, list[tuple[Array, Array]]] = {}

    def add(effect: str, *pairs: tuple[Array, Array]) -> None:
        found.setdefault(effect, []).extend(pairs)

    for side, q, v in (("motor", m.motor, m.motor_speed), ("arm", m.arm, m.arm_speed)):

        def on(values: Array, side: str = side) -> tuple[Array, Array]:
            return (values, zero) if side == "motor" else (zero, values)

        sign = np.tanh(v / (0.02 * np.std(v) + 1e-6))
        one = np.ones_like(q)
        add(f"constant_torque {side}", on(one))
        add(f"coulomb_friction {side}", on(sign))
        add(f"stribeck_friction {side}", on(sign), on(sign * np.exp(-((v / (0.2 * np.std(v))) ** 2))))
        add(f"asymmetric_friction {side}", on(sign), on(one))
        add(f"quadratic_drag {side}", on(v * np.abs(v)))
        add(f"friction_drift {side}", on(v * m.time))
        add(f"spring_to_ground {side}", on(q), on(one))
        reach = np.maximum(q - 0.85 * q.max(), 0.0)
        add(f"hard_stop {side}", on(reach))
    add("gravity arm", (zero, np.sin(m.arm)), (zero, np.cos(m.arm)))
    for order in (2.0, 5.0, 10.0, 20.0):
        add("torque_ripple motor", (np.sin(order * m.motor), zero), (np.cos(order * m.motor), zero))
    stretch, rate_ = m.motor - m.arm, m.motor_speed - m.arm_speed
    rms = float(np.std(stretch))
    for effect, values in (
        ("hardening_spring joint", stretch**3),
        ("backlash joint", -np.clip(stretch, -0.3 * rms, 0.3 * rms)),
        ("joint_damping joint", rate_),
        ("hysteresis joint", np.tanh(rate_ / (0.1 * np.std(rate_)))),
    ):
        add(effect, (values, -values))
    change = np.gradient(m.current, m.time)
    peak = float(np.max(np.abs(m.current)))
    add("input_delay actuator", (change, zero))
    add("actuator_lag actuator", (change, zero), (np.gradient(change, m.time), zero))
    add("torque_saturation actuator", (np.clip(m.current, -0.8 * peak, 0.8 * peak) - m.current, zero))
    add("dead_zone actuator", (np.clip(m.current, -0.1 * peak, 0.1 * peak), zero))
    add("gain_drift actuator", (m.current * m.time, zero))
    late = m.time > np.mean(m.time)
    add("payload_change arm", (zero, m.arm_acceleration * late))
    return found


def _terms(m: Motion) -> list[tuple[str, Array]]:
    """Return the library's columns one by one, each under the first effect that has it: of two that are equal
    a regression would give either half."""
    found: dict[bytes, tuple[str, Array]] = {}
    for name, pairs in library(m).items():
        for pair in pairs:
            column = np.concatenate(pair)
            found.setdefault(column.tobytes(), (name, column))
    return list(found.values())


def equations(m: Motion, stiffness: float) -> tuple[Array, Array]:
    """Return (2 n,) known spring torques and (2 n, 5) base columns of motor and arm equation together."""
    zero = np.zeros_like(m.time)
    spring = stiffness * (m.motor - m.arm)
    target = np.concatenate([-spring, spring])
    columns = [
        (m.motor_acceleration, zero),
        (m.motor_speed, zero),
        (-m.current, zero),
        (zero, m.arm_acceleration),
        (zero, m.arm_speed),
    ]
    return target, np.column_stack([np.concatenate(pair) for pair in columns])


def _scaled(target: Array, base: Array) -> tuple[Array, Array, Array]:
    """Weigh the two equations by what the base leaves of each."""
    n = len(target) // 2
    left = target - base @ np.linalg.lstsq(base, target, rcond=None)[0]
    weight = np.repeat([1.0 / (np.std(left[:n]) + 1e-12), 1.0 / (np.std(left[n:]) + 1e-12)], n)
    return target * weight, base * weight[:, None], np.asarray(weight, dtype=np.float64)


def sparse_regression(m: Motion, stiffness: float, threshold: float) -> list[str]:
    """Return what PySINDy's sequentially thresholded least squares keep beside the base, strongest first.

    The base's columns are projected out of target and library, which is a regression that always keeps them.
    Columns and target have norm one, so `threshold` is a share of what the base leaves.
    """
    from pysindy.optimizers import STLSQ  # two seconds, and only the baselines need it

    target, base = equations(m, stiffness)
    y, fixed, weight = _scaled(target, base)
    terms = [(name, column * weight) for name, column in _terms(m)]
    basis = np.linalg.qr(fixed)[0]
    columns = np.column_stack([column for _, column in terms])
    whole = np.linalg.norm(columns, axis=0)
    columns = columns - basis @ (basis.T @ columns)
    # What is nothing here (a limit that was never reached), or nothing beside the base, cannot have norm one.
    usable = np.linalg.norm(columns, axis=0) > 1e-9 * whole
    columns, terms = columns[:, usable], [t for t, kept in zip(terms, usable, strict=True) if kept]
    left = y - basis @ (basis.T @ y)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # that a threshold leaves nothing is an answer
        fitted = STLSQ(threshold=threshold, alpha=1e-6, normalize_columns=True, unbias=False).fit(
            columns, left / np.linalg.norm(left)
        )
    strength = np.abs(fitted.coef_[0]) * np.linalg.norm(columns, axis=0)
    return list(dict.fromkeys(terms[i][0] for i in np.argsort(-strength) if strength[i] > 0.0))


def fit_everything(m: Motion, stiffness: float, least: float) -> list[str]:
    """Return the terms whose t value exceeds `least` when all are fitted at once, strongest first."""
    target, base = equations(m, stiffness)
    y, fixed, weight = _scaled(target, base)
    terms = [(name, column * weight) for name, column in _terms(m)]
    columns = np.column_stack([fixed, *(c for _, c in terms)])
    scale = np.linalg.norm(columns, axis=0) + 1e-12
    columns = columns / scale
    gram = columns.T @ columns + 1e-10 * np.eye(len(scale))
    inverse = np.linalg.inv(gram)
    values = inverse @ (columns.T @ y)
    left = y - columns @ values
    t = np.abs(values) / np.sqrt(np.diag(inverse) * (left @ left) / (len(y) - len(values)))
    order = np.argsort(-t[5:])
    return list(dict.fromkeys(terms[i][0] for i in order if t[5 + i] > least))


def grouped(m: Motion, stiffness: float, gain: float) -> list[str]:
    """Return effects picked one by one, all columns of one at once, while BIC gains."""
    target, base = equations(m, stiffness)
    y, columns, weight = _scaled(target, base)
    groups = {
        name: np.column_stack([np.concatenate(pair) * weight for pair in pairs])
        for name, pairs in library(m).items()
    }
    n, chosen = len(y), []

    def bic(found: Array) -> float:
        left = y - found @ np.linalg.lstsq(found, y, rcond=1e-8)[0]
        return n * float(np.log(left @ left / n)) + found.shape[1] * float(np.log(n))

    now = bic(columns)
    for _ in range(3):
        trials = {name: bic(np.hstack([columns, c])) for name, c in groups.items() if name not in chosen}
        best = min(trials, key=lambda name: trials[name])
        if now - trials[best] <= gain:
            break
        chosen.append(best)
        columns, now = np.hstack([columns, groups[best]]), trials[best]
    return chosen


Method = Callable[[Motion, dict[str, Any], float], list[str]]
METHODS: dict[str, tuple[Method, tuple[float, ...]]] = {
    "sparse regression (PySINDy) on inverse dynamics": (
        lambda m, p, x: sparse_regression(m, p["stiffness"], x),
        (0.1, 0.2, 0.4, 0.8),
    ),
    "everything at once": (
        lambda m, p, x: fit_everything(m, p["stiffness"], x),
        (4.0, 8.0, 16.0, 32.0, 64.0),
    ),
    "inverse dynamics by groups, BIC": (
        lambda m, p, x: grouped(m, p["stiffness"], x),
        (0.0, 30.0, 100.0, 300.0, 1000.0, 3000.0),
    ),
    "nested output-error fits, BIC": (nested_fits, (0.0, 30.0, 100.0, 300.0, 1000.0, 3000.0)),
}
"""Each method with its thresholds, the usual one first."""


def examine(directory: Path, stage: str) -> dict[str, Any]:
    """Return {method: {"seconds", "said": [names for each threshold]}} for one case."""
    parameters = yaml.safe_load((directory / "model.yaml").read_text())["parameters"]
    motion = read_motion(directory / "estimation", stage)
    found: dict[str, Any] = {}
    for name, (method, thresholds) in METHODS.items():
        begin = time.perf_counter()
        said = [method(motion, parameters, thresholds[0])]
        seconds = time.perf_counter() - begin
        said += [method(motion, parameters, x) for x in thresholds[1:]]
        found[name] = {"seconds": seconds, "said": said}
    return found


def run_baselines(
    cases: Path, labels: dict[str, Any], number: int, jobs: int, dask: str | None
) -> dict[str, dict[str, Any]]:
    """Return each method's rates with its usual threshold and with the one calibrated on half of the clean
    recordings (at most 5 % alarms); judged on the other half and on the singles and pairs.
    """
    from haptic_teleop_sysid.spread import spread

    # Of cases that another machine has run there may be no recordings here.
    chosen = _chosen({n: v for n, v in labels.items() if (cases / n / "model.yaml").exists()}, number)
    found = dict(
        spread(
            _examine_named,
            [(cases / name, labels[name]["stage"]) for name in chosen],
            jobs,
            dask,
            "baselines",
        )
    )
    clean = [name for name in chosen if labels[name]["kind"] == "clean"]
    practice, judged = clean[::2], clean[1::2]
    table: dict[str, dict[str, Any]] = {}
    for method, (_, thresholds) in METHODS.items():
        calibrated = next(
            (
                i
                for i in range(len(thresholds))
                if sum(bool(found[n][method]["said"][i]) for n in practice) <= 0.05 * len(practice)
            ),
            len(thresholds) - 1,
        )
        for title, at in ((method, 0), (f"{method}, calibrated", calibrated)):
            said = {name: found[name][method]["said"][at] for name in chosen}
            table[title] = {
                "false_alarms": rate(bool(said[n]) for n in judged),
                "first_name": rate(
                    bool(said[n]) and said[n][0].split()[0] == labels[n]["truth"][0]["effect"]
                    for n in chosen
                    if labels[n]["kind"] == "single"
                ),
                "pairs": rate(
                    {t["effect"] for t in labels[n]["truth"]} <= {s.split()[0] for s in said[n][:2]}
                    for n in chosen
                    if labels[n]["kind"] == "pair"
                ),
                "threshold": thresholds[at],
                "seconds": float(np.median([found[n][method]["seconds"] for n in chosen])),
            }
    return table


def _examine_named(directory: Path, stage: str) -> tuple[str, dict[str, Any]]:
    return directory.name, examine(directory, stage)


def _chosen(labels: dict[str, Any], number: int) -> list[str]:
    """Return up to `number` cases: strong singles, clean ones and pairs, three to three to one."""
    by_kind = {
        "single": [
            n for n, v in labels.items() if v["kind"] == "single" and v["truth"][0]["detectability"] >= 7.2
        ],
        "clean": [n for n, v in labels.items() if v["kind"] == "clean"],
        "pair": [n for n, v in labels.items() if v["kind"] == "pair"],
    }
    share = {"single": 3 * number // 7, "clean": 3 * number // 7, "pair": number - 2 * (3 * number // 7)}
    return [name for kind, names in by_kind.items() for name in names[: max(1, share[kind])]]
