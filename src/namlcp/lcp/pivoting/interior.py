"""An interior-point method, Mehrotra's predictor-corrector, for a monotone box LCP.

z stays strictly between its finite bounds; A z + q - wl + wu is driven to 0 together
with the products wl (z - l) and wu (u - z). The end gives block pivoting its states.
"""

import numpy as np

from namlcp.compiled import kernel, part
from namlcp.lcp.pivoting.free_system import analyse, free_order, refactor, solve_free
from namlcp.lcp.pivoting.pivot import record, reset_patience, write_w
from namlcp.lcp.pivoting.work import opened, path_in
from namlcp.linalg import copy, largest_entry
from namlcp.residuals import natural_residuals

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
def enter_box(work, path):
    """Push path.z inside its bounds and write the multipliers, all equal.

    They are the larger of max|w| and the largest distance of z from its nearest bound.
    """
    lower, upper, z, w = work.lower, work.upper, path.z, work.w
    size = largest_entry(w)
    for i in range(z.size):
        distance = min(z[i] - lower[i], upper[i] - z[i])
        if distance < np.inf:
            size = max(size, distance)
    if size == 0.0:
        size = 1.0
    for i in range(z.size):
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
def longest_step(work, path):
    """Return the largest step that keeps slacks and multipliers >= 0, possibly inf."""
    step = np.inf
    for i in range(path.z.size):
        dz, dwl, dwu = path.dz[i], path.dwl[i], path.dwu[i]
        wl, wu = path.wl[i], path.wu[i]
        if wl > 0.0:
            if dz < 0.0:
                step = min(step, (work.lower[i] - path.z[i]) / dz)
            if dwl < 0.0:
                step = min(step, -wl / dwl)
        if wu > 0.0:
            if dz > 0.0:
                step = min(step, (work.upper[i] - path.z[i]) / dz)
            if dwu < 0.0:
                step = min(step, -wu / dwu)
    return step


@part
def mean_product(work, path, step):
    """Return the mean product of slack and multiplier after a step of this length."""
    total = 0.0
    pairs = 0
    for i in range(path.z.size):
        z = path.z[i] + step * path.dz[i]
        if path.wl[i] > 0.0:
            total += (z - work.lower[i]) * (path.wl[i] + step * path.dwl[i])
            pairs += 1
        if path.wu[i] > 0.0:
            total += (work.upper[i] - z) * (path.wu[i] + step * path.dwu[i])
            pairs += 1
    return total / max(pairs, 1)


@part
def aim(work, path):
    """Write to rhs the right-hand side for dz, towards slack * multiplier = target_mu.

    dz becomes 0, and dwl and dwu the values that belong to dz = 0.
    """
    rhs, mu = work.rhs, work.now.target_mu
    for i in range(path.z.size):
        rhs[i] = -work.w[i]
        path.dz[i] = 0.0
        path.dwl[i] = 0.0
        path.dwu[i] = 0.0
        if path.wl[i] > 0.0:
            target = (mu - path.low[i]) / (path.z[i] - work.lower[i])
            path.dwl[i] = target - path.wl[i]
            rhs[i] += target
        if path.wu[i] > 0.0:
            target = (mu - path.high[i]) / (work.upper[i] - path.z[i])
            path.dwu[i] = target - path.wu[i]
            rhs[i] -= target


@part
def recentre(work, path, step):
    """Write to low and high the terms of Gondzio's corrector for a longer step.

    It moves products outside [LEAST_PRODUCT, MOST_PRODUCT] target_mu towards this
    interval (Comput. Optim. Appl. 6, 1996, 137-156).
    """
    mu = work.now.target_mu
    step = min(1.0, max(ASK_FACTOR * step, step + ASK_MORE))
    low, high = LEAST_PRODUCT * mu, MOST_PRODUCT * mu
    for i in range(path.z.size):
        z = path.z[i] + step * path.dz[i]
        if path.wl[i] > 0.0:
            product = (z - work.lower[i]) * (path.wl[i] + step * path.dwl[i])
            path.low[i] -= max(min(max(product, low), high) - product, -high)
        if path.wu[i] > 0.0:
            product = (work.upper[i] - z) * (path.wu[i] + step * path.dwu[i])
            path.high[i] -= max(min(max(product, low), high) - product, -high)


@part
def try_direction(work, path, corrector):
    """Complete the direction from dz; return whether another corrector is to follow.

    Corrector 0 is the predictor, 1 Mehrotra's corrector, the others are Gondzio's. The
    function prepares target_mu, low and high for the next.
    """
    now, n = work.now, path.z.size
    for i in range(n):
        if path.wl[i] > 0.0:
            path.dwl[i] -= path.wl[i] / (path.z[i] - work.lower[i]) * path.dz[i]
        if path.wu[i] > 0.0:
            path.dwu[i] += path.wu[i] / (work.upper[i] - path.z[i]) * path.dz[i]
    step = longest_step(work, path)
    if corrector == 0:
        now.target_mu = 0.0
        if now.mu > 0.0:
            left = mean_product(work, path, min(1.0, step)) / now.mu
            now.target_mu = now.mu * left**3
        for i in range(n):
            path.low[i] = path.dwl[i] * path.dz[i]
            path.high[i] = -path.dwu[i] * path.dz[i]
        return True
    if corrector > 1 and step < LONGER * now.step:
        copy(path.old_dz, path.dz)
        copy(path.old_dwl, path.dwl)
        copy(path.old_dwu, path.dwu)
        return False
    now.step = step
    if corrector > CORRECTORS or step >= 1.0:
        return False
    copy(path.dz, path.old_dz)
    copy(path.dwl, path.old_dwl)
    copy(path.dwu, path.old_dwu)
    recentre(work, path, step)
    return True


@part
def use_direction(work, path, corrector):
    """Use the solution dz. Return AGAIN if another one is to follow, else move.

    AGAIN means that rhs is the right-hand side for the next corrector. Otherwise most
    of now.step, 1 at most, is TAKEN unless it is TOO_SHORT.
    """
    if try_direction(work, path, corrector):
        aim(work, path)
        return AGAIN
    now = work.now
    share = max(LEAST_SHARE, 1.0 - now.mu / now.largest_mu)
    step = min(1.0, MOST_SHARE * share * now.step)
    if not step > SHORTEST_STEP:
        return TOO_SHORT
    for i in range(path.z.size):
        path.z[i] += step * path.dz[i]
        path.wl[i] += step * path.dwl[i]
        path.wu[i] += step * path.dwu[i]
    return TAKEN


@part
def begin_step(work, path):
    """Write w, Res(z) and mu at the point, and the free system of the predictor.

    Its shift is the diagonal that the bounds add to A.
    """
    now, shift = work.now, work.shift
    write_w(work, path.z, work.w)
    found = natural_residuals(path.z, work.w, work.lower, work.upper, work.d)
    now.path_residual = found[0]
    for i in range(path.z.size):
        path.low[i] = 0.0
        path.high[i] = 0.0
        shift[i] = REGULARISATION
        if path.wl[i] > 0.0:
            shift[i] += path.wl[i] / (path.z[i] - work.lower[i])
        if path.wu[i] > 0.0:
            shift[i] += path.wu[i] / (work.upper[i] - path.z[i])
    now.mu = mean_product(work, path, 0.0)
    now.largest_mu = max(now.largest_mu, now.mu)
    now.target_mu = 0.0
    aim(work, path)


@part
def open_path(work, path):
    """On the first call, start the path from the proximal point."""
    if not work.now.path_followed:
        work.now.path_followed = True
        copy(work.centre, path.z)
        write_w(work, path.z, work.w)
        enter_box(work, path)


@part
def close_path(work, path):
    """Make the end of the path the proximal point if its Res is the least so far.

    The states are then bounded where the slack is smaller than the multiplier.
    """
    z, state = path.z, work.state
    copy(z, work.z)
    before = work.now.best_residual
    record(work)
    if work.now.best_residual < before:
        for i in range(z.size):
            at_lower = z[i] - work.lower[i] < path.wl[i]
            at_upper = work.upper[i] - z[i] < path.wu[i]
            fixed = work.lower[i] == work.upper[i]
            state[i] = -1 if at_lower or fixed else (1 if at_upper else 0)
        copy(z, work.centre)
    reset_patience(work.now, z.size, work.now.rho)


@kernel(error_model="numpy")
def follow(arena, target, steps):
    """Follow the path and restart block pivoting at its end; return the steps taken.

    The first call starts from the proximal point, a later one continues. The path ends
    after `steps`, at Res <= target * now.size, or where the step is too short.
    """
    work, path = opened(arena), path_in(arena)
    now = work.now
    open_path(work, path)
    state = np.zeros(path.z.size, dtype=np.int32)  # not free: the fixed unknowns
    for i in range(state.size):
        if work.lower[i] == work.upper[i]:
            state[i] = -1
    factor = analyse(work, free_order(work, state))
    for taken in range(steps + 1):
        begin_step(work, path)
        if now.path_residual <= target * now.size or taken == steps:
            break
        refactor(work, work.shift, factor)
        corrector, code = 0, AGAIN
        while code == AGAIN:
            solve_free(now.symmetric, factor, work.rhs, path.dz)
            code = use_direction(work, path, corrector)
            corrector += 1
        if code == TOO_SHORT:
            break
    close_path(work, path)
    return taken
