"""`solve_batch`: many QPs of the same sizes at once, on several threads.

Each item is solved alone and from nothing (or from its own warm start), so that its
answer does not depend on the others, nor on the number of threads.
"""

import ctypes
import os
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import dataclass, field, replace
from functools import partial
from operator import index
from threading import Event, Lock, get_ident
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp

from namlcp.checks import real_array
from namlcp.limits import interruptible
from namlcp.linalg import blas_threads
from namlcp.options import DEFAULT_OPTIONS, Options, check_count
from namlcp.qp.active import MOST_ORDER, OUTCOMES, attached, solve_items
from namlcp.qp.active.state import Code
from namlcp.qp.answer import OBJECTIVE
from namlcp.qp.closest import ClosestPoint
from namlcp.qp.convexity import check_convex
from namlcp.qp.guess import make_guess
from namlcp.qp.memory import Memory
from namlcp.qp.problem import QP, qp_data
from namlcp.qp.solve import solve_checked
from namlcp.residuals import UNDEFINED, Residuals
from namlcp.result import Differentiable, QPResult
from namlcp.status import Status

if TYPE_CHECKING:
    from namlcp.derivatives import BatchGradients

STATUSES = tuple(Status)
MATRICES = ("P", "G", "A")
# Chunks of items for each thread: enough that all threads end at about the same time.
CHUNKS = 8
# Operations of one compiled call at most, about: until its end Ctrl-C is not seen.
MOST_WORK = 1e8
# Time between two looks at Ctrl-C, which on Windows ends no wait [s].
LOOK = 0.1


@dataclass(frozen=True, eq=False, kw_only=True)
class BatchResult(Differentiable):
    """Result of `solve_batch` for N items; ``batch[i]`` is the `QPResult` of item i.

    Attributes
    ----------
    codes : (N,) int8 array
        How each item ended: its place in ``list(Status)``; `statuses` has the members.
    x, y, z, z_box : (N, n), (N, p), (N, m), (N, n) array
        As in `QPResult`; NaN where an item is INVALID.
    obj : (N,) array
        Objectives.
    residuals : (N,) structured array
        Its fields are those of `Residuals`.
    iterations : (N,) array
    form : (N,) array of str
        The solver that gave the point; "" where an item is INVALID.
    messages : dict
        Sentences that add to the status, by the number of the item.
    closest : dict
        The `ClosestPoint` of infeasible items, by the number of the item, if
        `Options.infeasible` asks for it.
    solve_time : float
        Seconds for all items together.

    Examples
    --------
    >>> import numpy as np
    >>> import namlcp
    >>> q = np.array([[-1.0], [2.0], [np.nan]])
    >>> batch = namlcp.solve_batch(np.eye(1), q, lb=np.zeros(1))
    >>> [status.value for status in batch.statuses], batch.x[:2, 0] + 0.0
    (['solved', 'solved', 'invalid'], array([1., 0.]))
    >>> batch[0].x
    array([1.])
    """

    codes: np.ndarray
    x: np.ndarray
    y: np.ndarray
    z: np.ndarray
    z_box: np.ndarray
    obj: np.ndarray
    residuals: np.ndarray
    iterations: np.ndarray
    form: np.ndarray
    messages: dict[int, str]
    closest: dict[int, ClosestPoint]
    solve_time: float = 0.0
    problem: Any = field(default=None, repr=False)
    """The `Items` that were solved, for the derivatives."""

    def backward(
        self,
        dx: Any = None,
        dy: Any = None,
        dz: Any = None,
        dz_box: Any = None,
        *,
        threads: int | None = None,
    ) -> "BatchGradients":
        """Return the gradients of a scalar in the data of all items.

        Parameters
        ----------
        dx, dy, dz, dz_box : (N, n), (N, p), (N, m), (N, n) array, optional
            The gradients of the scalar in the solutions, 0 where absent.
        threads : int, optional
            Threads, by default one for each core.

        Returns
        -------
        BatchGradients
            Items that were not solved have gradients 0, and False in `used`. An
            argument shared by all items has the sum of their gradients.

        Raises
        ------
        ValueError
            The result was pickled or copied, or an argument has a wrong shape.

        Examples
        --------
        >>> import numpy as np
        >>> from namlcp import solve_batch
        >>> batch = solve_batch(np.eye(1), np.array([[-1.0], [1.0]]), lb=np.zeros(1))
        >>> gradients = batch.backward(dx=np.ones((2, 1)))
        >>> gradients.q.tolist(), gradients.lb.tolist()
        ([[-1.0], [0.0]], [1.0])
        """
        from namlcp.derivatives import differentiate_batch

        cotangents = {"dx": dx, "dy": dy, "dz": dz, "dz_box": dz_box}
        return differentiate_batch(self, cotangents, threads)

    @property
    def statuses(self) -> list[Status]:
        """The status of each item."""
        return [STATUSES[code] for code in self.codes]

    @property
    def solved(self) -> np.ndarray:
        """(N,) bool: which items are solved."""
        return self.codes == STATUSES.index(Status.SOLVED)

    def __len__(self) -> int:
        return self.codes.size

    def __iter__(self) -> Iterator[QPResult]:
        return map(self.__getitem__, range(len(self)))

    def __getitem__(self, i: int) -> QPResult:
        """Return the result of one item; its times are not measured."""
        if not -len(self) <= index(i) < len(self):
            raise IndexError(f"the batch has {len(self)} items, got item {i}")
        number = range(len(self))[i]
        return QPResult(
            status=STATUSES[self.codes[i]],
            x=self.x[i],
            y=self.y[i],
            z=self.z[i],
            z_box=self.z_box[i],
            obj=float(self.obj[i]),
            residuals=Residuals(*self.residuals[i].item()),
            iterations=int(self.iterations[i]),
            form=str(self.form[i]),
            message=self.messages.get(number, ""),
            setup_time=0.0,
            solve_time=0.0,
            closest=self.closest.get(number),
            problem=self.problem and partial(self.problem.item, number),
        )

    def put(self, i: int, result: QPResult) -> None:
        """Write the result of item i."""
        self.codes[i] = STATUSES.index(result.status)
        self.x[i], self.y[i] = result.x, result.y
        self.z[i], self.z_box[i] = result.z, result.z_box
        self.obj[i], self.iterations[i] = result.obj, result.iterations
        self.form[i] = result.form
        self.residuals[i] = result.residuals
        if result.message:
            self.messages[i] = result.message
        if result.closest is not None:
            self.closest[i] = result.closest

    def refuse(self, i: int, error: Exception) -> None:
        """Write that item i could not be solved."""
        self.codes[i] = STATUSES.index(Status.INVALID)
        for array in (self.x, self.y, self.z, self.z_box, self.obj):
            array[i] = np.nan
        self.residuals[i], self.iterations[i], self.form[i] = UNDEFINED, 0, ""
        self.messages[i] = str(error) or repr(error)


def empty_result(size: int, qp: QP) -> BatchResult:
    """Return a result for `size` items with the sizes of `qp`, still to be written."""
    n, p, m = qp.q.size, qp.b.size, qp.h.size
    x, y, z, z_box = (np.empty((size, k)) for k in (n, p, m, n))
    return BatchResult(
        codes=np.empty(size, np.int8),
        x=x,
        y=y,
        z=z,
        z_box=z_box,
        obj=np.empty(size),
        residuals=np.empty(size, [(k, float) for k in Residuals._fields]),
        iterations=np.empty(size, np.int64),
        form=np.empty(size, "U12"),
        messages={},
        closest={},
    )


class Items:
    """The QPs of a batch; an argument without a batch axis belongs to all of them."""

    def __init__(self, arguments: dict[str, Any]) -> None:
        """Raise unless the shapes fit, and what is shared is sound."""
        self.stacked: dict[str, np.ndarray] = {}
        one = {}
        for name, value in arguments.items():
            one[name] = value
            axes = 2 if name in MATRICES else 1
            if value is None or sp.issparse(value):
                continue
            array = real_array(name, value)
            if array.ndim == axes + 1:
                self.stacked[name] = array
                one[name] = np.zeros(array.shape[1:])  # for the checks of the shapes
            elif array.ndim != axes:
                raise ValueError(
                    f"{name} must be {axes}-D, or {axes + 1}-D with the items first, "
                    f"got shape {array.shape}"
                )
        self.size = self.common_size()
        self.given = tuple(one[name] for name in MATRICES)
        self.shared = qp_data(**one)
        self.has_shared_matrices = self.stacked.keys().isdisjoint(MATRICES)
        if "P" not in self.stacked:
            check_convex(self.shared.P)

    def common_size(self) -> int:
        """Return the number of items; raise unless all stacked arguments have it."""
        sizes = {name: len(array) for name, array in self.stacked.items()}
        if not sizes:
            raise ValueError("one argument at least must have a batch axis, got none")
        name, size = next(iter(sizes.items()))
        for other, its in sizes.items():
            if its != size:
                raise ValueError(
                    f"{other} must have {size} items to match {name}, got {its}"
                )
        return size

    def item(self, i: int) -> tuple[QP, tuple[Any, ...]]:
        """Return item i, checked, and (P, G, A) as they were given."""
        parts = {name: array[i] for name, array in self.stacked.items()}
        qp = qp_data(**{**self.shared._asdict(), **parts})
        pairs = zip(MATRICES, self.given, strict=True)
        return qp, tuple(parts.get(name, M) for name, M in pairs)

    def solve(self, i: int, options: Options, warm_start: Any) -> QPResult:
        """Solve item i; raise if it is malformed or not convex."""
        start = time.perf_counter()
        qp, given = self.item(i)
        if isinstance(warm_start, BatchResult):
            warm_start = warm_start[i]
        # The memory is of this item alone: no other has a part in it.
        memory = Memory.of(qp) if self.has_shared_matrices else None
        guess = make_guess(qp, None, warm_start)
        return solve_checked(qp, options, guess, start, memory=memory, given=given)


@interruptible
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
    is shared by all, and what depends on it alone is done once. The results have the
    order of the items, and the same bits for every number of threads.

    Parameters
    ----------
    P, G, A : (n, n), (m, n), (p, n) array, with a leading axis N or without
        As for `solve_qp`. A sparse matrix is shared.
    q, h, b, lb, ub : (n,), (m,), (p,), (n,), (n,) array, with a leading axis N or not
        As for `solve_qp`.
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
    start = time.perf_counter()
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
    batch = empty_result(items.size, items.shared)

    def solve_one(i: int) -> None:
        try:
            batch.put(i, items.solve(i, options, warm_start))
        except Exception as error:  # of any kind: it is the result of this item
            batch.refuse(i, error)

    left = np.arange(items.size)
    if warm_start is None and options.time_limit == np.inf:
        left = solve_stack(items, batch, options, threads)
    on_threads(lambda k: solve_one(left[k]), left.size, threads)
    seconds = time.perf_counter() - start
    return replace(batch, solve_time=seconds, problem=items)


def solve_stack(
    items: Items, batch: BatchResult, options: Options, threads: int
) -> np.ndarray:
    """Solve small dense items in compiled loops; return the items that are left."""
    qp, size = items.shared, items.size
    order = qp.q.size + qp.h.size + qp.b.size
    if not qp.is_dense or order > MOST_ORDER:
        return np.arange(size)
    arrays: Any = tuple(
        items.stacked.get(name, own) for name, own in qp._asdict().items()
    )
    stacked = tuple(name in items.stacked for name in QP._fields)
    codes = np.empty(size, np.int64)
    numbers = batch.residuals.view(float)
    outs = batch.x, batch.y, batch.z, batch.z_box, numbers
    firsts = [M[0] if M.ndim > 2 else M for M in arrays[:6:2]]
    work = 4.0 * qp.q.size * (qp.q.size + qp.h.size) * (qp.q.size + order)
    length = min(
        -(-size // (CHUNKS * threads)), max(int(MOST_WORK / max(work, 1.0)), 1)
    )
    starts = range(0, size, length or 1)
    spaces: list[Any] = []

    def solve_chunk(k: int) -> None:
        try:
            space = spaces.pop()
        except IndexError:
            space = attached(*firsts)
        end = min(starts[k] + length, size)
        solve_items(
            space, arrays, stacked, starts[k], end, options.settings, outs, codes,
            batch.iterations,
        )  # fmt: skip
        spaces.append(space)

    with blas_threads(1, order):
        on_threads(solve_chunk, len(starts), threads)
    batch.obj[:] = batch.residuals["objective"]
    batch.form[:], left = "dual", np.full(size, True)
    for code, status in OUTCOMES.items():
        found = codes == code
        batch.codes[found] = STATUSES.index(status)
        if status in OBJECTIVE:
            batch.obj[found] = OBJECTIVE[status]
        left &= ~found
    if options.relaxation:
        left |= codes == Code.CONTRADICTION
    return np.flatnonzero(left)


def on_threads(work: Callable[[int], None], size: int, threads: int) -> None:
    """Call work(i) for i < size on so many threads; Ctrl-C ends them soon."""
    if threads == 1 or size <= 1:  # a pool takes as long as 20 tiny QPs
        for i in range(size):
            work(i)
        return
    left, lock, stop = iter(range(size)), Lock(), Event()
    running: set[int] = set()

    def taken() -> int | None:
        with lock:
            return next(left, None)

    def work_on() -> None:
        running.add(get_ident())
        try:
            while not stop.is_set() and (i := taken()) is not None:
                work(i)
        finally:
            stop.set()  # after an error; else nothing is left
            running.discard(get_ident())

    with ThreadPoolExecutor(threads) as pool:
        tasks = [pool.submit(work_on) for _ in range(min(threads, size))]
        try:
            while wait(tasks, LOOK).not_done:
                pass
        except BaseException:
            stop.set()
            for thread in running.copy():
                interrupt(thread)
            raise
    for task in tasks:
        task.result()


def interrupt(thread: int) -> None:
    """Raise KeyboardInterrupt in a thread, as Ctrl-C does in the main one."""
    error = ctypes.py_object(KeyboardInterrupt)
    ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(thread), error)


def available_cores() -> int:
    """Return the number of cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
