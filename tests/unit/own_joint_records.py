"""Records of the joint with physics of its own, and the model that its owner has of it."""

import numpy as np
from own_joint import DT, TRUTH, moved

from haptic_teleop_sim.kernel import simulate
from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.estimation.records import Record

LAB = Model(
    "sfj", "stage1", "flexible_joint",
    {n: v * (1.0 if n in ("torque_constant", "stiffness") else 1.08) for n, v in TRUTH.items()},
    fixed=("stiffness", "torque_constant"),
)  # fmt: skip


def records(law, *numbers, **options):
    """One record to fit and one to judge, in a list each, of a joint with that law (see `own_joint`)."""
    both = []
    for seed in (11, 12):
        current, angles = moved(seed, law, *numbers, **options)
        both.append(
            Record(f"made {seed}", DT, current, angles, np.zeros(len(current)), (1e-4, 2e-4), at_rest=True)
        )
    return [both[:1], both[1:]]


def errors_of(learn, judge):
    """The error of a model's free runs of the first record of each kind, as a share of the motion."""

    def one(model, record):
        shown = simulate(model, record.input, DT).states[:, :2]
        apart = np.linalg.norm(shown - record.measured, axis=0)
        return float(np.mean(apart / np.linalg.norm(record.measured - record.measured.mean(axis=0), axis=0)))

    return lambda model: (one(model, learn[0]), one(model, judge[0]))
