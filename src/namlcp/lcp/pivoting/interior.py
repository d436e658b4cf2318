"""An interior-point method, Mehrotra's predictor-corrector, for a monotone box LCP.

z stays strictly between its finite bounds; A z + q - wl + wu is driven to 0 together
with the products wl (z - l) and wu (u - z). The end gives block pivoting its states.
"""

import numpy as np

from namlcp.compiled import floats, ints, kernel, part
from namlcp.lcp.pivoting.free_system import analyse, free_order, refactor, solve_free
from namlcp.lcp.pivoting.pivot import record, reset_patience, residuals_of, write_w
from namlcp.lcp.pivoting.state import bounds_of, path_of, state_at
from namlcp.linalg import copy, largest_entry

REGULARISATION = 1e-12
"""Added to the unit diagonal of A, so that a singular A can be factored."""

CORRECTORS = 2
"""Gondzio's correctors at most after Mehrotra's corrector."""

LONGER = 1.03
"""Factor by which one of Gondzio's correctors must lengthen the step to be kept."""

ASK_FACTOR, ASK_MORE = 1.3, 0.1
"""Gondzio's correctors aim at the larger of ASK_FACTOR step and step + ASK_MORE."""

LEAST_PRODUCT, MOST_PRODUCT = 0.1, 10.0
"""Products of slack and multiplier that they leave alone, relative to target_mu."""

INSIDE = 0.05
"""The start is pushed inside its bounds, by at most this fraction of u - l."""

LEAST_SHARE, MOST_SHARE = 0.95, 0.995
"""Range of the fraction of the longest feasible step that is taken."""

SHORTEST_STEP = 1e-12
"""Step length up to which the path ends."""

# What `use_direction` returns.
TOO_SHORT, TAKEN, AGAIN = range(3)


@part
def enter_box(m):
    """Push path.z inside its bounds and write the multipliers, all equal.

    They are the larger of max|w| and the largest distance of z from its nearest bound.
    """
    path, (lower, upper), w = path_of(m), bounds_of(m), floats(m.w, m.n)
    z = path.z
    size = largest_entry(w)
    for i in range(m.n):
        distance = min(z[i] - lower[i], upper[i] - z[i])
        if distance < np.inf:
            size = max(size, distance)
    if size == 0.0:
        size = 1.0
    for i in range(m.n):
        path.wl[i] = 0.0
        path.wu[i] = 0.0
        if lower[i] == upper[i]:
            z[i] = lower[i]
            continue
        distance = min(size, INSIDE * (upper[i] - lower[i]))
        z[i] = min(max(z[i], lower[i] + distance), upper[i] - distance)
        if lower[i] > -np.inf:
            path.wl[i] = max(w[i], size)
        if upper[i] < np.inf:
            path.wu[i] = max(-w[i], size)


@part
def longest_step(m):
    """Return the largest step that keeps slacks and multipliers >= 0, possibly inf."""
    path, (lower, upper) = path_of(m), bounds_of(m)
    step = np.inf
    for i in range(m.n):
        dz, dwl, dwu = path.dz[i], path.dwl[i], path.dwu[i]
        wl, wu = path.wl[i], path.wu[i]
        if wl > 0.0:
            if dz < 0.0:
                step = min(step, (lower[i] - path.z[i]) / dz)
            if dwl < 0.0:
                step = min(step, -wl / dwl)
        if wu > 0.0:
            if dz > 0.0:
                step = min(step, (upper[i] - path.z[i]) / dz)
            if dwu < 0.0:
                step = min(step, -wu / dwu)
    return step


@part
def mean_product(m, step):
    """Return the mean product of slack and multiplier after a step of this length."""
    path, (lower, upper) = path_of(m), bounds_of(m)
    total = 0.0
    pairs = 0
    for i in range(m.n):
        z = path.z[i] + step * path.dz[i]
        if path.wl[i] > 0.0:
            total += (z - lower[i]) * (path.wl[i] + step * path.dwl[i])
            pairs += 1
        if path.wu[i] > 0.0:
            total += (upper[i] - z) * (path.wu[i] + step * path.dwu[i])
            pairs += 1
    return total / max(pairs, 1)


@part
def aim(m):
    """Write to rhs the right-hand side for dz, towards slack * multiplier = target_mu.

    dz becomes 0, and dwl and dwu the values that belong to dz = 0.
    """
    path, (lower, upper) = path_of(m), bounds_of(m)
    rhs, w, mu = floats(m.rhs, m.n), floats(m.w, m.n), m.target_mu
    for i in range(m.n):
        rhs[i] = -w[i]
        path.dz[i] = 0.0
        path.dwl[i] = 0.0
        path.dwu[i] = 0.0
        if path.wl[i] > 0.0:
            target = (mu - path.low[i]) / (path.z[i] - lower[i])
            path.dwl[i] = target - path.wl[i]
            rhs[i] += target
        if path.wu[i] > 0.0:
            target = (mu - path.high[i]) / (upper[i] - path.z[i])
            path.dwu[i] = target - path.wu[i]
            rhs[i] -= target


@part
def recentre(m, step):
    """Write to low and high the terms of Gondzio's corrector for a longer step.

    It moves products outside [LEAST_PRODUCT, MOST_PRODUCT] target_mu towards this
    interval (Comput. Optim. Appl. 6, 1996, 137-156).
    """
    path, (lower, upper), mu = path_of(m), bounds_of(m), m.target_mu
    step = min(1.0, max(ASK_FACTOR * step, step + ASK_MORE))
    least, most = LEAST_PRODUCT * mu, MOST_PRODUCT * mu
    for i in range(m.n):
        z = path.z[i] + step * path.dz[i]
        if path.wl[i] > 0.0:
            product = (z - lower[i]) * (path.wl[i] + step * path.dwl[i])
            path.low[i] -= max(min(max(product, least), most) - product, -most)
        if path.wu[i] > 0.0:
            product = (upper[i] - z) * (path.wu[i] + step * path.dwu[i])
            path.high[i] -= max(min(max(product, least), most) - product, -most)


@part
def try_direction(m, corrector):
    """Complete the direction from dz; return whether another corrector is to follow.

    Corrector 0 is the predictor, 1 Mehrotra's corrector, the others are Gondzio's. The
    function prepares target_mu, low and high for the next.
    """
    path, (lower, upper) = path_of(m), bounds_of(m)
    for i in range(m.n):
        if path.wl[i] > 0.0:
            path.dwl[i] -= path.wl[i] / (path.z[i] - lower[i]) * path.dz[i]
        if path.wu[i] > 0.0:
            path.dwu[i] += path.wu[i] / (upper[i] - path.z[i]) * path.dz[i]
    step = longest_step(m)
    if corrector == 0:
        m.target_mu = 0.0
        if m.mu > 0.0:
            left = mean_product(m, min(1.0, step)) / m.mu
            m.target_mu = m.mu * left**3
        for i in range(m.n):
            path.low[i] = path.dwl[i] * path.dz[i]
            path.high[i] = -path.dwu[i] * path.dz[i]
        return True
    if corrector > 1 and step < LONGER * m.step:
        copy(path.old_dz, path.dz)
        copy(path.old_dwl, path.dwl)
        copy(path.old_dwu, path.dwu)
        return False
    m.step = step
    if corrector > CORRECTORS or step >= 1.0:
        return False
    copy(path.dz, path.old_dz)
    copy(path.dwl, path.old_dwl)
    copy(path.dwu, path.old_dwu)
    recentre(m, step)
    return True


@part
def use_direction(m, corrector):
    """Use the solution dz. Return AGAIN if another one is to follow, else move.

    AGAIN means that rhs is the right-hand side for the next corrector. Otherwise most
    of m.step, 1 at most, is TAKEN unless it is TOO_SHORT.
    """
    if try_direction(m, corrector):
        aim(m)
        return AGAIN
    path = path_of(m)
    share = max(LEAST_SHARE, 1.0 - m.mu / m.largest_mu)
    step = min(1.0, MOST_SHARE * share * m.step)
    if not step > SHORTEST_STEP:
        return TOO_SHORT
    for i in range(m.n):
        path.z[i] += step * path.dz[i]
        path.wl[i] += step * path.dwl[i]
        path.wu[i] += step * path.dwu[i]
    return TAKEN


@part
def begin_step(m):
    """Write w, Res(z) and mu at the point, and the free system of the predictor.

    Its shift is the diagonal that the bounds add to A.
    """
    path, (lower, upper) = path_of(m), bounds_of(m)
    shift = floats(m.shift, m.n)
    write_w(m, path.z, floats(m.w, m.n))
    m.path_residual = residuals_of(m, path.z)[0]
    for i in range(m.n):
        path.low[i] = 0.0
        path.high[i] = 0.0
        shift[i] = REGULARISATION
        if path.wl[i] > 0.0:
            shift[i] += path.wl[i] / (path.z[i] - lower[i])
        if path.wu[i] > 0.0:
            shift[i] += path.wu[i] / (upper[i] - path.z[i])
    m.mu = mean_product(m, 0.0)
    m.largest_mu = max(m.largest_mu, m.mu)
    m.target_mu = 0.0
    aim(m)


@part
def open_path(m):
    """On the first call, start the path from the proximal point."""
    if not m.path_followed:
        m.path_followed = True
        z = floats(m.path_z, m.n)
        copy(floats(m.centre, m.n), z)
        write_w(m, z, floats(m.w, m.n))
        enter_box(m)


@part
def close_path(m):
    """Make the end of the path the proximal point if its Res is the least so far.

    The states are then bounded where the slack is smaller than the multiplier.
    """
    path, (lower, upper) = path_of(m), bounds_of(m)
    z, state = path.z, ints(m.state, m.n)
    copy(z, floats(m.z, m.n))
    before = m.best_residual
    record(m)
    if m.best_residual < before:
        for i in range(m.n):
            at_lower = z[i] - lower[i] < path.wl[i]
            at_upper = upper[i] - z[i] < path.wu[i]
            fixed = lower[i] == upper[i]
            state[i] = -1 if at_lower or fixed else (1 if at_upper else 0)
        copy(z, floats(m.centre, m.n))
    reset_patience(m, m.rho)


@kernel(error_model="numpy")
def follow(address, target, steps):
    """Follow the path and restart block pivoting at its end; return the steps taken.

    The first call starts from the proximal point, a later one continues. The path ends
    after `steps`, at Res <= target * m.size, or where the step is too short.
    """
    m = state_at(address)
    lower, upper = bounds_of(m)
    rhs, dz, shift = floats(m.rhs, m.n), floats(m.dz, m.n), floats(m.shift, m.n)
    open_path(m)
    state = np.zeros(m.n, dtype=np.int32)  # not free: the fixed unknowns
    for i in range(m.n):
        if lower[i] == upper[i]:
            state[i] = -1
    factor = analyse(m, free_order(m, state))
    for taken in range(steps + 1):
        begin_step(m)
        if m.path_residual <= target * m.size or taken == steps:
            break
        refactor(m, shift, factor)
        corrector, code = 0, AGAIN
        while code == AGAIN:
            solve_free(m.symmetric, factor, rhs, dz)
            code = use_direction(m, corrector)
            corrector += 1
        if code == TOO_SHORT:
            break
    close_path(m)
    return taken
