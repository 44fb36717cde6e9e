"""What the force controller tells in its diagnostics of the coupling: roles, energies, the link's delay."""

from __future__ import annotations

from typing import Any

from haptic_teleop_control.robots import STAGES
from haptic_teleop_control.teleoperation.coupling import Coupling


def measurements(coupling: Coupling, dropped: int) -> dict[str, Any]:
    """Values by name with unit, as people read them. dropped: late or repeated samples since the start."""
    energies = coupling.energies
    values = {
        "roles": f"master {coupling.roles[0]}, slave {coupling.roles[1]}",
        "saturated samples": coupling.saturations,
        "late or repeated samples dropped": dropped,
    }
    for i, stage in enumerate(STAGES):
        values[f"{stage} energy of the master's port (J)"] = f"{energies.master[i]:.5f}"
        values[f"{stage} energy of the slave's port (J)"] = f"{energies.slave[i]:.5f}"
        values[f"{stage} lowest energy of the master's port (J)"] = f"{energies.lowest_master[i]:.5f}"
        if coupling.linked:
            values[f"{stage} lowest energy of the link (J)"] = f"{energies.lowest_link[i]:.5f}"
    if coupling.linked:
        values["round trip (ms)"] = f"{1e3 * coupling.round_trip:.2f}"
    return values


def energy_warning(coupling: Coupling) -> str:
    """What to do where a port has given away more than `passivity.epsilon`; "" where none has."""
    energies, allowed = coupling.energies, -coupling.passivity.epsilon
    lowest = {"the master's port": energies.lowest_master, "the link": energies.lowest_link}
    active = [name for name, values in lowest.items() if values.min() < allowed]
    if not active:
        return ""
    return (
        f"{' and '.join(active)} gave away more than {-allowed:g} J: hold the master firmly, lower the "
        "feedback gain, or set passivity.controller"
    )
