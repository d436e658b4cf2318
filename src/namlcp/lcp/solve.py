"""The public function `solve_lcp`."""

import math
import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from scipy.sparse import issparse

from namlcp.checks import finite_vector
from namlcp.lcp.auto import LARGE_LCP, solve_auto
from namlcp.lcp.criterion import Criterion
from namlcp.lcp.data import LCP, Outcome, is_ordinary, lcp_data
from namlcp.lcp.general.lemke import solve_lemke
from namlcp.lcp.general.tableau import pivot_until
from namlcp.lcp.modulus.methods import SOLVERS, Parameters, find_method, spread
from namlcp.lcp.modulus.sweeps import sweep
from namlcp.lcp.multigrid.cycles import solve_by_multigrid
from namlcp.lcp.multigrid.kernels import ascend
from namlcp.lcp.operators import Operator
from namlcp.lcp.pivoting.driver import ACCURACY
from namlcp.lcp.pivoting.pivot import pivot
from namlcp.lcp.prepared import Prepared
from namlcp.lcp.relaxation import relax_csr
from namlcp.lcp.tridiagonal import solve_faces
from namlcp.limits import Deadline, Limits, interruptible
from namlcp.linalg.threads import blas_threads
from namlcp.options import check_count, check_flag, check_number
from namlcp.progress import LCP_COLUMNS, Progress
from namlcp.residuals import modulus_variable
from namlcp.result import LCPResult
from namlcp.status import Status

SWEEP_EPS_ABS = 1e-8
"""Default eps_abs of the sweep methods."""

LEAST_SIZE, MOST_SIZE = 1e-100, 1e100
"""Range of max |q_i| in which q is not scaled: sums of squares neither vanish nor
overflow there."""

Solver = Callable[[LCP, np.ndarray | None, Limits], Outcome]


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
    cover: Any = None,
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
    A : (n, n) array, sparse array, scipy LinearOperator or Prepared
        Symmetric or not; a LinearOperator must be symmetric positive semidefinite.
    q : (n,) array
    lower, upper : (n,) array or float
        Bounds, 0 and +inf unless given. lower_i = upper_i fixes z_i; an unknown with
        infinite bounds is free, w_i = 0.
    method : str
        "auto" chooses among elimination (tridiagonal A), projected SOR, multigrid
        cycles, block principal pivoting, interior-point methods and a proximal-point
        method. It solves every LCP with a P-matrix or a positive semidefinite matrix
        (z'A z >= 0, symmetric or not), as far as rounding allows. For other matrices,
        as of contact with friction, games and circuits, it has the methods of
        `namlcp.lcp.general`; with a copositive matrix (z'A z >= 0 for z >= 0) and the
        usual q they find a solution, elsewhere as a rule. With a LinearOperator
        it is MPRGP, see `namlcp.lcp.mprgp`; no other method takes one.
        "multigrid" means multigrid cycles alone, for matrices like those of
        differential equations, see `namlcp.lcp.multigrid`; "auto" tries them from order
        10^4 on. "lemke" means Lemke's method alone, with a dense tableau, for n up to
        5000; which matrices it suits, and what its rays prove, says
        `namlcp.lcp.general.lemke`. Otherwise the name of a sweep method:
        `namlcp.lcp.modulus.methods`.
    diagonal : (n,) array
        diag(A) of a LinearOperator, to scale the problem; it is not scaled without.
    alpha, beta : float
        Relaxation parameters of the sweep methods that have them. alpha = "auto" is
        chosen during the run.
    omega, shift : float or (n,) array
        Diagonals of the sweep methods; a number c stands for c I. omega = "auto" is a
        multiple of diag(A), chosen during the run.
    cover : float or (n,) array
        Covering vector d > 0 of "lemke", 1 by default: its path begins at w = A z + q +
        z_0 d with a large z_0. Entries of unknowns without bounds have no effect.
    s0 : (n,) array
        Start of a sweep method in the modulus variable (scale r = 2), instead of z0.
    z0 : (n,) array
        Start; "lemke" has none. With a `Prepared` matrix and "auto" it is the last
        solution that pivoting found, unless given.
    eps_abs : float
        Solved when Res(z) = || z - clip(z - w, lower, upper) ||_2 < eps_abs.
    eps_rel : float
        Not for sweep methods. Solved when Res of the problem scaled to a unit
        diagonal is at most eps_rel times its value at z = clip(0); "auto" returns
        clip(0) if that value is rounding error. If neither tolerance is given, eps_rel
        = 1e-9; if one is given, the other is 0.
    max_iter : int
        Limit on sweeps; for "multigrid" on cycles; for "lemke" on pivots; for "auto"
        on cycles, factorisations or, with a LinearOperator, iterations ("auto" limits
        its sweeps itself).
    time_limit : float
        Limit on the time of the solve [s]. The best point so far is then returned.
    history : bool
        Keep a row for every iteration.
    verbose : bool
        Print these rows.

    Returns
    -------
    LCPResult
        Read `status` first. UNSOLVABLE: there is no solution; `ray` is the proof, or
        `message` says that all complementary cones were enumerated. STALLED: no
        solution was found; for a general matrix there may be one.

    Raises
    ------
    TypeError, ValueError
        An argument is malformed; the text says which and why.
    MemoryError
        A matrix to be made would have more entries than int32 can count.

    Notes
    -----
    Pivoting follows Judice and Pires [1]_, see `namlcp.lcp.pivoting`; Lemke's method
    Cottle, Pang and Stone [2]_.

    References
    ----------
    .. [1] J. J. Judice and F. M. Pires, Computers Ops Res 21 (1994) 587-596.
    .. [2] R. W. Cottle, J.-S. Pang and R. E. Stone, The Linear Complementarity Problem
       (1992), section 4.4.

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
    find_method(method, alpha=alpha, beta=beta, omega=omega, shift=shift, cover=cover)
    if method in SOLVERS:
        refuse("is for the sweep methods, not for", method, s0=s0)
    else:
        refuse("is not for sweep methods, got", method, eps_rel=eps_rel)
    if method == "lemke":
        refuse("is not for", method, z0=z0)
    tolerances = tolerances_of(method, eps_abs, eps_rel)
    matrix = prepared(A, diagonal, method)
    lcp = lcp_data(matrix, q, lower, upper)
    progress = Progress(LCP_COLUMNS, verbose)
    if verbose:
        progress.say(f"namlcp  LCP: n = {lcp.q.size}, method = {method}")
        if method in SOLVERS:
            progress.announce(first_kernel(matrix, method))
    report = progress.report(history)
    limits = Limits(*tolerances, max_iter, deadline, report)
    ready = time.perf_counter()
    # A LinearOperator is the user's code: it keeps the user's number of BLAS threads.
    order = 0 if isinstance(matrix.A, Operator) else lcp.q.size
    with blas_threads(1, order):
        if method not in SOLVERS:
            given = Parameters(alpha, beta, omega, shift)
            outcome = sweep(lcp, method, given, limits, s0, z0)
        elif method == "auto" and z0 is None and A is matrix:
            outcome = solve_next(lcp, limits)
        else:
            solver = solver_of(method, cover, lcp.q.size)
            outcome = solve_exactly(lcp, solver, z0, limits)
    rows = progress.history() if history else None
    problem = lcp, matrix.A if A is matrix else A
    result = result_of(outcome, problem, start, ready, rows)
    if verbose:
        progress.close(conclude(result))
    return result


def tolerances_of(
    method: str, eps_abs: float | None, eps_rel: float | None
) -> tuple[float, float]:
    """Return eps_abs and eps_rel with the defaults of the method."""
    if method not in SOLVERS:
        return SWEEP_EPS_ABS if eps_abs is None else eps_abs, 0.0
    if eps_rel is None:
        eps_rel = ACCURACY if eps_abs is None else 0.0
    return eps_abs or 0.0, eps_rel


def result_of(
    outcome: Outcome,
    problem: tuple[LCP, Any],
    start: float,
    ready: float,
    history: np.ndarray | None,
) -> LCPResult:
    """Return the outcome as a result, with its residual and its modulus variable.

    problem: the checked LCP, and A as it was given. start, ready: the values of
    time.perf_counter() at the call and after its checks.
    """
    lcp, s = problem[0], outcome.s
    residual = lcp.residual(outcome.z, outcome.w)
    if s is None:
        s = np.empty(lcp.q.size)
        modulus_variable(outcome.z, outcome.w, lcp.matrix.slopes, s)
    return LCPResult(
        status=outcome.status,
        z=outcome.z,
        w=outcome.w,
        s=s,
        iterations=outcome.iterations,
        residual=residual,
        method=outcome.method,
        setup_time=ready - start,
        solve_time=time.perf_counter() - ready,
        ray=outcome.ray,
        message=outcome.message,
        history=history,
        problem=problem,
    )


def conclude(result: LCPResult) -> str:
    """Return the closing sentence of the verbose output."""
    seconds = result.setup_time + result.solve_time
    return (
        f"{result.status.value}: {result.method}, {result.iterations} iterations, "
        f"{seconds:.1e} s, residual {result.residual:.1e}"
    )


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
        matrix.last = outcome.z
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
        return outcome._replace(z=outcome.z * unit, w=outcome.w * unit, ray=ray)


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


def prepared(A: Any, diagonal: Any, method: str) -> Prepared:
    """Return A as a `Prepared`; raise if the method cannot use it."""
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


def refuse(why: str, method: str, **given: Any) -> None:
    """Raise if an argument is given that the method does not have."""
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
