"""The short path: Mehrotra's predictor and corrector for a monotone box LCP.

z stays strictly between its finite bounds, w - wl + wu = A z + q - wl + wu is driven to
0 together with wl (z - l) and wu (u - z). It is followed only until its signs tell the
face, or to the accuracy asked for where no face can be told.
"""

import numpy as np
from numba import njit

from namlcp.lapack import copy, inner
from namlcp.lcp.faces import analyse, face_order, refactor, solve_face
from namlcp.lcp.matrix import add_product, largest
from namlcp.lcp.pivoting import (
    BEST,
    CENTRE,
    FIRST_MU,
    PATH,
    PATHED,
    RHO,
    SIZE,
    STATE,
    WL,
    WU,
    W,
    Z,
    ordering_in,
    problem_in,
    record,
    residuals,
    restart,
)

REGULARISATION = 1e-12
"""Added to the unit diagonal of A."""


@inner
def enter(problem, z, w, wl, wu):
    """Push z inside its bounds and choose multipliers, all by 0.1 max|w|."""
    lower, upper = problem.lower, problem.upper
    n = z.size
    size = largest(w)
    if size == 0.0:
        size = 1.0
    for i in range(n):
        wl[i] = 0.0
        wu[i] = 0.0
        if lower[i] == upper[i]:
            z[i] = lower[i]
            continue
        room = min(0.1 * size, 0.05 * (upper[i] - lower[i]))
        z[i] = min(max(z[i], lower[i] + room), upper[i] - room)
        if lower[i] > -np.inf:
            wl[i] = max(w[i], 0.1 * size)
        if upper[i] < np.inf:
            wu[i] = max(-w[i], 0.1 * size)


@inner
def longest_step(lower, upper, z, wl, wu, dz, dwl, dwu):
    """Return the largest step in [0, inf) that keeps all of them nonnegative."""
    step = np.inf
    for i in range(z.size):
        if wl[i] > 0.0:
            if dz[i] < 0.0:
                step = min(step, (lower[i] - z[i]) / dz[i])
            if dwl[i] < 0.0:
                step = min(step, -wl[i] / dwl[i])
        if wu[i] > 0.0:
            if dz[i] > 0.0:
                step = min(step, (upper[i] - z[i]) / dz[i])
            if dwu[i] < 0.0:
                step = min(step, -wu[i] / dwu[i])
    return step


@inner
def complementarity(lower, upper, z, wl, wu, dz, dwl, dwu, step):
    """Return the mean product of slack and multiplier after the step."""
    total = 0.0
    pairs = 0
    for i in range(z.size):
        if wl[i] > 0.0:
            total += (z[i] + step * dz[i] - lower[i]) * (wl[i] + step * dwl[i])
            pairs += 1
        if wu[i] > 0.0:
            total += (upper[i] - z[i] - step * dz[i]) * (wu[i] + step * dwu[i])
            pairs += 1
    return total / max(pairs, 1)


@inner
def direction(problem, factor, z, w, wl, wu, mu, corrector, rhs, dz, dwl, dwu):
    """Overwrite dz, dwl, dwu by the Newton direction towards slack * multiplier = mu.

    With `corrector` the second-order terms dz dwl and dz dwu of the direction that
    comes in are taken along.
    """
    lower, upper = problem.lower, problem.upper
    n = z.size
    for i in range(n):
        rhs[i] = -w[i]
        low = corrector * dwl[i] * dz[i]
        high = corrector * dwu[i] * dz[i]
        dwl[i] = 0.0
        dwu[i] = 0.0
        if wl[i] > 0.0:
            dwl[i] = (mu - low) / (z[i] - lower[i]) - wl[i]
            rhs[i] += dwl[i] + wl[i]
        if wu[i] > 0.0:
            dwu[i] = (mu + high) / (upper[i] - z[i]) - wu[i]
            rhs[i] -= dwu[i] + wu[i]
    for i in range(n):
        dz[i] = 0.0
    solve_face(problem.symmetric, factor, rhs, dz)
    for i in range(n):
        if wl[i] > 0.0:
            dwl[i] -= wl[i] / (z[i] - lower[i]) * dz[i]
        if wu[i] > 0.0:
            dwu[i] += wu[i] / (upper[i] - z[i]) * dz[i]


@inner
def walk(problem, ordering, state, z, w, wl, wu, first, target, steps):
    """Follow the path from (z, wl, wu) until Res(z) <= target, `steps` at most.

    `state` is -1 for the fixed unknowns, 0 for all others; `first` is the mu that the
    path began with, 0 to measure it. Returns the steps taken and `first`.
    """
    lower, upper = problem.lower, problem.upper
    n = z.size
    memory = np.zeros((5, n))
    shift, rhs, dz, dwl, dwu = memory[0], memory[1], memory[2], memory[3], memory[4]
    order = face_order(problem.columns, problem.symmetric, state, ordering)
    factor = analyse(problem.columns, problem.symmetric, order, ordering)
    for k in range(steps + 1):
        copy(problem.q, w)
        add_product(problem.columns, z, w)
        done = residuals(z, w, lower, upper, problem.d)[0] <= target
        if done or k == steps:
            break
        for i in range(n):
            shift[i] = REGULARISATION
            if wl[i] > 0.0:
                shift[i] += wl[i] / (z[i] - lower[i])
            if wu[i] > 0.0:
                shift[i] += wu[i] / (upper[i] - z[i])
        refactor(problem.columns, problem.symmetric, shift, factor, ordering.local)
        mu = complementarity(lower, upper, z, wl, wu, dz, dwl, dwu, 0.0)
        first = max(first, mu)
        centre = 0.0
        for corrector in range(2):
            direction(
                problem, factor, z, w, wl, wu, centre, corrector, rhs, dz, dwl, dwu
            )
            step = longest_step(lower, upper, z, wl, wu, dz, dwl, dwu)
            if corrector == 0 and mu > 0.0:
                affine = complementarity(
                    lower, upper, z, wl, wu, dz, dwl, dwu, min(1.0, step)
                )
                centre = mu * (affine / mu) ** 3
        step = min(1.0, 0.995 * max(0.95, 1.0 - mu / first) * step)
        if not step > 1e-12:
            break
        for i in range(n):
            z[i] += step * dz[i]
            wl[i] += step * dwl[i]
            wu[i] += step * dwu[i]
    return k, first


@inner
def adopt(problem, work, z):
    """Go on from the end z of the path, unless it is no better than what is known."""
    vectors, state = work.vectors, work.marks[STATE]
    wl, wu = vectors[WL], vectors[WU]
    copy(z, vectors[Z])
    before = work.scalar[BEST]
    record(problem, work)
    if work.scalar[BEST] < before:
        for i in range(z.size):
            at_lower = z[i] - problem.lower[i] < wl[i]
            at_upper = problem.upper[i] - z[i] < wu[i]
            fixed = problem.lower[i] == problem.upper[i]
            state[i] = -1 if at_lower or fixed else (1 if at_upper else 0)
        copy(z, vectors[CENTRE])
    restart(work, work.scalar[RHO])


@njit(cache=True, nogil=True, error_model="numpy")
def follow(symmetric, work, target, steps):
    """Follow the path and give `work` its end, with the states it tells.

    The first call starts from the centre, another goes on. Ends after `steps`, or when
    Res <= target * scalar[SIZE]. Returns the steps taken.
    """
    problem = problem_in(work, symmetric)
    vectors, scalar = work.vectors, work.scalar
    z, w, wl, wu = vectors[PATH], vectors[W], vectors[WL], vectors[WU]
    if not work.counter[PATHED]:
        work.counter[PATHED] = 1
        copy(vectors[CENTRE], z)
        copy(problem.q, w)
        add_product(problem.columns, z, w)
        enter(problem, z, w, wl, wu)
    state = np.zeros(z.size, dtype=np.int32)
    for i in range(z.size):
        if problem.lower[i] == problem.upper[i]:
            state[i] = -1
    taken, first = walk(
        problem, ordering_in(work), state, z, w, wl, wu,
        scalar[FIRST_MU], target * scalar[SIZE], steps,
    )  # fmt: skip
    scalar[FIRST_MU] = first
    adopt(problem, work, z)
    return taken
