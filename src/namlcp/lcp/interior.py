"""The short path: Mehrotra's predictor and corrector for a monotone box LCP.

z stays strictly between its finite bounds, w - wl + wu = A z + q - wl + wu is driven to
0 together with wl (z - l) and wu (u - z). It is followed only until its signs tell the
face, or to the accuracy asked for where no face can be told.
"""

import numpy as np
from numba import njit

from namlcp.lcp.faces import analyse, refactor, solve_face
from namlcp.lcp.matrix import add_product

REGULARISATION = 1e-12
"""Added to the unit diagonal of A."""


@njit(cache=True, nogil=True)
def enter(problem, z, w, wl, wu):
    """Push z inside its bounds and choose multipliers, all by 0.1 max|w|."""
    lower, upper = problem.lower, problem.upper
    n = z.size
    w[:] = problem.q
    add_product(problem.columns, z, w)
    size = np.max(np.abs(w))
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


@njit(cache=True, nogil=True)
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


@njit(cache=True, nogil=True)
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


@njit(cache=True, nogil=True)
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
    dz[:] = 0.0
    solve_face(problem.symmetric, factor, rhs, dz)
    for i in range(n):
        if wl[i] > 0.0:
            dwl[i] -= wl[i] / (z[i] - lower[i]) * dz[i]
        if wu[i] > 0.0:
            dwu[i] += wu[i] / (upper[i] - z[i]) * dz[i]


@njit(cache=True, nogil=True)
def follow(problem, ordering, state, z, w, wl, wu, first, target, steps):
    """Follow the path from (z, wl, wu) until Res(z) <= target, `steps` at most.

    On entry mu of the first point is `first`; `state` marks the fixed unknowns (not 0).

    Returns
    -------
    steps taken, Res(z)
    """
    lower, upper = problem.lower, problem.upper
    n = z.size
    vectors = np.zeros((5, n))
    shift, rhs, dz, dwl, dwu = vectors[0], vectors[1], vectors[2], vectors[3], vectors[4]
    factor = analyse(problem.columns, problem.symmetric, state, ordering)
    for k in range(steps + 1):
        w[:] = problem.q
        add_product(problem.columns, z, w)
        residual = 0.0
        for i in range(n):
            residual += (z[i] - min(max(z[i] - w[i], lower[i]), upper[i])) ** 2
        residual = np.sqrt(residual)
        if not residual > target or k == steps:
            return k, residual
        for i in range(n):
            shift[i] = REGULARISATION
            if wl[i] > 0.0:
                shift[i] += wl[i] / (z[i] - lower[i])
            if wu[i] > 0.0:
                shift[i] += wu[i] / (upper[i] - z[i])
        refactor(problem.columns, problem.symmetric, shift, factor, ordering.local)
        mu = complementarity(lower, upper, z, wl, wu, dz, dwl, dwu, 0.0)
        direction(problem, factor, z, w, wl, wu, 0.0, 0.0, rhs, dz, dwl, dwu)
        step = min(1.0, longest_step(lower, upper, z, wl, wu, dz, dwl, dwu))
        affine = complementarity(lower, upper, z, wl, wu, dz, dwl, dwu, step)
        centre = mu * (affine / mu) ** 3 if mu > 0.0 else 0.0
        direction(problem, factor, z, w, wl, wu, centre, 1.0, rhs, dz, dwl, dwu)
        near = max(0.95, 1.0 - mu / first)
        step = min(1.0, 0.995 * near * longest_step(lower, upper, z, wl, wu, dz, dwl, dwu))
        if not step > 1e-12:
            return k, residual
        for i in range(n):
            z[i] += step * dz[i]
            wl[i] += step * dwl[i]
            wu[i] += step * dwu[i]
    return steps, residual
