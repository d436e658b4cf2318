"""The route of an LCP: scale it, call the method, or a chain of methods for "auto"."""

import math
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from scipy.sparse import issparse

from namlcp.checks import finite_vector
from namlcp.lcp.auto import LARGE_LCP, solve_auto
from namlcp.lcp.criterion import Criterion
from namlcp.lcp.data import LCP, LCPPoint, is_ordinary
from namlcp.lcp.general.lemke import solve_lemke
from namlcp.lcp.general.tableau import pivot_until
from namlcp.lcp.modulus.methods import Parameters, spread
from namlcp.lcp.modulus.sweeps import sweep
from namlcp.lcp.multigrid.cycles import solve_by_multigrid
from namlcp.lcp.multigrid.kernels import ascend
from namlcp.lcp.operators import Operator
from namlcp.lcp.pivoting.pivot import pivot
from namlcp.lcp.prepared import Prepared
from namlcp.lcp.relaxation import relax_csr
from namlcp.lcp.tridiagonal import solve_faces
from namlcp.limits import Limits
from namlcp.linalg.threads import blas_threads
from namlcp.outcome import Outcome
from namlcp.status import Status

LEAST_SIZE, MOST_SIZE = 1e-100, 1e100
"""Range of max |q_i| in which q is not scaled: sums of squares neither vanish nor
overflow there."""

Solver = Callable[[LCP, np.ndarray | None, Limits], Outcome]


def solve_by_method(
    lcp: LCP,
    limits: Limits,
    method: str = "auto",
    given: Parameters | None = None,
    cover: Any = None,
    s0: Any = None,
    z0: Any = None,
    is_kept: bool = False,
) -> Outcome:
    """Solve a checked LCP; the arguments are those of `solve_lcp`.

    given: the parameters of a sweep method. is_kept: whether the caller keeps the
    `Prepared` matrix, for one LCP after another.
    """
    # A LinearOperator is the user's code: it keeps the user's number of BLAS threads.
    order = 0 if isinstance(lcp.A, Operator) else lcp.q.size
    with blas_threads(1, order):
        if given is not None:
            return sweep(lcp, method, given, limits, s0, z0)
        if method == "auto" and z0 is None and is_kept:
            return solve_next(lcp, limits)
        return solve_exactly(lcp, solver_of(method, cover, lcp.q.size), z0, limits)


def solver_of(method: str, cover: Any, n: int) -> Solver:
    """Return the function of one of SOLVERS; raise for a bad covering vector."""
    if method == "lemke":
        cover = spread("cover", cover, n, np.ones(n), positive=True)
        return partial(solve_lemke, cover=cover)
    return solve_auto if method == "auto" else solve_multigrid


def solve_next(lcp: LCP, limits: Limits) -> Outcome:
    """Solve the next LCP with a `Prepared` matrix, from the face of the last one.

    What is not solved from there is solved as if it were the first one.
    """
    matrix = lcp.matrix
    outcome = solve_exactly(lcp, solve_auto, matrix.last, limits)
    undecided = outcome.status not in (Status.SOLVED, Status.TIME_LIMIT)
    if undecided and matrix.last is not None:
        outcome = solve_exactly(lcp, solve_auto, None, limits)
    if outcome.status is Status.SOLVED and outcome.method == "pivoting":
        matrix.last = outcome.point.z
    return outcome


def solve_exactly(lcp: LCP, solver: Solver, z0: Any, limits: Limits) -> Outcome:
    """Call the solver on the LCP scaled by `unit_of`, so that squares stay in range."""
    n = lcp.q.size
    if z0 is not None:
        z0 = finite_vector("z0", z0, n, "A", (n, n))
    unit = unit_of(lcp)
    if unit == 1.0:
        return solver(lcp, z0, limits)
    inner = LCP(lcp.matrix, lcp.q / unit, lcp.lower / unit, lcp.upper / unit)
    told = limits.report
    units = limits._replace(
        eps_abs=limits.eps_abs / unit,
        report=told and (lambda k, residual, active: told(k, residual * unit, active)),
    )
    outcome = solver(inner, None if z0 is None else z0 / unit, units)
    with np.errstate(over="ignore"):  # an entry of w that overflows is infinite
        ray = None if outcome.ray is None else outcome.ray / unit
        if ray is not None and not np.isfinite(ray).all():
            ray = None
        point = LCPPoint(outcome.point.z * unit, outcome.point.w * unit)
        residual = lcp.residual(point.z, point.w)
        return outcome._replace(point=point, residuals=residual, ray=ray)


def solve_multigrid(lcp: LCP, z0: np.ndarray | None, limits: Limits) -> Outcome:
    """Solve by multigrid cycles alone."""
    return solve_by_multigrid(lcp, z0, limits, Criterion(lcp, limits))


def unit_of(lcp: LCP) -> float:
    """Return 1, or a power of 2 near max |q_i| if squares may leave the range."""
    _, q, lower, upper = lcp
    if is_ordinary(q, lower, upper):
        return 1.0
    size = float(np.abs(q).max(initial=0.0))
    if size == 0.0 or LEAST_SIZE < size < MOST_SIZE:
        return 1.0
    return 2.0 ** math.floor(math.log2(size))


def first_kernel(matrix: Prepared, method: str) -> Any:
    """Return the kernel that the solve calls first, None for a LinearOperator."""
    A = matrix.A
    if isinstance(A, Operator):
        return None
    if method == "multigrid":
        return ascend
    if method == "lemke":
        return pivot_until
    if matrix.tridiagonal is not None:
        return solve_faces
    return relax_csr if issparse(A) and A.shape[0] >= LARGE_LCP else pivot
