"""Compiled: encoder readings, and the one-step prediction of both encoders with and without derivatives.

Joined to `integrator.py`, where state and arrays are described; not imported by itself.
"""

# ruff: noqa: F821
# fmt: off
# pyright: reportUndefinedVariable=false
from __future__ import annotations

import math

import numpy as np

from haptic_teleop_control.compiled import njit

# <the text below joins the kernel>


@inner
def encoder_reading(angle, channel, codes, p):
    """What the encoder of a channel (0 motor, 1 arm) reads at an angle."""
    y = angle
    for e in range(codes.shape[0]):
        if codes[e, 1] == channel:
            y = reading(codes[e, 0], y, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, p, codes[e, 2])
    return y


@njit
def encoder_series(angle, velocity, channel, codes, p, reading_out, velocity_out):
    """Readings (n,) of an encoder and their rates for true angles and velocities (n,)."""
    g = np.zeros(G_SIZE)
    for i in range(angle.shape[0]):
        y = angle[i]
        v = velocity[i]
        for e in range(codes.shape[0]):
            if codes[e, 1] == channel:
                y = reading_derivatives(codes[e, 0], y, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, p,
                                        codes[e, 2], g)
                v *= g[0]
        reading_out[i] = y
        velocity_out[i] = v


@inner
def encoder_reading_sensitive(angle, channel, codes, p, p_col, slope_out, ncol, dparam, g):
    """Reading; slope by the angle into ``slope_out[0]``, derivatives by parameters into ``dparam`` (ncol,).
    """
    y = angle
    slope = 1.0
    for c in range(ncol):
        dparam[c] = 0.0
    for e in range(codes.shape[0]):
        if codes[e, 1] == channel:
            k = codes[e, 2]
            y = reading_derivatives(codes[e, 0], y, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, p, k, g)
            for c in range(ncol):
                dparam[c] *= g[0]
            slope *= g[0]
            for i in range(codes[e, 3]):
                if p_col[k + i] >= 0:
                    dparam[p_col[k + i]] += g[FIRST_PARAMETER + i]
    slope_out[0] = slope
    return y


@inner
def within_sample(theta, dt, q0, v0, q1, v1):
    """The cubic between two samples with the angles and velocities of both, at the share ``theta``."""
    rest = 1.0 - theta
    return (rest * rest * ((1.0 + 2.0 * theta) * q0 + theta * dt * v0)
            + theta * theta * ((3.0 - 2.0 * theta) * q1 - rest * dt * v1))


@inner
def within_sample_rate(theta, dt, q0, v0, q1, v1):
    """Its rate."""
    return (6.0 * theta * (1.0 - theta) * (q1 - q0) / dt + (1.0 - theta) * (1.0 - 3.0 * theta) * v0
            + theta * (3.0 * theta - 2.0) * v1)


@njit
def predict_series(x, s, measured, gain, d_gain, decay, d_decay, torque, d_torque, moment, d_moment,
                   driven, torque_arm, exogenous, t0, dt, substeps, rigid, base, codes, p, base_col, p_col,
                   out_codes, skew_col, lead, innovation, d_innovation, states, d_states):
    """One-step prediction of both encoders with exact derivatives by the free parameters.

    At every sample: e = y - y_hat, x += gain e, then one sample ahead; disturbance torques decay by
    ``decay``; ``d_gain`` (nx, 2, np) and ``d_decay`` (2, np) are how both depend on the parameters, or empty
    where they are held. A NaN in ``measured`` (n, 2) is a missing reading: no correction, e = 0.  With
    ``gain`` zero this is a plain simulation with sensitivities.  Fills innovation (n, 2), d_innovation
    (n, 2, np) = de/dtheta, states (n, nx) before the correction, d_states (n, 4, np) unless it is empty.  An
    encoder shows where its axis was ``-lead`` (2,) seconds ago (less than a sample: whole samples are shifted
    in ``measured``); ``skew_col`` (2,): column of that delay or -1. ``moment`` (n,): of the torque within its
    sample, see `spread`. ``d_torque`` (n, k) and ``d_moment`` (n, k): derivatives of torque and moment by the
    parameters of the columns ``driven`` (k,), the latter empty where there is no moment.
    """
    n = x.shape[0]
    ncol = d_innovation.shape[2]
    # Whole vectors of columns: those beyond ncol stay zero.
    used = (ncol + 3) // 4 * 4
    linear = codes.shape[0] == 0 and s.shape[1] == PITCH
    matrix = sample_matrix(dt, substeps, rigid, base, codes, p) if linear else np.empty((0, 0))
    by_base = sample_slopes(dt, substeps, rigid, base, codes, p) if linear else np.empty((0, 0))
    pushed = np.zeros(20)
    work = sensitive_scratch(s, used)
    rows = s.reshape(s.size)
    last = np.array([x[0] - dt * x[2], x[1] - dt * x[3], x[2], x[3]])
    looking_back = lead[0] != 0.0 or lead[1] != 0.0
    last_s = s[:4].copy()
    for ch in range(2):
        for c in range(used):
            last_s[ch, c] -= dt * s[2 + ch, c]
    own = 0
    for e in range(codes.shape[0]):
        own += codes[e, 5]
    remembering = own == 0
    g = np.zeros(G_SIZE)
    slope = np.zeros(1)
    dpar = np.zeros((2, ncol))
    slopes = np.zeros(2)
    # Of the present innovations, and of gain and decay, with the same room for whole vectors.
    d_now = np.zeros((2, used))
    by_gain, by_decay = np.zeros((n, 2, used)), np.zeros((2, used))
    keep = d_states.shape[0] > 0
    correcting = False
    for j in range(n):
        if gain[j, 0] != 0.0 or gain[j, 1] != 0.0:
            correcting = True
    spreading = d_moment.shape[0] > 0
    mapped = out_codes.shape[0] > 0
    moving = d_gain.shape[0] > 0
    if moving:
        for ch in range(2):
            for c in range(ncol):
                by_decay[ch, c] = d_decay[ch, c]
                for j in range(n):
                    by_gain[j, ch, c] = d_gain[j, ch, c]
    for i in range(torque.shape[0]):
        for j in range(n):
            states[i, j] = x[j]
        if keep:
            for j in range(4):
                for c in range(ncol):
                    d_states[i, j, c] = s[j, c]
        for ch in range(2):
            late = lead[ch] != 0.0
            theta = 1.0 + lead[ch] / dt
            shown = x[ch]
            if late:
                shown = within_sample(theta, dt, last[ch], last[2 + ch], x[ch], x[2 + ch])
            if mapped:
                yh = encoder_reading_sensitive(shown, ch, out_codes, p, p_col, slope, ncol, dpar[ch], g)
                slopes[ch] = slope[0]
            else:
                yh = shown
                slopes[ch] = 1.0
            m = measured[i, ch]
            if math.isnan(m):
                innovation[i, ch] = 0.0
                for c in range(used):
                    d_now[ch, c] = 0.0
            else:
                innovation[i, ch] = m - yh
                turned = -slopes[ch]
                for c in range(used):
                    d_now[ch, c] = turned * s[ch, c]
                if late:
                    for c in range(ncol):
                        moved = within_sample(theta, dt, last_s[ch, c], last_s[2 + ch, c], s[ch, c],
                                              s[2 + ch, c])
                        d_now[ch, c] = turned * moved
                if mapped:
                    for c in range(ncol):
                        d_now[ch, c] -= dpar[ch, c]
                if skew_col[ch] >= 0:
                    rate = within_sample_rate(theta, dt, last[ch], last[2 + ch], x[ch], x[2 + ch])
                    d_now[ch, skew_col[ch]] += slopes[ch] * rate
            for c in range(ncol):
                d_innovation[i, ch, c] = d_now[ch, c]
        if correcting:
            e0, e1 = innovation[i, 0], innovation[i, 1]
            for j in range(n):
                g0, g1 = gain[j, 0], gain[j, 1]
                x[j] += g0 * e0 + g1 * e1
                if moving:
                    for c in range(used):
                        s[j, c] += (g0 * d_now[0, c] + g1 * d_now[1, c]
                                    + (by_gain[j, 0, c] * e0 + by_gain[j, 1, c] * e1))
                else:
                    for c in range(used):
                        s[j, c] += g0 * d_now[0, c] + g1 * d_now[1, c]
        if looking_back:
            for j in range(4):
                last[j] = x[j]
                for c in range(used):
                    last_s[j, c] = s[j, c]
        if linear:
            linear_sample_sensitive(x, s, rows, used, i, torque[i], torque_arm[i], matrix, by_base, base_col,
                                    d_torque, driven, pushed)
        else:
            advance_sensitive(x, s, i, t0 + i * dt, dt, substeps, torque[i], torque_arm[i], exogenous[i],
                              rigid, base, codes, p, base_col, p_col, d_torque, driven, remembering, work)
        if spreading:
            # As `spread`, with derivatives.
            jm, bm = base[1], base[2]
            shift = moment[i] / jm
            for k in range(driven.shape[0]):
                d_shift = d_moment[i, k] / jm
                s[0, driven[k]] += d_shift
                s[2, driven[k]] -= bm / jm * d_shift
            if base_col[1] >= 0:
                s[0, base_col[1]] -= shift / jm
                s[2, base_col[1]] += 2.0 * bm / jm * shift / jm
            if base_col[2] >= 0:
                s[2, base_col[2]] -= shift / jm
            spread(x, moment[i], base)
        for c in range(used):
            s[n - 2, c] *= decay[0]
            s[n - 1, c] *= decay[1]
        if moving:
            for c in range(used):
                s[n - 2, c] += by_decay[0, c] * x[n - 2]
                s[n - 1, c] += by_decay[1, c] * x[n - 1]
        x[n - 2] *= decay[0]
        x[n - 1] *= decay[1]


@njit
def innovations_series(x, measured, gain, decay, torque, moment, torque_arm, exogenous, t0, dt, substeps,
                       rigid, base, codes, p, out_codes, lead, innovation, states):
    """The same prediction without derivatives."""
    n = x.shape[0]
    last = np.array([x[0] - dt * x[2], x[1] - dt * x[3], x[2], x[3]])
    z, dz, total = np.zeros(n), np.zeros(n), np.zeros(n)
    linear = codes.shape[0] == 0
    matrix = sample_matrix(dt, substeps, rigid, base, codes, p) if linear else np.empty((0, 0))
    correcting = False
    for j in range(n):
        if gain[j, 0] != 0.0 or gain[j, 1] != 0.0:
            correcting = True
    for i in range(torque.shape[0]):
        for j in range(n):
            states[i, j] = x[j]
        for ch in range(2):
            m = measured[i, ch]
            shown = x[ch]
            if lead[ch] != 0.0:
                shown = within_sample(1.0 + lead[ch] / dt, dt, last[ch], last[2 + ch], x[ch], x[2 + ch])
            innovation[i, ch] = 0.0 if math.isnan(m) else m - encoder_reading(shown, ch, out_codes, p)
        if correcting:
            for j in range(n):
                x[j] += gain[j, 0] * innovation[i, 0] + gain[j, 1] * innovation[i, 1]
        for j in range(4):
            last[j] = x[j]
        if linear:
            linear_sample(x, torque[i], torque_arm[i], matrix)
        else:
            advance(x, t0 + i * dt, dt, substeps, torque[i], torque_arm[i], exogenous[i], rigid, base, codes,
                    p, z, dz, total)
        spread(x, moment[i], base)
        x[n - 2] *= decay[0]
        x[n - 1] *= decay[1]
