"""What tests of the diagnosis begin with: a stage and a rigid joint, records of the stage from an integrator
written here, and fits, explanations and results of a search in which nothing was estimated."""

from types import SimpleNamespace

import numpy as np
from plants import FLEXIBLE

from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sysid.diagnosis.decision.search.rounds import SearchResult
from haptic_teleop_sysid.diagnosis.hypotheses.explanation import Explanation
from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.estimation.noise import NoiseModel
from haptic_teleop_sysid.estimation.records import Record

DT = 0.002
STEP = 1e-5
MODEL = Model("sfj", "stage1", "flexible_joint", FLEXIBLE, fixed=("stiffness", "torque_constant"))
RIGID = Model(
    "generic",
    "j",
    "rigid_body",
    {n: FLEXIBLE[n] for n in ("torque_constant", "motor_inertia", "motor_damping")},
    fixed=("torque_constant",),
    io={
        "input": {"topic": "/plant/joint_states", "joint": "j", "field": "effort"},
        "motor": {"topic": "/plant/joint_states", "joint": "j"},
        "arm": None,
    },
)
NOISE = NoiseModel(0.05, 0.02, 5e-6, 5e-6)


def joint_record(
    seed,
    seconds=8.0,
    rms=0.25,
    motor_torque=None,
    arm_torque=None,
    window=None,
    name="made",
    motor_friction=None,
):
    """A record of the flexible joint under random sines, integrated by the semi-implicit Euler rule at 50 us;
    ``motor_torque`` and ``arm_torque`` are added torques as functions of the angle, N·m, ``motor_friction``
    one of angle and speed.  ``window``: times in s in which the input is three times as large."""
    rng = np.random.default_rng(seed)
    time = DT * np.arange(int(seconds / DT))
    input_ = np.zeros(len(time))
    for f in (0.15, 0.4, 0.9, 1.7, 3.1):
        input_ += rms * np.sqrt(2.0 / 5.0) * np.sin(2.0 * np.pi * (f * time + rng.uniform()))
    if window is not None:
        input_[(time >= window[0]) & (time < window[1])] *= 3.0
    disturbance = 2e-3 * rng.standard_normal(len(time))
    p, parts = FLEXIBLE, 40
    h = DT / parts
    qm = qa = vm = va = 0.0
    measured = np.empty((len(time), 2))
    for i, u in enumerate(input_):
        measured[i] = qm, qa
        drive = p["torque_constant"] * float(u) + float(disturbance[i])
        for _ in range(parts):
            elastic = p["stiffness"] * (qm - qa)
            tm = drive - elastic - p["motor_damping"] * vm
            ta = elastic - p["arm_damping"] * va
            if motor_torque is not None:
                tm += motor_torque(qm)
            if motor_friction is not None:
                tm += motor_friction(qm, vm)
            if arm_torque is not None:
                ta += arm_torque(qa)
            vm += h * tm / p["motor_inertia"]
            va += h * ta / p["arm_inertia"]
            qm += h * vm
            qa += h * va
    measured = np.rint(measured / STEP) * STEP
    return Record(name, DT, input_, measured, np.zeros(len(time)), (STEP, STEP), at_rest=True)


def fit_of(model=MODEL, log_likelihood=0.0):
    """A fit with given parameters: nothing is estimated here."""
    return Fit(model, NOISE, (), log_likelihood, np.zeros((0, 0)), np.zeros(0), True, 0, "as given")


def coupled(record):
    """The record with an acceleration of the other arm."""
    return Record(
        record.name, record.dt, record.input, record.measured, np.cos(record.input), record.resolution
    )


def explanation(name, gain, held_out, place="motor", is_material=True, **parameters):
    """An effect of the stage that gains so much where it was fitted and on the other recordings."""
    effect = Effect(name, f"stage1_{place}", parameters or {"torque": 0.1})
    return Explanation(fit_of(MODEL.with_effects(effect)), gain, held_out, is_material, 0)


def result_of(*choices, last_round=()):
    """The end of a search that made these choices."""
    final = choices[-1].chosen.fit if choices else fit_of()
    return SearchResult(fit_of(), final, choices, last_round, SimpleNamespace(size={"torque": 1.0}))


DRAG = Effect("quadratic_drag", "stage1_motor", {"coefficient": 2.0})


def unimpressed(model):
    """A free simulation in which no model is better than another."""
    return (90.0,)


def borne_out(fit, so_far, effect):
    """Free runs and torques that speak for everything."""
    return True
