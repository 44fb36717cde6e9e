"""One case by seed: robot, experiments, hidden physics sized by detectability, trace, label."""

from __future__ import annotations

import math
import zlib
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_sysid.blind import effects, outside
from haptic_teleop_sysid.blind.detect import (
    Column,
    Driven,
    Whitener,
    beyond,
    detectability,
    whiten,
    whitener,
)
from haptic_teleop_sysid.blind.detect import base_columns as refit_columns
from haptic_teleop_sysid.blind.effects import PLACES, Kind, Scene
from haptic_teleop_sysid.blind.planting import (
    Planted,
    Run,
    Setting,
    contribution,
    driven_of,
    fitted_to,
    run,
    shares_of,
)
from haptic_teleop_sysid.blind.planting import scene_of as scene_at
from haptic_teleop_sysid.blind.rivals import CANNOT_TELL, CONTAINS, distances
from haptic_teleop_sysid.blind.robot import (
    LOOPS,
    Robot,
    disturbance,
    draw_experiment,
    draw_robot,
    keep_in_range,
    lab_model,
    with_noise,
)

Array = NDArray[np.float64]
TOGETHER = {"pair": 2, "triple": 3}
"""How many effects are hidden together."""
KINDS = ("single", "clean", *TOGETHER, "outside", "tied")
LEVELS = (2.0, 8.0, 32.0, 128.0, 512.0)
DURATION = 24.0
DRAWS = 1000  # a stop that is just felt (d' 2) has needed close to a hundred
TIES: tuple[tuple[str, str], ...] = (
    ("sensor_delay", "motor_encoder"),
    ("sensor_delay", "arm_encoder"),
    ("input_delay", "actuator"),
    ("actuator_lag", "actuator"),
    ("gravity", "arm"),
    ("spring_to_ground", "arm"),
    ("constant_torque", "arm"),
    ("encoder_scale", "motor_encoder"),
    ("encoder_scale", "arm_encoder"),
    ("channel_skew", "motor_encoder"),
)
"""Where the effects that look alike (docs/effects.md) lie for this structure; each draw is
accepted only once its own recordings are found unable to separate it from another name."""
_TRACES = (
    ("coulomb_friction", "motor"),
    ("coulomb_friction", "arm"),
    ("constant_torque", "motor"),
    ("torque_ripple", "motor"),
    ("joint_damping", "joint"),
    ("hardening_spring", "joint"),
)


Places = tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Case:
    """All of a case but its files: two settings (estimation, validation), what is hidden, and its label."""

    name: str
    settings: tuple[Setting, Setting]
    others: tuple[tuple[Setting, Array], tuple[Setting, Array]]
    planted: tuple[Planted, ...]
    scenes: dict[str, Scene]
    pushes: tuple[Array, Array]
    sense_offset: float
    model: dict[str, object]
    label: dict[str, Any]
    seed: int


class Unlucky(Exception):
    """This draw came to nothing (ran away, could not be sized); draw again."""


def draw_case(
    seed: int,
    kind: str,
    index: int,
    name: str,
    levels: tuple[float, ...] = LEVELS,
    places: Places = PLACES,
) -> Case:
    """Return case `index` of `kind`, the same for the same seed, levels and (effect, part) to draw from.
    Draws without result are drawn again."""
    if kind == "single":  # few cases, too, are a mixture of all effects
        turn, place = divmod(index, len(places))
        index = turn * len(places) + int(np.random.default_rng((seed, 55)).permutation(len(places))[place])
    for attempt in range(DRAWS):
        entropy = (seed, zlib.crc32(kind.encode()), index, attempt)
        try:
            return _draw(np.random.default_rng(entropy), kind, index, name, levels, places)
        except Unlucky:
            continue
    raise RuntimeError(f"case {index} of {kind} with seed {seed}: {DRAWS} draws came to nothing")


def _draw(
    rng: np.random.Generator, kind: str, index: int, name: str, levels: tuple[float, ...], places: Places
) -> Case:
    stage = str(rng.choice(["stage1", "stage2"]))
    loop = str(rng.choice(list(LOOPS), p=[0.5, 0.25, 0.25]))
    wanted = _wanted(rng, kind, index, levels, places)
    known = any("known torque constant" in k.tags for k, _, _ in wanted)
    robot = draw_robot(rng, stage)
    small = kind == "tied"
    experiments, size = [], 1.0
    for _ in range(2):
        one = draw_experiment(rng, robot, loop, DURATION, slow=small, size=size * (0.35 if small else 1.0))
        experiments.append(one)
        size = rng.uniform(0.7, 1.3)
    driven_other = rng.random() < 0.5 or any(k.needs_other for k, _, _ in wanted)
    settings, others = [], []
    for one in experiments:
        other, push = _other(rng, stage, driven_other)
        moved = run(other, [], None, push)
        if not moved.settled:
            raise Unlucky
        acceleration = np.append(np.diff(moved.out[:, 3]), 0.0) / 0.002
        setting = Setting(robot, one, moved.out[:, 3].copy(), acceleration)
        settings.append(_in_range(setting))
        others.append((other, push))
    quiet = run(settings[0], [], None)
    settings[1] = _comparable(settings[1], quiet)
    torque = robot.truth["torque_constant"] * float(np.std(quiet.out[:, 8]))
    if torque < 1e-3:
        raise Unlucky
    noisy = with_noise(robot, rng, torque)
    settings = [replace(setting, robot=noisy) for setting in settings]
    filter_ = whitener(noisy)
    scenes = {part: scene_at(settings[0], quiet, part) for part in ("motor", "arm", "joint", "actuator")}
    scenes |= {f"{side}_encoder": scenes[side] for side in ("motor", "arm")}
    planted = _sized(rng, kind, wanted, settings[0], scenes, filter_, known)
    _check(kind, [_rivals(one, _sketched(one, settings, scenes), noisy, filter_, known) for one in planted])
    pushes = tuple(disturbance(rng, noisy, setting.samples) for setting in settings)
    recorded = _recorded(planted, settings, pushes, scenes) if planted else []
    if planted:
        planted = _as_large(planted, *recorded[0], filter_, known)
    tell = [
        _rivals(one, [(driven, added[i]) for driven, added in recorded], noisy, filter_, known)
        for i, one in enumerate(planted)
    ]
    _check(kind, tell)
    trace, offset = _trace(rng, planted, settings[0], scenes, filter_, known)
    everything = (*planted, *trace)
    for setting in settings:
        if not run(setting, list(everything), scenes["motor"]).settled:
            raise Unlucky
    label = {
        "kind": kind,
        "stage": stage,
        "excitation": [one.kind for one in experiments],
        "loop": loop,
        "other_stage_driven": driven_other,
        "truth": [_told(one, stage) for one in planted],
        "sets": [_explanations(one, found, stage) for one, found in zip(planted, tell, strict=True)],
        "nats": [
            {f"{e} {stage}_{p}": round(v, 2) for (e, p), v in sorted(found.items(), key=lambda x: x[1])[:6]}
            for found in tell
        ],
        "trace_of": trace[0].kind.effect if trace else ("sense_offset" if offset else None),
        "trace_detectability": trace[0].detectability if trace else None,
        "truth_parameters": noisy.truth,
        "noise": {
            "relative": noisy.noise_motor / torque,
            "motor": noisy.noise_motor,
            "arm": noisy.noise_arm,
            "colour_motor": noisy.colour_motor,
            "colour_arm": noisy.colour_arm,
        },
    }
    label["isolable"] = kind in ("single", *TOGETHER) and all(len(s) == 1 for s in label["sets"])
    model = lab_model(rng, noisy, known)
    return Case(
        name,
        (settings[0], settings[1]),
        (others[0], others[1]),
        everything,
        scenes,
        (pushes[0], pushes[1]),
        offset,
        model,
        label,
        int(rng.integers(1 << 62)),
    )


def _wanted(
    rng: np.random.Generator, kind: str, index: int, levels: tuple[float, ...], places: Places
) -> list[tuple[Kind, str, float]]:
    """Return (effect, part, d') to plant."""
    if kind == "clean":
        return []
    if kind == "single":
        effect, part = places[index % len(places)]
        turn = index // len(places) + index % len(places)
        return [(effects.BY_NAME[effect], part, levels[turn % len(levels)])]
    if kind == "outside":
        one = outside.KINDS[index % len(outside.KINDS)]
        return [(one, str(rng.choice(one.parts)), float(rng.choice([32.0, 128.0, 512.0])))]
    if kind == "tied":
        effect, part = TIES[index % len(TIES)]
        return [(effects.BY_NAME[effect], part, rng.uniform(8.0, 24.0))]
    chosen = rng.choice(len(places), TOGETHER[kind], replace=False)
    together = [
        (effects.BY_NAME[places[i][0]], places[i][1], float(rng.choice([32.0, 128.0, 512.0]))) for i in chosen
    ]
    for (one, *_), (other, *_) in combinations(together, 2):
        if one is other or _family(one) & _family(other):
            raise Unlucky
    return together


def _family(kind: Kind) -> set[str]:
    """Effects that share slots of the physics, or whose sum has the name of a third."""
    for family in (
        {k.effect for k in effects.KINDS if "friction" in k.effect and "drift" not in k.effect}
        | {"friction_after_rest"},
        {"input_delay", "actuator_lag", "torque_saturation", "torque_speed_limit", "dead_zone"}
        | {"channel_skew", "sensor_delay"},
        {"gravity", "spring_to_ground", "constant_torque"},
    ):
        if kind.effect in family:
            return family
    return {kind.effect}


def _other(rng: np.random.Generator, stage: str, driven: bool) -> tuple[Setting, Array]:
    """Return the other stage, open loop, and its random torque."""
    robot = draw_robot(rng, "stage2" if stage == "stage1" else "stage1")
    experiment = draw_experiment(rng, robot, "open loop current", DURATION)
    if not driven:
        experiment = experiment.scaled(0.0)
    n = len(experiment.reference)
    setting = Setting(robot, experiment, np.zeros(n), np.zeros(n))
    if driven:
        setting = _in_range(setting)
    scale = robot.truth["torque_constant"] * max(float(np.std(setting.experiment.reference)), 0.02)
    robot = with_noise(robot, rng, scale)
    return replace(setting, robot=robot), disturbance(rng, robot, n)


def _in_range(setting: Setting) -> Setting:
    for _ in range(3):
        out = run(setting, [], None).out
        if not np.isfinite(out).all():
            raise Unlucky
        travel = float(np.max(np.abs(out[:, :2])))
        kept = keep_in_range(setting.experiment, travel)
        if kept is setting.experiment:
            return setting
        setting = replace(setting, experiment=kept)
    raise Unlucky


def _comparable(setting: Setting, first: Run) -> Setting:
    """Return the second recording no wilder than the first, where the size of an effect is judged."""
    for _ in range(3):
        out = run(setting, [], None).out
        ratio = max(
            float(np.ptp(out[:, 0]) / np.ptp(first.out[:, 0])),
            float(np.ptp(out[:, 1]) / np.ptp(first.out[:, 1])),
            float(np.std(out[:, 0] - out[:, 1]) / np.std(first.out[:, 0] - first.out[:, 1])),
        )
        if ratio <= 1.25:
            return setting
        setting = replace(setting, experiment=setting.experiment.scaled(1.15 / ratio))
    return setting


def _sized(
    rng: np.random.Generator,
    kind: str,
    wanted: list[tuple[Kind, str, float]],
    setting: Setting,
    scenes: dict[str, Scene],
    filter_: Whitener,
    known: bool,
) -> list[Planted]:
    planted = []
    for effect, part, level in wanted:
        scene = scenes[part]
        parameters = effect.draw(rng, scene)
        if kind == "tied" and effect.effect == "channel_skew":
            parameters["delay"] = abs(parameters["delay"])
        sees = effect.sense and kind != "tied" and rng.random() < 0.5
        found = fitted_to(level, effect, part, parameters, sees, setting, scene, filter_, known)
        reached = found is not None and found.detectability > 0.6 * level
        if found is None or (not reached and not (kind == "single" and found.detectability > 1.0)):
            raise Unlucky
        planted.append(found)
    return planted


def _sketched(one: Planted, settings: list[Setting], scenes: dict[str, Scene]) -> list[tuple[Driven, Column]]:
    """Return each recording's trajectory without random torque, and what the effect adds to it."""
    experiments = []
    for setting in settings:
        quiet = run(setting, [one], scenes[one.part])
        if not quiet.settled:
            raise Unlucky
        experiments.append((driven_of(setting, quiet), contribution(setting, quiet)))
    return experiments


def _recorded(
    planted: list[Planted], settings: list[Setting], pushes: tuple[Array, ...], scenes: dict[str, Scene]
) -> list[tuple[Driven, list[Column]]]:
    """Return each recording's trajectory as it was made, and what every effect adds beside the others.

    Random torque moves the robot, too: a stop that is just touched without it may be missed with it, and in a
    loop it is in the command, where it tells a lag from a delay.
    """
    experiments = []
    for setting, push in zip(settings, pushes, strict=True):
        moved, added = shares_of(setting, planted, scenes, push)
        if not moved.settled:
            raise Unlucky
        experiments.append((driven_of(setting, moved), added))
    return experiments


def _as_large(
    planted: list[Planted], driven: Driven, added: list[Column], filter_: Whitener, known: bool
) -> list[Planted]:
    """Return the effects with the d' that they have in the recording itself, each beside the others.

    One effect may leave another no way to show. Unlucky where the recording makes much of a difference to a
    single effect, or leaves less than d' 8 of one of several.
    """
    base = refit_columns(filter_, driven, known)
    left = beyond(base, whiten(filter_, added, len(driven.motor)))
    found = []
    for i, one in enumerate(planted):
        alone: Array = left[:, i]
        others: list[Array] = []  # by Gram and Schmidt: digests of old labels hang on the last bit for pairs
        for j in range(len(planted)):
            if j != i:
                beside = left[:, j]
                for other in others:
                    beside = beside - other * (other @ beside)
                direction = beside / max(float(np.linalg.norm(beside)), 1e-12)
                others.append(direction)
                alone = alone - direction * (direction @ alone)
        found.append(replace(one, detectability=float(np.linalg.norm(alone))))
    if len(found) == 1:
        if not 0.6 < found[0].detectability / planted[0].detectability < 1.7:
            raise Unlucky
    elif min(one.detectability for one in found) < 8.0:
        raise Unlucky
    return found


def _rivals(
    one: Planted, experiments: list[tuple[Driven, Column]], robot: Robot, filter_: Whitener, known: bool
) -> dict[tuple[str, str], float]:
    """Return nats to every other explanation of one effect."""
    truth = robot.truth
    late = one.kind.effect in ("input_delay", "actuator_lag", "sensor_delay", "channel_skew")
    delays = tuple(abs(one.parameters[n]) for n in ("delay", "time_constant") if late and n in one.parameters)
    found = distances(filter_, experiments, truth["torque_constant"], truth["stiffness"], known, delays)
    own = found.pop((one.kind.effect, one.part), math.nan)
    return {
        # What adds the same along the path is the same under another name, however far either is from the
        # truth: that distance is how roughly it is written here.
        key: 0.0 if math.isclose(nats, own, rel_tol=1e-9) else nats
        for key, nats in found.items()
        if one.kind.effect not in CONTAINS.get(key[0], frozenset())
        or key[1].partition("_")[2] != one.part.partition("_")[2]
        or ("_" not in one.part and key[1] != one.part)
    }


def _check(kind: str, tell: list[dict[tuple[str, str], float]]) -> None:
    """Unlucky when a tie is none, an effect outside the table has a name in it, or one of several has
    another."""
    if kind == "tied" and min(tell[0].values()) > 0.4 * CANNOT_TELL:
        raise Unlucky
    if kind == "outside" and min(tell[0].values()) < 32.0:
        raise Unlucky
    if kind in TOGETHER and min(min(found.values()) for found in tell) < CANNOT_TELL:
        raise Unlucky


def _trace(
    rng: np.random.Generator,
    planted: list[Planted],
    setting: Setting,
    scenes: dict[str, Scene],
    filter_: Whitener,
    known: bool,
) -> tuple[list[Planted], float]:
    """Return a trace of another imperfection with d' at most 1 in half of the cases, and an offset of the
    sense."""
    draw, level = rng.random(), rng.uniform(0.3, 0.9)
    if draw < 0.5:
        return [], 0.0
    taken = {slot for one in planted for slot in _family(one.kind)}
    free = [(e, p) for e, p in _TRACES if e not in taken]
    if draw > 0.92:  # an offset of the current sense looks like a constant torque to whoever believes it
        quiet = run(setting, [], None)
        kt = setting.robot.truth["torque_constant"]
        unit = detectability(
            filter_, driven_of(setting, quiet), Column(motor_force=np.full(setting.samples, kt)), known
        )
        return [], level / unit * (1.0 if rng.random() < 0.5 else -1.0)
    effect, part = free[int(rng.integers(len(free)))]
    kind = effects.BY_NAME[effect]
    parameters = kind.draw(rng, scenes[part])
    found = fitted_to(level, kind, part, parameters, False, setting, scenes[part], filter_, known)
    if found is None or found.detectability > 1.0:
        return [], 0.0
    return [found], 0.0


def _told(one: Planted, stage: str) -> dict[str, Any]:
    return {
        "effect": one.kind.effect,
        "location": one.location(stage),
        "parameters": one.parameters,
        "scored": list(one.kind.scored),
        "detectability": one.detectability,
        "sense_sees": one.sees,
    }


def _explanations(one: Planted, found: dict[tuple[str, str], float], stage: str) -> list[tuple[str, str]]:
    """Return the truth and all that these recordings cannot tell from it, nearest first."""
    near = sorted((nats, key) for key, nats in found.items() if nats < CANNOT_TELL)
    return [(one.kind.effect, one.location(stage)), *((e, f"{stage}_{p}") for _, (e, p) in near)]
