"""What readings scatter by is no misfit of a model."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.estimation.records import Record
from haptic_teleop_sysid.estimation.residuals import residual_analysis, tuned_to
from haptic_teleop_sysid.estimation.whole_fit import fit_from_scratch
from haptic_teleop_sysid.recordings.scatter import beyond_scatter, scatter

DT = 0.001
TIME = DT * np.arange(10_000)
MOTION = sum(np.sin(2 * np.pi * f * TIME + f) / f for f in (0.3, 1.1, 2.3, 5.3))


def read(noise, seed=1):
    """Velocity by differences of angle readings with white noise, rad."""
    angle = MOTION + noise * np.random.default_rng(seed).standard_normal(len(TIME))
    return np.gradient(angle, DT)


def fit(measured, simulated):
    return 100.0 * (1.0 - np.linalg.norm(measured - simulated) / np.linalg.norm(measured - measured.mean()))


def told(measured, percent, position=99.0):
    signals = {"j.velocity": measured, "j.position": MOTION}
    dataset = SimpleNamespace(dt=DT, signals=lambda: signals)
    return beyond_scatter({"j.velocity": percent, "j.position": position}, dataset)


@pytest.mark.parametrize("noise", [1e-3, 4e-3, 1e-2])
def test_a_right_model_is_judged_right_however_much_the_readings_scatter(noise):
    measured = read(noise)
    percent = fit(measured, read(0.0))
    assert percent < 97.0
    found = told(measured, percent)
    assert found["j.velocity"] > 90.0
    assert found["j.position"] == 99.0


@pytest.mark.parametrize("noise", [0.0, 3e-3])
def test_a_wrong_model_is_not(noise):
    measured = read(noise)
    wrong = 0.6 * read(0.0)
    assert told(measured, fit(measured, wrong))["j.velocity"] == pytest.approx(60.0, abs=4.0)


def test_a_smooth_motion_scatters_by_nothing_and_noise_by_all():
    assert scatter(read(0.0), DT) < 0.02
    assert scatter(np.random.default_rng(2).standard_normal(5000), DT) == pytest.approx(1.0, abs=0.05)
    # At 50 Hz five readings take a tenth of a second, in which a joint may turn round.
    assert scatter(np.random.default_rng(2).standard_normal(5000), 0.02) == 0.0
    holed = read(0.0)
    holed[100:140] = np.nan
    assert scatter(holed, DT) < 0.05
    assert scatter(np.full(5000, np.nan), DT) == 0.0


def test_one_step_errors_on_other_recordings_are_those_of_their_own_noise_levels():
    """A free joint whose observer hardly corrects: the speed that it began with shows for a second."""
    inertia, damping, time = 0.05, 0.6, DT * np.arange(9_000)
    decay = np.exp(-damping / inertia * DT)

    def made(seed):
        chance = np.random.default_rng(seed)
        tones = zip((0.3, 0.9, 1.7, 3.1, 5.3), chance.uniform(0, 6.28, 5), strict=True)
        torque = 0.05 * sum(np.sin(2 * np.pi * f * time + p) for f, p in tones)
        speed, angle = np.zeros(len(time)), np.zeros(len(time))
        for k in range(len(time) - 1):
            drift = torque[k] / damping
            speed[k + 1] = drift + (speed[k] - drift) * decay
            angle[k + 1] = angle[k] + drift * DT + (speed[k] - drift) * inertia / damping * (1.0 - decay)
        read = angle + 2e-4 * chance.standard_normal(len(time))
        measured = np.column_stack([read, np.full(len(time), np.nan)])
        running = slice(1000, None)
        return Record("r", DT, torque[running], measured[running], np.zeros(8_000), (1.4e-4, 1.0))

    here, there = made(1), made(2)
    parameters = {"torque_constant": 1.0, "motor_inertia": inertia, "motor_damping": damping}
    model = Model("generic", "j", "rigid_body", parameters, fixed=("torque_constant",))
    fit = fit_from_scratch(model, [here])
    slow = replace(fit, noise=replace(fit.noise, motor_torque=0.1 * fit.noise.motor_torque))
    before, after = (residual_analysis(one, there)[0] for one in (slow, tuned_to(slow, there)))
    assert before.outside[0] > 0.5
    assert after.outside[0] < 0.1
    assert residual_analysis(fit, here)[0].outside[0] < 0.1
