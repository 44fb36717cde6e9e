"""What people would otherwise do, on a robot whose equations are known."""

import numpy as np
from blind_rigs import BA, BM, JA, JM, KT, K

from haptic_teleop_sysid.blind import command
from haptic_teleop_sysid.blind.baselines import sparse_regression
from haptic_teleop_sysid.blind.motion import Motion


def test_pysindy_keeps_the_friction_that_moves_a_robot_and_nothing_beside_a_linear_one() -> None:
    rng = np.random.default_rng(3)
    t = 0.02 * np.arange(1500)
    motor = np.column_stack([np.sin(2 * np.pi * f * t + p) for f, p in ((0.3, 0.1), (0.7, 1.0), (1.9, 2.0))])
    motor = motor.sum(axis=1)
    speed, acceleration = np.gradient(motor, t), np.gradient(np.gradient(motor, t), t)
    # A stiff arm that lags a little; what the equations leave over is noise of a hundredth of the friction.
    arm = motor - 0.02 * acceleration / K
    arm_speed, arm_acceleration = np.gradient(arm, t), np.gradient(np.gradient(arm, t), t)
    spring = K * (motor - arm)
    ground = JA * arm_acceleration + BA * arm_speed - spring

    def said(friction: float) -> list[str]:
        dry = friction * np.tanh(speed / (0.02 * np.std(speed)))
        noise = 0.002 * rng.standard_normal(len(t))
        known = arm - (ground + 0.002 * rng.standard_normal(len(t))) / K
        current = (JM * acceleration + BM * speed + K * (motor - known) + dry + noise) / KT
        motion = Motion(
            motor, known, speed, arm_speed, acceleration, arm_acceleration, current, t, 0.02,
            np.column_stack([motor, arm]),
        )  # fmt: skip
        return sparse_regression(motion, K, 0.1)

    assert said(0.2) == ["coulomb_friction motor"]
    assert said(0.0) == []
    # All angles negative: a stop at the upper end is then no column at all.
    motor, arm = motor - 10.0, arm - 10.0
    assert said(0.2)[0] == "coulomb_friction motor"


def test_a_missing_library_is_told_before_anything_runs(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    arguments = ["--seed", "1", "--baselines", "3", "--output", str(tmp_path / "out")]
    assert command.main(arguments) == 2
    assert "pip install pysindy" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
