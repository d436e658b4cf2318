"""The public functions that solve QPs: one, or many at once.

For `solve_many` joblib distributes problems; ``joblib.parallel_config(backend="dask")``
makes it a cluster. It comes with ``pip install "namlcp[batch]"`` and is imported at the
first call, as is tqdm, without which there is no bar.
"""

from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from functools import partial
from importlib import import_module
from time import perf_counter
from typing import Any

from namlcp.arrays import stamp_of
from namlcp.options import DEFAULT_OPTIONS, Options, check_count, check_flag
from namlcp.qp.active.solve import solve_small
from namlcp.qp.batch import Items, available_cores, solve_items
from namlcp.qp.intake import qp_data
from namlcp.qp.problem import QP, make_guess
from namlcp.qp.route import solve_checked
from namlcp.results import BatchResult, QPResult, batch_result, qp_result
from namlcp.status import QP_COLUMNS, Progress


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
        result = solve_small(
            QPResult, options.settings, start, derivative, arguments, x0, warm_start
        )
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
    items = Items(dict(zip(QP._fields, (P, q, G, h, A, b, lb, ub), strict=True)))
    if warm_start is not None:
        if not isinstance(warm_start, BatchResult):
            warm_start = [warm_start] * items.size
        if len(warm_start) != items.size:
            raise ValueError(
                f"warm_start must have {items.size} items, got {len(warm_start)}"
            )
        if items.size > 0:  # raises where that does not fit
            make_guess(items.shared, None, warm_start[0])
    outcomes = solve_items(items, warm_start, options, threads)
    return batch_result(outcomes, items, perf_counter() - start)


def solve_many(
    problems: Iterable[Any],
    n_jobs: int | None = -1,
    progress: bool = True,
    *,
    solve: Callable[..., Any] = solve_qp,
    **settings: Any,
) -> list[Any]:
    """Solve problems of any shapes, dense or sparse, in several processes.

    For many small QPs of the same shape `solve_batch` is quicker: it needs no other
    processes.

    Parameters
    ----------
    problems : iterable
        Each a qpsolvers.Problem, a tuple of positional arguments of `solve` or a dict
        of keyword arguments. It may be a generator.
    n_jobs : int or None
        1 is this process alone, without joblib. Else as for joblib.Parallel: -1 is one
        process for each core, None what ``joblib.parallel_config`` says. On a Dask
        cluster it is the cluster that decides.
    progress : bool
        Show a bar on standard error, by tqdm if that is installed.
    solve : function
        `solve_qp`, or `solve_lcp` for LCPs.
    **settings
        Further keyword arguments of `solve` for all problems, such as eps_abs.

    Returns
    -------
    list
        The results, in the order of the problems. Where `solve` raised an exception
        (a malformed problem), the exception stands in place of the result. Where
        joblib's own processes die, for example for lack of memory, its exception stands
        for all results not yet there; a Dask cluster solves the problems of a worker
        that died on another one.

    Raises
    ------
    TypeError
        `problems` is no iterable, or one problem as a dict.
    ImportError
        joblib is missing, and n_jobs is not 1.

    Examples
    --------
    >>> import numpy as np
    >>> from namlcp import solve_lcp, solve_many
    >>> qps = [(np.eye(n), -np.ones(n)) for n in (1, 2, 3)] + [(-np.eye(2), np.ones(2))]
    >>> for result in solve_many(qps, n_jobs=1, progress=False):
    ...     print(repr(result) if isinstance(result, Exception) else result.x)
    [1.]
    [1. 1.]
    [1. 1. 1.]
    NotConvex('P must be positive semidefinite: its diagonal entry 0 is negative')
    >>> lcps = [{"A": np.eye(2), "q": np.array([-1.0, 1.0])}]
    >>> solve_many(lcps, n_jobs=1, progress=False, solve=solve_lcp)[0].z
    array([1., 0.])
    """
    if not isinstance(problems, Iterable) or isinstance(problems, Mapping):
        raise TypeError(f"problems must be an iterable of problems, got {problems!r}")
    problems = list(problems)
    bar: Callable[[Iterable[Any]], Iterable[Any]] = iter
    if progress:
        with suppress(ImportError):
            tqdm = import_module("tqdm").tqdm
            bar = partial(tqdm, total=len(problems), unit="problem")
    if n_jobs == 1:
        return list(bar(solved(solve, one, settings) for one in problems))
    try:
        joblib = import_module("joblib")
    except ImportError as error:
        raise ImportError(
            'solve_many needs joblib unless n_jobs=1: pip install "namlcp[batch]"'
        ) from error
    tasks = [joblib.delayed(solved)(solve, one, settings) for one in problems]
    found: list[Any] = []
    try:
        found.extend(bar(joblib.Parallel(n_jobs=n_jobs, return_as="generator")(tasks)))
    except Exception as error:  # of the processes: `solved` raises none
        found.extend([error] * (len(problems) - len(found)))
    return found


def solved(solve: Callable[..., Any], problem: Any, settings: Mapping[str, Any]) -> Any:
    """Return what `solve` returns for one problem, or the exception that it raises."""
    try:
        if isinstance(problem, Mapping):
            return solve(**problem, **settings)
        if hasattr(problem, "unpack"):  # a qpsolvers.Problem
            problem = problem.unpack()
        return solve(*problem, **settings)
    except Exception as error:
        return error.with_traceback(None)
