"""Compiled: the rates with their exact derivatives.

Joined to `integrator.py`, where state and arrays are described; not imported by itself.
"""

# ruff: noqa: F821
# fmt: off
# pyright: reportUndefinedVariable=false
from __future__ import annotations

# <the text below joins the kernel>


@inner
def rates_sensitive(qm, qa, vm, va, z, moved_motor, moved_arm, t, torque_motor, torque_arm, driving,
                    exogenous, rigid, base, codes, p,
                    base_col, p_col, d_torque, driven, i_torque, stage, dz, by_state, by_parameter,
                    by_start, g):
    """`rates`, and their derivatives into ``by_state[stage]`` (rows, nx) and ``by_parameter[stage]`` (rows,
    columns): rows 2 (motor), 3 (arm) and 4... (own states of effects); the others are trivial. What is zero
    whatever the state is never written: both arrays must come as zeros.  ``by_start[stage]`` (rows, 2):
    derivatives by the angles at the start of the step, through the memories.

    ``base_col``, ``p_col``: column of each parameter or -1; ``d_torque[i_torque]``: derivatives of
    the acting torque by the parameters of the columns ``driven``. Sums are kept in scalars, because every
    parameter but the stiffness enters through one
    effect.
    """
    ks = base[0]
    d = qm - qa
    dv = vm - va
    n = z.shape[0]
    fm = torque_motor
    fa = torque_arm
    tau = ks * d
    rubm = -base[2] * vm
    ruba = -base[4] * va
    facm = 1.0
    faca = 1.0
    jm = base[1]
    ja = base[3]
    # First the factors and inertias, which scale what the others add: the inertias' first and second
    # derivatives by their angles, and how much of all three grows with the structure's inertia.
    bend_m, curve_m, share_m, share_bend_m = 0.0, 0.0, 1.0, 0.0
    bend_a, curve_a, share_a, share_bend_a = 0.0, 0.0, 1.0, 0.0
    first = 0
    for e in range(codes.shape[0]):
        if codes[e, 2] < 2:
            break
        first += 1
        loc = codes[e, 1]
        q, v = (qm, vm) if loc == 0 else (qa, va)
        f = scale(codes[e, 0], q, v, d, ks, t, exogenous, driving, dv, 0.0, 0.0, 0.0, p, codes[e, 3])
        if codes[e, 2] == 2:
            if loc == 0:
                facm *= f
            else:
                faca *= f
            continue
        g[0] = 0.0
        bend = slope_derivatives(codes[e, 0], q, v, d, ks, t, exogenous, driving, dv, 0.0, 0.0, 0.0, p,
                                 codes[e, 3], g)
        if loc == 0:
            w = base[1] if codes[e, 2] == 4 else 1.0
            jm += w * f
            bend_m += w * bend
            curve_m += w * g[0]
            if codes[e, 2] == 4:
                share_m += f
                share_bend_m += bend
        else:
            w = base[3] if codes[e, 2] == 4 else 1.0
            ja += w * f
            bend_a += w * bend
            curve_a += w * g[0]
            if codes[e, 2] == 4:
                share_a += f
                share_bend_a += bend
    im = 1.0 / jm
    fm -= 0.5 * bend_m * vm * vm
    fa -= 0.5 * bend_a * va * va
    ia = 0.0 if rigid else 1.0 / ja
    for r in range(2, 4):
        by_start[stage, r, 0] = 0.0
        by_start[stage, r, 1] = 0.0
    # Derivatives of the torque at the motor and at the arm by own angle and velocity, by deflection and its
    # rate; of the coupling torque by the latter; of each by the stiffness and by what the actuator gives.
    m_q, m_v, m_d, m_k = -0.5 * curve_m * vm * vm, -base[2] * facm - bend_m * vm, 0.0, 0.0
    a_q, a_v, a_d, a_k = -0.5 * curve_a * va * va, -base[4] * faca - bend_a * va, 0.0, 0.0
    t_d, t_v, t_k = ks, 0.0, d
    # Of a map by the motor's own angle and velocity.
    t_q, t_w = 0.0, 0.0
    m_r, a_r = 0.0, 0.0
    m_u, a_u, t_u = 1.0, 0.0, 0.0
    for e in range(first, codes.shape[0]):
        code = codes[e, 0]
        loc = codes[e, 1]
        k = codes[e, 3]
        o = codes[e, 4]
        nz = codes[e, 5]
        npar = codes[e, 6]
        q, v = (qm, vm) if loc == 0 or (loc == 2 and code == MAP) else ((qa, va) if loc == 1 else (d, dv))
        z0 = z[o] if nz > 0 else 0.0
        z1 = z[o + 1] if nz > 1 else 0.0
        way = 0.0
        memory = codes[e, 7]
        moved = 0.0
        s0 = 0.0
        if memory > 0:
            moved = moved_motor if loc == 0 else (moved_arm if loc == 1 else moved_motor - moved_arm)
            s0 = z[o + nz] if memory < 4 else 0.0
            way = direction_of(memory, moved, v, s0, p, k, npar)
        f = torque_derivatives(code, q, v, d, ks, t, exogenous, driving, dv, z0, z1, way, p, k, g)
        slope = 0.0
        keeps = 0.0
        if memory == 4:
            width = p[k + npar - 1]
            bend = g[6] * (1.0 - way * way) / width
            g[1] += bend
            g[FIRST_PARAMETER + npar - 1] -= bend * v / width
        elif memory > 0:
            dm = memory_displacement(memory, p, k, npar)
            side = side_of(moved, v)
            decay = forgotten(moved, dm)
            if decay > 0.0:
                slope = g[6] * (1.0 - s0 * side) * decay / dm
                keeps = g[6] * decay
                by_displacement = keeps * (s0 - side) * abs(moved) / (dm * dm)
                g[0] += slope
                if memory == 2:
                    g[FIRST_PARAMETER] += by_displacement / p[k + 1]
                    g[FIRST_PARAMETER + 1] -= by_displacement * dm / p[k + 1]
                elif memory == 3:
                    g[FIRST_PARAMETER + 1] += by_displacement
                else:
                    g[FIRST_PARAMETER + npar - 2] += by_displacement
        if loc == 0:
            w = 1.0
            if codes[e, 2] == 1:
                rubm += f
                w = facm
            else:
                fm += f
            m_q += w * g[0]
            m_v += w * g[1]
            m_d += w * g[2]
            m_k += w * g[3]
            m_u += w * g[7]
            m_r += w * g[8]
            w *= im
            if 0 < memory < 4:
                by_state[stage, 2, o + nz] = w * keeps
                by_start[stage, 2, 0] -= w * slope
            for i in range(nz):
                by_state[stage, 2, o + i] = w * g[4 + i]
            for i in range(npar):
                if p_col[k + i] >= 0:
                    by_parameter[stage, 2, p_col[k + i]] = w * g[FIRST_PARAMETER + i]
        elif loc == 1:
            w = 1.0
            if codes[e, 2] == 1:
                ruba += f
                w = faca
            else:
                fa += f
            a_q += w * g[0]
            a_v += w * g[1]
            a_d += w * g[2]
            a_k += w * g[3]
            a_u += w * g[7]
            a_r += w * g[8]
            w *= ia
            if 0 < memory < 4:
                by_state[stage, 3, o + nz] = w * keeps
                by_start[stage, 3, 1] -= w * slope
            for i in range(nz):
                by_state[stage, 3, o + i] = w * g[4 + i]
            for i in range(npar):
                if p_col[k + i] >= 0:
                    by_parameter[stage, 3, p_col[k + i]] = w * g[FIRST_PARAMETER + i]
        else:
            tau += f
            if code == MAP:
                t_q += g[0]
                t_w += g[1]
                g[0] = 0.0
                g[1] = 0.0
            t_d += g[0] + g[2]
            t_v += g[1] + g[8]
            t_k += g[3]
            t_u += g[7]
            if 0 < memory < 4:
                by_state[stage, 2, o + nz] = -im * keeps
                by_state[stage, 3, o + nz] = ia * keeps
                by_start[stage, 2, 0] += im * slope
                by_start[stage, 2, 1] -= im * slope
                by_start[stage, 3, 0] -= ia * slope
                by_start[stage, 3, 1] += ia * slope
            for i in range(nz):
                by_state[stage, 2, o + i] = -im * g[4 + i]
                by_state[stage, 3, o + i] = ia * g[4 + i]
            for i in range(npar):
                if p_col[k + i] >= 0:
                    by_parameter[stage, 2, p_col[k + i]] = -im * g[FIRST_PARAMETER + i]
                    by_parameter[stage, 3, p_col[k + i]] = ia * g[FIRST_PARAMETER + i]
        for i in range(nz):
            dz[o + i] = state_rate_derivatives(2 * code + i, q, v, d, ks, t, exogenous, driving, dv, z0, z1,
                                               0.0, p, k, g)
            own_state_row(by_state, by_parameter, stage, o + i, g, loc, o, nz, k, npar, base_col, p_col)
    # Acceleration = force / inertia.
    am = (fm + rubm * facm - (0.0 if rigid else tau)) * im
    aa = (fa + ruba * faca + tau) * ia
    if rigid:
        t_d, t_v, t_k, t_u, t_q, t_w = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    by_state[stage, 2, 0] = (m_q + m_d - t_d - t_q - am * bend_m) * im
    by_state[stage, 2, 1] = (t_d - m_d) * im
    by_state[stage, 2, 2] = (m_v + m_r - t_v - t_w) * im
    by_state[stage, 2, 3] = (t_v - m_r) * im
    by_state[stage, 2, n - 2] = im
    by_state[stage, 3, 0] = (t_d + t_q + a_d) * ia
    by_state[stage, 3, 1] = (a_q - a_d - t_d - aa * bend_a) * ia
    by_state[stage, 3, 2] = (t_v + t_w + a_r) * ia
    by_state[stage, 3, 3] = (a_v - a_r - t_v) * ia
    by_state[stage, 3, n - 1] = ia
    if base_col[0] >= 0:
        by_parameter[stage, 2, base_col[0]] = (m_k - t_k) * im
        by_parameter[stage, 3, base_col[0]] = (a_k + t_k) * ia
    if base_col[1] >= 0:
        by_parameter[stage, 2, base_col[1]] = -(am * share_m + 0.5 * share_bend_m * vm * vm) * im
    if base_col[2] >= 0:
        by_parameter[stage, 2, base_col[2]] = -vm * facm * im
    if base_col[3] >= 0:
        by_parameter[stage, 3, base_col[3]] = -(aa * share_a + 0.5 * share_bend_a * va * va) * ia
    if base_col[4] >= 0:
        by_parameter[stage, 3, base_col[4]] = -va * faca * ia
    for c in range(driven.shape[0]):
        by_parameter[stage, 2, driven[c]] = d_torque[i_torque, c] * (m_u - t_u) * im
        by_parameter[stage, 3, driven[c]] = d_torque[i_torque, c] * (a_u + t_u) * ia
    for e in range(first):
        loc = codes[e, 1]
        k = codes[e, 3]
        q, v = (qm, vm) if loc == 0 else (qa, va)
        f = scale_derivatives(codes[e, 0], q, v, d, ks, t, exogenous, driving, dv, 0.0, 0.0, 0.0, p, k, g)
        if codes[e, 2] == 2:
            others = (facm if loc == 0 else faca) / f if f != 0.0 else 0.0
            weight = (rubm if loc == 0 else ruba) * others
        else:
            weight = -(am if loc == 0 else aa)
        weight *= im if loc == 0 else ia
        if codes[e, 2] == 4:
            weight *= base[1] if loc == 0 else base[3]
        for i in range(codes[e, 6]):
            if p_col[k + i] >= 0:
                by_parameter[stage, 2 + loc, p_col[k + i]] = weight * g[FIRST_PARAMETER + i]
        if codes[e, 2] > 2:
            # Where no slope was generated `g` would keep the values of the inertia itself.
            for i in range(codes[e, 6]):
                g[FIRST_PARAMETER + i] = 0.0
            slope_derivatives(codes[e, 0], q, v, d, ks, t, exogenous, driving, dv, 0.0, 0.0, 0.0, p, k, g)
            speed = vm if loc == 0 else va
            weight = -0.5 * speed * speed * (im if loc == 0 else ia)
            if codes[e, 2] == 4:
                weight *= base[1] if loc == 0 else base[3]
            for i in range(codes[e, 6]):
                if p_col[k + i] >= 0:
                    by_parameter[stage, 2 + loc, p_col[k + i]] += weight * g[FIRST_PARAMETER + i]
    return am, aa


@inner
def own_state_row(by_state, by_parameter, stage, row, g, loc, o, nz, k, npar, base_col, p_col):
    """The row of an effect's own state, from its derivatives ``g`` (see ``codegen.DERIVATIVE_ORDER``)."""
    by_q, by_v, by_d = g[0], g[1], g[2]
    by_state[stage, row, 0] = (by_q if loc != 1 else 0.0) + by_d
    by_state[stage, row, 1] = (by_q if loc == 1 else 0.0) - (by_q if loc == 2 else 0.0) - by_d
    by_state[stage, row, 2] = by_v if loc != 1 else 0.0
    by_state[stage, row, 3] = by_v if loc == 1 else (-by_v if loc == 2 else 0.0)
    for i in range(nz):
        by_state[stage, row, o + i] = g[4 + i]
    if base_col[0] >= 0:
        by_parameter[stage, row, base_col[0]] = g[3]
    for i in range(npar):
        if p_col[k + i] >= 0:
            by_parameter[stage, row, p_col[k + i]] = g[FIRST_PARAMETER + i]
