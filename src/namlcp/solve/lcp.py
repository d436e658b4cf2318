"""The public function `solve_lcp`."""

import math
from time import perf_counter
from typing import Any

from scipy import sparse

from namlcp.lcp.data import SMALL_ORDER, Operator, Prepared, lcp_data
from namlcp.lcp.methods import find_method, solve_by_method
from namlcp.lcp.pivoting.pivot import ACCURACY, solve_small
from namlcp.limits import Deadline, Limits
from namlcp.options import check_count, check_flag, check_number
from namlcp.results import LCPResult, lcp_result
from namlcp.status import LCP_COLUMNS, Progress

SWEEP_EPS_ABS = 1e-8  # the default of the sweep methods


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
        `namlcp.lcp.general`: they find a solution if A is copositive (z'A z >= 0 for
        z >= 0) and q'v >= 0 wherever v >= 0, A v >= 0 and v'A v = 0, as of contact
        with friction; elsewhere in most cases. With a LinearOperator it is MPRGP, see
        `namlcp.lcp.mprgp`; no other method takes one.
        "multigrid" means multigrid cycles alone, for matrices like those of
        differential equations, see `namlcp.lcp.multigrid`; "auto" tries them from order
        10^4 on. "lemke" means Lemke's method alone, with a dense tableau, for n up to
        5000; which matrices it suits, and what its rays prove, says
        `namlcp.lcp.general.lemke`. Otherwise the name of a sweep method:
        `namlcp.lcp.modulus.methods`. Of these, "pgs" takes less time than "auto" on
        strongly dominant matrices.
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
        Solved when Res(z) = || z - clip(z - w, lower, upper) ||_2 < eps_abs; 1e-8 by
        default for sweep methods.
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
    Pivoting follows Judice and Pires (Computers Ops Res 21, 1994, 587-596), see
    `namlcp.lcp.pivoting`; Lemke's method Cottle, Pang and Stone (The Linear
    Complementarity Problem, 1992, section 4.4).

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
    start, matrix = perf_counter(), A
    is_plain = history is False and verbose is False and time_limit is math.inf
    if is_plain and isinstance(method, str) and method == "auto" and (
        None is diagonal is alpha is beta is omega is shift is cover is s0 is z0
        is eps_abs is eps_rel is max_iter
    ):  # fmt: skip
        own, last, stamp = A, None, None
        if sparse.issparse(A) and A.shape[0] <= SMALL_ORDER:
            matrix = Prepared(A)
            own = matrix.small
        elif type(A) is Prepared:
            own, last, stamp = A.small, A.last, A.stamp
        result = solve_small(LCPResult, start, A, own, q, lower, upper, last, stamp)
        if result is not None:
            if type(A) is Prepared:
                A.last = result.z
            return result
    for name, value in (("eps_abs", eps_abs), ("eps_rel", eps_rel)):
        if value is not None:
            check_number(name, value, closed=name == "eps_rel", finite=True)
    if max_iter is not None:
        check_count("max_iter", max_iter)
    check_number("time_limit", time_limit)
    check_flag("history", history)
    check_flag("verbose", verbose)
    options = dict(
        alpha=alpha, beta=beta, omega=omega, shift=shift, cover=cover, s0=s0,
        eps_rel=eps_rel, z0=z0,
    )  # fmt: skip
    options = {name: value for name, value in options.items() if value is not None}
    found = find_method(method, options)
    options.pop("eps_rel", None)
    if "eps_rel" not in found.takes:
        eps_abs, eps_rel = SWEEP_EPS_ABS if eps_abs is None else eps_abs, 0.0
    elif eps_rel is None:
        eps_rel = ACCURACY if eps_abs is None else 0.0
    if not isinstance(matrix, Prepared):
        matrix = Prepared(matrix, diagonal)
    elif diagonal is not None:
        raise ValueError("diagonal must be given to Prepared, with A")
    if method != "auto" and isinstance(matrix.A, Operator):
        raise ValueError(
            f"method {method!r} needs the entries of A; a LinearOperator is solved by "
            'method "auto"'
        )
    lcp, unit = lcp_data(matrix, q, lower, upper)
    progress = Progress(LCP_COLUMNS, verbose) if verbose or history else None
    if progress is not None:
        progress.say(f"namlcp  LCP: n = {lcp.q.size}, method = {method}")
    report = None if progress is None else progress.row
    deadline = Deadline(start + float(time_limit))
    limits = Limits(eps_abs or 0.0, eps_rel, max_iter, deadline, report)
    ready = perf_counter()
    outcome = solve_by_method(lcp, unit, limits, method, is_next=A is matrix, **options)
    if progress is not None:
        progress.close(outcome, start)
    rows = progress.history() if progress is not None and history else None
    problem = lcp, matrix.A if A is matrix else A
    return lcp_result(outcome, problem, start, ready, rows)
