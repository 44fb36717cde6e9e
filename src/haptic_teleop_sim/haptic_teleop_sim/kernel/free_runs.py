"""Compiled: where the free simulation of each window of a recording has to start.

Like `integrator.py` this text is not imported by itself: `build.py` joins it to the kernel of the present
effects and to the compiled functions of the control package. A recording is cut into hundreds of short
windows, and handing each of them over from Python would take several times as long as to compute it.

A *mechanics* is a model without its actuator, as the tuple made by `free_simulation.py`: dt, sub-steps,
rigid, base, codes, p, out_codes, lead (see `integrator.py` and `prediction.py`); moved (2,): whole samples by
which readings are moved ahead for a delay; follows (nx,): 1.0 for the effects' own states that begin as the
arm's velocity.

A *goal* is what the response should come near to, and how it counts: weights (2,) of the errors of both
angles, 1/rad; rate_weights (2,) of those of their rates, s/rad, 0.0 for a rate that does not count; whether
rates are `filtered`, and the coefficients of the recording's velocity filter; rates are differences where
they are not.
"""

# ruff: noqa: F821
# fmt: off
# pyright: reportUndefinedVariable=false
from __future__ import annotations

import math

import numpy as np

from haptic_teleop_control.compiled import njit
from haptic_teleop_control.filters import velocity_of

# <functions of the kernel are imported here>

#: A weighted error beyond this is just very wrong.
HUGE = 1e6
#: Where a response misses by more than the spread, the first part of it that is looked at, and how much
#: longer each next one is; no part has fewer samples than SHORTEST.
PARTS, GROWTH, SHORTEST = 64, 4, 50


@inner
def bounded(value):
    """The value; HUGE where it is none, or beyond."""
    if math.isnan(value) or value > HUGE:
        return HUGE
    return max(value, -HUGE)


@njit
def last_reading(read, moved, found):
    """The sample of the reading that each sample of both encoders (``read`` (n, 2): whether there is one)
    still has, into ``found`` (n, 2); the first one before there is any, 0 where there is none.

    ``moved`` (2,): the samples by which the model moves readings ahead for a delay, so that its prediction
    begins or ends without them. There it has no error, and the step to the next one would be a speed.
    """
    n = read.shape[0]
    for channel in range(2):
        latest = first = -1
        for i in range(n):
            source = i + moved[channel]
            if 0 <= source < n and read[source, channel]:
                latest = i
                if first < 0:
                    first = i
            found[i, channel] = latest
        for i in range(n):
            if found[i, channel] < 0:
                found[i, channel] = max(first, 0)


@njit
def weigh(innovation, sensitivity, columns, held, goal, dt, memory, errors):
    """Weighted errors of angles and rates into column 0 of ``errors``, their derivatives by as many
    ``columns`` of ``sensitivity`` into the next ones; the number of rows.

    held (m, 2): see `last_reading`. memory (2 (1 + columns) at least, 3): of the velocity filter.
    """
    weights, rate_weights, filtered, coefficients = goal
    m = innovation.shape[0]
    for i in range(m):
        for channel in range(2):
            errors[2 * i + channel, 0] = bounded(weights[channel] * innovation[i, channel])
            for c in range(columns):
                errors[2 * i + channel, 1 + c] = bounded(weights[channel] * sensitivity[i, channel, c])
    rows, each = 2 * m, 1 + columns
    for i in range(m):
        earlier, later = max(i - 1, 0), min(i + 1, m - 1)
        row = 2 * m + i
        for channel in range(2):
            if rate_weights[channel] > 0.0:
                for c in range(each):
                    if filtered:
                        j = channel * each + c
                        now = error_at(held[i, channel], channel, c, innovation, sensitivity)
                        if i == 0:
                            # The filter begins at rest: where the recording's own began does not matter,
                            # because errors of angles go through it.
                            memory[j, 0], memory[j, 1], memory[j, 2] = now, 0.0, now
                        rate = velocity_of(now, memory, j, coefficients)
                    else:
                        before = error_at(held[earlier, channel], channel, c, innovation, sensitivity)
                        after = error_at(held[later, channel], channel, c, innovation, sensitivity)
                        rate = (after - before) / (dt * max(later - earlier, 1))
                    errors[row, c] = bounded(rate_weights[channel] * rate)
                row += m
    for channel in range(2):
        if rate_weights[channel] > 0.0:
            rows += m
    return rows


@inner
def error_at(at, channel, c, innovation, sensitivity):
    """Error of an angle at the sample ``at``; its derivative by column c - 1 where c is not 0."""
    return innovation[at, channel] if c == 0 else sensitivity[at, channel, c - 1]


@inner
def read_alike(read, others, m):
    """Whether the same of the first ``m`` samples were read of both encoders."""
    alike = True
    for i in range(m):
        alike = alike and read[i, 0] == others[i, 0] and read[i, 1] == others[i, 1]
    return alike


@inner
def half_square(errors, rows):
    """Half the sum of squares of the errors."""
    total = 0.0
    for i in range(rows):
        total += errors[i, 0] * errors[i, 0]
    return 0.5 * total


@inner
def begin(state, follows, x):
    """The state vector ``x`` (nx,) that belongs to angles and velocities (4,)."""
    for j in range(x.shape[0]):
        x[j] = state[j] if j < 4 else follows[j] * state[3]


@njit
def newton_step(errors, rows, free, damping, slopes, step):
    """The damped Gauss-Newton step into ``step`` (free,) of the errors and derivatives in the first ``rows``,
    and by how much it should lessen half the sum of squares. slopes: scratch (3, 4, 4)."""
    information, lessened = slopes[0], slopes[1]
    gradient, scale = slopes[2, 0], slopes[2, 1]
    for a in range(free):
        gradient[a] = 0.0
        for b in range(free):
            information[a, b] = 0.0
    for i in range(rows):
        for a in range(free):
            slope = errors[i, 1 + a]
            gradient[a] += slope * errors[i, 0]
            for b in range(a + 1):
                information[a, b] += slope * errors[i, 1 + b]
    for a in range(free):
        scale[a] = math.sqrt(max(information[a, a], 1e-300))
        for b in range(a):
            information[b, a] = information[a, b]
    for a in range(free):
        step[a] = -gradient[a] / scale[a]
        for b in range(free):
            lessened[a, b] = information[a, b] / (scale[a] * scale[b])
        lessened[a, a] += damping
    # Gauss' elimination without exchange: the matrix is positive definite.
    for a in range(free):
        for b in range(a + 1, free):
            factor = lessened[b, a] / lessened[a, a]
            for c in range(a, free):
                lessened[b, c] -= factor * lessened[a, c]
            step[b] -= factor * step[a]
    for a in range(free - 1, -1, -1):
        for b in range(a + 1, free):
            step[a] -= lessened[a, b] * step[b]
        step[a] /= lessened[a, a]
    for a in range(free):
        step[a] /= scale[a]
    expected = 0.0
    for a in range(free):
        expected -= gradient[a] * step[a]
        for b in range(free):
            expected -= 0.5 * step[a] * information[a, b] * step[b]
    return expected


@njit
def nearest_starts(spans, states, angles, torque, exogenous, t0, mechanics, goal, enough, most_trials,
                   s):
    """Where the free response over each window (``spans`` (windows, 2)) comes nearest to the measured
    ``angles`` (n, 2), rad, NaN where missing: damped Gauss-Newton with the exact sensitivities of the
    response.

    ``states`` (windows, 4): angles and velocities of motor and arm from where to search, and in place what
    was found. ``enough``: relative gain of the sum of squares that is not worth another response. ``s``:
    room (nx, columns) for the sensitivities of the state, see `predict.py`.
    """
    dt, substeps, rigid, base, codes, p, out_codes, lead, moved, follows = mechanics
    nx = follows.shape[0]
    free = 2 if rigid else 4
    longest = 0
    for w in range(spans.shape[0]):
        longest = max(longest, spans[w, 1] - spans[w, 0])
    # What `predict_series` asks besides: nothing corrects, and nothing but the start is free.
    decay, gain, no_gains, no_decays = np.ones(2), np.zeros((nx, 2)), np.empty((0, 2, 0)), np.empty((2, 0))
    no_torques, no_moments, driven = np.empty((longest, 0)), np.empty((0, 0)), np.empty(0, dtype=np.int64)
    base_col, p_col = np.full(5, -1, dtype=np.int64), np.full(p.shape[0], -1, dtype=np.int64)
    skew_col, nothing = np.full(2, -1, dtype=np.int64), np.zeros(longest)
    no_states = np.empty((0, 4, free))
    x = np.zeros(nx)
    measured, innovation = np.empty((longest, 2)), np.empty((longest, 2))
    sensitivity, visited = np.empty((longest, 2, free)), np.empty((longest, nx))
    read, held = np.empty((longest, 2), dtype=np.bool_), np.zeros((longest, 2), dtype=np.int64)
    memory, slopes, step = np.zeros((2 * (1 + free), 3)), np.empty((3, 4, 4)), np.empty(4)
    errors, missed = np.empty((4 * longest, 1 + free)), np.empty((4 * longest, 1))
    state, trial = np.empty(4), np.empty(4)
    # Where nothing bends, the response has the same derivatives from every start and in every window of as
    # many samples, of which the same were read: they are computed once.
    straight = codes.shape[0] == 0 and out_codes.shape[0] == 0
    known, known_read = -1, np.empty((longest, 2), dtype=np.bool_)
    for w in range(spans.shape[0]):
        start, when = spans[w, 0], t0 + dt * spans[w, 0]
        length = spans[w, 1] - start
        for j in range(4):
            state[j] = states[w, j]
        m, tries, begun, ended = length, most_trials, False, False
        cost, at_first = -1.0, -1.0
        while not ended:
            stop = start + m
            for i in range(m):
                for channel in range(2):
                    read[i, channel] = not math.isnan(angles[start + i, channel])
                    source = i + moved[channel]
                    measured[i, channel] = angles[start + source, channel] if 0 <= source < m else np.nan
            last_reading(read[:m], moved, held)
            rows, cost, damping, fresh, renew = 0, -1.0, 1e-9, True, True
            ran_away = False
            for _ in range(tries):
                if renew and known == m and read_alike(read, known_read, m):
                    begin(state, follows, x)
                    innovations_series(x, measured[:m], gain, decay, torque[start:stop], nothing[:m],
                                       nothing[:m], exogenous[start:stop], when, dt, substeps, rigid, base,
                                       codes, p, out_codes, lead, innovation[:m], visited[:m])
                    rows = weigh(innovation[:m], sensitivity, 0, held, goal, dt, memory, missed)
                    for i in range(rows):
                        errors[i, 0] = missed[i, 0]
                    cost = half_square(errors, rows) if cost < 0.0 else cost
                elif renew:
                    begin(state, follows, x)
                    for j in range(nx):
                        for c in range(s.shape[1]):
                            s[j, c] = 0.0
                        s[j, free - 1] = 0.0 if rigid else follows[j]
                    for c in range(free):
                        s[2 * c if rigid else c, c] = 1.0
                    predict_series(x, s, measured[:m], gain, no_gains, decay, no_decays, torque[start:stop],
                                   no_torques[:m], nothing[:m], no_moments, driven, nothing[:m],
                                   exogenous[start:stop], when, dt, substeps, rigid, base, codes, p, base_col,
                                   p_col, out_codes, skew_col, lead, innovation[:m], sensitivity[:m],
                                   visited[:m], no_states)
                    rows = weigh(innovation[:m], sensitivity, free, held, goal, dt, memory, errors)
                    cost = half_square(errors, rows) if cost < 0.0 else cost
                    if straight:
                        known = m
                        for i in range(m):
                            known_read[i, 0], known_read[i, 1] = read[i, 0], read[i, 1]
                if not begun and not straight and m > SHORTEST and not cost < 0.5 * rows:
                    ran_away = True
                    break
                begun = True
                expected = newton_step(errors, rows, free, damping, slopes, step)
                # Derivatives of one step before that have kept their promise tell what is left to gain.
                if not renew and not fresh and expected < enough * cost:
                    break
                for j in range(4):
                    trial[j] = state[j]
                for c in range(free):
                    trial[2 * c if rigid else c] += step[c]
                begin(trial, follows, x)
                innovations_series(x, measured[:m], gain, decay, torque[start:stop], nothing[:m], nothing[:m],
                                   exogenous[start:stop], when, dt, substeps, rigid, base, codes, p,
                                   out_codes, lead, innovation[:m], visited[:m])
                weigh(innovation[:m], sensitivity, 0, held, goal, dt, memory, missed)
                gained = cost - half_square(missed, rows)
                if gained > 0.0:
                    cost -= gained
                    damping = max(damping / 30.0, 1e-9)
                    for j in range(4):
                        state[j] = trial[j]
                    for i in range(rows):
                        errors[i, 0] = missed[i, 0]
                if fresh and (expected < enough * cost or 0.0 < gained < enough * cost):
                    break
                # The derivatives hardly change on the way, and cost several responses: they are kept while
                # they keep their promise.
                renew = False
                if gained > 0.5 * expected and gained > enough * cost:
                    fresh = straight
                elif fresh and gained <= 0.0:
                    damping = max(30.0 * damping, 1e-4)
                else:
                    renew = fresh = True
            if ran_away:
                # From where it was measured to be the response runs away: what a short part of it says is
                # where the next longer one begins. What runs away from there, too, hardly ever comes back.
                at_first = cost
                m, tries, begun = max(length // PARTS, SHORTEST), max(most_trials // 3, 1), True
            elif m < length:
                m = min(GROWTH * m, length)
            else:
                ended = True
        if at_first < 0.0 or cost < at_first:
            for j in range(4):
                states[w, j] = state[j]


@njit
def respond(spans, states, torque, exogenous, t0, mechanics, out):
    """The states (n, nx) of the free response over each window from its ``states`` (windows, 4), into
    ``out``."""
    dt, substeps, rigid, base, codes, p, out_codes, lead, moved, follows = mechanics
    x, nothing = np.zeros(follows.shape[0]), np.zeros(torque.shape[0])
    for w in range(spans.shape[0]):
        start, stop = spans[w, 0], spans[w, 1]
        begin(states[w], follows, x)
        simulate_series(x, torque[start:stop], nothing[start:stop], nothing[start:stop],
                        exogenous[start:stop], t0 + dt * start, dt, substeps, rigid, base, codes, p,
                        out[start:stop])
