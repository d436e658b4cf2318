"""The public functions that solve QPs: one, or many at once."""

from time import perf_counter
from typing import Any

from namlcp.linalg.arrays import stamp_of
from namlcp.options import DEFAULT_OPTIONS, Options, check_count, check_flag
from namlcp.progress import QP_COLUMNS, Progress
from namlcp.qp.active.solve import solve_small
from namlcp.qp.batch import Items, available_cores, solve_items
from namlcp.qp.intake import qp_data
from namlcp.qp.problem import QP, check_warm_start, make_guess
from namlcp.qp.route import solve_checked
from namlcp.results import BatchResult, QPResult, batch_result, qp_result


def solve_qp(
    P: Any,
    q: Any,
    G: Any = None,
    h: Any = None,
    A: Any = None,
    b: Any = None,
    lb: Any = None,
    ub: Any = None,
    *,
    x0: Any = None,
    warm_start: Any = None,
    history: bool = False,
    derivative: bool = False,
    **settings: Any,
) -> QPResult:
    """Solve a convex quadratic program.

    ``minimise 1/2 x'Px + q'x  subject to  Gx <= h,  Ax = b,  lb <= x <= ub``

    Parameters
    ----------
    P : (n, n) array or sparse matrix
        Cost matrix, symmetric positive semidefinite; (P + P') / 2 takes its place if
        |P_ij - P_ji| <= 1e-6 sqrt(P_ii P_jj), as by rounding to single precision.
    q : (n,) array
        Cost vector.
    G, h : (m, n) array or sparse matrix, (m,) array, optional
        Inequalities; h_i = +inf (from 1e20 on) switches a row off. A finite h_i >= 1e20
        below 1e10 max_j |G_ij| is refused: that row is a constraint.
    A, b : (p, n) array or sparse matrix, (p,) array, optional
        Equalities.
    lb, ub : (n,) array or float, optional
        Bounds; lb_i <= -1e20 and ub_i >= 1e20 mean none.
    x0 : (n,) array, optional
        A guess of x; the constraints active there are tried first.
    warm_start : QPResult or qpsolvers.Solution, optional
        The solution of a similar problem of the same sizes; the constraints with a
        multiplier there are tried first. Overrides x0.
    history : bool
        Keep the rows of the verbose table in the result.
    derivative : bool
        Keep the factors of a dense QP in the result, where the method has left some, so
        that `backward` need not make them. Such a result is for one thread at a time.
    **settings
        The fields of `Options`: eps_abs, eps_rel, max_iter, time_limit [s], verbose,
        threads, infeasible.

    Returns
    -------
    QPResult
        Read `status` first. Signs of y, z, z_box as in qpsolvers.

    Raises
    ------
    ValueError
        Shapes disagree, an entry is NaN, P is not symmetric or not positive
        semidefinite, an option has no meaning. The message names the argument.
    TypeError
        An argument is no array of real numbers, or an option is unknown.
    MemoryError
        A matrix that the solve needs would have more entries than int32 can count.

    Notes
    -----
    SOLVED means that primal residual, dual residual and duality gap, recomputed on the
    arguments as they came, are within eps_abs + eps_rel * (size of their terms);
    `namlcp.residuals` has the formulas, `namlcp.qp.route` the methods.

    P is refused as not convex if, scaled to a unit diagonal, it has an eigenvalue below
    -1e-6; those between that and 0 count as rounding to single precision. (VALUES of
    the Maros-Meszaros collection is refused: its smallest eigenvalue is -1.3e-5.)

    Examples
    --------
    >>> import numpy as np
    >>> import namlcp
    >>> P = np.array([[4.0, 1.0], [1.0, 2.0]])
    >>> result = namlcp.solve_qp(P, np.ones(2), A=np.ones((1, 2)), b=np.ones(1),
    ...                          lb=np.zeros(2), ub=np.full(2, 0.7))
    >>> result.status.value, result.x.round(6), round(result.obj, 6)
    ('solved', array([0.3, 0.7]), 1.88)
    """
    start = perf_counter()
    options = Options.from_names(settings) if settings else DEFAULT_OPTIONS
    if history is not False:
        check_flag("history", history)
    if derivative is not False:
        check_flag("derivative", derivative)
    arguments = P, q, G, h, A, b, lb, ub
    if options.is_plain and not history:
        how = QPResult, options.settings, start, derivative
        result = solve_small(*how, arguments, x0, warm_start)
        if result is not None:
            return result
    return solve_arguments(
        arguments, options, start, x0, warm_start, history, derivative
    )


def solve_arguments(
    arguments: tuple[Any, ...],
    options: Options,
    start: float,
    x0: Any = None,
    warm_start: Any = None,
    history: bool = False,
    derivative: bool = False,
    name: str = "x0",
) -> QPResult:
    """Solve the QP of arguments of any kind; `name` stands for x0 in messages."""
    qp, given = qp_data(*arguments), arguments[:6:2]  # P, G and A
    guess = make_guess(qp, x0, warm_start, name)
    progress = Progress(QP_COLUMNS, options.verbose) if history else None
    ready = perf_counter()
    answer = solve_checked(qp, options, guess, start, progress, given=given)
    rows = progress.history() if progress is not None else None
    result = qp_result(answer, (qp, given), start, ready, rows)
    result.stamp = stamp_of(qp)
    if derivative:
        result.factors = answer.factors
    return result


def solve_batch(
    P: Any,
    q: Any,
    G: Any = None,
    h: Any = None,
    A: Any = None,
    b: Any = None,
    lb: Any = None,
    ub: Any = None,
    *,
    threads: int | None = None,
    warm_start: Any = None,
    **settings: Any,
) -> BatchResult:
    """Solve N convex QPs of the same sizes, on several threads.

    ``minimise 1/2 x'Px + q'x  subject to  Gx <= h,  Ax = b,  lb <= x <= ub``

    An argument with a leading axis of length N has one value for each item; one without
    is shared by all, and what depends on it alone is done once. Without any such axis
    there is one item. The results have the order of the items, and the same bits for
    every number of threads.

    Parameters
    ----------
    P, G, A : (n, n), (m, n), (p, n) array, with a leading axis N or without
        As for `solve_qp`. A sparse matrix is shared, as is one row given as a vector.
    q, h, b, lb, ub : (n,), (m,), (p,), (n,), (n,) array, with a leading axis N or not
        As for `solve_qp`: columns and rows are flattened.
    threads : int, optional
        Threads that solve items, by default one for each core. BLAS has one thread in
        each.
    warm_start : BatchResult, QPResult or qpsolvers.Solution, optional
        Solutions of a similar batch, item by item, or one for all items.
    **settings
        The fields of `Options` but threads and verbose. time_limit is for each item.

    Returns
    -------
    BatchResult
        An item that is malformed (a NaN) or not convex gets the status INVALID and a
        message, and harms no other.

    Raises
    ------
    ValueError, TypeError
        Shapes disagree, or an argument that is shared by all is malformed.

    Examples
    --------
    >>> import numpy as np
    >>> from namlcp import solve_batch
    >>> q = np.array([[-1.0, -2.0], [1.0, -1.0], [np.nan, 0.0]])
    >>> batch = solve_batch(np.eye(2), q, lb=np.zeros(2))
    >>> batch.x
    array([[ 1.,  2.],
           [ 0.,  1.],
           [nan, nan]])
    >>> batch[2].status.value, batch[2].message
    ('invalid', 'q must be finite, got nan at (0)')
    """
    start = perf_counter()
    options = Options.from_names(settings) if settings else DEFAULT_OPTIONS
    if options.verbose:
        raise ValueError("verbose is for the solve of one problem, not for a batch")
    if threads is None:
        threads = available_cores()
    check_count("threads", threads)
    names = dict(zip(QP._fields, (P, q, G, h, A, b, lb, ub), strict=True))
    items = Items(names)
    if isinstance(warm_start, BatchResult) and len(warm_start) != items.size:
        raise ValueError(
            f"warm_start must have {items.size} items, got {len(warm_start)}"
        )
    starts = warm_start
    if warm_start is not None and not isinstance(warm_start, BatchResult):
        check_warm_start(warm_start)
        starts = [warm_start] * items.size
    outcomes = solve_items(items, starts, options, threads)
    return batch_result(outcomes, items, perf_counter() - start)
