"""One stage of the robot, integrated at 20 µs: drift half, kick, drift half; bristle friction, true delays.

    Jm dωm/dt = Kt i - bm ωm - T + (motor effects)
    Ja dωa/dt = T - ba ωa + (arm effects),         T = K (θm - θa) and whatever the joint adds

Viscous terms are taken by the implicit midpoint, bristles relax by their exact exponential over a step, so no
part is stiff at this step. The controllers run at the sampling rate on what the encoders say.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_control.compiled import njit
from haptic_teleop_sysid.blind.slots import INDEX, SIDE, SIDE_SIZE

Array = NDArray[np.float64]
OPEN_LOOP, POSITION_LOOP, FORCE_LOOP = 0, 1, 2
OUTPUTS = (
    "motor",  # true angle at the sample
    "arm",
    "motor_speed",
    "arm_speed",
    "motor_read",  # what the encoder says
    "arm_read",
    "motor_shown",  # the same before quantisation
    "arm_shown",
    "command",  # A, acts from this sample to the next
    "sensed",  # A, mean of what the current sense saw from this sample to the next, without its noise
    "motor_force",  # N·m, mean until the next sample of all that the six parameters do not hold
    "arm_force",
    "true_current",
)
_S = {name: SIDE[name] for name in SIDE}
FRIC_POS, FRIC_NEG, BREAK_RATIO, BREAK_VELOCITY, BREAK_SHAPE, BRISTLE = (
    _S[n] for n in ("fric_pos", "fric_neg", "break_ratio", "break_velocity", "break_shape", "bristle")
)
FRIC_AMP, FRIC_ORDER, FRIC_PHASE, DWELL_GAIN, DWELL_TIME = (
    _S[n] for n in ("fric_amp", "fric_order", "fric_phase", "dwell_gain", "dwell_time")
)
DRAG, CUBIC_DRAG, GRAV, GRAV_PHASE, GROUND, GROUND_REST, CONSTANT = (
    _S[n] for n in ("drag", "cubic_drag", "grav", "grav_phase", "ground", "ground_rest", "constant")
)
VISC_CHANGE, VISC_TIME, VISC_ANGLE, VISC_ORDER = (
    _S[n] for n in ("visc_change", "visc_time", "visc_angle", "visc_order")
)
STOP_ANGLE, STOP_STIFFNESS, STOP_DAMPING = (_S[n] for n in ("stop_angle", "stop_stiffness", "stop_damping"))
SCALE, ECC_AMP, ECC_ORDER, ECC_PHASE, SENSOR_DELAY = (
    _S[n] for n in ("scale", "ecc_amp", "ecc_order", "ecc_phase", "sensor_delay")
)
DETENT, DETENT_AT, DETENT_WIDTH, CROSS_FRIC = (
    _S[n] for n in ("detent", "detent_at", "detent_width", "cross_fric")
)
ARM = SIDE_SIZE
LOAD, LOAD_BRISTLE, RIPPLE, RIPPLE_ORDER, RIPPLE_PHASE = (
    INDEX[n] for n in ("load_coefficient", "load_bristle", "ripple", "ripple_order", "ripple_phase")
)
GAP, GAP_DAMPING, CUBIC, HYST, HYST_YIELD, HYST_SHAPE, JOINT_DAMPING, CREEP, CREEP_TIME = (
    INDEX[n]
    for n in (
        "gap",
        "gap_damping",
        "cubic",
        "hyst_torque",
        "hyst_yield",
        "hyst_shape",
        "joint_damping",
        "creep_stiffness",
        "creep_time",
    )
)
DELAY, LAG, LIMIT, DEAD, GAIN_ERROR, GAIN_CHANGE, GAIN_TIME, CURRENT_STEP, SENSE_SEES = (
    INDEX[n]
    for n in (
        "delay",
        "lag",
        "limit",
        "dead",
        "gain_error",
        "gain_change",
        "gain_time",
        "current_step",
        "sense_sees",
    )
)
SPEED_LIMIT, SPEED_SLOPE, INERTIA_AMP, INERTIA_ORDER, INERTIA_PHASE = (
    INDEX[n] for n in ("speed_limit", "speed_slope", "inertia_amp", "inertia_order", "inertia_phase")
)
COUPLING, MODE_K, MODE_J, MODE_D, PAYLOAD, PAYLOAD_TIME = (
    INDEX[n]
    for n in ("coupling", "mode_stiffness", "mode_inertia", "mode_damping", "payload", "payload_time")
)


@njit(cache=True, inline="always")
def _side_force(e, o, q, v, t, viscous, other_speed):
    """Torque of the smooth effects of one side; `o` is where its slots begin."""
    force = e[o + CONSTANT] - e[o + DRAG] * v * abs(v) - e[o + CUBIC_DRAG] * v * v * v
    if e[o + GRAV] != 0.0:
        force -= e[o + GRAV] * math.sin(q + e[o + GRAV_PHASE])
    force -= e[o + GROUND] * (q - e[o + GROUND_REST])
    if e[o + VISC_CHANGE] != 0.0:
        force -= viscous * v * e[o + VISC_CHANGE] * (1.0 - math.exp(-t / e[o + VISC_TIME]))
    if e[o + VISC_ANGLE] != 0.0:
        force -= viscous * v * e[o + VISC_ANGLE] * math.sin(e[o + VISC_ORDER] * q)
    if e[o + STOP_ANGLE] != 0.0:
        side = 1.0 if e[o + STOP_ANGLE] > 0.0 else -1.0
        depth = side * (q - e[o + STOP_ANGLE])
        if depth > 0.0:
            push = e[o + STOP_STIFFNESS] * depth + e[o + STOP_DAMPING] * side * v
            if push > 0.0:  # a stop pushes, it never pulls
                force -= side * push
    if e[o + DETENT] != 0.0:
        x = (q - e[o + DETENT_AT]) / e[o + DETENT_WIDTH]
        if abs(x) < 4.0:
            force -= e[o + DETENT] * x * math.exp(0.5 - 0.5 * x * x)
    if e[o + CROSS_FRIC] != 0.0:
        force -= e[o + CROSS_FRIC] * abs(other_speed) * math.tanh(v / 0.01)
    return force


@njit(cache=True, inline="always")
def _level(e, o, q, v, dwell):
    """Level of dry friction of one side where it slides, N·m."""
    level = e[o + FRIC_POS] if v >= 0.0 else e[o + FRIC_NEG]
    if e[o + BREAK_RATIO] != 0.0:
        ratio = abs(v) / e[o + BREAK_VELOCITY]
        level *= 1.0 + e[o + BREAK_RATIO] * math.exp(-(ratio ** e[o + BREAK_SHAPE]))
    if e[o + FRIC_AMP] != 0.0:
        level *= 1.0 + e[o + FRIC_AMP] * math.sin(e[o + FRIC_ORDER] * q + e[o + FRIC_PHASE])
    if e[o + DWELL_GAIN] != 0.0:
        level *= 1.0 + e[o + DWELL_GAIN] * (1.0 - math.exp(-dwell / e[o + DWELL_TIME]))
    return level


@njit(cache=True, inline="always")
def _slide(z, v, dt, bristle):
    """Bristle state in (-1, 1) after `dt` at speed `v`: dz/dt = (v - |v| z) / bristle, solved exactly."""
    if v == 0.0:
        return z
    goal = 1.0 if v > 0.0 else -1.0
    return goal + (z - goal) * math.exp(-abs(v) * dt / bristle)


@njit(cache=True, inline="always")
def _before(past, place, steps):
    """The angle `steps` (any number) integration steps ago; `place` is where the newest lies."""
    whole = int(steps)
    rest = steps - whole
    n = len(past)
    return (1.0 - rest) * past[(place - whole) % n] + rest * past[(place - whole - 1) % n]


@njit(cache=True, inline="always")
def _shown(e, o, q):
    """What an ideal reader of this encoder would show at the angle `q`."""
    shown = q * (1.0 + e[o + SCALE])
    if e[o + ECC_AMP] != 0.0:
        shown += e[o + ECC_AMP] * math.sin(e[o + ECC_ORDER] * q + e[o + ECC_PHASE])
    return shown


@njit(cache=True)
def integrate(
    p, e, mode, gains, reference, push, gate, other_speed, other_acceleration, steps, quantise, path, follow
):
    """Return (len(reference), len(OUTPUTS)): the stage driven by `reference` through the controller `mode`.

    p: Kt, K, Jm, bm, Ja, ba, sampling period, motor and arm resolution, current limit. e: the slots.
    gains: (8,) of the controller, see `robot`. push: (n + 1, 2) random torque on motor and arm at the
    samples, linear between them. gate: (n,) torque multiplier and offset (n, 2) of effects that come and go.
    other_speed, other_acceleration: (n,) of the other stage's arm. steps: integration steps per sample.
    path: (n steps + 1, 6), filled with where the stage was (first row: start angles), or empty; with `follow`
    the stage is led along it instead, and the forces are what these slots do on that way.
    """
    kt, stiffness, jm, bm, ja, ba, period, step_m, step_a, current_limit = p
    n = len(reference)
    out = np.zeros((n, 13))
    dt = period / steps
    history = max(4, int(max(e[SENSOR_DELAY], e[ARM + SENSOR_DELAY]) / dt) + 3)
    past_m, past_a = np.zeros(history), np.zeros(history)
    qm, vm, qa, va = 0.0, 0.0, 0.0, 0.0
    # The start pose: arm at rest under what pulls at it, so the joint is already deflected. Encoders are
    # zeroed there.
    qa = 0.0
    pull = e[ARM + CONSTANT] - e[ARM + GRAV] * math.sin(e[ARM + GRAV_PHASE])
    pull += e[ARM + GROUND] * e[ARM + GROUND_REST]
    qm = -pull / stiffness
    # In the zeroed angles, the deflection of the start pose is a constant pair of torques.
    preload = stiffness * (qm - qa)
    if follow:
        qm, qa = path[0, 0], path[0, 1]
    elif len(path):
        path[0, 0], path[0, 1] = qm, qa
    q2, v2 = qa, 0.0
    start_m, start_a = qm, qa
    zero_m, zero_a = _shown(e, 0, qm), _shown(e, ARM, qa)
    past_m[:], past_a[:] = qm, qa
    zm, za, zl, zh, creep = 0.0, 0.0, 0.0, 0.0, 0.0
    dwell_m, dwell_a = 0.0, 0.0
    current, place = 0.0, 0
    integral, speed_filtered, last_read = 0.0, 0.0, 0.0
    for k in range(n):
        now_m = _before(past_m, place, e[SENSOR_DELAY] / dt)
        now_a = _before(past_a, place, e[ARM + SENSOR_DELAY] / dt)
        shown_m, shown_a = _shown(e, 0, now_m) - zero_m, _shown(e, ARM, now_a) - zero_a
        read_m, read_a = shown_m, shown_a
        if quantise:
            read_m, read_a = (
                step_m * math.floor(shown_m / step_m + 0.5),
                step_a * math.floor(shown_a / step_a + 0.5),
            )
        # The controller: its own plain filter, its own loops.
        speed_filtered += gains[5] * ((read_m - last_read) / period - speed_filtered)
        last_read = read_m
        if mode == 0:
            command = reference[k]
        elif mode == 1:
            command = gains[0] * (reference[k] - read_m) - gains[1] * speed_filtered
        else:
            wanted = reference[k] - gains[4] * read_m
            error = wanted - gains[6] * (read_m - read_a) - gains[3] * speed_filtered
            integral += error * period
            command = gains[0] * (error + gains[2] * integral) - gains[1] * speed_filtered
            if abs(command) > current_limit:
                integral -= error * period
        command = min(max(command, -current_limit), current_limit)
        out[k, 0], out[k, 1], out[k, 2], out[k, 3] = qm - start_m, qa - start_a, vm, va
        out[k, 4], out[k, 5], out[k, 6], out[k, 7] = read_m, read_a, shown_m, shown_a
        out[k, 8] = command
        sensed_sum, force_m, force_a, current_sum = 0.0, 0.0, 0.0, 0.0
        for s in range(steps):
            t = (k + (s + 0.5) / steps) * period
            share = (s + 0.5) / steps
            # --- from the command to the torque
            amp = command
            if e[DELAY] != 0.0:
                # The step may see the change of the held command: it gets its share of both.
                begin = math.floor((t - 0.5 * dt - e[DELAY]) / period + 1e-9)
                end = (t + 0.5 * dt - e[DELAY]) / period
                part = 1.0
                if math.floor(end) > begin:
                    part = 1.0 - min((end - math.floor(end)) * period / dt, 1.0)
                old = out[int(begin), 8] if begin >= 0.0 else 0.0
                new = out[int(begin) + 1, 8] if part < 1.0 and begin >= -1.0 else 0.0
                amp = part * old + (1.0 - part) * new
            if e[CURRENT_STEP] != 0.0:
                wobble = e[CURRENT_STEP] * (0.5 * math.sin(377.0 * t) + 0.3 * math.sin(1013.0 * t))
                amp = e[CURRENT_STEP] * math.floor((amp + wobble) / e[CURRENT_STEP] + 0.5)
            if e[LAG] != 0.0:
                current += (amp - current) * (1.0 - math.exp(-dt / e[LAG]))
                amp = current
            if e[LIMIT] != 0.0:
                amp = min(max(amp, -e[LIMIT]), e[LIMIT])
            if e[DEAD] != 0.0:
                amp = math.copysign(max(abs(amp) - e[DEAD], 0.0), amp)
            if e[SPEED_LIMIT] != 0.0:
                # Braking has the whole limit, driving what the speed leaves of it.
                left = e[SPEED_LIMIT]
                if amp * vm > 0.0:
                    left = max(left - e[SPEED_SLOPE] * abs(vm), 0.0)
                amp = min(max(amp, -left), left)
            sensed = amp if e[SENSE_SEES] != 0.0 else command
            drive = amp * (1.0 + e[GAIN_ERROR])
            if e[GAIN_CHANGE] != 0.0:
                drive *= 1.0 + e[GAIN_CHANGE] * (1.0 - math.exp(-t / e[GAIN_TIME]))
            drive *= gate[k, 0]
            sensed_sum += sensed
            current_sum += drive
            # --- half a drift
            qm += 0.5 * dt * vm
            qa += 0.5 * dt * va
            q2 += 0.5 * dt * v2
            step = 1 + k * steps + s
            if follow:
                qm, vm, qa, va = path[step, 0], path[step, 1], path[step, 2], path[step, 3]
            elif len(path):
                path[step, 0], path[step, 1], path[step, 2], path[step, 3] = qm, vm, qa, va
            stretch, rate = qm - qa, vm - va
            # --- the joint
            joint = 0.0
            if e[GAP] != 0.0:
                half = 0.5 * e[GAP]
                if stretch > half:
                    contact = stiffness * (stretch - half) + e[GAP_DAMPING] * rate
                    joint += max(contact, 0.0) - stiffness * stretch
                elif stretch < -half:
                    contact = stiffness * (stretch + half) + e[GAP_DAMPING] * rate
                    joint += min(contact, 0.0) - stiffness * stretch
                else:
                    joint -= stiffness * stretch
            joint += e[CUBIC] * stretch * stretch * stretch + e[JOINT_DAMPING] * rate
            if e[HYST] != 0.0:
                wear = abs(zh) ** e[HYST_SHAPE] * (0.5 + 0.5 * np.sign(rate * zh))
                zh += dt * rate / e[HYST_YIELD] * (1.0 - wear)
                joint += e[HYST] * zh
            if e[CREEP] != 0.0:
                creep += (stretch - creep) * (1.0 - math.exp(-dt / e[CREEP_TIME]))
                joint += e[CREEP] * (stretch - creep)
            # --- motor
            em = _side_force(e, 0, qm, vm, t, bm, other_speed[k]) - joint + gate[k, 1]
            if e[RIPPLE] != 0.0:
                em += e[RIPPLE] * math.sin(e[RIPPLE_ORDER] * qm + e[RIPPLE_PHASE])
            if e[BRISTLE] != 0.0:
                dwell_m = dwell_m + dt if abs(vm) < 0.01 else dwell_m * math.exp(-dt / 0.02)
                zm = _slide(zm, vm, dt, e[BRISTLE])
                em -= _level(e, 0, qm, vm, dwell_m) * zm
            if e[LOAD] != 0.0:
                zl = _slide(zl, vm, dt, e[LOAD_BRISTLE])
                em -= e[LOAD] * abs(stiffness * stretch + joint) * zl
            # --- arm
            ea = _side_force(e, ARM, qa, va, t, ba, other_speed[k]) + joint + gate[k, 2]
            ea -= e[COUPLING] * other_acceleration[k]
            if e[ARM + BRISTLE] != 0.0:
                dwell_a = dwell_a + dt if abs(va) < 0.01 else dwell_a * math.exp(-dt / 0.02)
                za = _slide(za, va, dt, e[ARM + BRISTLE])
                ea -= _level(e, ARM, qa, va, dwell_a) * za
            if e[MODE_J] != 0.0:
                between = e[MODE_K] * (q2 - qa) + e[MODE_D] * (v2 - va)
                ea += between
                v2 -= dt * between / e[MODE_J]
            load = ja
            if e[INERTIA_AMP] != 0.0:
                turn = e[INERTIA_ORDER] * qa + e[INERTIA_PHASE]
                load += ja * e[INERTIA_AMP] * math.cos(turn)
                ea += 0.5 * ja * e[INERTIA_AMP] * e[INERTIA_ORDER] * math.sin(turn) * va * va
            noise_m = push[k, 0] + share * (push[k + 1, 0] - push[k, 0])
            noise_a = push[k, 1] + share * (push[k + 1, 1] - push[k, 1])
            # --- the kick, viscous terms at its middle
            total_m = kt * drive - stiffness * stretch + em + noise_m
            total_a = stiffness * stretch + ea + noise_a
            if e[PAYLOAD] != 0.0 and t >= e[PAYLOAD_TIME]:
                load += e[PAYLOAD]
            hm, ha = 0.5 * dt * bm / jm, 0.5 * dt * ba / load
            vm = (vm * (1.0 - hm) + dt * total_m / jm) / (1.0 + hm)
            before = va
            va = (va * (1.0 - ha) + dt * total_a / load) / (1.0 + ha)
            if follow:
                va = path[min(step + 1, len(path) - 1), 3]
            force_m += em + kt * (drive - sensed)
            force_a += ea - (load - ja) * (va - before) / dt
            qm += 0.5 * dt * vm
            qa += 0.5 * dt * va
            q2 += 0.5 * dt * v2
            if follow:
                qm, qa = path[step, 4], path[step, 5]
            elif len(path):
                path[step, 4], path[step, 5] = qm, qa
            place = (place + 1) % history
            past_m[place], past_a[place] = qm, qa
        out[k, 9] = sensed_sum / steps
        out[k, 10], out[k, 11] = force_m / steps - preload, force_a / steps + preload
        out[k, 12] = current_sum / steps
    return out
