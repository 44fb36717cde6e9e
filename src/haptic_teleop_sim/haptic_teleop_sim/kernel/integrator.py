"""The compiled loops: acting torque, simulation, and prediction with exact sensitivities.

This text is joined behind the generated functions of ``codegen.py`` into one module that numba compiles and
caches (``build.py``); it is not imported by itself.  Classical Runge-Kutta with a held input; the number of
sub-steps is chosen from the stiffest part of the model (``pack.py``), and raised for a sample in which a law
without a bound, such as that of a drag, is steeper.

State: x = [q_motor, q_arm, v_motor, v_arm, own states of effects ..., disturbance torque at motor, at arm].
``base`` = [stiffness, motor_inertia, motor_damping, arm_inertia, arm_damping]. ``codes`` has one row per
effect: code, location (0 motor or actuator, 1 arm, 2 joint), kind (0 torque, 1 friction, 2 factor on
friction, 3 inertia, 4 inertia relative to the structure's), offset of its parameters in ``p``, offset of its
states in x, number of integrated states, number of parameters, kind of memory (0 none, 1 stiction, 2
displacement from the ratio of the first two parameters, 3 displacement from the second, 4 none but a smoothed
sign whose width is the last parameter).  A memory is one more state, behind the integrated ones.  Factors and
inertias come first.
"""

# ruff: noqa: F821
# fmt: off
# pyright: reportUndefinedVariable=false
from __future__ import annotations

import math

import numpy as np

from haptic_teleop_control.compiled import njit


@inner
def tanh(x):
    """Hyperbolic tangent to 1e-16 absolute, at half the time of the library's: friction spends most of its
    time here. Beyond 20 it is +-1 in double precision.
    """
    a = abs(x)
    if a > 20.0:
        return math.copysign(1.0, x)
    t = math.exp(-2.0 * a)
    return math.copysign((1.0 - t) / (1.0 + t), x)


@inner
def sech(x):
    """Hyperbolic secant, without the overflow of 1 / cosh(x)."""
    t = math.exp(-abs(x))
    return 2.0 * t / (1.0 + t * t)


#: Sub-steps to which a steep law raises those of a sample at most (`pack.MOST_STEEP`).
MOST_STEPS = 50
#: Sub-steps that a state would need from which it is overflowing.
OVERFLOWS = 1e6
#: Where the parameters' derivatives begin in ``g`` (`codegen.DERIVATIVE_ORDER`), and its room.
FIRST_PARAMETER = 9
G_SIZE = 24


# <generated functions are inserted here>


@inner
def actuated(torque, moment, t, dt, codes, p, z):
    """Mean and moment (see ``effects/actuator.py``) of what acts over a sample for a commanded ``torque`` and
    the ``moment`` it already has: every input effect in turn, memory in ``z``.
    """
    for e in range(codes.shape[0]):
        before = torque
        torque = actuate(codes[e, 0], torque, t, dt, p, codes[e, 1], z, codes[e, 2])
        if codes[e, 3] >= 0:
            moment += z[codes[e, 3]]
        elif before != 0.0:
            # A gain takes all of it, a limit or a dead band what is left of the torque.
            moment *= torque / before
    return torque, moment


@njit
def actuate_series(torque, moment, t0, dt, codes, p, z):
    """`actuated` in place for ``torque`` and ``moment`` (n,)."""
    for i in range(torque.shape[0]):
        torque[i], moment[i] = actuated(torque[i], moment[i], t0 + i * dt, dt, codes, p, z)


@inner
def spread(x, moment, base):
    """What the moment of the torque adds at the end of a sample: position, and by damping some speed."""
    if moment == 0.0:
        return
    shift = moment / base[1]
    x[0] += shift
    x[2] -= base[2] / base[1] * shift


@inner
def memory_displacement(kind, p, k, npar):
    """Displacement (rad) over which a memory follows the motion."""
    if kind == 2:
        return max(p[k], 1e-12) / p[k + 1]
    if kind == 3:
        return p[k + 1]
    return max(p[k + npar - 2], 1e-12)


@inner
def forgotten(moved, displacement):
    """What a memory still knows after a motion: exp(-abs(moved) / displacement), at no cost where that is
    nothing beside 1 in double precision; friction slides most of the time.
    """
    ways = abs(moved) / displacement
    return math.exp(-ways) if ways < 40.0 else 0.0


@inner
def side_of(moved, v):
    """Direction of a motion; of the velocity while nothing has moved."""
    return 1.0 if moved > 0.0 or (moved == 0.0 and v >= 0.0) else -1.0


@inner
def direction_of(kind, moved, v, s0, p, k, npar):
    """Direction of motion between -1 and 1: the memory ``s0`` after the location has moved one way by
    ``moved`` since the start of the step (exact solution of ds = (dq - abs(dq) s) / D), or the smoothed sign.
    """
    if kind == 4:
        return tanh(v / p[k + npar - 1])
    side = side_of(moved, v)
    return side + (s0 - side) * forgotten(moved, memory_displacement(kind, p, k, npar))


@inner
def update_memories(x, moved_motor, moved_arm, codes, p):
    """Memories at the end of a step in which motor and arm moved so far."""
    for e in range(codes.shape[0]):
        kind = codes[e, 7]
        if 0 < kind < 4:
            loc = codes[e, 1]
            if loc == 0:
                moved, v = moved_motor, x[2]
            elif loc == 1:
                moved, v = moved_arm, x[3]
            else:
                moved, v = moved_motor - moved_arm, x[2] - x[3]
            i = codes[e, 4] + codes[e, 5]
            x[i] = direction_of(kind, moved, v, x[i], p, codes[e, 3], codes[e, 6])


@inner
def rates(qm, qa, vm, va, z, moved_motor, moved_arm, t, torque_motor, torque_arm, driving, exogenous, rigid,
          base, codes, p, dz):
    """Accelerations of motor and arm; ``driving``: the part of ``torque_motor`` that the actuator gives. The
    rates of the effects' own states ``z[4:]`` into ``dz[4:]``, those
    of memories excepted: ``z`` holds them as at the start of the step, since when motor and arm have
    moved by so much.

    Angles and velocities come and go as scalars, because the way through memory would take longer than the
    equations.
    """
    ks = base[0]
    d = qm - qa
    dv = vm - va
    fm = torque_motor
    fa = torque_arm
    tau = ks * d
    rubm = -base[2] * vm
    ruba = -base[4] * va
    facm = 1.0
    faca = 1.0
    jm = base[1]
    ja = base[3]
    # Derivatives of the inertias by their own angles.
    bend_m = 0.0
    bend_a = 0.0
    for e in range(codes.shape[0]):
        code = codes[e, 0]
        loc = codes[e, 1]
        kind = codes[e, 2]
        k = codes[e, 3]
        o = codes[e, 4]
        # At the joint all but a map follow the deflection.
        q, v = (qm, vm) if loc == 0 or (loc == 2 and code == MAP) else ((qa, va) if loc == 1 else (d, dv))
        z0 = z[o] if codes[e, 5] > 0 else 0.0
        z1 = z[o + 1] if codes[e, 5] > 1 else 0.0
        way = 0.0
        if codes[e, 7] > 0:
            moved = moved_motor if loc == 0 else (moved_arm if loc == 1 else moved_motor - moved_arm)
            s0 = z[o + codes[e, 5]] if codes[e, 7] < 4 else 0.0
            way = direction_of(codes[e, 7], moved, v, s0, p, k, codes[e, 6])
        f = value(code, q, v, d, ks, t, exogenous, driving, dv, z0, z1, way, p, k)
        if kind == 0:
            if loc == 0:
                fm += f
            elif loc == 1:
                fa += f
            else:
                tau += f
        elif kind == 1:
            if loc == 0:
                rubm += f
            else:
                ruba += f
        elif kind == 2:
            if loc == 0:
                facm *= f
            else:
                faca *= f
        else:
            bend = slope(code, q, v, d, ks, t, exogenous, driving, dv, z0, z1, way, p, k)
            if loc == 0:
                w = base[1] if kind == 4 else 1.0
                jm += w * f
                bend_m += w * bend
            else:
                w = base[3] if kind == 4 else 1.0
                ja += w * f
                bend_a += w * bend
        for i in range(codes[e, 5]):
            dz[o + i] = state_rate(2 * code + i, q, v, d, ks, t, exogenous, driving, dv, z0, z1, 0.0, p, k)
    im = 1.0 / jm
    # Lagrange: d(J(q) v)/dt - J'(q) v^2 / 2 = J a + J'(q) v^2 / 2 is what the torques do.
    fm -= 0.5 * bend_m * vm * vm
    fa -= 0.5 * bend_a * va * va
    if rigid:
        return (fm + rubm * facm) * im, 0.0
    return (fm + rubm * facm - tau) * im, (fa + ruba * faca + tau) * (1.0 / ja)


@inner
def steps_here(x, dt, substeps, torque_motor, torque_arm, base, codes, p):
    """Sub-steps of this sample: ``substeps``, and as many more as laws are steeper than any bound at this
    state (`EffectEntry.steepness`), with the speed and the angle that may be reached within the sample."""
    steep = 0.0
    for e in range(codes.shape[0]):
        steep += is_steep(codes[e, 0], p, codes[e, 3])
    if steep == 0.0:
        return substeps
    k_motor, k_arm, b_motor, b_arm = 0.0, 0.0, 0.0, 0.0
    d = x[0] - x[1]
    spring = abs(base[0] * d)
    vm = abs(x[2]) + dt * (abs(torque_motor) + spring) / base[1]
    va = abs(x[3]) + dt * (abs(torque_arm) + spring) / base[3]
    for e in range(codes.shape[0]):
        loc = codes[e, 1]
        q, v = (x[0], vm) if loc == 0 else ((x[1], va) if loc == 1 else (d, vm + va))
        q = abs(q) + dt * v
        k = stiffness_here(codes[e, 0], q, v, d, base[0], 0.0, 0.0, 0.0, v, 0.0, 0.0, 0.0, p, codes[e, 3])
        b = damping_here(codes[e, 0], q, v, d, base[0], 0.0, 0.0, 0.0, v, 0.0, 0.0, 0.0, p, codes[e, 3])
        if loc != 1:
            k_motor += k
            b_motor += b
        if loc != 0:
            k_arm += k
            b_arm += b
    # As in ``pack.py``, for inertias that do not vary.
    more = dt * max(b_motor / base[1] / 2.2 + math.sqrt(k_motor / base[1]),
                    b_arm / base[3] / 2.2 + math.sqrt(k_arm / base[3]))
    # Up to a quarter of a step the rounding of ``substeps`` covers. A state that overflows is left to do so.
    return max(substeps, min(substeps + int(more + 0.75), MOST_STEPS)) if more < OVERFLOWS else substeps


@inner
def advance(x, t, dt, substeps, torque_motor, torque_arm, exogenous, rigid, base, codes, p, z, dz, total):
    """One sample of Runge-Kutta in place; ``z``, ``dz`` and ``total`` are (nx,) scratch. A rigid body has
    the torque of its environment, ``torque_arm``, within ``torque_motor``."""
    n = x.shape[0]
    own = n - 2
    tm = torque_motor + x[n - 2]
    ta = torque_arm + x[n - 1]
    steps = steps_here(x, dt, substeps, tm, ta, base, codes, p)
    h = dt / steps
    sixth = h / 6.0
    driving = torque_motor - (torque_arm if rigid else 0.0)
    qm, qa, vm, va = x[0], x[1], x[2], x[3]
    for s in range(steps):
        ts = t + s * h
        y0, y1, y2, y3 = qm, qa, vm, va
        s0, s1, s2, s3 = 0.0, 0.0, 0.0, 0.0
        for j in range(4, own):
            z[j] = x[j]
            total[j] = 0.0
        for k in range(4):
            weight = 1.0 if k == 0 or k == 3 else 2.0
            ahead = h if k == 2 else 0.5 * h
            when = ts if k == 0 else (ts + h if k == 3 else ts + 0.5 * h)
            am, aa = rates(y0, y1, y2, y3, z, y0 - qm, y1 - qa, when, tm, ta, driving, exogenous, rigid,
                           base, codes, p, dz)
            wa = 0.0 if rigid else y3
            s0 += weight * y2
            s1 += weight * wa
            s2 += weight * am
            s3 += weight * aa
            y0 = qm + ahead * y2
            y1 = qa + ahead * wa
            y2 = vm + ahead * am
            y3 = va + ahead * aa
            for j in range(4, own):
                total[j] += weight * dz[j]
                z[j] = x[j] + ahead * dz[j]
        qm += sixth * s0
        qa += sixth * s1
        vm += sixth * s2
        va += sixth * s3
        for j in range(4, own):
            x[j] += sixth * total[j]
        x[2], x[3] = vm, va
        update_memories(x, sixth * s0, sixth * s1, codes, p)
    x[0], x[1] = qm, qa


@njit
def simulate_series(x, torque, moment, torque_arm, exogenous, t0, dt, substeps, rigid, base, codes, p, out):
    """States (n, nx) at the sample times, each before its sample's torque acts; ``x`` is advanced in place.
    """
    n = x.shape[0]
    z, dz, total = np.zeros(n), np.zeros(n), np.zeros(n)
    linear = codes.shape[0] == 0
    matrix = sample_matrix(dt, substeps, rigid, base, codes, p) if linear else np.empty((0, 0))
    for i in range(torque.shape[0]):
        for j in range(n):
            out[i, j] = x[j]
        if linear:
            linear_sample(x, torque[i], torque_arm[i], matrix)
        else:
            advance(x, t0 + i * dt, dt, substeps, torque[i], torque_arm[i], exogenous[i], rigid, base, codes,
                    p, z, dz, total)
        spread(x, moment[i], base)
