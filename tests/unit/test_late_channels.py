"""A channel that is late by a third of a period of the motion: fits from small delays end on another hill."""

from dataclasses import replace

import numpy as np
import pytest
from disturbed_stage import dataset
from identification_plants import STAGE

from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.late_channels import _nats, late_channels
from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.motion import banded
from haptic_teleop_sysid.diagnosis.run import diagnose
from haptic_teleop_sysid.diagnosis.usable import records_of

LATE = 0.046
DELAYS = (0.0, 0.01, -0.01, 0.04, -0.04)


def late(data, channel):
    samples = round(LATE / data.dt)

    def shifted(values):
        return np.concatenate([np.full(samples, values[0]), values[:-samples]])

    names = {"motor": ("motor_position", "motor_velocity"), "arm": ("arm_position", "arm_velocity")}
    names |= {"input": ("input", "commanded_input")}
    return replace(data, **{name: shifted(getattr(data, name)) for name in names[channel]})


@pytest.mark.parametrize(
    ("channel", "location"),
    [("motor", "stage1_motor_encoder"), ("arm", "stage1_arm_encoder"), ("input", "stage1_actuator")],
)
def test_a_start_is_offered_where_the_equations_hold(channel, location):
    found = late_channels(STAGE, records_of([late(dataset(1), channel)]))
    (delay,) = found["channel_skew", location]
    assert delay == pytest.approx(LATE, rel=0.2)


def test_nothing_is_late_where_nothing_was_moved():
    assert late_channels(STAGE, records_of([dataset(1)])) == {}


def test_short_stretches_between_holes_say_nothing():
    """Of a stretch that is hardly longer than the shifts a row or two is left, which any delay explains."""
    records = records_of([late(dataset(1), "motor")])
    (one,) = records
    few = [
        replace(
            one,
            input=one.input[first : first + 260],
            measured=one.measured[first : first + 260],
            exogenous=one.exogenous[first : first + 260],
        )
        for first in range(500, 3000, 500)
    ]
    cutoff = 5.0 / (260 * one.dt)
    nats = [_nats(STAGE, banded(piece, False, cutoff), "motor_encoder", d) for piece in few for d in DELAYS]
    assert set(nats) == {0.0}
    assert late_channels(STAGE, [*records, *few]).keys() == late_channels(STAGE, records).keys()


def test_a_late_encoder_of_a_flexible_joint_is_named_with_its_delay():
    sets = [late(dataset(seed), "motor") for seed in (1, 2)]
    _, verdict, _, _ = diagnose(STAGE, sets[:1], sets[1:])
    assert verdict.kind == "ambiguous"
    (finding,) = verdict.findings
    names = {finding["effect"], *(one["effect"] for one in finding["alternatives"])}
    assert (finding["location"], names) == ("stage1_motor_encoder", {"sensor_delay", "channel_skew"})
    assert finding["parameters"]["delay"]["value"] == pytest.approx(LATE, abs=0.001)
