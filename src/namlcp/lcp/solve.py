"""The route of an LCP: scale it, and call the method."""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from namlcp.checks import finite_vector
from namlcp.lcp.data import LCP, LCPPoint
from namlcp.lcp.methods import NAMED, solve_auto
from namlcp.lcp.operators import Operator
from namlcp.limits import Limits
from namlcp.linalg.threads import blas_threads
from namlcp.outcome import Outcome
from namlcp.status import Status


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

    is_next: whether the caller has the `Prepared` matrix, for one LCP after another.
    """
    found = NAMED[method]
    # A LinearOperator is the user's code: it keeps the user's number of BLAS threads.
    order = 0 if isinstance(lcp.A, Operator) else lcp.q.size
    with blas_threads(1, order):
        if z0 is not None:
            z0 = finite_vector("z0", z0, lcp.q.size, "A", lcp.A.shape)
        elif method == "auto" and is_next:
            return solve_next(lcp, unit, limits)
        solve = partial(found.solve, **options) if options else found.solve
        if "eps_rel" not in found.takes:
            return solve(lcp, z0, limits)
        return solve_scaled(lcp, unit, solve, z0, limits)


def solve_next(lcp: LCP, unit: float, limits: Limits) -> Outcome:
    """Solve the next LCP with a `Prepared` matrix, from the face of the last one.

    What is not solved from there is solved as if it were the first one.
    """
    matrix = lcp.matrix
    outcome = solve_scaled(lcp, unit, solve_auto, matrix.last, limits)
    undecided = outcome.status not in (Status.SOLVED, Status.TIME_LIMIT)
    if undecided and matrix.last is not None:
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
    inner = LCP(lcp.matrix, lcp.q / unit, lcp.lower / unit, lcp.upper / unit)
    told = limits.report
    units = limits._replace(
        eps_abs=limits.eps_abs / unit,
        report=told and (lambda k, residual, active: told(k, residual * unit, active)),
    )
    outcome = solve(inner, None if z0 is None else z0 / unit, units)
    with np.errstate(over="ignore"):  # an entry of w that overflows is infinite
        ray = None if outcome.ray is None else outcome.ray / unit
        if ray is not None and not np.isfinite(ray).all():
            ray = None
        point = LCPPoint(outcome.point.z * unit, outcome.point.w * unit)
        residual = lcp.residual(point.z, point.w)
        return outcome._replace(point=point, residuals=residual, ray=ray)
