"""Convex QPs that strain a solver, each of known solution, and the units to judge in.

`ROWS` has one function of a seed for every row of the table of `stress.comparison`. A
case is a problem in natural units, in which all terms are of order one, with a
primal-dual point that solves it by construction, and the units in which a solver sees
it:

    x = c x',  P' = s diag(c) P diag(c),  q' = s c q,  lb' = lb / c,  ub' = ub / c,
    G' = diag(r) G diag(c),  h' = r h,  and A, b with their own row units likewise,

with s the unit of the cost, c of the variables, r of the rows. Only the rows about
scale have units other than 1. The piles under gravity have no planted point: bodies at
rest show that a solution exists, and residuals decide.
"""

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np
from qpsolvers import Problem

from namlcp.qp import QP
from validation.harness import qps
from validation.problems.contact_scenes import STEP, Scene, brick_wall, heap

N, INEQUALITIES, EQUALITIES = 20, 30, 3
ACTIVE_ROWS, ACTIVE_BOUNDS = 6, 4  # with EQUALITIES fewer than N: unique multipliers
CONTACTS = 80
ONE = np.ones(1)


class Point(NamedTuple):
    """A primal-dual point in the signs of qpsolvers."""

    x: np.ndarray
    y: np.ndarray
    z: np.ndarray
    z_box: np.ndarray


class Units(NamedTuple):
    """Factors on the cost, the variables, the inequalities and the equalities."""

    cost: float = 1.0
    variables: np.ndarray = ONE
    inequalities: np.ndarray = ONE
    equalities: np.ndarray = ONE

    def smallest(self) -> float:
        """Return the smallest unit of any residual, at most 1."""
        c = self.variables
        every = (ONE, self.inequalities, self.equalities, 1.0 / c, self.cost * c)
        return float(np.min(np.concatenate([np.atleast_1d(u) for u in every])))


class Case(NamedTuple):
    """A problem in natural units, a solution of it, and the units a solver sees."""

    qp: QP
    point: Point | None = None
    units: Units = Units()


def posed(case: Case) -> Problem:
    """Return the problem as a solver sees it; parts without rows or bounds are None."""
    P, q, G, h, A, b, lb, ub = case.qp
    s, c, r, e = case.units
    lower = lb / c if np.isfinite(lb).any() else None
    upper = ub / c if np.isfinite(ub).any() else None
    rows = r[:, None] * G * c, r * h, e[:, None] * A * c, e * b
    return qps.joined(s * c[:, None] * P * c, s * c * q, *rows, lower, upper)


def natural(case: Case, point: Point) -> Point:
    """Return a point of the posed problem in natural units."""
    s, c, r, e = case.units
    x, y, z, z_box = point
    return Point(c * x, e * y / s, r * z / s, z_box / (s * c))


def definite(rng: np.random.Generator, n: int, condition: float) -> np.ndarray:
    """Return an SPD matrix of eigenvalues between 1 and 1 / condition."""
    V, _ = np.linalg.qr(rng.standard_normal((n, n)))
    P = (V * np.geomspace(1.0, 1.0 / condition, n)) @ V.T
    return 0.5 * (P + P.T)


def normal_rows(rng: np.random.Generator, rows: int, n: int) -> np.ndarray:
    """Return random rows of length 1."""
    G = rng.standard_normal((rows, n))
    return G / np.linalg.norm(G, axis=1, keepdims=True)


def planted(
    rng: np.random.Generator,
    P: np.ndarray,
    G: np.ndarray,
    z: np.ndarray,
    slack: np.ndarray,
    A: np.ndarray,
    sides: np.ndarray | None = None,
) -> Case:
    """Choose x, y and the bounds' multipliers, then q, h, b, lb, ub to match z, slack.

    sides_i: -1 and +1 are variables at lb and at ub, 0 between bounds, 2 without any.
    """
    n = P.shape[0]
    if sides is None:
        sides = rng.choice([0, 2], n)
        some = rng.choice(n, min(ACTIVE_BOUNDS, n // 2), replace=False)
        sides[some] = rng.choice([-1, 1], some.size)
    x, y = rng.standard_normal(n), rng.standard_normal(A.shape[0])
    width = 0.1 + rng.random(n)
    lb = np.where(sides == 2, -np.inf, x - np.where(sides == -1, 0.0, width))
    ub = np.where(sides == 2, np.inf, x + np.where(sides == 1, 0.0, width))
    z_box = np.where(np.abs(sides) == 1, sides * (0.1 + rng.random(n)), 0.0)
    q = -(P @ x + G.T @ z + A.T @ y + z_box)
    qp = QP(P, q, G, G @ x + slack, A, A @ x, lb, ub)
    return Case(qp, Point(x, y, z, z_box))


def some_active(rng: np.random.Generator, m: int) -> tuple[np.ndarray, np.ndarray]:
    """Return z and slack of m rows, ACTIVE_ROWS of them active, strictly so."""
    active = np.zeros(m, dtype=bool)
    active[rng.choice(m, min(ACTIVE_ROWS, m), replace=False)] = True
    size = 0.1 + rng.random(m)
    return np.where(active, size, 0.0), np.where(active, 0.0, size)


def plain(seed: int, condition: float = 10.0) -> Case:
    """Return a well-posed problem whose P has that condition number."""
    rng = np.random.default_rng(seed)
    P = definite(rng, N, condition)
    G, A = normal_rows(rng, INEQUALITIES, N), normal_rows(rng, EQUALITIES, N)
    return planted(rng, P, G, *some_active(rng, INEQUALITIES), A)


def nearly_parallel(seed: int, angle: float) -> Case:
    """Return a problem where each active row has a twin at that angle, active too."""
    rng = np.random.default_rng(seed)
    P, A = definite(rng, N, 10.0), normal_rows(rng, EQUALITIES, N)
    G = normal_rows(rng, INEQUALITIES, N)
    z, slack = some_active(rng, INEQUALITIES)
    own = np.flatnonzero(z)[: ACTIVE_ROWS // 2]
    twins = G[own] + angle * normal_rows(rng, own.size, N)
    z = np.append(z, 0.1 + rng.random(own.size))
    slack = np.append(slack, np.zeros(own.size))
    return planted(rng, P, np.vstack((G, twins)), z, slack, A)


def degenerate_lcp(seed: int) -> Case:
    """Return an LCP with z_i = w_i = 0 for half the indices; z* > 0 for a quarter."""
    rng = np.random.default_rng(seed)
    n = 60
    P, kind = definite(rng, n, 100.0), rng.permutation(n) % 4
    size = 0.1 + rng.random(n)
    x, w = np.where(kind == 0, size, 0.0), np.where(kind == 1, size, 0.0)
    qp = QP(P, w - P @ x, *no_rows(n), np.zeros(n), np.full(n, np.inf))
    return Case(qp, Point(x, np.zeros(0), np.zeros(0), -w))


def degenerate_vertex(seed: int) -> Case:
    """Return a problem with 2 n active rows at x*, half of the multipliers zero."""
    rng = np.random.default_rng(seed)
    P, A = definite(rng, N, 10.0), normal_rows(rng, EQUALITIES, N)
    G = normal_rows(rng, 2 * N + 10, N)
    z, slack = np.zeros(2 * N + 10), np.zeros(2 * N + 10)
    z[:N], slack[2 * N :] = 0.1 + rng.random(N), 0.1 + rng.random(10)
    return planted(rng, P, G, z, slack, A)


def at_rest(seed: int) -> Case:
    """Return a pile that comes to rest: more contacts than freedom, w* = 0.

    Half of the contacts carry nothing: z_i = w_i = 0. A = N'M^-1 N is singular, z* is
    one of many.
    """
    rng = np.random.default_rng(seed)
    A = pile(seed, 1.0).A.toarray()
    n = A.shape[0]
    z = np.where(rng.permutation(n) % 2 == 0, 0.1 + rng.random(n), 0.0)
    qp = QP(A, -A @ z, *no_rows(n), np.zeros(n), np.full(n, np.inf))
    return Case(qp, Point(z, np.zeros(0), np.zeros(0), np.zeros(n)))


def gravity(seed: int, mass_ratio: float) -> Case:
    """Return a pile of bodies of very different masses under gravity.

    Velocities in units of gravity times the time step.
    """
    scene = pile(seed, mass_ratio)
    n = scene.q.size
    A = scene.A.toarray()
    bounds = np.zeros(n), np.full(n, np.inf)
    return Case(QP(0.5 * (A + A.T), scene.q / STEP, *no_rows(n), *bounds))


def pile(seed: int, mass_ratio: float) -> Scene:
    """Return a full heap of discs (even seeds) or a wall of bricks, both singular."""
    if seed % 2:
        return brick_wall(CONTACTS, mass_ratio=mass_ratio, seed=seed)
    return heap(CONTACTS, sideways=True, mass_ratio=mass_ratio, seed=seed)


def no_rows(n: int) -> tuple[np.ndarray, ...]:
    """Return G, h, A, b without rows."""
    return np.zeros((0, n)), np.zeros(0), np.zeros((0, n)), np.zeros(0)


def in_units(seed: int, part: str, decades: float) -> Case:
    """Return the plain problem with factors 10^(+-decades).

    rows, columns: a factor for each; cost: one; all: one for the cost, one for all
    variables, one for all inequalities and one for all equalities.
    """
    case = plain(seed)
    rng = np.random.default_rng([seed, 1])

    def factors(count: int) -> np.ndarray:
        """Return factors, the largest and the smallest among them."""
        exponent = rng.uniform(-1.0, 1.0, count)
        ends = rng.permutation(count)[:2]
        exponent[ends] = (-1.0, 1.0)[: ends.size]
        return 10.0 ** (decades * exponent)

    def one() -> float:
        """Return one of the two extreme factors."""
        return float(10.0 ** (decades * rng.choice([-1.0, 1.0])))

    n, m, p = N, INEQUALITIES, EQUALITIES
    units = {
        "rows": lambda: Units(1.0, np.ones(n), factors(m), factors(p)),
        "columns": lambda: Units(1.0, factors(n), np.ones(m), np.ones(p)),
        "cost": lambda: Units(one(), np.ones(n), np.ones(m), np.ones(p)),
        "all": lambda: Units(
            one(), np.full(n, one()), np.full(m, one()), np.full(p, one())
        ),
    }
    return case._replace(units=units[part]())


def duplicated(seed: int) -> Case:
    """Return a problem with every row twice more, once in another unit.

    Equalities too, so that A has a third of full row rank.
    """
    case = plain(seed)
    qp, point = case.qp, case.point
    assert point is not None
    copies = (1.0, 1.0, 1e3)
    G, h = (np.concatenate([k * part for k in copies]) for part in (qp.G, qp.h))
    A, b = (np.concatenate([k * part for k in copies]) for part in (qp.A, qp.b))
    qp = qp._replace(G=G, h=h, A=A, b=b)
    return Case(qp, point._replace(z=padded(point.z, h), y=padded(point.y, b)))


def redundant(seed: int) -> Case:
    """Return a problem with rows and equations that follow from the others.

    As many sums of two rows, the active ones among them; sums of equations; all finite
    bounds as rows.
    """
    case = plain(seed)
    qp, point = case.qp, case.point
    assert point is not None
    G, h, A, b = qp.G, qp.h, qp.A, qp.b
    eye, up, low = np.eye(N), np.isfinite(qp.ub), np.isfinite(qp.lb)
    order = np.argsort(-point.z)  # active rows first: their sums are active
    G = np.vstack((G, G[order] + G[np.roll(order, 1)], eye[up], -eye[low]))
    h = np.concatenate((h, h[order] + h[np.roll(order, 1)], qp.ub[up], -qp.lb[low]))
    A, b = np.vstack((A, A + np.roll(A, 1, 0))), np.append(b, b + np.roll(b, 1))
    qp = qp._replace(G=G, h=h, A=A, b=b)
    return Case(qp, point._replace(z=padded(point.z, h), y=padded(point.y, b)))


def padded(multiplier: np.ndarray, side: np.ndarray) -> np.ndarray:
    """Return multipliers, those of the added rows zero."""
    return np.append(multiplier, np.zeros(side.size - multiplier.size))


def thin(seed: int, width: float) -> Case:
    """Return 12 slabs -d'x <= ..., d'x <= ... of that width around x*, nearly empty.

    Half of them are active on one side.
    """
    rng = np.random.default_rng(seed)
    P, A = definite(rng, N, 10.0), normal_rows(rng, EQUALITIES, N)
    D = normal_rows(rng, 12, N)
    upper = rng.permutation(12) % 2 == 0
    z = np.append(np.where(upper, 0.1 + rng.random(12), 0.0), np.zeros(12))
    slack = width * np.append(~upper, upper)
    slack[:12] *= 0.5
    slack[12:] += 0.5 * width * ~upper
    sides = rng.choice([0, 2], N)
    return planted(rng, P, np.vstack((D, -D)), z, slack, A, sides)


def single(seed: int) -> Case:
    """Return a problem of one variable: P > 0 or 0, some with rows or bounds."""
    rng = np.random.default_rng(seed)
    side = (-1, 0, 1, 2)[seed % 4]
    held = abs(side) == 1
    P = np.array([[rng.random() if seed % 3 else 0.0]])
    m = seed // 4 % 3
    G = rng.choice([-1.0, 1.0], (m, 1)) * (0.5 + rng.random((m, 1)))
    active = np.arange(m) == 0
    z, slack = np.where(active, 0.5, 0.0), np.where(active, 0.0, 1.0)
    equation = rng.standard_normal((1, 1)) if not (held or m) else np.zeros((0, 1))
    return planted(rng, P, G, z, slack, equation, np.array([side]))


def empty(seed: int) -> Case:
    """Return a problem with something missing.

    In turn: no constraint; no variable; all variables fixed; as many equations as
    variables; rows of infinite side alone; rows of zeros alone.
    """
    rng = np.random.default_rng(seed)
    kind = seed % 6
    n = 0 if kind == 1 else 1 + seed % 5
    P = definite(rng, n, 10.0) if n else np.zeros((0, 0))
    G, _, A, _ = no_rows(n)
    if kind == 3:
        A = rng.standard_normal((n, n)) + 3.0 * np.eye(n)
    if kind in (4, 5):
        G = np.ones((2, n)) * (kind == 4)
    slack = np.array([np.inf, np.inf] if kind == 4 else [1.0, 0.0])[: G.shape[0]]
    case = planted(rng, P, G, np.zeros(G.shape[0]), slack, A, np.full(n, 2))
    if kind == 2:
        case = case._replace(qp=case.qp._replace(lb=case.point.x, ub=case.point.x))
    return case


ROWS: dict[str, Callable[[int], Case]] = {
    **{
        f"P of condition 1e{k}": partial(plain, condition=10.0**k)
        for k in (0, 4, 8, 10, 12, 14)
    },
    "active rows at an angle of 1e-4": partial(nearly_parallel, angle=1e-4),
    "active rows at an angle of 1e-8": partial(nearly_parallel, angle=1e-8),
    "LCP, half z = w = 0": degenerate_lcp,
    "2n active rows, half z = 0": degenerate_vertex,
    "contact, rank-deficient": at_rest,
    "contact, masses 1 to 1e2": partial(gravity, mass_ratio=1e2),
    "contact, masses 1 to 1e4": partial(gravity, mass_ratio=1e4),
    **{
        f"{part} times 10^(+-{k})": partial(in_units, part=part, decades=float(k))
        for part in ("rows", "columns", "cost", "all")
        for k in (4, 8)
    },
    "every row three times": duplicated,
    "redundant rows": redundant,
    "feasible set 1e-4 thin": partial(thin, width=1e-4),
    "feasible set 1e-8 thin": partial(thin, width=1e-8),
    "feasible set flat": partial(thin, width=0.0),
    "n = 1": single,
    "empty": empty,
}
"""A function of a seed for every row of the table."""
