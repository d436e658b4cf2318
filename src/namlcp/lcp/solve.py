"""solve_lcp: check, choose, solve, judge."""

import math
import time
from typing import Any

import numpy as np

from namlcp.checks import refuse_number, vector
from namlcp.lcp.auto import MAX_ITER, Outcome, solve_auto
from namlcp.lcp.data import LCPData, lcp_data
from namlcp.lcp.methods import find_method
from namlcp.lcp.pivoting import pivot
from namlcp.lcp.prepared import Prepared
from namlcp.lcp.sweeps import sweep
from namlcp.options import check_count, check_flag, check_number
from namlcp.progress import LCP_COLUMNS, Progress
from namlcp.residuals import natural_residual
from namlcp.result import LCPResult

SWEEP_EPS_ABS = 1e-8
SWEEP_MAX_ITER = 100_000
AUTO_EPS_REL = 1e-9


def solve_lcp(
    A: Any,
    q: Any,
    lower: Any = None,
    upper: Any = None,
    *,
    method: str = "auto",
    alpha: float | str | None = None,
    beta: float | None = None,
    omega: Any = None,
    shift: Any = None,
    s0: Any = None,
    z0: Any = None,
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
    A : (n, n) array, sparse array or Prepared
        Symmetric or not.
    q : (n,) array
    lower, upper : (n,) array or float
        Bounds, 0 and +inf unless given. lower_i = upper_i pins z_i, lower_i = -inf with
        upper_i = +inf frees it: equation i.
    method : str
        "auto": sweeps, block principal pivoting, a short interior path and a proximal
        loop; for every P-matrix and every symmetric positive semidefinite matrix, as
        far as rounding allows. Otherwise the name of a sweep method, see
        `namlcp.lcp.methods`.
    alpha, beta : float
        Relaxation parameters of the sweep methods that have them. alpha = "auto" is
        chosen as the method runs.
    omega, shift : float or (n,) array
        Diagonals of the sweep methods; a number c stands for c I. omega = "auto" is a
        multiple of diag(A), chosen as the method runs.
    s0 : (n,) array
        Start of a sweep method in the modulus variable (scale r = 2).
    z0 : (n,) array
        Where to start.
    eps_abs : float
        Solved when Res(z) = || z - clip(z - w, lower, upper) ||_2 < eps_abs.
    eps_rel : float
        "auto" only. Solved when Res, of the problem scaled to a unit diagonal, is at
        most eps_rel times its value at z = clip(0), which is || min(q, 0) ||_2 without
        bounds. If neither is given eps_rel = 1e-9; if one is given the other is 0.
    max_iter : int
        Limit on sweeps; for "auto" on factorisations (of sweeps it makes few).
    time_limit : float
        Limit on the solve [s]; the best point so far is returned.
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
    deadline = start + check_limits(eps_abs, eps_rel, max_iter, time_limit)
    check_flag("history", history)
    check_flag("verbose", verbose)
    parameters: dict[str, Any] = {
        "alpha": alpha, "beta": beta, "omega": omega, "shift": shift, "s0": s0,
    }  # fmt: skip
    find_method(method, **{k: v for k, v in parameters.items() if k != "s0"})
    if method == "auto" and s0 is not None:
        raise ValueError('s0 is for the sweep methods, pass z0 to method "auto"')
    matrix = A if isinstance(A, Prepared) else Prepared(A)
    data = lcp_data(matrix.A, q, lower, upper)
    progress = Progress(LCP_COLUMNS, verbose)
    progress.say(f"namlcp  LCP: n = {data.q.size}, method = {method}")
    limits: dict[str, Any] = {"deadline": deadline, "report": progress.report(history)}
    ready = time.perf_counter()
    if method == "auto":
        progress.announce(pivot)
        if eps_rel is None:
            eps_rel = AUTO_EPS_REL if eps_abs is None else 0.0
        start_at = None if z0 is None else start_point(z0, data.q.size)
        limits["max_iter"] = max_iter or MAX_ITER
        outcome, method = solve_in_units(
            matrix, data, start_at, eps_abs or 0.0, eps_rel, limits
        )
        diagonal = data.A.diagonal()
        s = outcome.z - outcome.w / np.where(diagonal > 0.0, diagonal, 1.0)
    else:
        if eps_rel is not None:
            raise ValueError(f'eps_rel is for method "auto" only, got {method!r}')
        swept = sweep(
            data.A,
            data.q,
            data.lower,
            data.upper,
            method,
            z0=z0,
            eps_abs=SWEEP_EPS_ABS if eps_abs is None else eps_abs,
            max_iter=max_iter or SWEEP_MAX_ITER,
            **parameters,
            **limits,
        )
        w, s = data.A @ swept.z + data.q, swept.s
        outcome = Outcome(swept.status, swept.z, w, swept.iterations, None)
    residual = natural_residual(outcome.z, outcome.w, data.lower, data.upper)
    end = time.perf_counter()
    progress.close(
        f"{outcome.status.value}: {outcome.iterations} iterations, "
        f"{end - start:.1e} s, residual {residual:.1e}"
    )
    return LCPResult(
        status=outcome.status,
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


def check_limits(eps_abs: Any, eps_rel: Any, max_iter: Any, time_limit: Any) -> float:
    """Raise for a bad tolerance or limit; return the time limit."""
    for name, value in (("eps_abs", eps_abs), ("eps_rel", eps_rel)):
        if value is not None:
            check_number(name, value, 0.0, closed=name == "eps_rel", finite=True)
    if max_iter is not None:
        check_count("max_iter", max_iter)
    check_number("time_limit", time_limit, 0.0)
    return float(time_limit)


def solve_in_units(
    matrix: Prepared,
    data: LCPData,
    z0: np.ndarray | None,
    eps_abs: float,
    eps_rel: float,
    limits: dict[str, Any],
) -> tuple[Outcome, str]:
    """Call `solve_auto`, in units of `unit_of(q)` for q, z and the bounds."""
    unit = unit_of(data.q)
    outcome, method = solve_auto(
        matrix,
        data.q / unit,
        data.lower / unit,
        data.upper / unit,
        None if z0 is None else z0 / unit,
        eps_abs=eps_abs / unit,
        eps_rel=eps_rel,
        **limits,
    )
    return outcome._replace(z=outcome.z * unit, w=outcome.w * unit), method


def unit_of(q: np.ndarray) -> float:
    """Return 1, or a power of 2 near max |q| where squares would leave the range."""
    size = float(np.abs(q).max(initial=0.0))
    if size == 0.0 or 1e-100 < size < 1e100:
        return 1.0
    return 2.0 ** math.floor(math.log2(size))


def start_point(z0: Any, n: int) -> np.ndarray:
    """Return z0 as a clean vector."""
    z0 = vector("z0", z0, n, "A", (n, n))
    refuse_number("z0", z0, False)
    return z0
