"""Models for the tests of the plants."""

from haptic_teleop_sim.model import Effect, Model

FLEXIBLE = {
    "torque_constant": 8.925,
    "stiffness": 3.971,
    "motor_inertia": 0.0635,
    "motor_damping": 2.6,
    "arm_inertia": 0.17,
    "arm_damping": 0.02,
}


def flexible(*effects: tuple[str, str, dict[str, float]], **changes: float) -> Model:
    """Stage 1 with (effect, place, parameters) and changed parameters."""
    model = Model("sfj", "stage1", "flexible_joint", {**FLEXIBLE, **changes})
    return model.with_effects(*(Effect(name, f"stage1_{place}", values) for name, place, values in effects))


def rigid(*effects: tuple[str, dict[str, float]], inertia: float = 0.2, damping: float = 0.0) -> Model:
    """A body with (effect, parameters) at the motor; a place other than that as "effect@place"."""
    parameters = {"torque_constant": 1.0, "motor_inertia": inertia, "motor_damping": damping}
    model = Model("generic", "j", "rigid_body", parameters)
    found = []
    for name, values in effects:
        effect, _, place = name.partition("@")
        found.append(Effect(effect, f"j_{place or 'motor'}", values))
    return model.with_effects(*found)
