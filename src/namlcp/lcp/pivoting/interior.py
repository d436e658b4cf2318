"""The short path: Mehrotra's predictor and corrector for a monotone box LCP.

z stays strictly between its finite bounds, w - wl + wu = A z + q - wl + wu is driven to
0 together with wl (z - l) and wu (u - z). It is followed only until its signs tell the
face, or to the accuracy asked for where no face can be told.
"""

from typing import NamedTuple

import numpy as np

from namlcp.compiled import kernel, part, pasted
from namlcp.lcp.pivoting.blocks import (
    record,
    restart,
)
from namlcp.lcp.pivoting.faces import analyse, face_order, refactor, solve_face
from namlcp.lcp.pivoting.work import (
    BEST,
    CENTRE,
    FIRST_MU,
    LOWER,
    PATH,
    PATHED,
    RHO,
    SIZE,
    STATE,
    UPPER,
    WL,
    WU,
    W,
    Z,
    ordering_in,
    problem_in,
)
from namlcp.linalg import add_product, copy, largest_entry
from namlcp.residuals import natural_residuals

REGULARISATION = 1e-12
"""Added to the unit diagonal of A."""

CORRECTORS = 2
"""Right sides at most after Mehrotra's corrector."""

LONGER = 1.03
"""What each of them must make of the step."""

# Rows of the memory of a step: the direction, products, the direction before.
DZ, DWL, DWU, LOW, HIGH, KEPT = range(6)
DIRECTIONS = KEPT + 3
# Numbers of a step.
RESIDUAL, MU, FIRST, STEP, AIM = range(5)


class Path(NamedTuple):
    """A point of the path and its bounds; wl > 0 and wu > 0 tell which bounds count."""

    lower: np.ndarray
    upper: np.ndarray
    z: np.ndarray
    wl: np.ndarray
    wu: np.ndarray


@part
def path_in(work):
    """Return the point of the path as views of the workspace."""
    v = work.vectors
    return Path(v[LOWER], v[UPPER], v[PATH], v[WL], v[WU])


@part
def enter(problem, z, w, wl, wu):
    """Push z inside its bounds and choose multipliers, all of one size.

    That is the larger of max|w| and the largest distance of z from its nearest bound.
    """
    lower, upper = problem.lower, problem.upper
    n = z.size
    size = largest_entry(w)
    for i in range(n):
        room = min(z[i] - lower[i], upper[i] - z[i])
        if room < np.inf:
            size = max(size, room)
    if size == 0.0:
        size = 1.0
    for i in range(n):
        wl[i] = 0.0
        wu[i] = 0.0
        if lower[i] == upper[i]:
            z[i] = lower[i]
            continue
        room = min(size, 0.05 * (upper[i] - lower[i]))
        z[i] = min(max(z[i], lower[i] + room), upper[i] - room)
        if lower[i] > -np.inf:
            wl[i] = max(w[i], size)
        if upper[i] < np.inf:
            wu[i] = max(-w[i], size)


@part
def longest_step(path, d):
    """Return the largest step in [0, inf) that keeps all of them nonnegative."""
    step = np.inf
    for i in range(path.z.size):
        dz, dwl, dwu = d[DZ, i], d[DWL, i], d[DWU, i]
        wl, wu = path.wl[i], path.wu[i]
        if wl > 0.0:
            if dz < 0.0:
                step = min(step, (path.lower[i] - path.z[i]) / dz)
            if dwl < 0.0:
                step = min(step, -wl / dwl)
        if wu > 0.0:
            if dz > 0.0:
                step = min(step, (path.upper[i] - path.z[i]) / dz)
            if dwu < 0.0:
                step = min(step, -wu / dwu)
    return step


@part
def complementarity(path, d, step):
    """Return the mean product of slack and multiplier after the step."""
    total = 0.0
    pairs = 0
    for i in range(path.z.size):
        z = path.z[i] + step * d[DZ, i]
        if path.wl[i] > 0.0:
            total += (z - path.lower[i]) * (path.wl[i] + step * d[DWL, i])
            pairs += 1
        if path.wu[i] > 0.0:
            total += (path.upper[i] - z) * (path.wu[i] + step * d[DWU, i])
            pairs += 1
    return total / max(pairs, 1)


@pasted
def weights(path, shift):
    """Write the diagonal that the bounds add to A to shift."""
    for i in range(path.z.size):
        shift[i] = REGULARISATION
        if path.wl[i] > 0.0:
            shift[i] += path.wl[i] / (path.z[i] - path.lower[i])
        if path.wu[i] > 0.0:
            shift[i] += path.wu[i] / (path.upper[i] - path.z[i])


@pasted
def right_side(path, mu, w, d, rhs):
    """Write the right side for dz, towards slack * multiplier = mu.

    d[LOW] and d[HIGH] are the products of second order to leave out. d[DWL] and d[DWU]
    become what they are for dz = 0.
    """
    for i in range(path.z.size):
        rhs[i] = -w[i]
        d[DZ, i] = 0.0
        d[DWL, i] = 0.0
        d[DWU, i] = 0.0
        if path.wl[i] > 0.0:
            target = (mu - d[LOW, i]) / (path.z[i] - path.lower[i])
            d[DWL, i] = target - path.wl[i]
            rhs[i] += target
        if path.wu[i] > 0.0:
            target = (mu - d[HIGH, i]) / (path.upper[i] - path.z[i])
            d[DWU, i] = target - path.wu[i]
            rhs[i] -= target


@part
def recentre(path, mu, step, d):
    """Aim to bring the products a longer step gives closer to mu (Gondzio)."""
    step = min(1.0, max(1.3 * step, step + 0.1))
    low, high = 0.1 * mu, 10.0 * mu
    for i in range(path.z.size):
        z = path.z[i] + step * d[DZ, i]
        if path.wl[i] > 0.0:
            product = (z - path.lower[i]) * (path.wl[i] + step * d[DWL, i])
            d[LOW, i] -= max(min(max(product, low), high) - product, -high)
        if path.wu[i] > 0.0:
            product = (path.upper[i] - z) * (path.wu[i] + step * d[DWU, i])
            d[HIGH, i] -= max(min(max(product, low), high) - product, -high)


@part
def digest(path, corrector, d, number):
    """Take d[DZ] as solved for; return whether another right side should be tried.

    Corrector 0 is the predictor, 1 Mehrotra's corrector. Further ones (Gondzio 1996)
    cost a solve each, and are kept while they lengthen the step.
    """
    n = path.z.size
    for i in range(n):
        if path.wl[i] > 0.0:
            d[DWL, i] -= path.wl[i] / (path.z[i] - path.lower[i]) * d[DZ, i]
        if path.wu[i] > 0.0:
            d[DWU, i] += path.wu[i] / (path.upper[i] - path.z[i]) * d[DZ, i]
    step = longest_step(path, d)
    mu = number[MU]
    if corrector == 0:
        number[AIM] = 0.0
        if mu > 0.0:
            number[AIM] = mu * (complementarity(path, d, min(1.0, step)) / mu) ** 3
        for i in range(n):
            d[LOW, i] = d[DWL, i] * d[DZ, i]
            d[HIGH, i] = -d[DWU, i] * d[DZ, i]
        return True
    if corrector > 1 and step < LONGER * number[STEP]:
        for k in range(3):
            copy(d[KEPT + k], d[DZ + k])
        return False
    number[STEP] = step
    if corrector > CORRECTORS or step >= 1.0:
        return False
    for k in range(3):
        copy(d[DZ + k], d[KEPT + k])
    recentre(path, number[AIM], step, d)
    return True


@pasted
def advance(path, d, number):
    """Go nearly the longest step, 1 at most; return whether it is a step."""
    share = max(0.95, 1.0 - number[MU] / number[FIRST])
    step = min(1.0, 0.995 * share * number[STEP])
    if not step > 1e-12:
        return False
    for i in range(path.z.size):
        path.z[i] += step * d[DZ, i]
        path.wl[i] += step * d[DWL, i]
        path.wu[i] += step * d[DWU, i]
    return True


@pasted
def measure(problem, path, w, d, number):
    """Write w = A z + q, Res(z), mu and the largest mu so far; clear d."""
    copy(problem.q, w)
    add_product(problem.columns, path.z, w)
    res, _ = natural_residuals(path.z, w, path.lower, path.upper, problem.d)
    number[RESIDUAL] = res
    for i in range(w.size):
        d[LOW, i] = 0.0
        d[HIGH, i] = 0.0
    number[MU] = complementarity(path, d, 0.0)
    number[FIRST] = max(number[FIRST], number[MU])


@pasted
def walk(problem, ordering, state, path, w, number, target, steps):
    """Follow the path until Res(z) <= target, `steps` at most; return the steps taken.

    `state` is -1 for the fixed unknowns, 0 for all others.
    """
    n = w.size
    d = np.zeros((DIRECTIONS, n))
    memory = np.zeros((2, n))
    shift, rhs = memory[0], memory[1]
    order = face_order(problem.columns, problem.symmetric, state, ordering)
    factor = analyse(problem.columns, problem.symmetric, order, ordering)
    for k in range(steps + 1):
        measure(problem, path, w, d, number)
        if number[RESIDUAL] <= target or k == steps:
            break
        weights(path, shift)
        refactor(problem.columns, problem.symmetric, shift, factor, ordering.local)
        corrector = 0
        number[AIM] = 0.0
        more = True
        while more:
            right_side(path, number[AIM], w, d, rhs)
            solve_face(problem.symmetric, factor, rhs, d[DZ])
            more = digest(path, corrector, d, number)
            corrector += 1
        if not advance(path, d, number):
            break
    return k


@part
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


@part
def open_path(problem, work):
    """On the first call, start the path from the centre."""
    if work.counter[PATHED]:
        return
    work.counter[PATHED] = 1
    vectors = work.vectors
    copy(vectors[CENTRE], vectors[PATH])
    copy(problem.q, vectors[W])
    add_product(problem.columns, vectors[PATH], vectors[W])
    enter(problem, vectors[PATH], vectors[W], vectors[WL], vectors[WU])


@kernel(error_model="numpy")
def follow(symmetric, work, target, steps):
    """Follow the path and give `work` its end, with the states it tells.

    The first call starts from the centre, another goes on. Ends after `steps`, or when
    Res <= target * scalar[SIZE]. Returns the steps taken.
    """
    problem = problem_in(work, symmetric)
    open_path(problem, work)
    state = np.zeros(problem.q.size, dtype=np.int32)
    for i in range(state.size):
        if problem.lower[i] == problem.upper[i]:
            state[i] = -1
    number = np.zeros(AIM + 1)
    number[FIRST] = work.scalar[FIRST_MU]
    path = path_in(work)
    taken = walk(
        problem, ordering_in(work), state, path, work.vectors[W], number,
        target * work.scalar[SIZE], steps,
    )  # fmt: skip
    work.scalar[FIRST_MU] = number[FIRST]
    adopt(problem, work, path.z)
    return taken
