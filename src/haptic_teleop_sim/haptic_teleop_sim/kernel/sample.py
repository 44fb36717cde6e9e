"""Compiled: one sample of state and sensitivities, and the matrices that make it where the joint is linear.

Joined to `integrator.py`, where state and arrays are described; not imported by itself.  Without an effect in
the equations of motion a sample of Runge-Kutta is a linear map of state and torques: the columns of its
matrix are the samples of unit vectors, and the derivatives of the matrix are their sensitivities.  So the
solution is the same but for rounding, at a fraction of the work.
"""

# ruff: noqa: F821
# fmt: off
# pyright: reportUndefinedVariable=false
from __future__ import annotations

import numpy as np

from haptic_teleop_control.compiled import njit

# <the text below joins the kernel>


@njit
def sample_matrix(dt, substeps, rigid, base, codes, p):
    """The matrix (4, 6) from angles, velocities and torques at motor and arm to angles and velocities one
    sample later, without effects."""
    matrix = np.empty((4, 6))
    x, z, dz, total = np.zeros(6), np.zeros(6), np.zeros(6), np.zeros(6)
    for j in range(6):
        for r in range(6):
            x[r] = 1.0 if r == j else 0.0
        advance(x, 0.0, dt, substeps, 0.0, 0.0, 0.0, rigid, base, codes, p, z, dz, total)
        for r in range(4):
            matrix[r, j] = x[r]
    return matrix


@njit
def sample_slopes(dt, substeps, rigid, base, codes, p):
    """Derivatives (6, 20) of `sample_matrix`: its element (r, j) by the number b of ``base`` is in row j and
    column 4 b + r."""
    slopes = np.zeros((6, 20))
    x, s = np.zeros(6), np.zeros((6, PITCH))
    # No constants: for each of them as an argument the integrator would be compiled once more.
    effects = codes.shape[0]  # none
    work = sensitive_scratch(s, 8)
    base_col, p_col = np.arange(5), np.full(len(p), -1)
    d_torque, driven = np.zeros((1, 0)), np.empty(0, dtype=np.int64)
    for j in range(6):
        for r in range(6):
            x[r] = 1.0 if r == j else 0.0
            for c in range(8):
                s[r, c] = 0.0
        advance_sensitive(x, s, effects, 0.0, dt, substeps, 0.0, 0.0, 0.0, rigid, base, codes, p, base_col,
                          p_col, d_torque, driven, effects == 0, work)
        for b in range(5):
            for r in range(4):
                slopes[j, 4 * b + r] = s[r, b]
    return slopes


@inner
def linear_sample(x, torque_motor, torque_arm, a):
    """One sample of a joint without effects in place, by its `sample_matrix`."""
    q0, q1, v0, v1 = x[0], x[1], x[2], x[3]
    w0, w1 = torque_motor + x[4], torque_arm + x[5]
    x[0] = a[0, 0] * q0 + a[0, 1] * q1 + a[0, 2] * v0 + a[0, 3] * v1 + a[0, 4] * w0 + a[0, 5] * w1
    x[1] = a[1, 0] * q0 + a[1, 1] * q1 + a[1, 2] * v0 + a[1, 3] * v1 + a[1, 4] * w0 + a[1, 5] * w1
    x[2] = a[2, 0] * q0 + a[2, 1] * q1 + a[2, 2] * v0 + a[2, 3] * v1 + a[2, 4] * w0 + a[2, 5] * w1
    x[3] = a[3, 0] * q0 + a[3, 1] * q1 + a[3, 2] * v0 + a[3, 3] * v1 + a[3, 4] * w0 + a[3, 5] * w1


@inner
def linear_columns(s, used, a):
    """The first ``used`` columns of sensitivities (6, PITCH), which lie row after row, times the matrix in
    place."""
    a00, a01, a02, a03, a04, a05 = a[0, 0], a[0, 1], a[0, 2], a[0, 3], a[0, 4], a[0, 5]
    a10, a11, a12, a13, a14, a15 = a[1, 0], a[1, 1], a[1, 2], a[1, 3], a[1, 4], a[1, 5]
    a20, a21, a22, a23, a24, a25 = a[2, 0], a[2, 1], a[2, 2], a[2, 3], a[2, 4], a[2, 5]
    a30, a31, a32, a33, a34, a35 = a[3, 0], a[3, 1], a[3, 2], a[3, 3], a[3, 4], a[3, 5]
    for c in range(used):
        s0, s1, s2 = s[c], s[PITCH + c], s[2 * PITCH + c]
        s3, s4, s5 = s[3 * PITCH + c], s[4 * PITCH + c], s[5 * PITCH + c]
        s[c] = a00 * s0 + a01 * s1 + a02 * s2 + a03 * s3 + a04 * s4 + a05 * s5
        s[PITCH + c] = a10 * s0 + a11 * s1 + a12 * s2 + a13 * s3 + a14 * s4 + a15 * s5
        s[2 * PITCH + c] = a20 * s0 + a21 * s1 + a22 * s2 + a23 * s3 + a24 * s4 + a25 * s5
        s[3 * PITCH + c] = a30 * s0 + a31 * s1 + a32 * s2 + a33 * s3 + a34 * s4 + a35 * s5


@inner
def linear_sample_sensitive(x, s, rows, used, i, torque_motor, torque_arm, a, slopes, base_col, d_torque,
                            driven, forced):
    """`linear_sample` with its sensitivities ``s`` (6, PITCH), row after row ``rows``, of which so many
    columns are used: the matrix' derivatives by ``base`` are in ``slopes`` (`sample_slopes`), those of the
    torque by the ``driven`` columns in ``d_torque[i]``; ``forced`` (20,) is scratch."""
    q0, q1, v0, v1 = x[0], x[1], x[2], x[3]
    w0, w1 = torque_motor + x[4], torque_arm + x[5]
    for k in range(20):
        forced[k] = (slopes[0, k] * q0 + slopes[1, k] * q1 + slopes[2, k] * v0 + slopes[3, k] * v1
                     + slopes[4, k] * w0 + slopes[5, k] * w1)
    linear_columns(rows, used, a)
    for k in range(driven.shape[0]):
        for r in range(4):
            s[r, driven[k]] += a[r, 4] * d_torque[i, k]
    for b in range(5):
        if base_col[b] >= 0:
            for r in range(4):
                s[r, base_col[b]] += forced[4 * b + r]
    linear_sample(x, torque_motor, torque_arm, a)


@njit
def sensitive_scratch(s, used):
    """Scratch of `advance_sensitive` for sensitivities ``s`` (n, columns), of whose columns so many are
    used."""
    n, wide = s.shape
    z, dz, sums = np.zeros(n), np.zeros(n), np.zeros(n)
    by_state, by_parameter = np.zeros((4, n, n)), np.zeros((4, max(n, ROWS), wide))
    by_start, began = np.zeros((4, 4, 2)), np.zeros((2, wide))
    stage, total, changes = np.zeros((n, wide)), np.zeros((n, wide)), np.zeros((n, wide))
    rows, flat = s.reshape(n * wide), by_parameter.reshape(by_parameter.size)
    g = np.zeros(G_SIZE)
    return z, dz, sums, by_state, by_parameter, by_start, began, stage, total, changes, g, rows, flat, used


@inner
def advance_sensitive(x, s, i, t, dt, substeps, torque_motor, torque_arm, exogenous, rigid, base, codes, p,
                      base_col, p_col, d_torque, driven, remembering, work):
    """One sample of Runge-Kutta of state and sensitivities in place; ``driven``: columns whose parameters the
    acting torque depends on, by ``d_torque[i]``; ``remembering``: no effect has own states but memories;
    ``work``: `sensitive_scratch`."""
    z, dz, sums, by_state, by_parameter, by_start, began, stage, total, changes, g, rows, flat, used = work
    n = x.shape[0]
    own = n - 2
    tm = torque_motor + x[n - 2]
    ta = torque_arm + x[n - 1]
    steps = steps_here(x, dt, substeps, tm, ta, base, codes, p)
    h = dt / steps
    driving = torque_motor - (torque_arm if rigid else 0.0)
    for sub in range(steps):
        ts = t + sub * h
        qm, qa, vm, va = x[0], x[1], x[2], x[3]
        y0, y1, y2, y3 = qm, qa, vm, va
        s0, s1, s2, s3 = 0.0, 0.0, 0.0, 0.0
        for j in range(4, own):
            z[j] = x[j]
            sums[j] = 0.0
        for k in range(4):
            weight = 1.0 if k == 0 or k == 3 else 2.0
            ahead = h if k == 2 else 0.5 * h
            when = ts if k == 0 else (ts + h if k == 3 else ts + 0.5 * h)
            am, aa = rates_sensitive(y0, y1, y2, y3, z, y0 - qm, y1 - qa, when, tm, ta, driving, exogenous,
                                     rigid, base, codes, p, base_col, p_col, d_torque, driven, i, k, dz,
                                     by_state, by_parameter, by_start, g)
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
                sums[j] += weight * dz[j]
                z[j] = x[j] + ahead * dz[j]
        x[0] = qm + h / 6.0 * s0
        x[1] = qa + h / 6.0 * s1
        x[2] = vm + h / 6.0 * s2
        x[3] = va + h / 6.0 * s3
        for j in range(4, own):
            x[j] += h / 6.0 * sums[j]
        for c in range(used):
            began[0, c] = s[0, c]
            began[1, c] = s[1, c]
        if remembering:
            step_sensitivities(s, rows, used, h, rigid, by_state, by_start, by_parameter, flat, stage, total,
                               changes)
        else:
            step_many_sensitivities(s, used, h, rigid, by_state, by_parameter, by_start, stage, total,
                                    changes)
        if n > 6:
            update_memories_sensitive(x, h / 6.0 * s0, h / 6.0 * s1, s, used, began, codes, p, p_col)
