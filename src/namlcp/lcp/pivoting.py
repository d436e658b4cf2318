"""Block principal pivoting inside a proximal loop: the exact finish of method="auto".

Every unknown is at its lower bound (state -1), at its upper bound (1) or free (0). With
the bounded ones fixed, the free ones solve (A_FF + rho I) z_F = rhs; whoever has the
wrong sign then changes state: all of them (Judice and Pires, Computers Ops Res 21 (1994)
587-596), or only the last one (Murty 1974) when nothing else makes progress, which ends
after finitely many steps for every P-matrix. The proximal loop around it (centre c, rho
relative to the unit diagonal) carries singular matrices and refines the others.

The problem is scaled to a unit diagonal. `begin` and `advance` are one compiled call
each and come back to Python only with a reason: see the codes.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from namlcp.lcp.faces import (
    INDEFINITE,
    REGULAR,
    Ordering,
    analyse,
    refactor,
    solve_face,
)
from namlcp.lcp.matrix import Columns, add_column, add_product, scale

# Why `begin` and `advance` return.
GO_ON = -1  # never returned
SOLVED = 0
MORE = 1  # the budget of factorisations is used up
PATH = 2  # stagnated: follow the path, then come back
FACE = 3  # the caller is to solve the face system: right side in RHS, answer to Z
RAY = 4  # RHS may be a direction that proves that there is no solution
STUCK = 5  # nothing else to try

# Places in `Iterate.count`.
FACTORED, OUTER, FEWEST, PATIENCE, STALE, PATHED, OUTSIDE = range(7)
# Places in `Iterate.number`.
RHO, TOLERANCE, SIZE, EPS_ABS, EPS_REL, BEST, MET = range(7)
# Rows of `Iterate.vectors`.
Z, W, CENTRE, BEST_Z, RHS, SHIFT, WL, WU = range(8)

OMEGA = 1.4
SWEEPS = 30
STILL = 3
BLOCK_STEPS = 3
import os; LEAST_RHO = float(os.environ.get("LR","1e-8"))
MOST_RHO = 1.0
OUTER_STEPS = 200
EXACT = 1e-15


class Problem(NamedTuple):
    """Box LCP scaled by d to a unit diagonal; where that failed d = 1, unit = False."""

    columns: Columns
    symmetric: bool
    q: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    d: np.ndarray
    unit: np.ndarray


class Iterate(NamedTuple):
    """All that changes: vectors, states and where each would go, scalars, the order."""

    vectors: np.ndarray
    state: np.ndarray
    goal: np.ndarray
    count: np.ndarray
    number: np.ndarray
    ordering: Ordering


@njit(cache=True, nogil=True)
def residuals(problem, z, w):
    """Return Res of the scaled problem and of the user's."""
    lower, upper, d = problem.lower, problem.upper, problem.d
    scaled = 0.0
    plain = 0.0
    for i in range(z.size):
        r = z[i] - min(max(z[i] - w[i], lower[i]), upper[i])
        scaled += r * r
        z_i = d[i] * z[i]
        r = z_i - min(max(z_i - w[i] / d[i], lower[i] * d[i]), upper[i] * d[i])
        plain += r * r
    return np.sqrt(scaled), np.sqrt(plain)


@njit(cache=True, nogil=True)
def evaluate(problem, z, w):
    """Write A z + q to w."""
    w[:] = problem.q
    add_product(problem.columns, z, w)


@njit(cache=True, nogil=True)
def set_states(problem, z, w, state):
    """Guess the state of every unknown from z - w."""
    lower, upper = problem.lower, problem.upper
    for i in range(z.size):
        s = z[i] - w[i]
        state[i] = -1 if s <= lower[i] else (1 if s >= upper[i] else 0)


@njit(cache=True, nogil=True)
def relax(problem, z, w, state):
    """Sweep by projected SOR in residual form: w = A z + q is kept, not computed.

    An unknown that stays at its bound costs no more than its test. Ends after `SWEEPS`,
    or once the states stood still.
    """
    lower, upper = problem.lower, problem.upper
    still = 0
    for _ in range(SWEEPS):
        still += 1
        for i in range(z.size):
            if problem.unit[i]:
                t = min(max(z[i] - OMEGA * w[i], lower[i]), upper[i])
                if t != z[i]:
                    add_column(problem.columns, i, t - z[i], w)
                    z[i] = t
            s = z[i] - w[i]
            guess = -1 if s <= lower[i] else (1 if s >= upper[i] else 0)
            if guess != state[i]:
                state[i] = guess
                still = 0
        if still >= STILL:
            break


@njit(cache=True, nogil=True)
def record(problem, it):
    """Judge z, w, keep z if it is the best so far; return whether it improved much."""
    scaled, plain = residuals(problem, it.vectors[Z], it.vectors[W])
    number = it.number
    improved = scaled < 0.25 * number[BEST]
    if scaled < number[BEST]:
        number[BEST] = scaled
        it.vectors[BEST_Z] = it.vectors[Z]
        met = scaled <= number[EPS_REL] * number[SIZE] or plain < number[EPS_ABS]
        number[MET] = 1.0 if met else 0.0
    return improved


@njit(cache=True, nogil=True)
def mark(problem, it):
    """Write to `goal` the state each unknown belongs to; return how many are wrong."""
    z, w, centre = it.vectors[Z], it.vectors[W], it.vectors[CENTRE]
    lower, upper, state, goal = problem.lower, problem.upper, it.state, it.goal
    rho, tolerance = it.number[RHO], it.number[TOLERANCE]
    wrong = 0
    for i in range(z.size):
        goal[i] = state[i]
        if state[i] == 0:
            if z[i] < lower[i] - tolerance:
                goal[i] = -1
            elif z[i] > upper[i] + tolerance:
                goal[i] = 1
        elif lower[i] < upper[i]:
            if state[i] * (w[i] + rho * (z[i] - centre[i])) > tolerance:
                goal[i] = 0
        wrong += goal[i] != state[i]
    return wrong


@njit(cache=True, nogil=True)
def may_be_ray(problem, v):
    """Tell whether v, scaled here to max|v| = 1, looks like a Farkas direction."""
    lower, upper, q = problem.lower, problem.upper, problem.q
    v /= np.max(np.abs(v))
    for i in range(v.size):
        if abs(v[i]) <= 1e-9:
            v[i] = 0.0
        elif (v[i] > 0.0 and upper[i] < np.inf) or (v[i] < 0.0 and lower[i] > -np.inf):
            return False
    if not np.sum(q * v) < -1e-9 * np.max(np.abs(q)):
        return False
    Av = np.zeros(v.size)
    add_product(problem.columns, v, Av)
    for i in range(v.size):
        # A'v = -A v in the monotone unsymmetric case, both 0 in the symmetric one.
        if Av[i] < -1e-9 or (problem.symmetric and Av[i] > 1e-9):
            return False
    return True


@njit(cache=True, nogil=True)
def restart(it, rho):
    """Count wrong signs afresh, with this rho."""
    count = it.count
    count[FEWEST] = it.state.size + 1
    count[PATIENCE] = BLOCK_STEPS
    if rho != it.number[RHO]:
        it.number[RHO] = rho
        count[STALE] = 1


@njit(cache=True, nogil=True)
def close_outer(problem, it):
    """End an outer step: no sign is wrong. Return a code; GO_ON starts the next."""
    z, w, centre = it.vectors[Z], it.vectors[W], it.vectors[CENTRE]
    count, number = it.count, it.number
    clipped = False
    for i in range(z.size):
        t = min(max(z[i], problem.lower[i]), problem.upper[i])
        clipped |= t != z[i]
        z[i] = t
    if clipped:
        evaluate(problem, z, w)
    improved = record(problem, it)
    count[OUTER] += 1
    rho = number[RHO]
    exact = number[BEST] <= EXACT * number[SIZE]
    if number[MET] and (exact or rho == 0.0 or not improved):
        return SOLVED
    if count[OUTER] >= OUTER_STEPS:
        return STUCK
    v = it.vectors[RHS]
    v[:] = z - centre
    centre[:] = z
    if rho == 0.0:
        restart(it, LEAST_RHO)
    elif rho > LEAST_RHO:
        restart(it, max(0.01 * rho, LEAST_RHO))
    else:
        restart(it, rho)
    if count[OUTER] >= 3 and rho > 0.0 and may_be_ray(problem, v):
        return RAY
    return GO_ON


@njit(cache=True, nogil=True)
def flip(problem, it, wrong):
    """Change states towards `goal`: all, or when that stagnates as the module says."""
    count, number, state = it.count, it.number, it.state
    if wrong < count[FEWEST]:
        count[FEWEST] = wrong
        count[PATIENCE] = BLOCK_STEPS
    elif count[PATIENCE] > 0:
        count[PATIENCE] -= 1
    elif not count[PATHED]:
        return PATH
    elif problem.symmetric and number[RHO] < MOST_RHO:
        restart(it, min(1000.0 * number[RHO], MOST_RHO))
        centre = it.vectors[CENTRE]
        evaluate(problem, centre, it.vectors[W])
        set_states(problem, centre, it.vectors[W], state)
        count[STALE] = 1
        return GO_ON
    else:
        last = state.size - 1
        while it.goal[last] == state[last]:
            last -= 1
        state[last] = it.goal[last]
        count[STALE] = 1
        return GO_ON
    state[:] = it.goal
    count[STALE] = 1
    return GO_ON


@njit(cache=True, nogil=True)
def judge(problem, it):
    """With the face system solved, flip what is wrong or end the outer step."""
    evaluate(problem, it.vectors[Z], it.vectors[W])
    if not np.isfinite(np.sum(it.vectors[W])):
        if it.number[RHO] >= LEAST_RHO:
            return STUCK
        it.vectors[CENTRE] = it.vectors[BEST_Z]
        restart(it, LEAST_RHO)
        return GO_ON
    wrong = mark(problem, it)
    if wrong == 0:
        return close_outer(problem, it)
    if it.number[MET]:
        return SOLVED
    return flip(problem, it, wrong)


@njit(cache=True, nogil=True)
def set_face(problem, it):
    """Put bounded unknowns at their bounds, write the right side of the face system."""
    z, centre, rhs = it.vectors[Z], it.vectors[CENTRE], it.vectors[RHS]
    state, rho = it.state, it.number[RHO]
    rhs[:] = problem.q
    for i in range(z.size):
        z[i] = 0.0
        if state[i] != 0:
            z[i] = problem.lower[i] if state[i] < 0 else problem.upper[i]
            if z[i] != 0.0:
                add_column(problem.columns, i, z[i], rhs)
    for i in range(z.size):
        rhs[i] = rho * centre[i] - rhs[i]


@njit(cache=True, nogil=True)
def advance(problem, it, factor, budget, outside):
    """Go on until solved, or for `budget` factorisations.

    With `outside` faces are factored by the caller. Returns a code and the factor.
    """
    count = it.count
    symmetric = problem.symmetric
    while True:
        if count[STALE] and not outside:
            if budget <= 0:
                return MORE, factor
            budget -= 1
            shift = it.vectors[SHIFT]
            shift[:] = it.number[RHO]
            factor = analyse(problem.columns, symmetric, it.state, it.ordering)
            quality = refactor(
                problem.columns, symmetric, shift, factor, it.ordering.local
            )
            count[FACTORED] += 1
            count[STALE] = 0
            if quality == INDEFINITE:
                count[OUTSIDE] = 1
            if quality != REGULAR and it.number[RHO] < LEAST_RHO:
                it.vectors[CENTRE] = it.vectors[BEST_Z]
                restart(it, LEAST_RHO)
                continue
        set_face(problem, it)
        if outside:
            return FACE, factor
        solve_face(symmetric, factor, it.vectors[RHS], it.vectors[Z])
        code = judge(problem, it)
        if code != GO_ON:
            return code, factor


@njit(cache=True, nogil=True)
def begin(columns, problem, it, factor, budget, outside):
    """Scale `columns` to problem.columns, take z from the start by sweeps, advance.

    On entry vectors[Z] is the start on the scaled problem, number[EPS_ABS], [EPS_REL]
    are set and everything else in `it` is 0.
    """
    count, number = it.count, it.number
    z, w = it.vectors[Z], it.vectors[W]
    n = z.size
    scale(columns, problem.d, problem.columns)
    best = it.vectors[BEST_Z]
    for i in range(n):
        best[i] = min(max(0.0, problem.lower[i]), problem.upper[i])
        z[i] = min(max(z[i], problem.lower[i]), problem.upper[i])
    evaluate(problem, best, w)
    size, plain = residuals(problem, best, w)
    if size == 0.0:
        z[:] = best
        return SOLVED, factor
    number[SIZE] = size
    number[BEST] = np.inf
    eps = number[6] * number[EPS_REL] * size / np.sqrt(n)
    number[MET] = 0.0
    number[TOLERANCE] = max(1e-14 * np.max(np.abs(problem.q)), eps)
    evaluate(problem, z, w)
    record(problem, it)
    set_states(problem, z, w, it.state)
    if number[MET]:
        return SOLVED, factor
    relax(problem, z, w, it.state)
    record(problem, it)
    if problem.symmetric or number[BEST] == residuals(problem, z, w)[0]:
        set_states(problem, z, w, it.state)
    else:
        z[:] = best
    it.vectors[CENTRE] = z
    count[STALE] = 1
    number[RHO] = -1.0
    restart(it, LEAST_RHO if problem.symmetric else 0.0)
    return advance(problem, it, factor, budget, outside)


@njit(cache=True, nogil=True)
def adopt(problem, it, z):
    """Go on from the end z of the path, unless it is no better than what is known."""
    it.vectors[Z] = z
    evaluate(problem, z, it.vectors[W])
    before = it.number[BEST]
    record(problem, it)
    if it.number[BEST] < before:
        wl, wu, state = it.vectors[WL], it.vectors[WU], it.state
        for i in range(z.size):
            at_lower = z[i] - problem.lower[i] < wl[i]
            at_upper = problem.upper[i] - z[i] < wu[i]
            state[i] = -1 if at_lower else (1 if at_upper else 0)
            if problem.lower[i] == problem.upper[i]:
                state[i] = -1
        it.vectors[CENTRE] = z
    it.count[PATHED] = 1
    it.count[STALE] = 1
    restart(it, it.number[RHO])
