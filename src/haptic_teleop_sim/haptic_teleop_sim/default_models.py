"""The models that the simulated robots have when the configuration names no model file.

`config/models/` holds the same numbers as model files, to be copied and changed.

Sources: torque constants, stiffness and ranges as in `robots.py`. Inertias: the drives from rotor and fixture
of Quanser's configuration of the sibling 2DSFL, the arms from its CAD data (the arms of the 2DSFJ differ).
Drive
friction: regression on recorded data of a 2DSFL, stage 2 converted to its gear ratio. Damping of the arms:
*assumed*. Omni: Y and Z inertia from published three-axis models, X the mean part of the same model's turret
inertia; friction in the form of equation (22), *assumed* within the 0.26 N that the data sheet states.
"""

from __future__ import annotations

from haptic_teleop_control.robots import OMNI_AXES, SFJ_STAGES

from .model import Effect, Model

_DRIVES = {
    "stage1": {"motor_inertia": 0.0635, "motor_damping": 2.6, "arm_inertia": 0.17, "arm_damping": 0.02},
    "stage2": {"motor_inertia": 0.00704, "motor_damping": 0.6, "arm_inertia": 0.0064, "arm_damping": 0.005},
}
_COULOMB = {"stage1": 0.6, "stage2": 0.12}
_OMNI_X_INERTIA = 1.8e-3
_OMNI_VISCOUS = 2.0e-3
_OMNI_FRICTION = {"coulomb": 0.02, "breakaway": 0.03, "velocity": 0.2, "smoothing": 0.02}
#: Stops of the Omni's axes: stiff for the device's inertia, and damped so that it does not bounce. Assumed.
_OMNI_STOP = {"stiffness": 20.0, "dissipation": 1.0}


def sfj_stage_model(stage: str) -> Model:
    """The flexible joint with Coulomb friction at the motor of `stage` ("stage1" or "stage2")."""
    facts = SFJ_STAGES[stage]
    return Model(
        robot="sfj",
        joint=stage,
        structure="flexible_joint",
        parameters={"torque_constant": facts.torque_constant, "stiffness": facts.stiffness, **_DRIVES[stage]},
        effects=(Effect("coulomb_friction", f"{stage}_motor", {"torque": _COULOMB[stage]}),),
        # It was measured; and scaling all parameters together would change no motion.
        fixed=("stiffness",),
        source=f"the built-in model of {stage}",
    )


def omni_axis_model(axis: str) -> Model:
    """The rigid body with friction, range and, on Y, internal spring of `axis`, e.g. "omni_y". The device is
    mounted horizontally, so that gravity does not act (thesis 2.3.2)."""
    facts = OMNI_AXES[axis]
    inertia = _OMNI_X_INERTIA if facts.inertia is None else facts.inertia
    motor = f"{axis}_motor"
    stop = {"angle": facts.upper, **_OMNI_STOP, "both_sides": 1.0}
    effects = [
        Effect("stribeck_friction", motor, dict(_OMNI_FRICTION)),
        Effect("hard_stop", motor, stop),
    ]
    if facts.spring_stiffness > 0.0:
        spring = {"stiffness": facts.spring_stiffness, "rest": facts.spring_rest}
        effects.append(Effect("spring_to_ground", motor, spring))
    return Model(
        robot="omni",
        joint=axis,
        structure="rigid_body",
        parameters={"torque_constant": 1.0, "motor_inertia": inertia, "motor_damping": _OMNI_VISCOUS},
        effects=tuple(effects),
        # Its input is a torque already; and what the stops are does not show in a recording between them.
        fixed=("torque_constant", *(f"{motor}.hard_stop.{name}" for name in stop)),
        source=f"the built-in model of {axis}",
    )
