"""QPs of qpsolvers taken apart and put together."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import scipy.sparse as sp
from qpsolvers import Problem


def parts(problem: Problem) -> tuple[Any, ...]:
    """Return P, q, G, h, A, b, lb, ub, with zero rows and infinite bounds for None."""
    P, q, G, h, A, b, lb, ub = problem.unpack()
    n = q.size
    empty = sp.csc_matrix((0, n))
    return (
        P, q, empty if G is None else G, np.zeros(0) if h is None else h,
        empty if A is None else A, np.zeros(0) if b is None else b,
        np.full(n, -np.inf) if lb is None else lb,
        np.full(n, np.inf) if ub is None else ub,
    )  # fmt: skip


def by_name(problem: Problem) -> dict[str, Any]:
    return dict(zip("P q G h A b lb ub".split(), problem.unpack(), strict=True))


def joined(P: Any, q: np.ndarray, *parts: Any) -> Problem:
    """Return the problem of the parts G, h, A, b, lb, ub, None for no rows."""
    G, h, A, b, lb, ub = parts
    rows = (G, h) if h.size else (None, None)
    equations = (A, b) if b.size else (None, None)
    return Problem(P, q, *rows, *equations, lb, ub)


def tiny_problems(problem: Problem) -> Iterator[Problem]:
    """Yield a definite and a semidefinite problem like `problem`, n = 3."""
    row = np.ones((1, 3))
    G, h = np.vstack([row, -np.eye(3)]), np.array([1.0, 0.0, 0.5, 0.5])
    rest = G, h, row, np.array([0.5]), np.zeros(3), np.ones(3)
    for last in (2.0, 0.0):
        P = np.diag([2.0, 3.0, last]) + 0.5 * row.T @ row
        arrays = P, np.array([-1.0, 1.0, -0.5]), *rest
        own = zip(arrays, problem.unpack(), strict=True)
        tiny = Problem(*(None if theirs is None else v for v, theirs in own))
        yield sparse(tiny) if problem.has_sparse else tiny


def sparse(problem: Problem) -> Problem:
    arrays = problem.unpack()
    return Problem(*(sp.csc_matrix(v) if np.ndim(v) == 2 else v for v in arrays))


def dense(M: Any) -> Any:
    return M.toarray() if sp.issparse(M) else M


def filled(problem: Problem) -> Problem:
    return Problem(*map(dense, problem.unpack()))
