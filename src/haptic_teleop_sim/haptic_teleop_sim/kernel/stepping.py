"""The compiled loops around the plants: one sample of several joints, the hardware before and behind them,
and whole experiments of which every sample is computed by these very functions.

Like `integrator.py` this text is not imported by itself: `build.py` joins it to the kernel of the present
effects and to the compiled functions of the control package.

A *bank* is m joints that share a clock, as the tuple made by `PlantBank`: dt; clock (1,): samples so far;
layout (m, 11): rigid, sub-steps, first and last of its states, effects, input effects, output effects, what
its effects follow of the other arm (0 acceleration, 1 angle, 2 velocity); x: states of all joints; base
(m, 5); gain (m,): true torque constants; codes, p, in_codes, out_codes as in `integrator.py`; memory of input
effects; delay (m, 2): age of the encoders' readings in samples;
past (m, depth, 2): angles of the last samples; work: scratch.

A *device* is the hardware, as the tuple made by `Robot`:
hw (m, 11): nominal torque constant, limit and resolution of the command, resolutions of both encoders,
offset, noise and resolution of the measured current, nominal stiffness, memory and gain of the random torque;
state and coefficients of the velocity filter; flow (m,): what the amplifiers give; disturbance (m,);
acceleration (m,) of the arms; scratch (3, m); encoders per joint, 1 or 2.
"""

# ruff: noqa: F821
# fmt: off
# pyright: reportUndefinedVariable=false
from __future__ import annotations

import math

import numpy as np

from haptic_teleop_control.compiled import njit
from haptic_teleop_control.filters import velocity_step
from haptic_teleop_control.laws.augmented_error import augmented_error_step
from haptic_teleop_control.laws.master_side import master_side_step
from haptic_teleop_control.omni_compensation import compensation_step

# <functions of the kernel are imported here>

REFUSED_COMMAND = 1
LIMITED = 2
DIVERGED = 4


@inner
def bank_step(inputs, external, exogenous, bank):
    """One sample of all joints: `inputs` (m,) times the torque constants, `external` (m,) N·m at the arms."""
    dt, clock, layout, x, base, gain, codes, p, in_codes, out_codes, memory, delay, past, work = bank
    t = clock[0] * dt
    for i in range(layout.shape[0]):
        torque, moment = actuated(inputs[i] * gain[i], 0.0, t, dt, in_codes[layout[i, 6] : layout[i, 7]], p,
                                  memory)
        outer = external[i]
        rigid = layout[i, 0] == 1
        if rigid:
            torque += outer
        n = layout[i, 3] - layout[i, 2]
        advance(x[layout[i, 2] : layout[i, 3]], t, dt, layout[i, 1], torque, outer, exogenous[i], rigid,
                base[i], codes[layout[i, 4] : layout[i, 5]], p, work[:n], work[n : 2 * n], work[2 * n : 3 *
                n])
        spread(x[layout[i, 2] : layout[i, 3]], moment, base[i])
    clock[0] += 1


@inner
def bank_read(bank, angles):
    """What the encoders show now, before quantisation, into `angles` (m, 2): motor, arm."""
    dt, clock, layout, x, base, gain, codes, p, in_codes, out_codes, memory, delay, past, work = bank
    depth = past.shape[1]
    now = clock[0]
    for i in range(layout.shape[0]):
        for channel in range(2):
            angle = x[layout[i, 2] + channel]
            past[i, now % depth, channel] = angle
            if delay[i, channel] > 0.0:
                whole = int(delay[i, channel])
                fraction = delay[i, channel] - whole
                # Before the first sample the axis stood still.
                newer = past[i, max(now - whole, 0) % depth, channel]
                older = past[i, max(now - whole - 1, 0) % depth, channel]
                angle = (1.0 - fraction) * newer + fraction * older
            angles[i, channel] = encoder_reading(angle, channel, out_codes[layout[i, 8] : layout[i, 9]], p)


@inner
def quantised(value, resolution):
    """`value` rounded to a multiple of `resolution`; 0 leaves it as it is."""
    return round(value / resolution) * resolution if resolution > 0.0 else value


@njit
def robot_sense(bank, device, noise, angles, out):
    """Position, velocity and effort of every encoder into `out` (3, m * encoders); `noise` (2 m,) standard
    normal, of which the even ones are the current senses'.
    """
    hw, filter_state, coefficients, flow, disturbance, acceleration, scratch, encoders = device
    bank_read(bank, angles)
    for i in range(hw.shape[0]):
        j = encoders * i
        motor = quantised(angles[i, 0], hw[i, 3])
        out[0, j] = motor
        out[2, j] = quantised(flow[i] + hw[i, 5] + hw[i, 6] * noise[2 * i], hw[i, 7]) * hw[i, 0]
        if encoders == 2:
            arm = quantised(angles[i, 1], hw[i, 4])
            out[0, j + 1] = arm
            out[2, j + 1] = hw[i, 8] * (motor - arm)
    velocity = velocity_step(out[0], filter_state, coefficients)
    for j in range(velocity.shape[0]):
        out[1, j] = velocity[j]


@inner
def robot_step(effort, external, bank, device, noise):
    """One sample with the commands `effort` (m,), N·m; what was done to them as the sum of the codes above.
    """
    hw, filter_state, coefficients, flow, disturbance, acceleration, scratch, encoders = device
    dt, clock, layout, x, base, gain, codes, p, in_codes, out_codes, memory, delay, past, work = bank
    flags = 0
    m = hw.shape[0]
    before, exogenous, outer = scratch[0], scratch[1], scratch[2]
    for i in range(m):
        wanted = effort[i] / hw[i, 0]
        if not math.isfinite(wanted):
            wanted = 0.0
            flags |= REFUSED_COMMAND
        limit = hw[i, 1]
        if wanted > limit or wanted < -limit:
            flags |= LIMITED
        flow[i] = min(max(quantised(min(max(wanted, -limit), limit), hw[i, 2]), -limit), limit)
        if hw[i, 10] > 0.0:
            disturbance[i] = hw[i, 9] * disturbance[i] + hw[i, 10] * noise[2 * i + 1]
            x[layout[i, 3] - 2] = disturbance[i]
        outer[i] = external[i] if math.isfinite(external[i]) else 0.0
        before[i] = x[layout[i, 2] + 3]
        # Of two arms each feels the other's acceleration, one sample late.
        exogenous[i] = 0.0
        if m == 2:
            followed = layout[i, 10]
            exogenous[i] = acceleration[1 - i] if followed == 0 else x[layout[1 - i, 2] + 2 * followed - 1]
    bank_step(flow, outer, exogenous, bank)
    for i in range(m):
        first, last = layout[i, 2], layout[i, 3]
        for j in range(first, last):
            if not math.isfinite(x[j]):
                flags |= DIVERGED
                for i_state in range(first, last):
                    x[i_state] = 0.0
                break
        acceleration[i] = (x[first + 3] - before[i]) / dt
    return flags


@njit
def open_loop(effort, external, bank, device, noise, out, counts):
    """A whole experiment: at each sample sense, then step with that sample's `effort` (n, m) and `external`
    (n, m). Fills `out` (n, 3, signals) and `counts` (3,): samples with each of the codes.
    """
    angles = np.zeros((effort.shape[1], 2))
    for k in range(effort.shape[0]):
        robot_sense(bank, device, noise[k], angles, out[k])
        count_flags(robot_step(effort[k], external[k], bank, device, noise[k]), counts)


@inner
def count_flags(flags, counts):
    """Counts each code of a step in `counts` (3,)."""
    for bit in range(3):
        if flags & (1 << bit):
            counts[bit] += 1


@njit
def scenario_loop(kinds, stamps, reference, latest, device_commands, slave, slave_device, slave_noise, push,
                  master, master_device, master_noise, hand, compensation, wanted, wanted_state, felt,
                  felt_state, gains, law_state, law_dt, ramp_time, master_limit, slave_out, slave_command,
                  master_out, master_command, counts):
    """Scenario 1: every sample of master and slave in order of time, with the controller between them.

    kinds (events,): 0 master, 1 slave; stamps (events,) ns; reference (samples, 2): commanded positions of
    the slave's stages, used unless `device_commands`, and latest (events,): its newest row at each event;
    push (slave samples, 2), hand (master samples, 3): torques of the operators; compensation: whether there
    is one, its settings, its state, the time between the master's samples.
    The answer to a state acts until the next state of that robot, as in the graph.
    counts (7,): the codes of the slave's steps, of the master's steps, and saturated samples of the law.
    """
    compensating, compensation_settings, compensation_state, compensation_dt = compensation
    slave_angles, master_angles = np.zeros((2, 2)), np.zeros((3, 2))
    slave_effort, master_effort, added = np.zeros(2), np.zeros(3), np.zeros(3)
    enabled = np.ones(2, dtype=np.bool_)
    results = np.zeros(2, dtype=np.int64)
    inner = np.zeros((2, 2))
    inputs, law_inputs = np.zeros((2, 2)), np.zeros((4, 2))
    arm_torque, axis = np.zeros(2), np.zeros(2)
    engaged = np.int64(-1)
    k = j = 0
    for event in range(kinds.shape[0]):
        elapsed = (stamps[event] - engaged) * 1e-9
        scale = 1.0 if elapsed >= ramp_time else elapsed / ramp_time
        if kinds[event] == 0:
            state = master_out[j]
            robot_sense(master, master_device, master_noise[j], master_angles, state)
            axis[0], axis[1] = state[0, 1], state[0, 2]
            master_effort[:] = 0.0
            if engaged >= 0:
                for i in range(2):
                    inputs[0, i] = axis[i]
                    inputs[1, i] = arm_torque[i]
                torque = master_side_step(inputs, felt, enabled, felt_state, results)
                for i in range(2):
                    torque_i = min(max(torque[1, i], -master_limit), master_limit) * scale
                    master_effort[i + 1] = torque_i + 0.0  # never -0.0: the graph adds its damping here
            for i in range(3):
                master_command[j, i] = master_effort[i]
            if compensating:
                compensation_step(
                    state[:2], compensation_settings, compensation_dt, compensation_state, added
                )
                for i in range(3):
                    master_effort[i] += added[i]
            count_flags(
                robot_step(master_effort, hand[j], master, master_device, master_noise[j]), counts[3:6]
            )
            j += 1
        else:
            state = slave_out[k]
            robot_sense(slave, slave_device, slave_noise[k], slave_angles, state)
            if engaged < 0:
                engaged = stamps[event]
                scale = 0.0 if ramp_time > 0.0 else 1.0
            for i in range(2):
                arm_torque[i] = state[2, 2 * i + 1]
                inputs[0, i] = axis[i] if device_commands else reference[latest[event], i]
                inputs[1, i] = arm_torque[i]
                law_inputs[1, i] = state[0, 2 * i]
                law_inputs[2, i] = state[0, 2 * i + 1]
                law_inputs[3, i] = state[1, 2 * i]
            torque = master_side_step(inputs, wanted, enabled, wanted_state, results)
            for i in range(2):
                law_inputs[0, i] = torque[0, i]
            current = augmented_error_step(law_inputs, gains, law_dt, enabled, law_state, results, inner)
            if results[0] == 1 or results[1] == 1:
                counts[6] += 1
            for i in range(2):
                slave_effort[i] = current[i] * gains[i, 6] * scale
                slave_command[k, i] = slave_effort[i]
            count_flags(robot_step(slave_effort, push[k], slave, slave_device, slave_noise[k]), counts[:3])
            k += 1
