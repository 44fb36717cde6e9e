"""Effects put into recordings of real machines: are they found, and how large?

    python tests/studies/effects_in_real_recordings.py ../shared/data/real --output /tmp/put_in

What may honestly be put into a recording that exists: what a sensor, a clock or a recorder would have made of
the same motion, and a torque that is added to the *recorded* input without the machine having felt it (then
the machine behaves as if it were taken from what was recorded).  Every machine is diagnosed as it is, and
with one thing put into its estimation and validation recordings.  Sizes are held against what was put in,
beside what the untouched recording says.  Goes on where it was interrupted; prints a table, and writes a file
for each case.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from haptic_teleop_control.recording import Recording, read_recording
from haptic_teleop_sim.model import load_model
from haptic_teleop_sysid.diagnosis.run import diagnose
from haptic_teleop_sysid.recordings.dataset import load_dataset

Channels = dict[str, np.ndarray]
NEAR = 0.3
"""Error of a size, relative, up to which it counts as right."""


def span(q: np.ndarray) -> float:
    return float(np.ptp(q))


def rms(u: np.ndarray) -> float:
    return float(np.sqrt(np.mean((u - u.mean()) ** 2)))


def speed(c: Channels) -> np.ndarray:
    """Velocity by differences over nine samples, per second."""
    t, q = c["time"], c["motor"]
    reach = 4
    ahead, behind = (
        np.minimum(np.arange(len(q)) + reach, len(q) - 1),
        np.maximum(np.arange(len(q)) - reach, 0),
    )
    return (q[ahead] - q[behind]) / (t[ahead] - t[behind])


def late_input(c: Channels, size: float, which: int) -> None:
    late = round(size / float(np.median(np.diff(c["time"]))))
    c["input"] = np.concatenate([c["input"][late:], np.full(late, c["input"][-1])])


def late_angle(c: Channels, size: float, which: int) -> None:
    late = round(size / float(np.median(np.diff(c["time"]))))
    c["motor"] = np.concatenate([np.full(late, c["motor"][0]), c["motor"][:-late]])


def eccentric(c: Channels, size: float, which: int) -> None:
    c["motor"] = c["motor"] + size * np.sin(6.0 * np.pi * c["motor"] / c["reach"])


def slip(c: Channels, size: float, which: int) -> None:
    c["motor"] = c["motor"] + np.where(
        c["time"] > c["time"][0] + (0.6 - 0.2 * which) * span(c["time"]), size, 0.0
    )


def dropped(c: Channels, size: float, which: int) -> None:
    keep = np.random.default_rng(which).random(len(c["time"])) > size
    for name in ("time", "input", "motor", "arm"):
        if name in c:
            c[name] = c[name][keep]


def coarse(c: Channels, size: float, which: int) -> None:
    c["motor"] = size * np.floor(c["motor"] / size + 0.5)


def rubbing(c: Channels, size: float, which: int) -> None:
    c["input"] = c["input"] + size * np.sign(speed(c))


def spring(c: Channels, size: float, which: int) -> None:
    c["input"] = c["input"] + size * c["motor"]


def offset(c: Channels, size: float, which: int) -> None:
    c["input"] = c["input"] + size


def ripple(c: Channels, size: float, which: int) -> None:
    c["input"] = c["input"] + size * np.sin(10.0 * np.pi * c["motor"] / c["reach"])


#: What is put in: how, how much of what, by which names and which parameter it would be found.
Kind = tuple[Callable[[Channels, float, int], None], Callable[[Channels], float], tuple[str, ...], str]
DELAYS = ("input_delay", "channel_skew", "sensor_delay")
FRICTIONS = ("coulomb_friction", "asymmetric_friction", "stribeck_friction")
SPRINGS = ("spring_to_ground", "gravity")
CONSTANTS = ("constant_torque", "asymmetric_friction")
KINDS: dict[str, Kind] = {
    "late input": (late_input, lambda c: 10.0 * float(np.median(np.diff(c["time"]))), DELAYS, "delay"),
    "late encoder": (late_angle, lambda c: 5.0 * float(np.median(np.diff(c["time"]))), DELAYS, "delay"),
    "eccentric encoder": (
        eccentric,
        lambda c: 0.02 * span(c["motor"]),
        ("encoder_eccentricity",),
        "amplitude",
    ),
    "slip of the encoder": (slip, lambda c: 0.05 * span(c["motor"]), (), ""),
    "a twentieth of the samples dropped": (dropped, lambda c: 0.05, (), ""),
    "encoder of 500 steps over the travel": (coarse, lambda c: span(c["motor"]) / 500.0, (), ""),
    "dry friction": (rubbing, lambda c: 0.25 * rms(c["input"]), FRICTIONS, "torque"),
    "spring": (spring, lambda c: 0.5 * rms(c["input"]) / rms(c["motor"]), SPRINGS, "stiffness"),
    "constant torque": (offset, lambda c: 0.25 * rms(c["input"]), CONSTANTS, "torque"),
    "torque ripple": (ripple, lambda c: 0.3 * rms(c["input"]), ("torque_ripple",), "amplitude"),
}


def changed(recording: Recording, model: Any, change: Callable[[Channels], None]) -> Recording:
    """The recording with its channels changed."""
    io = model.io
    topic = io["motor"]["topic"]
    series = recording.topics[topic]
    places = {n: series.names.index(io[n]["joint"]) for n in ("motor", "arm") if io.get(n)}
    c = {n: np.array(series.position[:, place]) for n, place in places.items()}
    entry = series.names.index(io["input"]["joint"])
    c |= {"time": series.stamp * 1e-9, "input": np.array(series.effort[:, entry])}
    c["reach"] = np.array(span(c["motor"]))
    change(c)
    kept = np.searchsorted(series.stamp * 1e-9, c["time"])
    position, effort = np.array(series.position[kept]), np.array(series.effort[kept])
    for name, place in places.items():
        position[:, place] = c[name]
    effort[:, entry] = c["input"]
    one = replace(
        series,
        stamp=series.stamp[kept],
        received=series.received[kept],
        position=position,
        velocity=None,
        effort=effort,
    )
    return replace(recording, topics={**recording.topics, topic: one})


def asked(folder: Path, change: Callable[[Channels, int], None]) -> dict[str, Any]:
    """What the diagnosis says of a machine's recordings with a change."""
    model = load_model(folder / "model.yaml")
    sets = []
    for which, kind in enumerate(("estimation", "validation")):
        one = changed(read_recording(folder / kind), model, lambda c, which=which: change(c, which))
        sets.append(load_dataset(one, model, kind, True))
    begin = time.monotonic()
    content = diagnose(model, [sets[0]], [sets[1]])[3]
    content["seconds"] = round(time.monotonic() - begin, 1)
    content["slips"] = [[s.encoder, s.size] for one in sets for s in one.slips]
    return content


def named(content: dict[str, Any], names: tuple[str, ...]) -> dict[str, Any] | None:
    """The finding that bears one of the names, or has one among its alternatives."""
    for f in content["findings"]:
        if f["effect"] in names:
            return f
    return next(
        (f for f in content["findings"] if any(a["effect"] in names for a in f["alternatives"])), None
    )


def size_of(content: dict[str, Any], names: tuple[str, ...], parameter: str) -> float:
    """The size by which an effect of these names was found; 0 where it was not. A gravity counts by its
    slope; an asymmetric friction is a plain one beside a constant torque, and all of either count."""
    if names in (FRICTIONS, CONSTANTS):
        return sum(dry_and_constant(f)[int(names == CONSTANTS)] for f in content["findings"])
    found = named(content, names)
    if found is None:
        return 0.0
    p = {n: v["value"] for n, v in found["parameters"].items()}
    return abs(p.get(parameter, p.get("torque", p.get("amplitude", 0.0))))


def dry_and_constant(finding: dict[str, Any]) -> tuple[float, float]:
    """The torque of a finding that opposes the motion, and the one that acts on it whatever its direction."""
    p = {n: v["value"] for n, v in finding["parameters"].items()}
    match finding["effect"]:
        case "coulomb_friction":
            return p["torque"], 0.0
        case "stribeck_friction":
            return p["coulomb"], 0.0
        case "asymmetric_friction":
            return 0.5 * (p["positive"] + p["negative"]), 0.5 * (p["negative"] - p["positive"])
        case "constant_torque":
            return 0.0, p["torque"]
    return 0.0, 0.0


def told(content: dict[str, Any]) -> str:
    names = [f"{f['effect']} {100 * f['confidence']:.0f} %" for f in content["findings"]]
    return f"{content['verdict']}: {', '.join(names) or '-'}"


def judged(kind: str, before: dict[str, Any], after: dict[str, Any]) -> str:
    """right | named | in the set | as before | unknown | missed | wrong"""
    _, _, names, parameter = KINDS[kind]
    own = {f["effect"] for f in before["findings"]}
    new = {f["effect"] for f in after["findings"]}
    if kind.startswith("slip"):
        sizes = [abs(s) for _, s in after["slips"]]
        said = [s for s in sizes if abs(s / after["put_in"] - 1.0) < NEAR]
        return "right" if len(said) >= 2 else "missed" if not said else "named"
    if not names:
        return "as before" if new == own else "fewer" if new < own else "wrong"
    found = named(after, names)
    if found is None:
        return "unknown" if after["verdict"] == "unknown" else "missed" if new <= own else "wrong"
    if found["effect"] not in names:
        return "in the set"
    # What is added to the input is missing from the torque: dry friction, or a constant one the other way.
    already = size_of(before, names, parameter) if parameter == "torque" else 0.0
    size = abs(size_of(after, names, parameter) - already)
    return "right" if abs(size / after["put_in"] - 1.0) < NEAR else "named"


def main() -> int:
    """Diagnose every machine with everything, and print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path, help="holds a folder for each machine")
    parser.add_argument("--output", type=Path, required=True)
    parser.add_argument("--machines", nargs="*")
    arguments = parser.parse_args()
    arguments.output.mkdir(parents=True, exist_ok=True)
    machines = arguments.machines or sorted(
        p.name for p in arguments.folder.iterdir() if (p / "model.yaml").is_file()
    )

    def answer(machine: str, kind: str | None) -> dict[str, Any]:
        path = arguments.output / f"{machine}_{(kind or 'as_it_is').replace(' ', '_')}.json"
        if not path.exists():
            size: list[float] = []

            def change(c: Channels, which: int) -> None:
                if kind is not None:
                    apply, amount, _, _ = KINDS[kind]
                    size.append(amount(c) if not size else size[0])
                    apply(c, size[0], which)

            content = asked(arguments.folder / machine, change)
            content["put_in"] = size[0] if size else None
            path.write_text(json.dumps(content, default=float))
        return json.loads(path.read_text())

    counts: dict[str, int] = {}
    print("| machine | put in | answer | what it says | size put in | found | s |")
    print("|---|---|---|---|---|---|---|")
    for machine in machines:
        before = answer(machine, None)
        print(f"| {machine} | nothing | | {told(before)} | | | {before['seconds']} |", flush=True)
        for kind, (_, _, names, parameter) in KINDS.items():
            after = answer(machine, kind)
            verdict = judged(kind, before, after)
            counts[verdict] = counts.get(verdict, 0) + 1
            size = f"{size_of(after, names, parameter):.3g}" if names else ""
            row = (machine, kind, verdict, told(after), f"{after['put_in']:.3g}", size, after["seconds"])
            print(f"| {' | '.join(map(str, row))} |", flush=True)
    print(", ".join(f"{n} {v}" for n, v in sorted(counts.items(), key=lambda c: -c[1])))
    return 0


if __name__ == "__main__":
    sys.exit(main())
