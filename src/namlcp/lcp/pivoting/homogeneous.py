"""A homogeneous interior-point method: a monotone LCP's solution or a certificate.

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

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from scipy import sparse

from namlcp.lcp.modulus import dense_solver, sparse_solver

MAX_STEPS = 50
"""Steps at most."""

LEAST_STEP = 1e-8
"""Step length up to which the path ends: the direction is inaccurate."""

STEP_PART = 0.995
"""Fraction of the longest feasible step that is taken."""

EQUILIBRATED_SHIFT = 1e-13
"""Added to the diagonal of the equilibrated matrix, so that it can be factored."""

EQUILIBRATIONS = 3
"""Rounds of scaling rows and columns by their absolute sums."""


class PathPoint(NamedTuple):
    """A point of the path in the variables of the box LCP; ratio = kappa / tau.

    z is the iterate if ratio < 1, else a ray with 0 where complementarity demands it.
    """

    z: np.ndarray
    ratio: float


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


class Model:
    """The equilibrated LCP of p without fixed unknowns: z = base + unit scale p / tau.

    kept: the unknowns with l < u. Of these, signed have a bound, boxed two.
    """

    def __init__(self, A: Any, q: np.ndarray, lower: np.ndarray, upper: np.ndarray):
        """Take a dense or sparse A, and scale so that max |c_i| = 1."""
        low, high = np.isfinite(lower), np.isfinite(upper)
        self.base = np.where(low, lower, np.where(high, upper, 0.0))
        kept = self.kept = np.flatnonzero(lower < upper)
        c = (A @ self.base + q)[kept]
        self.signed, self.boxed = (low | high)[kept], (low & high)[kept]
        A = A[:, kept][kept]
        d = equilibrating_scale(A)
        self.scale = np.where(low | ~high, 1.0, -1.0)[kept] * d
        self.M = congruent(A, self.scale)
        self.c = self.scale * c
        self.unit = float(np.abs(self.c).max(initial=0.0)) or 1.0
        self.c /= self.unit
        self.r = np.zeros(kept.size)
        self.r[self.boxed] = ((upper - lower)[kept] / (self.unit * d))[self.boxed]

    def solver(self, diagonal: np.ndarray) -> Any:
        """Factor M + diag(diagonal); return its solve, None if it is singular."""
        if sparse.issparse(self.M):
            return sparse_solver(self.M + sparse.diags_array(diagonal), False)
        K = self.M.copy(order="F")
        K[np.diag_indices_from(K)] += diagonal
        return dense_solver(K, False)

    def point(self, x: Embedded) -> PathPoint:
        """Return x in the variables of the box LCP."""
        ratio = float(x.kappa[0] / x.tau[0])
        if ratio < 1.0:
            z, over = self.base.copy(), self.unit / x.tau[0]
            z[self.kept] += over * self.scale * x.p
        else:
            z, over = np.zeros(self.base.size), self.unit / x.kappa[0]
            positive = np.where(self.signed, x.p > x.s, ~self.boxed)
            z[self.kept] = over * self.scale * np.where(positive, x.p, 0.0)
        return PathPoint(z, ratio)


def equilibrating_scale(A: Any) -> np.ndarray:
    """Return d > 0: the larger of row sum i and column sum i of |D A D| is near 1."""
    d, size = np.ones(A.shape[0]), abs(A)
    for _ in range(EQUILIBRATIONS):
        total = np.maximum(size @ d, size.T @ d) * d
        d /= np.sqrt(np.where(total > 0.0, total, 1.0))
    return d


def congruent(A: Any, d: np.ndarray) -> Any:
    """Return D A D, dense or CSC."""
    if sparse.issparse(A):
        D = sparse.diags_array(d)
        return sparse.csc_array(D @ A @ D)
    return A * np.outer(d, d)


def homogeneous_path(
    A: Any, q: np.ndarray, lower: np.ndarray, upper: np.ndarray
) -> Iterator[PathPoint]:
    """Yield the points of the path, one factorisation from one to the next.

    It ends after `MAX_STEPS`, with a step up to `LEAST_STEP`, or where the matrix
    cannot be factored.
    """
    model = Model(A, q, lower, upper)
    signed, boxed = model.signed, model.boxed
    one = np.ones(1)
    x = Embedded(*(1.0 * signed,) * 2, *(1.0 * boxed,) * 2, one, one)
    inside = signed, signed, boxed, boxed, one > 0.0, one > 0.0
    for _ in range(MAX_STEPS):
        yield model.point(x)
        found = step_from(model, x, inside)
        if found is None:
            return
        dx, step = found
        values = [v + step * dv for v, dv in zip(x, dx, strict=True)]
        size = max(float(np.abs(v).max(initial=0.0)) for v in values)
        if not (LEAST_STEP < step and size < np.inf):
            return
        x = Embedded(*(v / size for v in values))
    yield model.point(x)


def step_from(
    model: Model, x: Embedded, inside: tuple[np.ndarray, ...]
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
    solve = model.solver(diagonal + weight)
    if solve is None:
        return None
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
