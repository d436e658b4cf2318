"""Random QPs around a planted primal-dual solution, and changes of the data of a QP."""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import scipy.sparse as sp
from qpsolvers import Problem

from validation.problems.draw import Rng, around


def planted(
    rng: Rng,
    P: Any,
    G: Any,
    A: Any,
    active: float = 0.3,
    weak: float = 0.0,
    box: float = 0.5,
) -> Problem:
    """Return a QP with these matrices around a random complementary point.

    A share `active` of the rows, and of the finite sides of a share `box` of the
    variables, holds with equality; a share `weak` of those has multiplier zero.
    """
    n, m = P.shape[0], G.shape[0]
    x, y = rng.standard_normal(n), rng.standard_normal(A.shape[0])

    def multipliers(size: int) -> tuple[np.ndarray, np.ndarray]:
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


def definite_stack(
    rng: Rng, n: int, m: int, items: int, active: float = 0.3
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return P, q, G, h of dense QPs with definite P, stacked along the first axis.

    As in `planted`, a share `active` of the rows of each holds with equality.
    """
    B = rng.standard_normal((items, n, n))
    P = B.swapaxes(1, 2) @ B / n + 0.1 * np.eye(n)
    G, x = rng.standard_normal((items, m, n)), rng.standard_normal((items, n, 1))
    on = rng.random((items, m, 1)) < active
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


def sizes(rng: Rng, largest: int) -> tuple[int, int, int]:
    """Return n, m, p: log-uniform n from 5 on, as many rows up to twice, p < n."""
    n = int(np.exp(rng.uniform(np.log(5), np.log(largest))))
    return n, int(rng.integers(1, 2 * n + 1)), int(rng.integers(1, n // 2 + 1))


def sparse_parts(rng: Rng, largest: int, rank: float = 0.5) -> tuple[Any, Any, Any]:
    """Return P = B'B of the given relative rank, G and A, all sparse."""
    n, m, p = sizes(rng, largest)
    density = min(1.0, 4.0 / n)
    B = entries(rng, max(int(rank * n), 1), n, density)
    G, A = entries(rng, m, n, density), entries(rng, p, n, density)
    return sp.csc_matrix(B.T @ B), G, A


def sparse_qp(rng: Rng) -> Problem:
    """Sparse, P of half the rank."""
    return planted(rng, *sparse_parts(rng, 2000))


def dense_qp(rng: Rng) -> Problem:
    """Dense, P of half the rank."""
    n, m, p = sizes(rng, 200)
    B = rng.standard_normal((n // 2 + 1, n))
    return planted(
        rng, B.T @ B, rng.standard_normal((m, n)), rng.standard_normal((p, n))
    )


def lp_like(rng: Rng) -> Problem:
    """Linear, or with a P of rank 1 to 3; the solution is mostly a vertex."""
    n, m, p = sizes(rng, 1000)
    density = min(1.0, 4.0 / n)
    B = entries(rng, int(rng.integers(1, 4)), n, density)
    P = sp.csc_matrix(B.T @ B) * float(rng.integers(0, 2))
    G, A = entries(rng, m, n, density), entries(rng, p, n, density)
    return planted(rng, P, G, A, active=0.6, box=1.0)


def degenerate(rng: Rng) -> Problem:
    """Sparse; two thirds of the rows active, half of those with multiplier zero."""
    return planted(rng, *sparse_parts(rng, 1000), active=0.67, weak=0.5)


def badly_scaled(rng: Rng) -> Problem:
    """Sparse; rows and columns in units of 10^U(-2, 2)."""
    return rescaled(planted(rng, *sparse_parts(rng, 1000)), rng, 2.0, 2.0)


def nearly_dependent(rng: Rng) -> Problem:
    """Sparse; a fifth of the rows repeated, changed by 1e-3 to 1e-8."""
    P, G, A = sparse_parts(rng, 1000)

    def repeated(C: Any) -> Any:
        rows = C[rng.integers(0, C.shape[0], C.shape[0] // 5 + 1)]
        size = 10.0 ** rng.integers(-8, -2)
        return sp.csc_matrix(
            sp.vstack([C, rows + size * entries(rng, *rows.shape, 4.0 / P.shape[0])])
        )

    return planted(rng, P, repeated(G), repeated(A))


FAMILIES: dict[str, Callable[[Rng], Problem]] = {
    "sparse": sparse_qp,
    "dense": dense_qp,
    "lp": lp_like,
    "degenerate": degenerate,
    "scaled": badly_scaled,
    "dependent": nearly_dependent,
}


def scaled(problem: Problem, D: np.ndarray, E: np.ndarray, F: np.ndarray) -> Problem:
    """Return the problem for x/D, its inequalities times E, its equalities times F."""
    P, q, G, h, A, b, lb, ub = problem.unpack()
    d = sp.diags_array(D)
    return Problem(
        sp.csc_matrix(d @ P @ d),
        D * q,
        None if G is None else sp.csc_matrix(sp.diags_array(E) @ G @ d),
        None if G is None else E * h,
        None if A is None else sp.csc_matrix(sp.diags_array(F) @ A @ d),
        None if A is None else F * b,
        None if lb is None else lb / D,
        None if ub is None else ub / D,
    )


def rescaled(problem: Problem, rng: Rng, rows: float, columns: float) -> Problem:
    """Return the problem in units of 10^U(-1, 1) to these powers."""
    m = 0 if problem.h is None else problem.h.size
    p = 0 if problem.b is None else problem.b.size
    units = (columns, problem.q.size), (rows, m), (rows, p)
    return scaled(problem, *(10.0 ** rng.uniform(-k, k, size) for k, size in units))


def noisy(problem: Problem, rng: Rng, size: float = 1e-3) -> Problem:
    """Return the problem with every number times 1 + size N(0, 1)."""
    P, q, G, h, A, b, lb, ub = problem.unpack()

    def factors(count: int) -> np.ndarray:
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
