"""method="auto": choose the methods that solve a box LCP.

MPRGP solves LCPs with a LinearOperator, elimination those with a tridiagonal A and a
start nearby. For any other large sparse A, and a tridiagonal A whose start was far,
projected SOR is tried as long as it converges fast enough, then multigrid where A suits
it. Pivoting solves the rest, and what these leave unsolved.
Where pivoting makes no progress, or the diagonal of A shows that it is neither a
P-matrix nor semidefinite, the methods of `namlcp.lcp.general` take over.
"""

import numpy as np
from scipy import sparse

from namlcp.lcp.criterion import Criterion
from namlcp.lcp.data import LCP
from namlcp.lcp.general.order import solve_general
from namlcp.lcp.mprgp import solve_by_products
from namlcp.lcp.multigrid.cycles import solve_by_multigrid
from namlcp.lcp.multigrid.hierarchy import hierarchy_of
from namlcp.lcp.operators import Operator
from namlcp.lcp.pivoting.driver import solve_box
from namlcp.lcp.psor import MAX_SWEEPS, solve_by_sweeps
from namlcp.lcp.tridiagonal import solve_tridiagonal
from namlcp.limits import Limits
from namlcp.outcome import Outcome
from namlcp.status import Status

LARGE_LCP = 10_000
"""Least order n at which projected SOR and multigrid are tried on a sparse A."""

TINY_LCP = 100
"""Largest order n at which pivoting is tried on every A: it takes less than 1 ms."""

LAST_SWEEPS = 5000
"""Largest number of sweeps after multigrid has failed on a nonsymmetric A."""


def solve_auto(lcp: LCP, z0: np.ndarray | None, limits: Limits) -> Outcome:
    """Solve a checked box LCP; max_iter = None is the default of each method."""
    matrix = lcp.matrix
    large = lcp.q.size >= LARGE_LCP
    if isinstance(lcp.A, Operator):
        return solve_by_products(lcp, z0, limits, Criterion(lcp, limits))
    if lcp.q.size > TINY_LCP and matrix.is_general:
        return solve_general(lcp, z0, limits)
    if matrix.tridiagonal is not None:
        outcome = solve_tridiagonal(lcp, matrix.tridiagonal, z0, limits)
        # A small A may be singular: pivoting may prove that there is no solution.
        is_open = outcome.status is Status.STALLED and not large
        if outcome.status is not Status.DIVERGED and not is_open:
            return outcome
        z0, large = outcome.point.z, large or (lcp.q.size > TINY_LCP and not is_open)
    if sparse.issparse(lcp.A) and large:
        outcome = solve_large(lcp, z0, limits)
        if outcome.ends:
            return outcome
        if limits.deadline.reached():  # before a long factorisation
            return outcome._replace(status=Status.TIME_LIMIT)
        z0 = outcome.point.z
    outcome = solve_box(lcp, z0, limits)
    if outcome.status is Status.STALLED:
        return solve_general(lcp, outcome.point.z, limits, outcome.iterations)
    return outcome


def solve_large(lcp: LCP, z0: np.ndarray | None, limits: Limits) -> Outcome:
    """Try projected SOR, then multigrid cycles where A suits them."""
    criterion = Criterion(lcp, limits)
    few, many = (limits._replace(max_iter=k) for k in (MAX_SWEEPS, LAST_SWEEPS))
    outcome = solve_by_sweeps(lcp, z0, few, criterion)
    if outcome.ends or hierarchy_of(lcp.matrix, limits.deadline) is None:
        return outcome
    outcome = solve_by_multigrid(lcp, outcome.point.z, limits, criterion)
    if outcome.ends or lcp.matrix.symmetric:
        return outcome
    return solve_by_sweeps(lcp, outcome.point.z, many, criterion)
