"""`solve_many`: problems of different shapes, in several processes or on a cluster.

joblib distributes them; ``joblib.parallel_config(backend="dask")`` makes it a cluster.
It comes with ``pip install "namlcp[batch]"`` and is imported at the first call, as is
tqdm, without which there is no bar.
"""

from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from functools import partial
from importlib import import_module
from typing import Any

from namlcp.solve.qp import solve_qp


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
