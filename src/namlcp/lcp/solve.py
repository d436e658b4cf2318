"""solve_lcp: check, choose, solve, judge."""

import math
import time
from typing import Any

import numpy as np
from scipy.sparse import issparse

from namlcp.checks import finite_vector
from namlcp.lcp.auto import LARGE, ask_multigrid, solve_auto
from namlcp.lcp.data import LCP, lcp_data
from namlcp.lcp.modulus import EXACT, find_method, relax_csr, sweep
from namlcp.lcp.multigrid import ascend
from namlcp.lcp.operators import Operator
from namlcp.lcp.pivoting import ACCURACY, Outcome, pivot
from namlcp.lcp.prepared import Prepared
from namlcp.lcp.tridiagonal import solve_faces
from namlcp.limits import Deadline, interruptible
from namlcp.linalg import blas_threads
from namlcp.options import check_count, check_flag, check_number
from namlcp.progress import LCP_COLUMNS, Progress
from namlcp.residuals import modulus_variable, natural_residual
from namlcp.result import LCPResult

SWEEP_EPS_ABS = 1e-8
SWEEP_MAX_ITER = 100_000


@interruptible
def solve_lcp(
    A: Any,
    q: Any,
    lower: Any = None,
    upper: Any = None,
    *,
    method: str = "auto",
    diagonal: Any = None,
    alpha: float | str | None = None,
    beta: float | None = None,
    omega: Any = None,
    shift: Any = None,
    s0: Any = None,
    z0: Any = None,
    threads: int | None = None,
    eps_abs: float | None = None,
    eps_rel: float | None = None,
    max_iter: int | None = None,
    time_limit: float = math.inf,
    history: bool = False,
    verbose: bool = False,
) -> LCPResult:
    """Solve a linear complementarity problem, with bounds.

    Find z in [lower, upper] such that w = A z + q satisfies w_i >= 0 where z_i =
    lower_i, w_i <= 0 where z_i = upper_i, and w_i = 0 in between. With the default
    bounds: z >= 0, w >= 0, z'w = 0.

    Parameters
    ----------
    A : (n, n) array, sparse array, scipy LinearOperator or Prepared
        Symmetric or not; a LinearOperator must be symmetric positive semidefinite.
    q : (n,) array
    lower, upper : (n,) array or float
        Bounds, 0 and +inf unless given. lower_i = upper_i pins z_i, lower_i = -inf with
        upper_i = +inf frees it: equation i.
    method : str
        "auto": elimination (tridiagonal A), sweeps, multigrid cycles, block principal
        pivoting, a short interior path, a homogeneous one and a proximal loop, as A
        needs; for every P-matrix and every positive semidefinite matrix (z'A z >= 0,
        symmetric or not), as far as rounding allows. For a LinearOperator it is MPRGP,
        see `namlcp.lcp.mprgp`, and there is no other. "multigrid": the cycles
        alone, for matrices like those of differential equations, see
        `namlcp.lcp.multigrid`; "auto" takes them from order 10^4 on where A suits.
        Otherwise the name of a sweep method, see `namlcp.lcp.modulus.methods`.
    diagonal : (n,) array
        diag(A) of a LinearOperator, which scales the problem; without it the scale is
        left as it is.
    alpha, beta : float
        Relaxation parameters of the sweep methods that have them. alpha = "auto" is
        chosen as the method runs.
    omega, shift : float or (n,) array
        Diagonals of the sweep methods; a number c stands for c I. omega = "auto" is a
        multiple of diag(A), chosen as the method runs.
    s0 : (n,) array
        Start of a sweep method in the modulus variable (scale r = 2); not beside z0.
    z0 : (n,) array
        Where to start.
    threads : int
        Sparse A and a triangular sweep method only. Sweep on at most so many threads,
        in the coloured order of `namlcp.lcp.modulus.coloured`: another splitting than
        that of the natural order (None), with other counts of iterations, but the same
        ones for every number of threads.
    eps_abs : float
        Solved when Res(z) = || z - clip(z - w, lower, upper) ||_2 < eps_abs.
    eps_rel : float
        "auto" and "multigrid" only. Solved when Res, of the problem scaled to a unit
        diagonal, is at most eps_rel times its value at z = clip(0), which is
        || min(q, 0) ||_2 without bounds; where that value is rounding alone clip(0) is
        the answer. If neither is given eps_rel = 1e-9; if one is given the other is 0.
    max_iter : int
        Limit on sweeps; for "multigrid" on cycles, for "auto" on cycles, factorisations
        or, of a LinearOperator, iterations (of sweeps it makes few).
    time_limit : float
        Limit on the solve [s]; the best point so far is returned. So it is after Ctrl-C
        in the main thread (a second one raises KeyboardInterrupt).
    history : bool
        Keep a row for every iteration.
    verbose : bool
        Print them.

    Returns
    -------
    LCPResult
        Read `status` first. UNSOLVABLE: there is no solution, with `ray` as the proof,
        or A is outside what the method can decide.

    Raises
    ------
    TypeError, ValueError
        An argument is malformed; the text says which and why.
    MemoryError
        A matrix to be made would have more entries than int32 can count.

    Notes
    -----
    Pivoting after Judice and Pires [1]_; `namlcp.lcp.pivoting` has the details. It
    works on d A d, d_i = a_ii^(-1/2), so that units do not matter.

    References
    ----------
    .. [1] J. J. Judice and F. M. Pires, Computers Ops Res 21 (1994) 587-596.

    Examples
    --------
    >>> import numpy as np
    >>> from namlcp import solve_lcp
    >>> result = solve_lcp(np.array([[2.0, 1.0], [1.0, 2.0]]), np.array([-5.0, -6.0]))
    >>> result.status.value
    'solved'
    >>> (3 * result.z).round(9)
    array([4., 7.])
    """
    start = time.perf_counter()
    deadline = Deadline(start + check_limits(eps_abs, eps_rel, max_iter, time_limit))
    check_flag("history", history)
    check_flag("verbose", verbose)
    find_method(method, alpha=alpha, beta=beta, omega=omega, shift=shift)
    if method in EXACT:
        refuse("is for the sweep methods, not for", method, s0=s0, threads=threads)
    else:
        refuse('is for method "auto" or "multigrid", not for', method, eps_rel=eps_rel)
    matrix = prepared(A, diagonal, method)
    data = lcp_data(matrix.A, q, lower, upper)
    progress = Progress(LCP_COLUMNS, verbose)
    if verbose:
        progress.say(f"namlcp  LCP: n = {data.q.size}, method = {method}")
        if method in EXACT:
            progress.announce(first_kernel(matrix, method))
    limits: dict[str, Any] = {"deadline": deadline, "report": progress.report(history)}
    limits |= {"eps_abs": eps_abs, "max_iter": max_iter}
    ready = time.perf_counter()
    # The products of a LinearOperator are the user's own, with the user's setting.
    order = 0 if isinstance(matrix.A, Operator) else data.q.size
    with deadline.listening(), blas_threads(1, order):
        if method in EXACT:
            limits["eps_rel"] = eps_rel
            outcome, s, method = solve_exactly(matrix, data, method, z0, limits)
        else:
            limits |= {"alpha": alpha, "beta": beta, "omega": omega, "shift": shift}
            limits |= {"s0": s0, "z0": z0, "threads": threads}
            outcome, s = solve_by_name(data, method, limits)
    status = deadline.verdict(outcome.status)
    residual = natural_residual(outcome.z, outcome.w, data.lower, data.upper)
    end = time.perf_counter()
    if verbose:
        progress.close(
            f"{status.value}: {method}, {outcome.iterations} iterations, "
            f"{end - start:.1e} s, residual {residual:.1e}"
        )
    return LCPResult(
        status=status,
        z=outcome.z,
        w=outcome.w,
        s=s,
        iterations=outcome.iterations,
        residual=residual,
        method=method,
        setup_time=ready - start,
        solve_time=end - ready,
        ray=outcome.ray,
        history=progress.history() if history else None,
    )


def solve_exactly(
    matrix: Prepared, data: LCP, method: str, z0: Any, limits: dict[str, Any]
) -> tuple[Outcome, np.ndarray, str]:
    """Solve by one of EXACT; return outcome, s and the method that gave it.

    It is called in units of data.unit for q, z, the bounds and eps_abs.
    """
    _, q, lower, upper, unit = data
    eps_abs, eps_rel = limits["eps_abs"], limits["eps_rel"]
    if eps_rel is None:
        limits["eps_rel"] = ACCURACY if eps_abs is None else 0.0
    limits["eps_abs"] = (eps_abs or 0.0) / unit
    if z0 is not None:
        z0 = finite_vector("z0", z0, q.size, "A", (q.size, q.size))
    solver = solve_auto if method == "auto" else ask_multigrid
    if unit != 1.0:
        q, lower, upper = q / unit, lower / unit, upper / unit
        z0 = None if z0 is None else z0 / unit
        told = limits["report"]
        if told is not None:
            limits["report"] = lambda k, residual, active: told(
                k, residual * unit, active
            )
    outcome, method = solver(matrix, q, lower, upper, z0, **limits)
    if unit != 1.0:
        with np.errstate(over="ignore"):  # beyond the range w is infinite
            ray = None if outcome.ray is None else outcome.ray / unit
            if ray is not None and not np.isfinite(ray).all():
                ray = None
            outcome = outcome._replace(z=outcome.z * unit, w=outcome.w * unit, ray=ray)
    s = np.empty(q.size)
    modulus_variable(outcome.z, outcome.w, matrix.slopes, s)
    return outcome, s, method


def solve_by_name(
    data: LCP, method: str, limits: dict[str, Any]
) -> tuple[Outcome, np.ndarray]:
    """Solve by a named sweep method; return outcome and s."""
    A, q, lower, upper, _ = data
    if limits["eps_abs"] is None:
        limits["eps_abs"] = SWEEP_EPS_ABS
    limits["max_iter"] = limits["max_iter"] or SWEEP_MAX_ITER
    swept = sweep(A, q, lower, upper, method, **limits)
    w = A @ swept.z + q
    return Outcome(swept.status, swept.z, w, swept.iterations, None), swept.s


def prepared(A: Any, diagonal: Any, method: str) -> Prepared:
    """Return A prepared, as it is if it was; raise if the method cannot use it."""
    if isinstance(A, Prepared):
        if diagonal is not None:
            raise ValueError("diagonal must be given to Prepared, with A")
        matrix = A
    else:
        matrix = Prepared(A, diagonal)
    if method != "auto" and isinstance(matrix.A, Operator):
        raise ValueError(
            f"method {method!r} needs the entries of A; a LinearOperator is solved by "
            'method "auto"'
        )
    return matrix


def first_kernel(matrix: Prepared, method: str) -> Any:
    """Return the compiled function that the solve will begin with, None if none."""
    A = matrix.A
    if isinstance(A, Operator):
        return None
    if method == "multigrid":
        return ascend
    if matrix.tridiagonal is not None:
        return solve_faces
    return relax_csr if issparse(A) and A.shape[0] >= LARGE else pivot


def refuse(why: str, method: str, **given: Any) -> None:
    """Raise for an argument that was given but is not for the method."""
    for name, value in given.items():
        if value is not None:
            raise ValueError(f"{name} {why} method {method!r}")


def check_limits(eps_abs: Any, eps_rel: Any, max_iter: Any, time_limit: Any) -> float:
    """Raise for a bad tolerance or limit; return the time limit."""
    for name, value in (("eps_abs", eps_abs), ("eps_rel", eps_rel)):
        if value is not None:
            check_number(name, value, 0.0, closed=name == "eps_rel", finite=True)
    if max_iter is not None:
        check_count("max_iter", max_iter)
    check_number("time_limit", time_limit, 0.0)
    return float(time_limit)
