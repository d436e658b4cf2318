"""The public function `solve_batch`: many QPs of the same sizes at once."""

from time import perf_counter
from typing import Any

from namlcp.options import DEFAULT_OPTIONS, Options, check_count
from namlcp.qp import QP, Items, available_cores, check_warm_start, solve_items
from namlcp.results import BatchResult, batch_result


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
