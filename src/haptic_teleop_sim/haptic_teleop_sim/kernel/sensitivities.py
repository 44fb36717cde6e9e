"""Compiled: the rates with their exact derivatives, and one Runge-Kutta step of the sensitivities.

Joined to `integrator.py`, where state and arrays are described; not imported by itself. The derivatives are
those of the discrete solution: every stage of the state's step is differentiated, so nothing is approximated.
"""

# ruff: noqa: F821
# fmt: off
# pyright: reportUndefinedVariable=false
from __future__ import annotations

# <the text below joins the kernel>


#: Columns for which sensitivities have room (`predict.ROOM`).
PITCH = 32


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


@inner
def step_columns(s, n, used, h, rigid, a, by_start, b):
    """One Runge-Kutta step of the first ``used`` columns of the sensitivities in place, from the four stages'
    derivatives of the rates: ``a`` by the states (4, n, n), ``by_start`` by the angles at the start of the
    step (4, 4, 2) and ``b`` by the parameters (4, 8, PITCH), with the sensitivities of the disturbances in
    its first two rows. ``s`` (n, PITCH) and ``b`` lie row after row. Of the n states two at most are memories
    of effects, whose other states none has.

    The variational equation is linear, so its stages need the states of each stage only through these. Column
    by column in scalars, which compilers turn into vectors over the columns where they see that no two rows
    overlap: every place of a row is a constant here, and the number of columns is none. What all columns
    share is read before, or it might be another number after each for all that compilers know.
    """
    half = 0.5 * h
    sixth = h / 6.0
    arm = 0.0 if rigid else 1.0
    m = n - 2
    one, two = 1.0 if n > 6 else 0.0, 1.0 if n > 7 else 0.0
    b0, b1, b2, b3 = 2 * PITCH, 10 * PITCH, 18 * PITCH, 26 * PITCH
    a020, a021, a022, a023, a024 = a[0, 2, 0], a[0, 2, 1], a[0, 2, 2], a[0, 2, 3], a[0, 2, m]
    a030, a031, a032, a033, a034 = a[0, 3, 0], a[0, 3, 1], a[0, 3, 2], a[0, 3, 3], a[0, 3, n - 1]
    a120, a121, a122, a123, a124 = a[1, 2, 0], a[1, 2, 1], a[1, 2, 2], a[1, 2, 3], a[1, 2, m]
    a130, a131, a132, a133, a134 = a[1, 3, 0], a[1, 3, 1], a[1, 3, 2], a[1, 3, 3], a[1, 3, n - 1]
    a220, a221, a222, a223, a224 = a[2, 2, 0], a[2, 2, 1], a[2, 2, 2], a[2, 2, 3], a[2, 2, m]
    a230, a231, a232, a233, a234 = a[2, 3, 0], a[2, 3, 1], a[2, 3, 2], a[2, 3, 3], a[2, 3, n - 1]
    a320, a321, a322, a323, a324 = a[3, 2, 0], a[3, 2, 1], a[3, 2, 2], a[3, 2, 3], a[3, 2, m]
    a330, a331, a332, a333, a334 = a[3, 3, 0], a[3, 3, 1], a[3, 3, 2], a[3, 3, 3], a[3, 3, n - 1]
    c020, c021, e020, e021 = by_start[0, 2, 0], by_start[0, 2, 1], one * a[0, 2, 4], two * a[0, 2, 5]
    c030, c031, e030, e031 = by_start[0, 3, 0], by_start[0, 3, 1], one * a[0, 3, 4], two * a[0, 3, 5]
    c120, c121, e120, e121 = by_start[1, 2, 0], by_start[1, 2, 1], one * a[1, 2, 4], two * a[1, 2, 5]
    c130, c131, e130, e131 = by_start[1, 3, 0], by_start[1, 3, 1], one * a[1, 3, 4], two * a[1, 3, 5]
    c220, c221, e220, e221 = by_start[2, 2, 0], by_start[2, 2, 1], one * a[2, 2, 4], two * a[2, 2, 5]
    c230, c231, e230, e231 = by_start[2, 3, 0], by_start[2, 3, 1], one * a[2, 3, 4], two * a[2, 3, 5]
    c320, c321, e320, e321 = by_start[3, 2, 0], by_start[3, 2, 1], one * a[3, 2, 4], two * a[3, 2, 5]
    c330, c331, e330, e331 = by_start[3, 3, 0], by_start[3, 3, 1], one * a[3, 3, 4], two * a[3, 3, 5]
    for c in range(used):
        q0, q1, v0, v1 = s[c], s[PITCH + c], s[2 * PITCH + c], s[3 * PITCH + c]
        w0, w1 = b[c], b[PITCH + c]
        f02, f03, f12, f13 = b[b0 + c], b[b0 + PITCH + c], b[b1 + c], b[b1 + PITCH + c]
        f22, f23, f32, f33 = b[b2 + c], b[b2 + PITCH + c], b[b3 + c], b[b3 + PITCH + c]
        # Memories are held over the step: they push like parameters, and so does where the angles were at its
        # start.
        z0, z1 = s[4 * PITCH + c], s[5 * PITCH + c]
        f02 += c020 * q0 + c021 * q1 + e020 * z0 + e021 * z1
        f03 += c030 * q0 + c031 * q1 + e030 * z0 + e031 * z1
        f12 += c120 * q0 + c121 * q1 + e120 * z0 + e121 * z1
        f13 += c130 * q0 + c131 * q1 + e130 * z0 + e131 * z1
        f22 += c220 * q0 + c221 * q1 + e220 * z0 + e221 * z1
        f23 += c230 * q0 + c231 * q1 + e230 * z0 + e231 * z1
        f32 += c320 * q0 + c321 * q1 + e320 * z0 + e321 * z1
        f33 += c330 * q0 + c331 * q1 + e330 * z0 + e331 * z1
        k0 = v0
        k1 = v1 * arm
        k2 = a020 * q0 + a021 * q1 + a022 * v0 + a023 * v1 + a024 * w0 + f02
        k3 = a030 * q0 + a031 * q1 + a032 * v0 + a033 * v1 + a034 * w1 + f03
        y0, y1, y2, y3 = q0 + half * k0, q1 + half * k1, v0 + half * k2, v1 + half * k3
        l0 = y2
        l1 = y3 * arm
        l2 = a120 * y0 + a121 * y1 + a122 * y2 + a123 * y3 + a124 * w0 + f12
        l3 = a130 * y0 + a131 * y1 + a132 * y2 + a133 * y3 + a134 * w1 + f13
        y0, y1, y2, y3 = q0 + half * l0, q1 + half * l1, v0 + half * l2, v1 + half * l3
        m0 = y2
        m1 = y3 * arm
        m2 = a220 * y0 + a221 * y1 + a222 * y2 + a223 * y3 + a224 * w0 + f22
        m3 = a230 * y0 + a231 * y1 + a232 * y2 + a233 * y3 + a234 * w1 + f23
        y0, y1, y2, y3 = q0 + h * m0, q1 + h * m1, v0 + h * m2, v1 + h * m3
        n0 = y2
        n1 = y3 * arm
        n2 = a320 * y0 + a321 * y1 + a322 * y2 + a323 * y3 + a324 * w0 + f32
        n3 = a330 * y0 + a331 * y1 + a332 * y2 + a333 * y3 + a334 * w1 + f33
        s[c] = q0 + sixth * (k0 + 2.0 * l0 + 2.0 * m0 + n0)
        s[PITCH + c] = q1 + sixth * (k1 + 2.0 * l1 + 2.0 * m1 + n1)
        s[2 * PITCH + c] = v0 + sixth * (k2 + 2.0 * l2 + 2.0 * m2 + n2)
        s[3 * PITCH + c] = v1 + sixth * (k3 + 2.0 * l3 + 2.0 * m3 + n3)


@called
def step_sensitivities(s, rows, used, h, rigid, by_state, by_start, by_parameter, flat, stage, total, rate):
    """One step of the first ``used`` columns of ``s`` (n, columns) in place, where effects have no own states
    but memories: `step_columns`, or where it has no room `step_many_sensitivities`, whose scratch comes last.
    ``rows`` and ``flat`` are ``s`` and ``by_parameter`` row after row."""
    n = s.shape[0]
    if n < 9 and s.shape[1] == PITCH:
        for c in range(used):
            flat[c], flat[PITCH + c] = s[n - 2, c], s[n - 1, c]
        step_columns(rows, n, used, h, rigid, by_state, by_start, flat)
    else:
        step_many_sensitivities(s, used, h, rigid, by_state, by_parameter, by_start, stage, total, rate)


@called
def step_many_sensitivities(s, ncol, h, rigid, by_state, by_parameter, by_start, stage, total, rate):
    """One step of the first ``ncol`` columns with any number of own states; ``stage``, ``total`` and
    ``rate`` (nx, columns) are scratch."""
    n = s.shape[0]
    rows = n - 2
    for j in range(n):
        for c in range(ncol):
            stage[j, c] = s[j, c]
            total[j, c] = s[j, c]
    for k in range(4):
        for c in range(ncol):
            rate[0, c] = stage[2, c]
            rate[1, c] = 0.0 if rigid else stage[3, c]
        for r in range(2, rows):
            for c in range(ncol):
                rate[r, c] = by_parameter[k, r, c]
            if r < 4:
                for c in range(ncol):
                    rate[r, c] += by_start[k, r, 0] * s[0, c] + by_start[k, r, 1] * s[1, c]
            for j in range(n):
                factor = by_state[k, r, j]
                if factor != 0.0:
                    for c in range(ncol):
                        rate[r, c] += factor * stage[j, c]
        weight = h / 6.0 if k == 0 or k == 3 else h / 3.0
        ahead = h if k == 2 else 0.5 * h
        for r in range(rows):
            for c in range(ncol):
                total[r, c] += weight * rate[r, c]
                stage[r, c] = s[r, c] + ahead * rate[r, c]
    for r in range(rows):
        for c in range(ncol):
            s[r, c] = total[r, c]


@inner
def update_memories_sensitive(x, moved_motor, moved_arm, s, ncol, began, codes, p, p_col):
    """Memories and their sensitivities at the end of a step; ``began`` (2, columns): the angles' rows before
    it.
    """
    for e in range(codes.shape[0]):
        kind = codes[e, 7]
        if 0 < kind < 4:
            loc = codes[e, 1]
            k = codes[e, 3]
            if loc == 0:
                moved, v = moved_motor, x[2]
            elif loc == 1:
                moved, v = moved_arm, x[3]
            else:
                moved, v = moved_motor - moved_arm, x[2] - x[3]
            i = codes[e, 4] + codes[e, 5]
            npar = codes[e, 6]
            d = memory_displacement(kind, p, k, npar)
            side = side_of(moved, v)
            decay = forgotten(moved, d)
            slope = (1.0 - x[i] * side) * decay / d
            by_displacement = (x[i] - side) * decay * abs(moved) / (d * d)
            for c in range(ncol):
                way = s[loc % 2, c] - began[loc % 2, c]
                if loc == 2:
                    way -= s[1, c] - began[1, c]
                s[i, c] = decay * s[i, c] + slope * way
            if kind == 2:
                if p_col[k] >= 0:
                    s[i, p_col[k]] += by_displacement / p[k + 1]
                if p_col[k + 1] >= 0:
                    s[i, p_col[k + 1]] -= by_displacement * d / p[k + 1]
            elif kind == 3 and p_col[k + 1] >= 0:
                s[i, p_col[k + 1]] += by_displacement
            elif kind == 1 and p_col[k + npar - 2] >= 0:
                s[i, p_col[k + npar - 2]] += by_displacement
            x[i] = side + (x[i] - side) * decay
