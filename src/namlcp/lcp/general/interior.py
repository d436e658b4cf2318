"""Infeasible interior-point paths, Mehrotra's, from a fixed start.

Each step has one factorisation, of M + diag(m/g), for a predictor that aims at the
products g_k m_k = 0 and a corrector that aims at their centre. `mehrotra` follows the
path of an LCP with a matrix of any kind, with Gondzio's correctors for products far
from the centre. It solves most friction problems in 10 to 20 steps; where M is not
monotone it promises nothing, and may jam where `arc` would have to turn.

`farkas` follows the homogeneous path of an LCP with M = -M', the optimality conditions
of a linear program. With r = g - S p, S p the signed entries of p in the pairs, and
tau, kappa >= 0

    M p + c tau = S'm,   g = S p + r tau,   kappa = -c'p - r'm,
    g_k m_k = 0,   tau kappa = 0

always has a solution other than 0. If tau > 0, p / tau solves the LCP; if kappa > 0 it
has no solution: p is a ray with c'p + r'm < 0.

References
----------
Mehrotra, SIAM J. Optim. 2 (1992) 575-601; Gondzio, Comput. Optim. Appl. 6 (1996)
137-156 (more correctors); Andersen and Ye, Math. Program. 84 (1999)
375-399 (the homogeneous path).
"""

import math
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from scipy import sparse

from namlcp.lcp.data import LCP
from namlcp.lcp.distances import Distances, equilibrating_scale
from namlcp.lcp.shifted import Quasidefinite, System

# Added to a unit diagonal, and to an equilibrated one, so that a singular matrix can be
# factored; steps at most of either path.
SHIFT, EQUILIBRATED_SHIFT = 1e-11, 1e-13
STEPS, HOMOGENEOUS_STEPS = 100, 50
# Fraction of the longest step with positive gaps and multipliers that is taken.
STEP_PART = 0.99
# Range of the mean product aimed at, relative to the present one.
LEAST_CENTRING, MOST_CENTRING = 1e-4, 0.9
# Gondzio's correctors at most. Each asks for the larger of two steps, the one before
# times the first number and plus the second, moves products to within the factor OFF
# of the one aimed at, and is kept if it makes the step LONGER.
CORRECTORS, ASK, OFF, LONGER = 2, (1.3, 0.1), 10.0, 1.03
# So many steps in a row shorter than JAM end the path of an LCP. So does, from step
# FIRST_STALL on, an error below SETTLED that does not halve in STALL steps; before, it
# may fall as slowly on the way to a solution, in heaps of 10^4 bodies.
JAM, JAMS, STALL, FIRST_STALL, SETTLED = 0.05, 3, 8, 15, 1e-9
# Step length up to which the homogeneous path ends: the direction is inaccurate.
LEAST_STEP = 1e-8
# A proof is sought once kappa / tau exceeds CLEAR, and again whenever it has grown by
# the factor CLEARER; below FEASIBLE the linear program counts as feasible.
CLEAR, CLEARER, FEASIBLE = 1e3, 10.0, 1e-6


class Point(NamedTuple):
    """A point of a path, or a direction from it: p, gaps and multipliers m."""

    p: np.ndarray
    gaps: np.ndarray
    m: np.ndarray

    def moved(self, step: float, d: "Point") -> "Point":
        return Point(*(x + step * dx for x, dx in zip(self, d, strict=True)))


def mehrotra(model: Distances, system: System) -> Iterator[np.ndarray]:
    """Yield the points p of the path, one factorisation from one to the next."""
    p, gaps = model.start()
    at = Point(p, gaps, np.ones(gaps.size))  # max |c_i| of the model is 1
    least, jams = [math.inf], 0
    for _ in range(STEPS):
        yield at.p
        excess = model.F(at.p) - model.total(at.m)
        error = float(np.abs(excess).max(initial=0.0))
        error = max(error, float((at.gaps * at.m).max(initial=0.0)))
        least.append(min(error, least[-1]))
        may_stall = len(least) > FIRST_STALL and least[-1] <= SETTLED
        if may_stall and least[-1] > 0.5 * least[-1 - STALL]:
            return
        ratio = at.m / at.gaps
        factors = system.factors(model.total(ratio, 1.0) + SHIFT)
        if factors is None:
            return
        towards = partial(direction, model, at, factors, excess)
        d, step = centred(at, towards)
        step *= STEP_PART
        jams = jams + 1 if step < JAM else 0
        if jams == JAMS or not math.isfinite(step):
            return
        at = at.moved(step, d)
    yield at.p


def direction(
    model: Distances, at: Point, factors: Any, excess: np.ndarray, change: np.ndarray
) -> Point:
    """Return the direction that removes the excess and changes the products so."""
    wish = change / at.gaps
    dp = factors.solve(model.total(wish) - excess)
    dgaps = model.of(dp)
    return Point(dp, dgaps, wish - at.m / at.gaps * dgaps)


def centred(at: Point, towards: Callable[[np.ndarray], Point]) -> tuple[Point, float]:
    """Return the direction of predictor and correctors, and the longest step along it.

    towards: changes of the products to the direction for them.
    """
    change, sigma = corrected(at, towards(-at.gaps * at.m))
    d = towards(change)
    step, aim = longest(at, d), sigma * mean_product(at)
    for _ in range(CORRECTORS):
        if not 0.0 < step < 1.0:
            break
        asked = min(1.0, max(ASK[0] * step, step + ASK[1]))
        products = (at.gaps + asked * d.gaps) * (at.m + asked * d.m)
        off = np.clip(products, aim / OFF, OFF * aim) - products
        change += np.maximum(off, -OFF * aim)
        other = towards(change)
        longer = longest(at, other)
        if not longer >= LONGER * step:
            break
        d, step = other, longer
    return d, step


def corrected(at: Point, d: Point) -> tuple[np.ndarray, float]:
    """Return the changes of the products to aim at, d being Mehrotra's predictor.

    The number is that of the centring, sigma.
    """
    products, mu = at.gaps * at.m, mean_product(at)
    step = longest(at, d)
    left = mean_product(at.moved(step, d))
    sigma = (left / mu) ** 3 if mu > 0.0 else 0.0
    sigma = min(max(sigma, LEAST_CENTRING), MOST_CENTRING)
    return sigma * mu - np.clip(d.gaps * d.m, -mu, mu) - products, sigma


def mean_product(at: Point) -> float:
    return float(at.gaps @ at.m) / max(at.m.size, 1)


def longest(at: Point, d: Point) -> float:
    """Return the largest step up to 1 that keeps gaps and multipliers >= 0."""
    fall = max((-dx / x).max(initial=0.0) for x, dx in zip(at[1:], d[1:], strict=True))
    return 1.0 if fall <= 1.0 else 1.0 / float(fall)


def homogeneous(model: Distances, system: System) -> Iterator[Point]:
    """Yield the points of the homogeneous path, for M = -M', a factorisation each.

    tau and kappa are the last gap and the last multiplier. The equation for dtau is its
    own plus those for dp, weighted with p / tau. Terms of this sum that cancel near the
    solution have been removed analytically.
    """
    p, gaps = model.start()
    r = gaps - model.of(p)
    at = Point(p, np.append(gaps, 1.0), np.ones(gaps.size + 1))
    for _ in range(HOMOGENEOUS_STEPS):
        yield at
        p, tau, kappa = at.p, float(at.gaps[-1]), float(at.m[-1])
        excess = model.M @ p + model.c * tau - model.total(at.m[:-1])
        last = -model.c @ p - r @ at.m[:-1] - kappa
        ratio = at.m / at.gaps
        factors = system.factors(model.total(ratio[:-1], 1.0) + EQUILIBRATED_SHIFT)
        if factors is None:
            return
        u = factors.solve(model.c + model.total(ratio[:-1] * r))
        slope = ratio[:-1] @ (model.of(u) - r) ** 2
        slope += kappa / tau + EQUILIBRATED_SHIFT * (u @ u)
        change, sigma = -at.gaps * at.m, 0.0
        for is_predictor in (True, False):
            eta = 1.0 - sigma  # the part of the residuals that a full step removes
            wish = change / at.gaps
            e = factors.solve(model.total(wish[:-1]) - eta * excess)
            rise = change.sum() - eta * (p @ excess)
            rise += (excess - EQUILIBRATED_SHIFT * p) @ e
            dtau = (rise / tau - eta * last) / slope
            dp = e - dtau * u
            dgaps = np.append(model.of(dp) + r * dtau, dtau)
            d = Point(dp, dgaps, wish - ratio * dgaps)
            if is_predictor:
                change, sigma = corrected(at, d)
        step = STEP_PART * longest(at, d)
        at = at.moved(step, d)
        size = max(float(np.abs(x).max(initial=0.0)) for x in at)
        if not (LEAST_STEP < step and size < math.inf):
            return
        at = Point(*(x / size for x in at))
    yield at


def farkas(lcp: LCP) -> Iterator[np.ndarray]:
    """Yield directions v (n,) that may prove that no w has the signs it must have.

    These are w >= 0 where z has only a lower bound, w <= 0 where it has only an upper
    one, w = 0 where it has none. That a z in the box has such a w = A z + q is a linear
    program without an objective. Its optimality conditions are a box LCP with a
    skew-symmetric matrix,

        [ 0  -A_R' ] [ z ]   [  0  ]
        [ A_R  0   ] [ v ] + [ q_R ],

    with v signed as w is, R the rows in question: the homogeneous path finds a
    solution, or a ray with its v in the sense of `rays.proof` (Farkas' lemma). v is 0
    while there is none.

    There is one factorisation from each to the next. The last one comes where the
    linear program is feasible.
    """
    low, high = np.isfinite(lcp.lower), np.isfinite(lcp.upper)
    rows = np.flatnonzero(~(low & high))
    n = lcp.q.size
    B = sparse.csr_array(lcp.A)[rows]
    matrix = sparse.block_array([[None, -B.T], [B, None]], format="csc")
    lower = np.append(lcp.lower, np.where(low, 0.0, -np.inf)[rows])
    upper = np.append(lcp.upper, np.where(high, 0.0, np.inf)[rows])
    q = np.concatenate((np.zeros(n), lcp.q[rows]))
    model = Distances(matrix, q, lower, upper, equilibrating_scale)
    is_dual = model.unfixed >= n
    system = Quasidefinite(model.M, np.where(is_dual, -1.0, 1.0))
    clear = CLEAR
    for at in homogeneous(model, system):
        ratio = at.m[-1] / at.gaps[-1]
        if ratio < FEASIBLE:
            return
        v = np.zeros(n)
        if ratio > clear:
            ray, count = model.scale * at.p, model.signed.size
            ray[model.signed[at.gaps[:count] <= at.m[:count]]] = 0.0  # p_i or m_i is 0
            v[rows[model.unfixed[is_dual] - n]] = ray[is_dual]
            clear = CLEARER * ratio
        yield v
