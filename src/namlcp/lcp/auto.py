"""method="auto": which method solves a box LCP, from what A and the first sweeps tell.

A LinearOperator leaves only products, and a tridiagonal matrix is eliminated directly.
For other large sparse matrices sweeps alone are tried as long as their rate promises
enough, then multigrid cycles where A suits them. Everything else, and what they leave
unsolved, is for pivoting. The caller's matrix is not copied before that.
"""

import numpy as np
from scipy import sparse

from namlcp.lcp.criterion import Criterion
from namlcp.lcp.data import LCP, Outcome
from namlcp.lcp.mprgp import solve_by_products
from namlcp.lcp.multigrid import solve_by_multigrid
from namlcp.lcp.operators import Operator
from namlcp.lcp.pivoting import solve_box
from namlcp.lcp.psor import MAX_SWEEPS, solve_by_sweeps
from namlcp.lcp.tridiagonal import solve_tridiagonal
from namlcp.limits import Limits
from namlcp.status import Status

LARGE_LCP = 10_000
"""From this order on, sparse problems try whether sweeps or multigrid will do."""

LAST_SWEEPS = 5000
"""Sweeps at most after multigrid cycles on a nonsymmetric matrix have failed."""

ENDS = (Status.SOLVED, Status.TIME_LIMIT)
"""With these there is nothing left for another method to do."""


def solve_auto(lcp: LCP, z0: np.ndarray | None, limits: Limits) -> Outcome:
    """Solve a checked box LCP; max_iter = None is the default of each method."""
    matrix = lcp.matrix
    large = lcp.q.size >= LARGE_LCP
    if isinstance(lcp.A, Operator):
        return solve_by_products(lcp, z0, limits, Criterion(lcp, limits))
    if matrix.tridiagonal is not None:
        outcome = solve_tridiagonal(lcp, matrix.tridiagonal, z0, limits)
        # Where a small A is singular, pivoting may prove what is wrong.
        is_open = outcome.status is Status.STALLED and not large
        if outcome.status is not Status.UNSOLVABLE and not is_open:
            return outcome
        z0 = outcome.z
    if sparse.issparse(lcp.A) and large:
        outcome = solve_large(lcp, z0, limits)
        if outcome.status in ENDS:
            return outcome
        if limits.deadline.reached():  # before a long factorisation
            return outcome._replace(status=Status.TIME_LIMIT)
        z0 = outcome.z
    return solve_box(lcp, z0, limits)


def solve_large(lcp: LCP, z0: np.ndarray | None, limits: Limits) -> Outcome:
    """Try what needs no factorisation: sweeps, and multigrid cycles where A suits."""
    criterion = Criterion(lcp, limits)
    few, many = (limits._replace(max_iter=k) for k in (MAX_SWEEPS, LAST_SWEEPS))
    outcome = solve_by_sweeps(lcp, z0, few, criterion)
    if outcome.status in ENDS or lcp.matrix.hierarchy(limits.deadline) is None:
        return outcome
    outcome = solve_by_multigrid(lcp, outcome.z, limits, criterion)
    if outcome.status in ENDS or lcp.matrix.symmetric:
        return outcome
    return solve_by_sweeps(lcp, outcome.z, many, criterion)
