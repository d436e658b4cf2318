"""Interior paths: Mehrotra's, that of a linear program, and Lemke's homotopy.

`mehrotra` (SIAM J. Optim. 2, 1992, 575-601; correctors of Gondzio, Comput. Optim.
Appl. 6, 1996, 137-156) starts outside of the equations. It solves most friction
problems in 10 to 20 steps; where M is not monotone it promises nothing, and may jam
where `arc` would have to turn.

*Lemke's homotopy as a smooth curve.* The curve of all (p, m, t) with positive gaps g,
multipliers m and

    M p + c + t d = sum of sign_k m_k,    g_k m_k = t a_k                      (1)

starts at a point of our choice with t = 1, which defines d and a > 0. For a copositive
M with d > 0, and c'v >= 0 wherever v >= 0 has v'M v = 0, p stays bounded while t does,
so that the curve leads to t = 0, a solution, as Lemke's path of pivots does (Cottle,
Pang, Stone: The Linear Complementarity Problem, 1992, section 4.4). Its t turns where
the determinant of M + diag(m / g) changes its sign, the orientation of the curve.
"""

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from scipy import sparse

from namlcp.lcp.data import LCP
from namlcp.lcp.general.cones import Condensed, System
from namlcp.lcp.general.distances import Distances
from namlcp.lcp.shifted import Shifted

# Added to the unit diagonal, so that a singular matrix can be factored; steps at most.
SHIFT, STEPS = 1e-11, 100
# Fraction of the longest step with positive gaps and multipliers that is taken.
STEP_PART = 0.99
# Range of the mean product aimed at, relative to the present one.
LEAST_CENTRING, MOST_CENTRING = 1e-4, 0.9
# Gondzio's correctors at most. Each asks for the larger of two steps, the one before
# times the first number and plus the second, moves products to within the factor OFF
# of the one aimed at, and is kept if it makes the step LONGER.
CORRECTORS, ASK, OFF, LONGER = 2, (1.3, 0.1), 10.0, 1.03
# So many steps in a row shorter than JAM end the path. So does, from step FIRST_STALL
# on, an error below SETTLED that does not halve in STALL steps; above, it may fall as
# slowly on the way to a solution, in heaps of 10^4 bodies.
JAM, JAMS, STALL, FIRST_STALL, SETTLED = 0.05, 3, 8, 15, 1e-9
# A proof is sought while Res of the path is between CLEAR and ENOUGH. If then no v_i,
# relative to its bound, exceeds FEASIBLE, the linear program counts as feasible. It is
# scaled by EQUILIBRATIONS rounds of dividing rows and columns by roots of their
# absolute sums.
CLEAR, ENOUGH, FEASIBLE, EQUILIBRATIONS = 1e-3, 1e-10, 1e-6, 3
# Of `arc`: what is added to the unit diagonal; steps at most; more with friction cones,
# where the curve leads to a solution, but may wind: 2100 steps with 2000 unknowns.
ARC_SHIFT, ARC_STEPS, PROMISED_STEPS = 1e-12, 400, 5000
# Largest relative change of a gap or multiplier in a step along the curve: in the first
# step; where an earlier point of the stack is taken instead; in any step.
FIRST_STEP, LEAST_STEP, MOST_STEP = 0.9, 0.02, 0.98
# Relative changes back to the curve: below NEAR steps grow, above FAR they shrink;
# above LOST the point is given up, and the step from the one before is SHORTER.
NEAR, FAR, LOST, SHORTER = 0.05, 0.2, 1.0, 0.3
# Points on the stack at most.
KEPT = 3
# Entry of p, relative to max |c_i| = 1, and t, at which the path ends.
FAR_AWAY, LARGE_T = 1e10, 1e4


class PathPoint(NamedTuple):
    """A point of a path, or a direction from it."""

    p: np.ndarray
    gaps: np.ndarray
    m: np.ndarray

    def moved(self, step: float, d: "PathPoint") -> "PathPoint":
        return PathPoint(*(x + step * dx for x, dx in zip(self, d, strict=True)))


def mehrotra(model: Distances, system: System) -> Iterator[np.ndarray]:
    """Yield points p, one factorisation from one to the next."""
    p, gaps = model.start()
    at = PathPoint(p, gaps, np.ones(gaps.size))  # max |c_i| of the model is 1
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
        d, step = centred(model, at, factors, excess)
        step *= STEP_PART
        jams = jams + 1 if step < JAM else 0
        if jams == JAMS or not math.isfinite(step):
            return
        at = at.moved(step, d)
    yield at.p


def centred(
    model: Distances, at: PathPoint, factors: Any, excess: np.ndarray
) -> tuple[PathPoint, float]:
    """Return the direction of predictor and correctors, and the longest step along it.

    It removes the excess.
    """

    def towards(change: np.ndarray) -> PathPoint:
        """Return the direction for changes of the products."""
        wish = change / at.gaps
        dp = factors.solve(model.total(wish) - excess)
        dgaps = model.of(dp)
        return PathPoint(dp, dgaps, wish - at.m / at.gaps * dgaps)

    products, mu = at.gaps * at.m, float(at.gaps @ at.m) / max(at.m.size, 1)
    d = towards(-products)
    after = at.moved(longest(at, d), d)
    left = float(after.gaps @ after.m) / max(at.m.size, 1)
    sigma = min(left / mu, 1.0) ** 3 if mu > 0.0 else 0.0
    aim = min(max(sigma, LEAST_CENTRING), MOST_CENTRING) * mu
    change = aim - np.clip(d.gaps * d.m, -mu, mu) - products
    d = towards(change)
    step = longest(at, d)
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


def longest(at: PathPoint, d: PathPoint) -> float:
    """Return the largest step up to 1 that keeps gaps and multipliers >= 0."""
    fall = max((-dx / x).max(initial=0.0) for x, dx in zip(at[1:], d[1:], strict=True))
    return 1.0 if fall <= 1.0 else 1.0 / float(fall)


def farkas(lcp: LCP) -> Iterator[np.ndarray]:
    """Yield directions v (n,) that may prove that no w has the signs it must have.

    These are w >= 0 where z has only a lower bound, w <= 0 where it has only an upper
    one, w = 0 where it has none. A z in the box whose w violates them least, by a
    weighted sum of |w_i| over the rows R in question, solves a linear program. Its
    optimality conditions are a box LCP that always has a solution,

        [ 0  -A_R' ] [ z ]   [  0  ]
        [ A_R  0   ] [ v ] + [ q_R ],

    with v signed as w is, and bounded by the weights: v = 0 if and only if nothing is
    violated, else it is a proof in the sense of `driver.proof` (Farkas' lemma). v is 0
    while there is none; each takes one factorisation.
    """
    low, high = np.isfinite(lcp.lower), np.isfinite(lcp.upper)
    rows = np.flatnonzero(~(low & high))
    n = lcp.q.size
    B = sparse.csr_array(lcp.A)[rows]
    matrix = sparse.block_array([[None, -B.T], [B, None]], format="csc")
    q = np.concatenate((np.zeros(n), lcp.q[rows]))
    d, size = np.ones(q.size), abs(matrix)
    for _ in range(EQUILIBRATIONS):
        total = np.maximum(size @ d, size.T @ d) * d
        d /= np.sqrt(np.where(total > 0.0, total, 1.0))
    weights = d[n:] * (np.abs(d * q).max(initial=0.0) or 1.0)
    lower = np.append(lcp.lower, np.where(low[rows], 0.0, -weights))
    upper = np.append(lcp.upper, np.where(high[rows], 0.0, weights))
    model = Distances(matrix, q, lower, upper, 1.0 / d)
    system = Shifted(model.M, np.where(model.unfixed < n, 1.0, -1.0))
    for p in mehrotra(model, system):
        v, F = np.zeros(n), model.F(p)
        error = model.residual(p, F)
        if error <= CLEAR:
            s = p - F
            high_p = np.where(s >= model.upper, model.upper, p)
            v[rows] = model.z(np.where(s <= model.lower, model.lower, high_p))[n:]
            if not np.abs(v[rows] / weights).max(initial=0.0) > FEASIBLE:
                return
        yield v
        if error <= ENOUGH:
            return


# ---- Lemke's homotopy


class Directions:
    """The directions at a point of the path, with its t and the next step from it.

    U, V: relative changes of the gaps, then of the multipliers, per unit of log t along
    the curve, and back to it; du, dv: the changes of p that belong to them; tv: the
    relative change of t with V. forward: whether t falls along the curve. error: the
    largest entry of V and tv.
    """

    h: float

    def __init__(
        self,
        curve: tuple[Distances, np.ndarray, np.ndarray],
        at: PathPoint,
        t: float,
        factors: Any,
    ):
        """Take the model, d and the products a, and M + diag(m / g) factored."""
        (model, d, products), self.at, self.t, self.factors = curve, at, t, factors
        self.model = model
        wish = t * products / at.gaps
        excess = model.F(at.p) + t * d - model.total(at.m)
        sides = np.empty((model.c.size, 2), order="F")
        sides[:, 0] = model.total(wish) - t * d
        sides[:, 1] = model.total(wish - at.m) - excess
        self.du, self.dv = factors.solve(sides).T
        ratio = t * products / (at.gaps * at.m)
        self.U = self.changes(self.du, ratio)
        self.V = self.changes(self.dv, ratio - 1.0)
        # V goes across the curve, not to the point of it with the same t, so that it
        # stays bounded where t turns.
        along = float(self.U @ self.V) / float(self.U @ self.U + 1.0)
        self.V -= along * self.U
        self.dv = self.dv - along * self.du
        self.tv = -along
        self.error = max(float(np.abs(self.V).max(initial=0.0)), abs(along))
        self.forward = factors.is_positive()

    def changes(self, dp: np.ndarray, products: np.ndarray) -> np.ndarray:
        a = self.model.of(dp) / self.at.gaps
        return np.concatenate((a, products - a))

    def move(self) -> tuple[PathPoint, float]:
        """Return the point a step h along the curve and V away, and its t."""
        at, model, number = self.at, self.model, self.at.m.size
        tau = self.h / max(float(np.abs(self.U).max(initial=0.0)), 1.0)
        tau = -tau if self.forward else tau
        rates, dp = tau * self.U + self.V, tau * self.du + self.dv
        # products are to stay what the first order makes them
        bend = -(tau**2) * self.U[:number] * self.U[number:]
        dx = self.factors.solve(model.total(at.m * bend))
        X = self.changes(dx, bend)
        if np.abs(X).max(initial=0.0) <= 0.5 * self.h:
            rates += X
            dp += dx
        rate = tau + self.tv
        fall = max(float(-rates.min(initial=0.0)), -rate)
        cut = min(1.0, MOST_STEP / fall) if fall > 0.0 else 1.0
        gaps = at.gaps * (1.0 + cut * rates[:number])
        m = at.m * (1.0 + cut * rates[number:])
        return PathPoint(at.p + cut * dp, gaps, m), self.t * (1.0 + cut * rate)


def arc(model: Distances, system: System) -> Iterator[np.ndarray]:
    """Yield points p, one factorisation from one to the next; d >= 1."""
    p, gaps = model.start()
    F = model.F(p)
    m = np.maximum(model.of(F), 0.0) + 1.0
    curve = model, model.total(m) - F, gaps * m
    at, t, h = PathPoint(p, gaps, m), 1.0, FIRST_STEP
    stack: list[Directions] = []
    for _ in range(PROMISED_STEPS if isinstance(system, Condensed) else ARC_STEPS):
        yield at.p
        if t > LARGE_T or np.abs(at.p).max(initial=0.0) > FAR_AWAY:
            return
        factors = system.factors(model.total(at.m / at.gaps, 1.0) + ARC_SHIFT)
        here = None if factors is None else Directions(curve, at, t, factors)
        off = here is None or not here.error <= LOST
        if here is not None and math.isfinite(here.error) and not (off and stack):
            here.h = 0.7 * h if here.error > FAR else h
            if here.error < NEAR:
                here.h = min(MOST_STEP, 2.0 * h)
            stack.append(here)
            del stack[:-KEPT]
        elif stack:  # an earlier point is better where the last step was short
            stack[-1].h *= SHORTER
            while stack[-1].h < LEAST_STEP and len(stack) > 1:
                stack.pop()
                stack[-1].h *= SHORTER
        else:
            return
        h = stack[-1].h
        at, t = stack[-1].move()
    yield at.p
