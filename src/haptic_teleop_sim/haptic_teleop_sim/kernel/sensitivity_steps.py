"""Compiled: one Runge-Kutta step of the sensitivities, from the derivatives of the rates at its four stages.

Joined to `integrator.py`, where state and arrays are described; not imported by itself. The derivatives are
those of the discrete solution: every stage of the state's step is differentiated, so nothing is approximated.
"""

# ruff: noqa: F821
# fmt: off
# pyright: reportUndefinedVariable=false
from __future__ import annotations

# <the text below joins the kernel>


#: Columns of sensitivities, used or not, and rows of derivatives by parameters, for which `step_columns` is
#: compiled: six states of the joint and two memories.
PITCH, ROWS = 32, 8


@inner
def step_columns(s, n, used, h, rigid, a, by_start, b):
    """One Runge-Kutta step of the first ``used`` columns of the sensitivities in place, from the four stages'
    derivatives of the rates: ``a`` by the states (4, n, n), ``by_start`` by the angles at the start of the
    step (4, 4, 2) and ``b`` by the parameters (4, ROWS, PITCH), with the sensitivities of the disturbances in
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
    b0, b1, b2, b3 = 2 * PITCH, (2 + ROWS) * PITCH, (2 + 2 * ROWS) * PITCH, (2 + 3 * ROWS) * PITCH
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
    if n <= ROWS and s.shape[1] == PITCH:
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
