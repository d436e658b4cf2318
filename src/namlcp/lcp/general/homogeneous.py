"""A homogeneous interior-point method: whether a monotone LCP is solvable, and a ray.

It requires x'Ax >= 0 for all x; A may be nonsymmetric. p >= 0 is the distance of an
unknown from a finite bound, t >= 0 the slack to its other bound at the distance r;
unknowns without bounds have a free p. With tau, kappa >= 0, multipliers s of p >= 0 and
y of t >= 0,

    s = A p + c tau + y,   t = r tau - p,   kappa = -p'A p / tau - c'p - r'y,
    s_i p_i = 0,   y_i t_i = 0,   tau kappa = 0

always has a solution other than 0. If tau > 0, p / tau solves the LCP; if kappa > 0,
the LCP has no solution: p is a ray with c'p + r'y < 0. Mehrotra's predictor-corrector
follows the interior path from a fixed start, with one factorisation a step.

References
----------
Andersen and Ye, Math. Program. 84 (1999) 375-399.
"""

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
from scipy import sparse

from namlcp.lcp.data import LCP
from namlcp.lcp.distances import Distances, equilibrating_scale
from namlcp.lcp.shifted import Quasidefinite, System

MAX_STEPS = 50
"""Steps at most."""

LEAST_STEP = 1e-8
"""Step length up to which the path ends: the direction is inaccurate."""

STEP_PART = 0.995
"""Fraction of the longest feasible step that is taken."""

EQUILIBRATED_SHIFT = 1e-13
"""Added to the diagonal of the equilibrated matrix, so that it can be factored."""

CLEAR, CLEARER = 1e3, 10.0
"""A proof is sought once kappa / tau of the path exceeds CLEAR, and again whenever it
has grown by the factor CLEARER."""

FEASIBLE = 1e-6
"""kappa / tau of the path below which the program counts as feasible."""


class Embedded(NamedTuple):
    """A point of the path, or a step; tau and kappa have shape (1,).

    s is 0 for unknowns without bounds, y and t for those without two.
    """

    p: np.ndarray
    s: np.ndarray
    y: np.ndarray
    t: np.ndarray
    tau: np.ndarray
    kappa: np.ndarray


def ray_of(model: Distances, x: Embedded) -> np.ndarray:
    """Return p / kappa, 0 where complementarity demands it, for the box LCP."""
    z, over = np.zeros(model.base.size), model.unit / x.kappa[0]
    positive = np.where(model.signed, x.p > x.s, ~model.boxed)
    z[model.unfixed] = over * model.scale * np.where(positive, x.p, 0.0)
    return z


def homogeneous_path(
    A: Any,
    q: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    systems: Callable[[Distances], System],
) -> Iterator[tuple[float, np.ndarray]]:
    """Yield kappa / tau and the ray of each point of the path, a factorisation each.

    It ends after `MAX_STEPS`, with a step up to `LEAST_STEP`, or where the matrix
    cannot be factored. `systems` makes the linear systems of the path.
    """
    model = Distances(A, q, lower, upper, equilibrating_scale)
    system = systems(model)
    signed, boxed = model.signed, model.boxed
    one = np.ones(1)
    x = Embedded(*(1.0 * signed,) * 2, *(1.0 * boxed,) * 2, one, one)
    inside = signed, signed, boxed, boxed, one > 0.0, one > 0.0
    for _ in range(MAX_STEPS):
        yield float(x.kappa[0] / x.tau[0]), ray_of(model, x)
        found = step_from(model, system, x, inside)
        if found is None:
            return
        dx, step = found
        values = [v + step * dv for v, dv in zip(x, dx, strict=True)]
        size = max(float(np.abs(v).max(initial=0.0)) for v in values)
        if not (LEAST_STEP < step and size < np.inf):
            return
        x = Embedded(*(v / size for v in values))
    yield float(x.kappa[0] / x.tau[0]), ray_of(model, x)


def step_from(
    model: Distances, system: System, x: Embedded, inside: tuple[np.ndarray, ...]
) -> tuple[Embedded, float] | None:
    """Return direction and step length, None if the matrix cannot be factored.

    The equation for dtau is its own plus those for dp, weighted with p / tau. Terms of
    this sum that cancel near the solution have been removed analytically.
    """
    M, c, r = model.M, model.c, model.r
    signed, boxed = 1.0 * model.signed, 1.0 * model.boxed
    p, s, y, t = x[:4]
    tau, kappa = float(x.tau[0]), float(x.kappa[0])
    P, T = np.where(model.signed, p, 1.0), np.where(model.boxed, t, 1.0)
    Mp = M @ p
    rx = Mp + c * tau + y - s
    rt = boxed * (r * tau - p - t)
    rk = -p @ Mp / tau - c @ p - r @ y - kappa
    weight, diagonal = y / T, s / P + EQUILIBRATED_SHIFT
    factors = system.factors(diagonal + weight)
    if factors is None:
        return None
    solve = factors.solve
    u = solve(c - weight * r)
    v = p / tau + u
    slope = kappa / tau + v @ (M @ v) + weight @ (r + u) ** 2 + diagonal @ u**2
    h = (rx + weight * rt - EQUILIBRATED_SHIFT * p) / tau
    mu = (p @ s + y @ t + tau * kappa) / (signed.sum() + boxed.sum() + 1.0)
    low, high, last = -p * s, -y * t, -tau * kappa  # change of products aimed at
    eta = 1.0  # fraction of the residuals that a full step removes
    for corrector in range(2):
        b = (high - eta * y * rt) / T
        e = solve(signed * low / P - b - eta * rx)
        rise = last + (t + rt) @ b + low.sum() - eta * (p @ rx)
        dtau = (rise / tau - eta * rk + h @ e) / slope
        dp = e - dtau * u
        ds = signed * (low - s * dp) / P
        dt = boxed * (r * dtau - dp + eta * rt)
        dy = boxed * (high - y * dt) / T
        dkappa = (last - kappa * dtau) / tau
        dx = Embedded(dp, ds, dy, dt, np.array([dtau]), np.array([dkappa]))
        step = min(1.0, STEP_PART * longest(x, dx, inside))
        if corrector == 0:
            eta = 1.0 - (1.0 - step) ** 3
            aim = (1.0 - eta) * mu
            low = signed * (aim - p * s - dp * ds)
            high = boxed * (aim - y * t - dy * dt)
            last = aim - tau * kappa - dtau * dkappa
    return dx, step


def longest(x: Embedded, dx: Embedded, inside: tuple[np.ndarray, ...]) -> float:
    """Return the largest step that keeps the entries that `inside` marks >= 0."""
    step = np.inf
    for v, dv, signed in zip(x, dx, inside, strict=True):
        falls = signed & (dv < 0.0)
        step = min(step, float((-v[falls] / dv[falls]).min(initial=np.inf)))
    return step


def farkas(lcp: LCP) -> Iterator[np.ndarray]:
    """Yield directions v (n,) that may prove that no w has the signs it must have.

    These are w >= 0 where z has only a lower bound, w <= 0 where it has only an upper
    one, w = 0 where it has none. That a z in the box has such a w = A z + q is a linear
    program without an objective. Its optimality conditions are a box LCP with a
    skew-symmetric matrix,

        [ 0  -A_R' ] [ z ]   [  0  ]
        [ A_R  0   ] [ v ] + [ q_R ],

    with v signed as w is, R the rows in question; it is monotone for every A, and the
    path finds a solution, or a ray with its v in the sense of `rays.proof` (Farkas'
    lemma). v is 0 while there is none.

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

    def system(model: Distances) -> Quasidefinite:
        return Quasidefinite(model.M, np.where(model.unfixed < n, 1.0, -1.0))

    clear = CLEAR
    for ratio, ray in homogeneous_path(matrix, q, lower, upper, system):
        if ratio < FEASIBLE:
            return
        v = np.zeros(n)
        if ratio > clear:
            v[rows], clear = ray[n:], CLEARER * ratio
        yield v
