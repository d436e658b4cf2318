"""QPs with a known solution: what all sets, and the tests, plant them with.

`around` makes the QP that a point solves, `planted` one around a random point. The
dials of a random QP are those of `Dials`; `definite` has a condition. CHANGES are what
may be done to the data of a QP.
"""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp
from qpsolvers import Problem

Array, Rng = np.ndarray, np.random.Generator


class Known(NamedTuple):
    """A QP as P, q, G, h, A, b, lb, ub, and a primal-dual solution of it."""

    qp: tuple[Any, ...]
    x: Array
    y: Array
    z: Array
    z_box: Array


def around(
    P: Any, G: Any, A: Any, point: Any, slack: Array, below: Array, above: Array
) -> Known:
    """Return the QP with these matrices that (x, y, z, z_box) solves.

    `slack` are h - G x, `below` and `above` the distances from x to its bounds; the
    point must be complementary to them.
    """
    x, y, z, z_box = point
    q = -(P @ x + G.T @ z + A.T @ y + z_box)
    return Known((P, q, G, G @ x + slack, A, A @ x, x - below, x + above), *point)


def definite(rng: Rng, n: int, condition: float) -> Array:
    """Return an SPD matrix of random eigenvectors, eigenvalues 1 to 1 / condition."""
    V, _ = np.linalg.qr(rng.standard_normal((n, n)))
    A = (V * np.geomspace(1.0, 1.0 / condition, n)) @ V.T
    return 0.5 * (A + A.T)


def planted(
    rng: Rng, P: Any, G: Any, A: Any, active: float, weak: float, box: float
) -> Problem:
    """Return a QP with these matrices around a random complementary point.

    A share `active` of the rows, and of the finite sides of a share `box` of the
    variables, holds with equality; a share `weak` of those has multiplier zero.
    """
    n, m = P.shape[0], G.shape[0]
    x, y = rng.standard_normal(n), rng.standard_normal(A.shape[0])

    def multipliers(size: int) -> tuple[Array, Array]:
        on = rng.random(size) < active
        z = np.where(on & (rng.random(size) >= weak), rng.exponential(size=size), 0.0)
        return on, z

    on, z = multipliers(m)
    slack = np.where(on, 0.0, rng.exponential(size=m))
    on, z_upper = multipliers(n)
    boxed = rng.random(n) < box
    upper = rng.random(n) < 0.5
    gap = np.where(on, 0.0, rng.exponential(size=n))
    z_box = np.where(boxed, np.where(upper, z_upper, -z_upper), 0.0)
    below = np.where(boxed & ~upper, gap, np.inf)
    above = np.where(boxed & upper, gap, np.inf)
    G, A = (sp.csc_matrix(C) if sp.issparse(P) else C for C in (G, A))
    return Problem(*around(P, G, A, (x, y, z, z_box), slack, below, above).qp)


def definite_stack(rng: Rng, n: int, m: int, items: int) -> tuple[Array, ...]:
    """Return P, q, G, h of dense QPs with definite P, stacked along the first axis."""
    B = rng.standard_normal((items, n, n))
    P = B.swapaxes(1, 2) @ B / n + 0.1 * np.eye(n)
    G, x = rng.standard_normal((items, m, n)), rng.standard_normal((items, n, 1))
    on = rng.random((items, m, 1)) < 0.3
    slack, z = rng.exponential(size=(2, items, m, 1))
    h = G @ x + np.where(on, 0.0, slack)
    q = -(P @ x + G.swapaxes(1, 2) @ np.where(on, z, 0.0))
    return P, q[..., 0], G, h[..., 0]


def entries(rng: Rng, rows: int, n: int, density: float) -> sp.csc_matrix:
    """Return a random sparse matrix without empty rows."""
    count = rng.poisson(density * rows * n)
    i = np.r_[rng.integers(0, rows, count), np.arange(rows)]
    j = np.r_[rng.integers(0, n, count), rng.integers(0, n, rows)]
    return sp.csc_matrix((rng.standard_normal(i.size), (i, j)), shape=(rows, n))


class Dials(NamedTuple):
    """Of a random QP: the largest n, the rank of P over n (0: 0 to 3), what holds.

    n is log-uniform from 5 on, with up to 2 n inequalities and n / 2 equalities.
    `units`: rows and columns are in units of 10^U(-units, units). `dependent`: a fifth
    of the rows is repeated, changed by 1e-3 to 1e-8. For the others see `planted`.
    """

    largest: int = 1000
    dense: bool = False
    rank: float = 0.5
    active: float = 0.3
    weak: float = 0.0
    box: float = 0.5
    units: float = 0.0
    dependent: bool = False


FAMILIES = {
    "sparse": Dials(2000),
    "dense": Dials(200, dense=True),
    "lp": Dials(rank=0.0, active=0.6, box=1.0),  # the solution is mostly a vertex
    "degenerate": Dials(active=0.67, weak=0.5),
    "scaled": Dials(units=2.0),
    "dependent": Dials(dependent=True),
}


def random_qp(rng: Rng, dials: Dials) -> Problem:
    n = int(np.exp(rng.uniform(np.log(5), np.log(dials.largest))))
    m, p = int(rng.integers(1, 2 * n + 1)), int(rng.integers(1, n // 2 + 1))
    density = 1.0 if dials.dense else min(1.0, 4.0 / n)
    rank = max(1, int(dials.rank * n)) if dials.rank else int(rng.integers(0, 4))
    B, G, A = (entries(rng, rows, n, density) for rows in (rank, m, p))
    if dials.dependent:
        G, A = (repeated(rng, C, density) for C in (G, A))
    if dials.dense:
        B, G, A = (C.toarray() for C in (B, G, A))
    problem = planted(rng, B.T @ B, G, A, dials.active, dials.weak, dials.box)
    return rescaled(problem, rng, dials.units, dials.units) if dials.units else problem


def repeated(rng: Rng, C: Any, density: float) -> Any:
    rows = C[rng.integers(0, C.shape[0], C.shape[0] // 5 + 1)]
    size = 10.0 ** rng.integers(-8, -2)
    again = rows + size * entries(rng, *rows.shape, density)
    return sp.csc_matrix(sp.vstack([C, again]))


def rescaled(problem: Problem, rng: Rng, rows: float, columns: float) -> Problem:
    """Return the problem with columns times D, rows times E: 10^U(-1, 1) to powers."""
    P, q, G, h, A, b, lb, ub = problem.unpack()
    D = 10.0 ** rng.uniform(-columns, columns, q.size)
    d = sp.diags_array(D)

    def scaled(C: Any, side: Any) -> tuple[Any, Any]:
        if C is None:
            return None, None
        E = 10.0 ** rng.uniform(-rows, rows, side.size)
        return sp.csc_matrix(sp.diags_array(E) @ C @ d), E * side

    constraints = *scaled(G, h), *scaled(A, b)
    lb, ub = (None if v is None else v / D for v in (lb, ub))
    return Problem(sp.csc_matrix(d @ P @ d), D * q, *constraints, lb, ub)


def noisy(problem: Problem, rng: Rng, size: float = 1e-3) -> Problem:
    P, q, G, h, A, b, lb, ub = problem.unpack()

    def factors(count: int) -> Array:
        return 1.0 + size * rng.standard_normal(count)

    def changed(C: Any) -> Any:
        if C is None:
            return None
        C = C.copy()
        C.data *= factors(C.data.size)
        return C

    D = sp.diags_array(factors(q.size))
    sides = [None if v is None else v * factors(v.size) for v in (h, b, lb, ub)]
    if lb is not None and ub is not None:
        sides[2] = np.minimum(sides[2], sides[3])
    P, q = sp.csc_matrix(D @ P @ D), q * factors(q.size)
    return Problem(P, q, changed(G), sides[0], changed(A), *sides[1:])


CHANGES: dict[str, Callable[[Problem, Rng], Problem]] = {
    "plain": lambda problem, rng: problem,
    "noise": noisy,
    "rows": partial(rescaled, rows=3.0, columns=0.0),
    "columns": partial(rescaled, rows=0.0, columns=3.0),
}
