"""method="auto": which method solves a box LCP, from what A and the first sweeps tell.

A LinearOperator leaves only products, and a tridiagonal matrix is eliminated directly.
For other large sparse matrices sweeps alone are tried as long as their rate promises
enough, then multigrid cycles where A suits them. Everything else, and what they leave
unsolved, is for pivoting. The caller's matrix is not copied before that.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from scipy import sparse

from namlcp.lcp import mprgp
from namlcp.lcp.mprgp import solve_by_products
from namlcp.lcp.multigrid import MAX_CYCLES, solve_multigrid
from namlcp.lcp.operators import Operator
from namlcp.lcp.pivoting import MAX_ITER, Outcome, solve_box
from namlcp.lcp.prepared import Prepared
from namlcp.lcp.psor import dominance, relaxation, solve_dominant
from namlcp.lcp.tridiagonal import solve_tridiagonal
from namlcp.limits import Deadline
from namlcp.progress import Report
from namlcp.residuals import natural_residual, natural_residuals
from namlcp.status import Status

LARGE = 10_000
"""From this order on, sparse problems try whether sweeps or multigrid will do."""

WORTH = 200
"""So many sweeps cost about as much as one sparse factorisation of that order."""

LAST = 5000
"""So many are worth it where cycles on a nonsymmetric matrix have come to nothing."""

TOO_FAR = 1e6
"""Products at a start with a residual so many times that of clip(0) lose its digits."""

ENDS = (Status.SOLVED, Status.TIME_LIMIT)
"""With these there is nothing left for another method to do."""


def solve_auto(
    matrix: Prepared,
    q: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    z0: np.ndarray | None,
    *,
    max_iter: int | None,
    **limits: Any,
) -> tuple[Outcome, str]:
    """Solve a checked box LCP; return the outcome and the method that gave it.

    limits: eps_abs, eps_rel, deadline, report as in `solve_box`; max_iter = None stands
    for the default of each method.
    """
    A = matrix.A
    if isinstance(A, Operator):
        most = max_iter or mprgp.MAX_ITER
        outcome = ask_products(matrix, q, lower, upper, z0, max_iter=most, **limits)
        return outcome, "mprgp"
    if matrix.tridiagonal is not None:
        most = max_iter or MAX_ITER
        status, z, w, faces = solve_tridiagonal(
            matrix.tridiagonal, q, lower, upper, z0, max_iter=most, **limits
        )
        if status is Status.STALLED and q.size < LARGE:
            status = None  # A may be singular, and pivoting may prove what is wrong
        if status is not None:
            return Outcome(status, z, w, faces, None), "tridiagonal"
        z0 = z
    if sparse.issparse(A) and q.size >= LARGE:
        name = "psor"
        outcome = ask_sweeps(matrix, q, lower, upper, z0, **limits)
        if outcome.status in ENDS:
            return outcome, name
        if matrix.hierarchy(limits["deadline"]) is not None:
            problem = matrix, q, lower, upper, outcome.z
            outcome, name = ask_multigrid(*problem, max_iter=max_iter, **limits)
            if outcome.status not in ENDS and not matrix.symmetric:
                name = "psor"
                outcome = ask_sweeps(matrix, q, lower, upper, outcome.z, LAST, **limits)
            if outcome.status in ENDS:
                return outcome, name
        if limits["deadline"].reached():  # before a long factorisation
            return outcome._replace(status=Status.TIME_LIMIT), name
        z0 = outcome.z
    limits |= {"max_iter": max_iter or MAX_ITER, "symmetric": matrix.symmetric}
    return solve_box(A, q, lower, upper, z0, **limits), "pivoting"


def ask_sweeps(
    matrix: Prepared,
    q: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    z0: np.ndarray | None,
    worth: int = WORTH,
    *,
    eps_abs: float,
    eps_rel: float,
    deadline: Deadline,
    report: Report = None,
) -> Outcome:
    """Sweep over the caller's own matrix, as long as `worth` sweeps seem to do."""
    A = matrix.A
    z = start(z0, lower, upper)
    mu = dominance(A)
    if not mu < math.inf:
        return Outcome(Status.STALLED, z, A @ z + q, 0, None)
    accept, goal, size = criterion(matrix, q, lower, upper, eps_abs, eps_rel)
    w = A @ z + q if z.any() else q.copy()
    if accept(z, w):
        return Outcome(Status.SOLVED, z, w, 0, None)
    alpha = relaxation(mu, False)
    if alpha == 1.0 and mu < 1.0:
        young = relaxation(mu, True)
        if (young - 1.0) ** (worth // 2) * size <= goal and matrix.symmetric:
            alpha = young
    status, w, done = solve_dominant(
        A, q, z, lower, upper, alpha, accept, goal, worth, deadline
    )
    if report is not None and status in ENDS:
        active = np.count_nonzero((z == lower) | (z == upper))
        report(done, natural_residual(z, w, lower, upper), active)
    return Outcome(status, z, w, done, None)


def ask_multigrid(
    matrix: Prepared,
    q: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    z0: np.ndarray | None,
    *,
    eps_abs: float,
    eps_rel: float,
    max_iter: int | None,
    **limits: Any,
) -> tuple[Outcome, str]:
    """Solve by multigrid cycles; raise if A does not suit."""
    hierarchy = matrix.hierarchy(limits["deadline"])
    if hierarchy is None and limits["deadline"].reached():
        z = start(z0, lower, upper)
        return Outcome(Status.TIME_LIMIT, z, matrix.A @ z + q, 0, None), "multigrid"
    if hierarchy is None:
        raise ValueError(
            'A does not suit method "multigrid": it must have a positive diagonal, '
            "short rows, mostly negative couplings and V-cycles that contract; "
            'use method="auto"'
        )
    accept, goal, _ = criterion(matrix, q, lower, upper, eps_abs, eps_rel)
    limits |= {"accept": accept, "goal": goal}
    limits["max_cycles"] = max_iter or MAX_CYCLES
    found = solve_multigrid(hierarchy, q, lower, upper, z0, **limits)
    return Outcome(*found, None), "multigrid"


def ask_products(
    matrix: Prepared,
    q: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    z0: np.ndarray | None,
    *,
    eps_abs: float,
    eps_rel: float,
    **limits: Any,
) -> Outcome:
    """Solve with products only; the other limits are `solve_by_products`'s."""
    A, root = matrix.A, np.sqrt(matrix.slopes)
    with np.errstate(all="ignore"):  # numbers out of range are noticed
        accept, _, size = criterion(matrix, q, lower, upper, eps_abs, eps_rel)
        z = start(z0, lower, upper)
        if z0 is not None:
            there = natural_residuals(z, A @ z + q, lower, upper, root)[1]
            if not there <= TOO_FAR * size:
                z = start(None, lower, upper)
        return Outcome(*solve_by_products(A, q, lower, upper, z, accept, **limits))


def start(z0: np.ndarray | None, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """Return clip(z0), an array of its own."""
    z = np.zeros(lower.size) if z0 is None else z0.copy()
    return np.clip(z, lower, upper, out=z)


class Criterion(NamedTuple):
    """When a point solves the LCP: accept(z, w).

    Of the problem scaled to a unit diagonal: a Res of `goal` will pass, and `size` is
    Res(clip(0)).
    """

    accept: Callable[[np.ndarray, np.ndarray], bool]
    goal: float
    size: float


def criterion(
    matrix: Prepared,
    q: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    eps_abs: float,
    eps_rel: float,
) -> Criterion:
    """Return the criterion of `solve_lcp`."""
    root = np.sqrt(matrix.slopes)
    z = start(None, lower, upper)
    w = matrix.A @ z + q if z.any() else q
    size = natural_residuals(z, w, lower, upper, root)[1]

    def accept(z: np.ndarray, w: np.ndarray) -> bool:
        plain, scaled = natural_residuals(z, w, lower, upper, root)
        return plain < eps_abs or scaled <= eps_rel * size < math.inf

    largest = float(root.max(initial=1e-300))
    return Criterion(accept, max(eps_rel * size, eps_abs / largest), size)
