"""The energy at the ports of master and slave: picture and table of a verification."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from haptic_teleop_control.robots import STAGES
from haptic_teleop_control.teleoperation.recorded_energy import PortEnergy
from haptic_teleop_sysid.report import Panel, Plot, Series
from haptic_teleop_sysid.report.roles import RUNS
from haptic_teleop_sysid.verification.tables import number

Energies = Mapping[str, PortEnergy]
"""Port -> its energy, as `port_energies` gives it."""

PORTS = {
    "master": "given by the hand at the master",
    "slave": "got by the slave's arm and environment",
}

EXPLANATION = (
    "A master's port below zero has given energy to the hand. Master and slave together are not passive and "
    "not meant to be: the slave's motors work as long as the master is held off its neutral position."
)


def energy_plot(energies: Energies) -> Plot | None:
    """One panel for each port, both stages; None where the recording holds neither."""
    panels = []
    for port, title in PORTS.items():
        if port in energies:
            one = energies[port]
            lines = [
                Series(stage.replace("stage", "stage "), one.time, 1e3 * one.energy[:, i], RUNS[i])
                for i, stage in enumerate(STAGES)
            ]
            panels.append(Panel(title, "mJ", lines, guides=(0.0,)))
    return Plot(panels) if panels else None


def energy_table(
    energies: Sequence[Energies], labels: Sequence[str]
) -> tuple[list[str], list[list[object]], str]:
    """Energy at the end and its lowest value, mJ, of every port, stage and run."""
    rows: list[list[object]] = [
        [label, PORTS[port], stage, *(number(e, 2, 1e3) for e in (one.energy[-1, i], one.lowest[i]))]
        for run, label in zip(energies, labels, strict=True)
        for port, one in run.items()
        for i, stage in enumerate(STAGES)
    ]
    return ["run", "energy", "stage", "at the end (mJ)", "lowest (mJ)"], rows, ""
