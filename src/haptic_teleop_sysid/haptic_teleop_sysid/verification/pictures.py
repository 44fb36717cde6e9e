"""Pictures of a scenario: command, motion, torque and current of one stage, several runs laid over each
other.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from haptic_teleop_sysid.report import Panel, Plot, Series, histogram
from haptic_teleop_sysid.report.roles import RUNS
from haptic_teleop_sysid.verification.run import Run

if TYPE_CHECKING:  # importing matplotlib takes half a second
    from matplotlib.figure import Figure

#: Dashes of an arm where colours tell runs apart, and of the speed that the force law promises.
_ARM, _PROMISE = (2, 3), (3, 3)


def stage_picture(
    runs: Sequence[Run],
    stage: str,
    labels: Sequence[str],
    remove_delay: bool = False,
    roles: Sequence[str] = (),
) -> Plot:
    """Return the stage's panels over time; contact and release of the first run are shaded.

    With `remove_delay` each run's time counts from the onset of its command. ``roles``: what each of several
    runs means, see `ROLES`; without them they are told apart by their order.
    """
    shown = [
        (run, label, roles[number] if roles else RUNS[number % len(RUNS)])
        for number, (run, label) in enumerate(zip(runs, labels, strict=True))
        if stage in run.stages
    ]
    single = len(shown) == 1
    first = shown[0][0]
    of_omni = first.merits[stage].of_omni
    command, position, velocity, torque, current = [], [], [], [], []
    for run, label, role in shown:
        data = run.stages[stage]
        time = data.time - run.onset if remove_delay else data.time
        name = "" if single else f"{label}: "
        # One run: a colour for each signal. Several: a colour for each run, and dots for its arm.
        arm, dots = ("second", None) if single else (role, _ARM)
        moving = f"{name}{'axis' if of_omni else 'motor'}"
        wanted = Series(f"{name}Td", time, data.desired_torque, "reference" if single else role)
        command.append(wanted)
        if of_omni:
            position.append(Series(moving, time, data.arm_position, role))
        else:
            position.append(Series(moving, time, data.motor_position, role))
            position.append(Series(f"{name}arm", time, data.arm_position, arm, dots))
        velocity.append(Series(moving, time, data.motor_velocity, role))
        if data.settings.lambda_ and run is shown[0][0]:
            expected = data.desired_torque / data.settings.lambda_
            velocity.append(Series("Td / λ", time, expected, "reference", _PROMISE))
        torque.append(Series(f"{name}Te" if single else moving, time, data.environment_torque, role))
        if single:
            torque.append(wanted)
        current.append(Series(f"{name}current" if single else moving, time, data.current, role))
        if single and data.commanded_current is not None:
            current.append(Series("commanded current", time, data.commanded_current, "input", (3, 3)))
    shift = first.onset if remove_delay else 0.0
    spans = [
        (a - shift, b - shift) for kind, a, b in first.merits[stage].phases if kind in ("contact", "release")
    ]
    settings = first.stages[stage].settings
    # The wall is drawn where it was met: a guide far away would only squeeze the lines.
    walls = [contact.arm_position for contact in first.merits[stage].contacts]
    limit = settings.current_limit
    reached = max(float(np.nanmax(np.abs(run.stages[stage].current))) for run, _, _ in shown)
    limits = (-limit, limit) if reached > 0.8 * limit else ()
    return Plot(
        [
            Panel("Command: desired torque Td", "N·m", command, spans=spans),
            Panel("Position", "rad", position, guides=walls, spans=spans),
            Panel("Velocity", "rad/s", velocity, spans=spans),
            Panel(f"Torque on the environment Te{', estimated' * of_omni}", "N·m", torque, spans=spans),
            Panel(
                "Torque of the motor" if of_omni else "Current",
                first.merits[stage].unit,
                current,
                guides=limits,
                spans=spans,
            ),
        ],
        x_label="time since the command's onset (s)" if remove_delay else "time since the first sample (s)",
    )


def latency_picture(runs: Sequence[Run], labels: Sequence[str]) -> Figure | None:
    """Return a histogram of the loop latency of each run, or None when no run tells it."""
    samples = [
        (label, 1e3 * run.latency) for run, label in zip(runs, labels, strict=True) if len(run.latency)
    ]
    if not samples:
        return None
    limit = max(float(np.percentile(values, 99.9)) for _, values in samples) * 1.2
    return histogram(
        samples,
        "from a state's stamp to its command's arrival (ms; what is later stands at the right edge)",
        limit,
    )
