"""The compiled loops: acting torque, simulation, and prediction with exact sensitivities.

This text is joined behind the generated functions of ``codegen.py`` into one module that numba compiles and
caches (``build.py``); it is not imported by itself.  Fixed-step classical Runge-Kutta with a held input; the
number of sub-steps is chosen from the stiffest part of the model (``pack.py``).

State: x = [q_motor, q_arm, v_motor, v_arm, own states of effects ..., disturbance torque at motor, at arm].
``base`` = [stiffness, motor_inertia, motor_damping, arm_inertia, arm_damping].
``codes`` has one row per effect: code, location (0 motor, 1 arm, 2 joint), kind (0 torque, 1 friction, 2 factor
on friction, 3 inertia), offset of its parameters in ``p``, offset of its states in x, number of integrated states,
number of parameters, kind of memory (0 none, 1 stiction, 2 displacement from the ratio of the first two parameters,
3 displacement from the second, 4 none but a smoothed sign whose width is the last parameter).  A memory is one more
state, behind the integrated ones.  Factors and inertias come first.
"""
# ruff: noqa: F821, PLR0913, PLR0912, PLR0915
from __future__ import annotations

import math

import numpy as np
from numba import njit

# <generated functions are inserted here>


@njit
def actuate_series(torque, t0, dt, codes, p, z, out):
    """Acting torque for commanded ``torque`` (n,): every input effect in turn, memory in ``z``."""
    for i in range(torque.shape[0]):
        value_ = torque[i]
        for e in range(codes.shape[0]):
            value_ = actuate(codes[e, 0], value_, t0 + i * dt, dt, p, codes[e, 1], z, codes[e, 2])
        out[i] = value_


STICTION = 2e-4


@njit
def memory_displacement(kind, p, k):
    """Displacement (rad) over which a memory follows the motion."""
    if kind == 2:
        return max(p[k], 1e-12) / p[k + 1]
    if kind == 3:
        return p[k + 1]
    return STICTION


@njit
def follow(s0, moved, v, d):
    """Memory after the location has moved by ``moved`` in one direction: exact solution of d s = (dq - |dq| s) / D."""
    side = 1.0 if moved > 0.0 or (moved == 0.0 and v >= 0.0) else -1.0
    return side + (s0 - side) * math.exp(-abs(moved) / d)


@njit
def direction_of(kind, q, v, q0, s0, p, k, npar):
    """Direction of motion between -1 and 1: the memory at a stage of the step, or the smoothed sign."""
    if kind == 4:
        return math.tanh(v / p[k + npar - 1])
    return follow(s0, q - q0, v, memory_displacement(kind, p, k))


@njit
def update_memories(x, before, codes, p):
    """Memories at the end of a step that began at ``before``."""
    for e in range(codes.shape[0]):
        kind = codes[e, 7]
        if 0 < kind < 4:
            loc = codes[e, 1]
            if loc == 0:
                moved, v = x[0] - before[0], x[2]
            elif loc == 1:
                moved, v = x[1] - before[1], x[3]
            else:
                moved, v = x[0] - x[1] - before[0] + before[1], x[2] - x[3]
            i = codes[e, 4] + codes[e, 5]
            x[i] = follow(x[i], moved, v, memory_displacement(kind, p, codes[e, 3]))


@njit
def rates(x, start, t, torque_motor, torque_arm, exogenous, rigid, base, codes, p, dx):
    """Time derivative of the state ``x`` at a stage of a step that began at ``start``, into ``dx``."""
    ks = base[0]
    qm, qa, vm, va = x[0], x[1], x[2], x[3]
    d = qm - qa
    dv = vm - va
    n = x.shape[0]
    fm = torque_motor + x[n - 2]
    fa = torque_arm + x[n - 1]
    tau = ks * d
    rubm = -base[2] * vm
    ruba = -base[4] * va
    facm = 1.0
    faca = 1.0
    jm = base[1]
    ja = base[3]
    for e in range(codes.shape[0]):
        code = codes[e, 0]
        loc = codes[e, 1]
        kind = codes[e, 2]
        k = codes[e, 3]
        o = codes[e, 4]
        q, v = (qm, vm) if loc == 0 else ((qa, va) if loc == 1 else (d, dv))
        z0 = x[o] if codes[e, 5] > 0 else 0.0
        z1 = x[o + 1] if codes[e, 5] > 1 else 0.0
        way = 0.0
        if codes[e, 7] > 0:
            q0 = start[0] if loc == 0 else (start[1] if loc == 1 else start[0] - start[1])
            m = o + codes[e, 5]
            way = direction_of(codes[e, 7], q, v, q0, start[m] if codes[e, 7] < 4 else 0.0, p, k, codes[e, 6])
            if codes[e, 7] < 4:
                dx[m] = 0.0
        f = value(code, q, v, d, ks, t, exogenous, z0, z1, way, p, k)
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
        elif loc == 0:
            jm += f
        else:
            ja += f
        for i in range(codes[e, 5]):
            dx[o + i] = state_rate(2 * code + i, q, v, d, ks, t, exogenous, z0, z1, 0.0, p, k)
    dx[0] = vm
    if rigid:
        dx[1] = 0.0
        dx[2] = (fm + rubm * facm) / jm
        dx[3] = 0.0
    else:
        dx[1] = va
        dx[2] = (fm + rubm * facm - tau) / jm
        dx[3] = (fa + ruba * faca + tau) / ja
    dx[n - 2] = 0.0
    dx[n - 1] = 0.0


@njit
def advance(x, t, dt, substeps, torque_motor, torque_arm, exogenous, rigid, base, codes, p, work):
    """One sample of Runge-Kutta in place; ``work`` is (5, n) scratch."""
    n = x.shape[0]
    h = dt / substeps
    k1, k2, k3, k4, y = work[0], work[1], work[2], work[3], work[4]
    for s in range(substeps):
        ts = t + s * h
        rates(x, x, ts, torque_motor, torque_arm, exogenous, rigid, base, codes, p, k1)
        for i in range(n):
            y[i] = x[i] + 0.5 * h * k1[i]
        rates(y, x, ts + 0.5 * h, torque_motor, torque_arm, exogenous, rigid, base, codes, p, k2)
        for i in range(n):
            y[i] = x[i] + 0.5 * h * k2[i]
        rates(y, x, ts + 0.5 * h, torque_motor, torque_arm, exogenous, rigid, base, codes, p, k3)
        for i in range(n):
            y[i] = x[i] + h * k3[i]
        rates(y, x, ts + h, torque_motor, torque_arm, exogenous, rigid, base, codes, p, k4)
        for i in range(n):
            y[i] = x[i]
            x[i] += h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i])
        update_memories(x, y, codes, p)


@njit
def simulate_series(x, torque, torque_arm, exogenous, t0, dt, substeps, rigid, base, codes, p, out):
    """States (n, nx) at the sample times, each before its sample's torque acts; ``x`` is advanced in place."""
    work = np.zeros((5, x.shape[0]))
    for i in range(torque.shape[0]):
        for j in range(x.shape[0]):
            out[i, j] = x[j]
        advance(x, t0 + i * dt, dt, substeps, torque[i], torque_arm[i], exogenous[i], rigid, base, codes, p, work)


@njit
def rates_sensitive(x, start, t, torque_motor, torque_arm, exogenous, rigid, base, codes, p, base_col, p_col,
                    d_torque, s, s_start, dx, ds, jac, g):
    """Rates and the rates of the sensitivities ``s`` (nx, np): ds = (d rates / d x) s + d rates / d theta, at a stage of
    a step that began at ``start`` with ``s_start``.

    ``base_col``, ``p_col``: column of each parameter or -1; ``d_torque`` (np,): derivative of the acting torque;
    ``jac`` is (4 + own states, nx + np) scratch for the rows of motor, arm and own states.
    """
    ks = base[0]
    qm, qa, vm, va = x[0], x[1], x[2], x[3]
    d = qm - qa
    dv = vm - va
    n = x.shape[0]
    ncol = s.shape[1]
    fm = torque_motor + x[n - 2]
    fa = torque_arm + x[n - 1]
    tau = ks * d
    rubm = -base[2] * vm
    ruba = -base[4] * va
    facm = 1.0
    faca = 1.0
    jm = base[1]
    ja = base[3]
    rows = n - 2
    for r in range(2, rows):
        for c in range(n + ncol):
            jac[r, c] = 0.0
    # First the factors and inertias, which scale what the others add.
    first = 0
    for e in range(codes.shape[0]):
        if codes[e, 2] < 2:
            break
        first += 1
        loc = codes[e, 1]
        q, v = (qm, vm) if loc == 0 else (qa, va)
        f = value(codes[e, 0], q, v, d, ks, t, exogenous, 0.0, 0.0, 0.0, p, codes[e, 3])
        if codes[e, 2] == 2:
            if loc == 0:
                facm *= f
            else:
                faca *= f
        elif loc == 0:
            jm += f
        else:
            ja += f
    # Row 2: force at the motor, row 3: at the arm; coupling torque enters both.
    jac[2, 0] -= ks
    jac[2, 1] += ks
    jac[3, 0] += ks
    jac[3, 1] -= ks
    jac[2, n - 2] += 1.0
    jac[3, n - 1] += 1.0
    jac[2, 2] -= base[2] * facm
    jac[3, 3] -= base[4] * faca
    if base_col[0] >= 0:
        jac[2, n + base_col[0]] -= d
        jac[3, n + base_col[0]] += d
    if base_col[2] >= 0:
        jac[2, n + base_col[2]] -= vm * facm
    if base_col[4] >= 0:
        jac[3, n + base_col[4]] -= va * faca
    for e in range(first, codes.shape[0]):
        code = codes[e, 0]
        loc = codes[e, 1]
        kind = codes[e, 2]
        k = codes[e, 3]
        o = codes[e, 4]
        nz = codes[e, 5]
        npar = codes[e, 6]
        q, v = (qm, vm) if loc == 0 else ((qa, va) if loc == 1 else (d, dv))
        z0 = x[o] if nz > 0 else 0.0
        z1 = x[o + 1] if nz > 1 else 0.0
        way = 0.0
        memory = codes[e, 7]
        m = o + nz
        slope = 0.0
        keeps = 0.0
        if memory > 0:
            q0 = start[0] if loc == 0 else (start[1] if loc == 1 else start[0] - start[1])
            way = direction_of(memory, q, v, q0, start[m] if memory < 4 else 0.0, p, k, npar)
        f = value_derivatives(code, q, v, d, ks, t, exogenous, z0, z1, way, p, k, g)
        if memory == 4:
            width = p[k + npar - 1]
            bend = g[6] * (1.0 - way * way) / width
            g[1] += bend
            g[7 + npar - 1] -= bend * v / width
        elif memory > 0:
            dx[m] = 0.0
            slope, keeps = _memory_slopes(memory, q - q0, v, start[m], p, k, g)
        if loc == 0:
            w = facm if kind == 1 else 1.0
            if kind == 1:
                rubm += f
            else:
                fm += f
            _spread(jac, 2, w, g, 0, o, nz, k, npar, n, base_col, p_col)
            if memory > 0:
                _remember(jac, 2, w, slope, keeps, s_start, 0, m, n, ncol)
        elif loc == 1:
            w = faca if kind == 1 else 1.0
            if kind == 1:
                ruba += f
            else:
                fa += f
            _spread(jac, 3, w, g, 1, o, nz, k, npar, n, base_col, p_col)
            if memory > 0:
                _remember(jac, 3, w, slope, keeps, s_start, 1, m, n, ncol)
        else:
            tau += f
            _spread(jac, 2, -1.0, g, 2, o, nz, k, npar, n, base_col, p_col)
            _spread(jac, 3, 1.0, g, 2, o, nz, k, npar, n, base_col, p_col)
            if memory > 0:
                _remember(jac, 2, -1.0, slope, keeps, s_start, 2, m, n, ncol)
                _remember(jac, 3, 1.0, slope, keeps, s_start, 2, m, n, ncol)
        for i in range(nz):
            dx[o + i] = state_rate_derivatives(2 * code + i, q, v, d, ks, t, exogenous, z0, z1, 0.0, p, k, g)
            _spread(jac, o + i, 1.0, g, loc, o, nz, k, npar, n, base_col, p_col)
    # Acceleration = force / inertia.
    am = (fm + rubm * facm - (0.0 if rigid else tau)) / jm
    aa = 0.0 if rigid else (fa + ruba * faca + tau) / ja
    if base_col[1] >= 0:
        jac[2, n + base_col[1]] -= am
    if base_col[3] >= 0:
        jac[3, n + base_col[3]] -= aa
    for e in range(first):
        loc = codes[e, 1]
        k = codes[e, 3]
        q, v = (qm, vm) if loc == 0 else (qa, va)
        f = value_derivatives(codes[e, 0], q, v, d, ks, t, exogenous, 0.0, 0.0, 0.0, p, k, g)
        if codes[e, 2] == 2:
            others = (facm if loc == 0 else faca) / f if f != 0.0 else 0.0
            weight = (rubm if loc == 0 else ruba) * others
        else:
            weight = -(am if loc == 0 else aa)
        for i in range(codes[e, 6]):
            if p_col[k + i] >= 0:
                jac[2 + loc, n + p_col[k + i]] += weight * g[7 + i]
    dx[0] = vm
    dx[1] = 0.0 if rigid else va
    dx[2] = am
    dx[3] = aa
    dx[n - 2] = 0.0
    dx[n - 1] = 0.0
    im = 1.0 / jm
    ia = 1.0 / ja
    for c in range(ncol):
        ds[0, c] = s[2, c]
        ds[1, c] = 0.0 if rigid else s[3, c]
        ds[2, c] = (jac[2, n + c] + d_torque[c]) * im
        ds[3, c] = jac[3, n + c] * ia
        ds[n - 2, c] = 0.0
        ds[n - 1, c] = 0.0
    for r in range(4, rows):
        for c in range(ncol):
            ds[r, c] = jac[r, n + c]
    for j in range(n):
        a = jac[2, j] * im
        if a != 0.0:
            for c in range(ncol):
                ds[2, c] += a * s[j, c]
        a = jac[3, j] * ia
        if a != 0.0:
            for c in range(ncol):
                ds[3, c] += a * s[j, c]
        for r in range(4, rows):
            a = jac[r, j]
            if a != 0.0:
                for c in range(ncol):
                    ds[r, c] += a * s[j, c]
    if rigid:
        for c in range(ncol):
            ds[3, c] = 0.0


@njit
def _memory_slopes(memory, moved, v, s0, p, k, g):
    """Add a memory's derivatives to an effect's ``g``; returns the effect's slope by the angle and the memory kept at the
    start of the step."""
    d = memory_displacement(memory, p, k)
    side = 1.0 if moved > 0.0 or (moved == 0.0 and v >= 0.0) else -1.0
    decay = math.exp(-abs(moved) / d)
    slope = g[6] * (1.0 - s0 * side) * decay / d
    by_displacement = g[6] * (s0 - side) * decay * abs(moved) / (d * d)
    g[0] += slope
    if memory == 2:
        g[7] += by_displacement / p[k + 1]
        g[8] -= by_displacement * d / p[k + 1]
    elif memory == 3:
        g[8] += by_displacement
    return slope, g[6] * decay


@njit
def _remember(jac, row, weight, slope, keeps, s_start, loc, m, n, ncol):
    """What an effect's memory owes to the state at the start of the step, as a term per column."""
    for c in range(ncol):
        if loc == 2:
            began = s_start[0, c] - s_start[1, c]
        else:
            began = s_start[loc, c]
        jac[row, n + c] += weight * (keeps * s_start[m, c] - slope * began)


@njit
def update_memories_sensitive(x, before, s, s_before, codes, p, p_col):
    """Memories and their sensitivities at the end of a step; ``s_before`` (2, np): rows of the angles before it."""
    ncol = s.shape[1]
    for e in range(codes.shape[0]):
        kind = codes[e, 7]
        if 0 < kind < 4:
            loc = codes[e, 1]
            k = codes[e, 3]
            if loc == 0:
                moved, v = x[0] - before[0], x[2]
            elif loc == 1:
                moved, v = x[1] - before[1], x[3]
            else:
                moved, v = x[0] - x[1] - before[0] + before[1], x[2] - x[3]
            i = codes[e, 4] + codes[e, 5]
            d = memory_displacement(kind, p, k)
            side = 1.0 if moved > 0.0 or (moved == 0.0 and v >= 0.0) else -1.0
            decay = math.exp(-abs(moved) / d)
            slope = (1.0 - x[i] * side) * decay / d
            by_displacement = (x[i] - side) * decay * abs(moved) / (d * d)
            for c in range(ncol):
                if loc == 2:
                    way = s[0, c] - s[1, c] - s_before[0, c] + s_before[1, c]
                else:
                    way = s[loc, c] - s_before[loc, c]
                s[i, c] = decay * s[i, c] + slope * way
            if kind == 2:
                if p_col[k] >= 0:
                    s[i, p_col[k]] += by_displacement / p[k + 1]
                if p_col[k + 1] >= 0:
                    s[i, p_col[k + 1]] -= by_displacement * d / p[k + 1]
            elif kind == 3 and p_col[k + 1] >= 0:
                s[i, p_col[k + 1]] += by_displacement
            x[i] = side + (x[i] - side) * decay


@njit
def _spread(jac, row, weight, g, loc, o, nz, k, npar, n, base_col, p_col):
    """Add an effect's derivatives ``g`` (see ``codegen.DERIVATIVE_ORDER``) to one row of the Jacobian."""
    if loc == 0:
        jac[row, 0] += weight * g[0]
        jac[row, 2] += weight * g[1]
    elif loc == 1:
        jac[row, 1] += weight * g[0]
        jac[row, 3] += weight * g[1]
    else:
        jac[row, 0] += weight * g[0]
        jac[row, 1] -= weight * g[0]
        jac[row, 2] += weight * g[1]
        jac[row, 3] -= weight * g[1]
    jac[row, 0] += weight * g[2]
    jac[row, 1] -= weight * g[2]
    if base_col[0] >= 0:
        jac[row, n + base_col[0]] += weight * g[3]
    for i in range(nz):
        jac[row, o + i] += weight * g[4 + i]
    for i in range(npar):
        if p_col[k + i] >= 0:
            jac[row, n + p_col[k + i]] += weight * g[7 + i]


@njit
def encoder_reading(angle, channel, codes, p):
    """What the encoder of a channel (0 motor, 1 arm) reads at an angle."""
    y = angle
    for e in range(codes.shape[0]):
        if codes[e, 1] == channel:
            y = reading(codes[e, 0], y, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, p, codes[e, 2])
    return y


@njit
def encoder_series(angle, velocity, channel, codes, p, reading_out, velocity_out):
    """Readings (n,) of an encoder and their rates for true angles and velocities (n,)."""
    g = np.zeros(16)
    for i in range(angle.shape[0]):
        y = angle[i]
        v = velocity[i]
        for e in range(codes.shape[0]):
            if codes[e, 1] == channel:
                y = reading_derivatives(codes[e, 0], y, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, p, codes[e, 2], g)
                v *= g[0]
        reading_out[i] = y
        velocity_out[i] = v


@njit
def encoder_reading_sensitive(angle, channel, codes, p, p_col, slope_out, ncol, dparam, g):
    """Reading; slope by the angle into ``slope_out[0]``, derivatives by parameters into ``dparam`` (ncol,)."""
    y = angle
    slope = 1.0
    for c in range(ncol):
        dparam[c] = 0.0
    for e in range(codes.shape[0]):
        if codes[e, 1] == channel:
            k = codes[e, 2]
            y = reading_derivatives(codes[e, 0], y, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, p, k, g)
            for c in range(ncol):
                dparam[c] *= g[0]
            slope *= g[0]
            for i in range(codes[e, 3]):
                if p_col[k + i] >= 0:
                    dparam[p_col[k + i]] += g[7 + i]
    slope_out[0] = slope
    return y


@njit
def predict_series(x, s, measured, gain, decay, torque, d_torque, torque_arm, exogenous, t0, dt, substeps, rigid,
                   base, codes, p, base_col, p_col, out_codes, skew_col, lead, innovation, d_innovation, states,
                   d_states):
    """One-step prediction of both encoders with exact derivatives by the free parameters.

    At every sample: e = y - y_hat, x += gain e, then one sample ahead; disturbance torques decay by ``decay``.
    A NaN in ``measured`` (n, 2) is a missing reading: no correction, e = 0.  With ``gain`` zero this is a plain
    simulation with sensitivities.  Fills innovation (n, 2), d_innovation (n, 2, np) = de/dtheta, states (n, nx)
    before the correction, d_states (n, 4, np) unless it is empty.  An encoder shows where its axis was ``-lead``
    (2,) seconds ago (less than a sample: whole samples are shifted in ``measured``); ``skew_col`` (2,): column of that
    delay or -1.
    """
    n = x.shape[0]
    ncol = s.shape[1]
    h = dt / substeps
    dx = np.zeros((4, n))
    y = np.zeros(n)
    ds = np.zeros((4, n, ncol))
    sy = np.zeros((n, ncol))
    jac = np.zeros((n, n + ncol))
    g = np.zeros(16)
    slope = np.zeros(1)
    dpar = np.zeros((2, ncol))
    slopes = np.zeros(2)
    keep = d_states.shape[0] > 0
    correcting = False
    last = np.array([x[2], x[3]])
    for j in range(n):
        if gain[j, 0] != 0.0 or gain[j, 1] != 0.0:
            correcting = True
    mapped = out_codes.shape[0] > 0
    for i in range(torque.shape[0]):
        for j in range(n):
            states[i, j] = x[j]
        if keep:
            for j in range(4):
                for c in range(ncol):
                    d_states[i, j, c] = s[j, c]
        for ch in range(2):
            shown = x[ch] + lead[ch] * x[2 + ch] + 0.5 * lead[ch] ** 2 * (x[2 + ch] - last[ch]) / dt
            if mapped:
                yh = encoder_reading_sensitive(shown, ch, out_codes, p, p_col, slope, ncol, dpar[ch], g)
                slopes[ch] = slope[0]
            else:
                yh = shown
                slopes[ch] = 1.0
            m = measured[i, ch]
            if math.isnan(m):
                innovation[i, ch] = 0.0
                for c in range(ncol):
                    d_innovation[i, ch, c] = 0.0
            else:
                innovation[i, ch] = m - yh
                for c in range(ncol):
                    d_innovation[i, ch, c] = -slopes[ch] * (s[ch, c] + lead[ch] * s[2 + ch, c]) - dpar[ch, c]
                if skew_col[ch] >= 0:
                    d_innovation[i, ch, skew_col[ch]] += slopes[ch] * x[2 + ch]
        if correcting:
            for j in range(n):
                x[j] += gain[j, 0] * innovation[i, 0] + gain[j, 1] * innovation[i, 1]
                for c in range(ncol):
                    s[j, c] += gain[j, 0] * d_innovation[i, 0, c] + gain[j, 1] * d_innovation[i, 1, c]
        last[0] = x[2]
        last[1] = x[3]
        t = t0 + i * dt
        for sub in range(substeps):
            ts = t + sub * h
            rates_sensitive(x, x, ts, torque[i], torque_arm[i], exogenous[i], rigid, base, codes, p, base_col, p_col,
                            d_torque[i], s, s, dx[0], ds[0], jac, g)
            for j in range(n):
                y[j] = x[j] + 0.5 * h * dx[0, j]
                for c in range(ncol):
                    sy[j, c] = s[j, c] + 0.5 * h * ds[0, j, c]
            rates_sensitive(y, x, ts + 0.5 * h, torque[i], torque_arm[i], exogenous[i], rigid, base, codes, p, base_col,
                            p_col, d_torque[i], sy, s, dx[1], ds[1], jac, g)
            for j in range(n):
                y[j] = x[j] + 0.5 * h * dx[1, j]
                for c in range(ncol):
                    sy[j, c] = s[j, c] + 0.5 * h * ds[1, j, c]
            rates_sensitive(y, x, ts + 0.5 * h, torque[i], torque_arm[i], exogenous[i], rigid, base, codes, p, base_col,
                            p_col, d_torque[i], sy, s, dx[2], ds[2], jac, g)
            for j in range(n):
                y[j] = x[j] + h * dx[2, j]
                for c in range(ncol):
                    sy[j, c] = s[j, c] + h * ds[2, j, c]
            rates_sensitive(y, x, ts + h, torque[i], torque_arm[i], exogenous[i], rigid, base, codes, p, base_col,
                            p_col, d_torque[i], sy, s, dx[3], ds[3], jac, g)
            for j in range(n):
                y[j] = x[j]
                if j < 2:
                    for c in range(ncol):
                        sy[j, c] = s[j, c]
                x[j] += h / 6.0 * (dx[0, j] + 2.0 * dx[1, j] + 2.0 * dx[2, j] + dx[3, j])
                for c in range(ncol):
                    s[j, c] += h / 6.0 * (ds[0, j, c] + 2.0 * ds[1, j, c] + 2.0 * ds[2, j, c] + ds[3, j, c])
            update_memories_sensitive(x, y, s, sy, codes, p, p_col)
        x[n - 2] *= decay[0]
        x[n - 1] *= decay[1]
        for c in range(ncol):
            s[n - 2, c] *= decay[0]
            s[n - 1, c] *= decay[1]


@njit
def innovations_series(x, measured, gain, decay, torque, torque_arm, exogenous, t0, dt, substeps, rigid, base,
                       codes, p, out_codes, lead, innovation, states):
    """The same prediction without derivatives."""
    n = x.shape[0]
    last = np.array([x[2], x[3]])
    work = np.zeros((5, n))
    for i in range(torque.shape[0]):
        for j in range(n):
            states[i, j] = x[j]
        for ch in range(2):
            m = measured[i, ch]
            shown = x[ch] + lead[ch] * x[2 + ch] + 0.5 * lead[ch] ** 2 * (x[2 + ch] - last[ch]) / dt
            innovation[i, ch] = 0.0 if math.isnan(m) else m - encoder_reading(shown, ch, out_codes, p)
        for j in range(n):
            x[j] += gain[j, 0] * innovation[i, 0] + gain[j, 1] * innovation[i, 1]
        last[0] = x[2]
        last[1] = x[3]
        advance(x, t0 + i * dt, dt, substeps, torque[i], torque_arm[i], exogenous[i], rigid, base, codes, p, work)
        x[n - 2] *= decay[0]
        x[n - 1] *= decay[1]
