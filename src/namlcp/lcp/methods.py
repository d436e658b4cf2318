"""The methods for LCPs by name, and the route of those that try several.

"auto" solves every LCP with a P-matrix or a semidefinite matrix, as far as rounding
allows. Where the diagonal of A shows that it is neither, or pivoting makes no progress,
`solve_general` goes on. No method solves every LCP: the problem is NP-complete (Chung,
J. Optim. Theory Appl. 60, 1989, 393-399).
"""

from collections.abc import Callable, Collection, Iterator
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from namlcp.checks import vector
from namlcp.lcp.data import LCP, LCPPoint, Operator, Prepared
from namlcp.lcp.general.lemke import (
    LARGEST_ENUMERATION,
    solve_by_enumeration,
    solve_by_lemke,
    solve_game,
    solve_lemke,
)
from namlcp.lcp.general.search import Search
from namlcp.lcp.loops import MOST_SMALL
from namlcp.lcp.modulus.methods import SWEEPS
from namlcp.lcp.modulus.sweeps import sweep
from namlcp.lcp.mprgp import solve_by_products
from namlcp.lcp.multigrid.cycles import solve_by_multigrid
from namlcp.lcp.multigrid.hierarchy import hierarchy_of
from namlcp.lcp.pivoting.driver import Attempt
from namlcp.lcp.psor import solve_by_sweeps
from namlcp.lcp.tridiagonal import solve_tridiagonal
from namlcp.limits import Deadline, Limits
from namlcp.linalg.threads import blas_threads
from namlcp.options import nearest
from namlcp.status import ENDS, Outcome, Status

# Least order n at which projected SOR and multigrid are tried on a sparse A.
LARGE_LCP = 10_000
# Largest orders for Lemke's method on a dense tableau: up to the first it is faster
# than the paths where A is dense, up to the second it is tried after them. (An A of up
# to `data.DENSE_ORDER` unknowns is dense here even if given as sparse.)
LEMKE_ORDER, LAST_LEMKE = 400, 1200
# Order up to which a proof is cheap beside a path.
PROOF_ORDER = 250


class Method(NamedTuple):
    """solve(lcp, z0, limits, **options), and the options it takes beside the limits."""

    solve: Callable[..., Outcome]
    takes: tuple[str, ...]


def solve_auto(lcp: LCP, z0: np.ndarray | None, limits: Limits) -> Outcome:
    """Solve a checked box LCP; max_iter = None is the default of each method."""
    deadline = limits.deadline
    for solve, unsettled in ways(lcp.matrix, deadline):
        outcome = solve(lcp, z0, limits)
        if outcome.status not in unsettled:
            break
        if deadline.reached():
            return outcome._replace(status=Status.TIME_LIMIT)
        z0 = outcome.point.z
    return outcome


def ways(matrix: Prepared, deadline: Deadline) -> Iterator[tuple[Any, ...]]:
    """Yield what "auto" tries, each with the statuses after which the next goes on."""
    if isinstance(matrix.A, Operator):
        yield solve_by_products, ()
    if matrix.n > MOST_SMALL and matrix.is_general:
        yield solve_general, ()
    if matrix.tridiagonal is not None:
        yield solve_by_elimination, (Status.DIVERGED,)
    # Iterations may beat the factorisations of a large sparse matrix, and of a smaller
    # tridiagonal one whose elimination met too many faces.
    may_be_slow = matrix.n >= LARGE_LCP or matrix.tridiagonal is not None
    if matrix.is_sparse and matrix.n > MOST_SMALL and may_be_slow:
        if matrix.dominance < np.inf:
            yield solve_by_sweeps, (Status.STALLED, Status.MAX_ITER)
        if hierarchy_of(matrix, deadline) is not None:
            yield solve_by_multigrid, (Status.STALLED, Status.MAX_ITER)
    yield solve_by_pivoting, ()


def solve_general(
    lcp: LCP, z0: np.ndarray | None, limits: Limits, before: int = 0
) -> Outcome:
    """Solve a box LCP with any matrix, prove that it has no solution, or give up.

    limits.max_iter counts factorisations, `before` those of earlier methods.
    """
    with np.errstate(all="ignore"):  # paths overflow where they diverge
        search = Search(lcp, limits, before)
        if z0 is not None and not search.over():
            search.complete(search.model.p(lcp.start(z0)), "start")
        for stage in stages(lcp.matrix):
            if search.over():
                return search.outcome()
            outcome = search.decided(stage(search))
            if outcome is not None:
                return outcome
        return search.outcome("no solution was found, and no proof that there is none")


def stages(matrix: Prepared) -> Iterator[Callable[[Search], Outcome | None]]:
    n = matrix.n
    yield solve_game
    lemke_is_faster = n <= LEMKE_ORDER and isinstance(matrix.compact, np.ndarray)
    if lemke_is_faster:
        yield solve_by_lemke
    yield Search.by_path
    if n <= PROOF_ORDER:
        yield Search.by_proof
    if n <= LARGEST_ENUMERATION:
        yield solve_by_enumeration
    yield Search.by_arc
    if n > PROOF_ORDER:
        yield Search.by_proof
    if n <= LAST_LEMKE and not lemke_is_faster:
        yield solve_by_lemke


def solve_by_pivoting(lcp: LCP, z0: np.ndarray | None, limits: Limits) -> Outcome:
    """Solve by pivoting, and as a general LCP where that makes no progress."""
    attempt = Attempt(lcp, z0, limits, ask_convex=False)
    attempt.run()
    outcome = attempt.outcome()
    if outcome.status is Status.STALLED:
        return solve_general(lcp, outcome.point.z, limits, outcome.iterations)
    return outcome


def solve_by_elimination(lcp: LCP, z0: np.ndarray | None, limits: Limits) -> Outcome:
    """Solve a tridiagonal LCP; a small A may be singular, which pivoting may prove."""
    outcome = solve_tridiagonal(lcp, z0, limits)
    if outcome.status is Status.STALLED and lcp.q.size < LARGE_LCP:
        return solve_by_pivoting(lcp, outcome.point.z, limits)
    return outcome


METHODS = {
    "auto": Method(solve_auto, ("z0", "eps_rel")),
    "multigrid": Method(solve_by_multigrid, ("z0", "eps_rel")),
    "lemke": Method(solve_lemke, ("cover", "eps_rel")),
} | {
    name: Method(partial(sweep, method=name), (*row.takes, "s0", "z0"))
    for name, row in SWEEPS.items()
}


def find_method(method: str, options: Collection[str] = ()) -> Method:
    """Return a method; raise if it is unknown or lacks an option that is given."""
    if not isinstance(method, str):
        raise TypeError(f"method must be a string, got {method!r}")
    if method not in METHODS:
        near = nearest(method, METHODS)
        hint = f"; did you mean {near!r}?" if near else ""
        raise ValueError(f"method must be one of {list(METHODS)}, got {method!r}{hint}")
    found = METHODS[method]
    for name in options:
        if name not in found.takes:
            takers = [other for other, row in METHODS.items() if name in row.takes]
            raise ValueError(
                f"{name} is not a parameter of method {method!r}, "
                f"only of {', '.join(takers)}"
            )
    if "alpha" in options and "omega" in options and SWEEPS[method].factored:
        raise ValueError(
            f"method {method!r} has Omega = alpha I: give alpha or omega, not both"
        )
    return found


def solve_by_method(
    lcp: LCP,
    unit: float,
    limits: Limits,
    method: str = "auto",
    z0: Any = None,
    is_next: bool = False,
    **options: Any,
) -> Outcome:
    """Solve an LCP as `lcp_data` returns it; the options are those of `solve_lcp`.

    is_next: whether the user has the `Prepared` matrix, for one LCP after another.
    """
    found = METHODS[method]
    # A LinearOperator is the user's code: it keeps the user's number of BLAS threads.
    order = 0 if isinstance(lcp.A, Operator) else lcp.q.size
    with blas_threads(1, order):
        if z0 is not None:
            z0 = vector("z0", z0, lcp.q.size, "A", lcp.A.shape, finite=True)
        elif method == "auto" and is_next:
            return solve_next(lcp, unit, limits)
        solve = partial(found.solve, **options)
        if "eps_rel" not in found.takes:
            return solve(lcp, z0, limits)
        return solve_scaled(lcp, unit, solve, z0, limits)


def solve_next(lcp: LCP, unit: float, limits: Limits) -> Outcome:
    """Solve the next LCP with a `Prepared` matrix, from the face of the last one."""
    matrix = lcp.matrix
    outcome = solve_scaled(lcp, unit, solve_auto, matrix.last, limits)
    if outcome.status not in ENDS and matrix.last is not None:
        outcome = solve_scaled(lcp, unit, solve_auto, None, limits)
    if outcome.status is Status.SOLVED and outcome.method == "pivoting":
        matrix.last = outcome.point.z
    return outcome


def solve_scaled(
    lcp: LCP,
    unit: float,
    solve: Callable[[LCP, Any, Limits], Outcome],
    z0: np.ndarray | None,
    limits: Limits,
) -> Outcome:
    """Call a method on the LCP divided by `unit`, so that squares stay in range."""
    if unit == 1.0:
        return solve(lcp, z0, limits)
    told = limits.report
    units = limits._replace(
        eps_abs=limits.eps_abs / unit,
        report=told and (lambda k, residual, active: told(k, residual * unit, active)),
    )
    with np.errstate(over="ignore"):  # a bound or an entry that overflows is infinite
        inner = LCP(lcp.matrix, lcp.q / unit, lcp.lower / unit, lcp.upper / unit)
        outcome = solve(inner, None if z0 is None else z0 / unit, units)
        ray = None if outcome.ray is None else outcome.ray / unit
        if ray is not None and not np.isfinite(ray).all():
            ray = None
        point = LCPPoint(outcome.point.z * unit, outcome.point.w * unit)
        residual = lcp.residual(point.z, point.w)
        return outcome._replace(point=point, residuals=residual, ray=ray)
