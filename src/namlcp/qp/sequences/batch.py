"""Many QPs of the same sizes at once, on several threads.

Each item is solved alone and from nothing (or from its own warm start), so that its
answer does not depend on the others, nor on the number of threads.
"""

import ctypes
import os
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import dataclass
from threading import Event, Lock, get_ident
from typing import Any

import numpy as np
import scipy.sparse as sp

from namlcp.checks import real_array
from namlcp.linalg import blas_threads
from namlcp.linalg.arrays import stamps_of_items
from namlcp.options import Options
from namlcp.outcome import OBJECTIVE, Outcome, objective_of
from namlcp.qp.active import MOST_ORDER, OUTCOMES, attach
from namlcp.qp.active import solve_items as solve_dense_items
from namlcp.qp.active.dense import DenseActiveSet
from namlcp.qp.active.engine import Code
from namlcp.qp.convexity import check_convex
from namlcp.qp.guess import make_guess
from namlcp.qp.intake import qp_data, stamp_of
from namlcp.qp.memory import Memory
from namlcp.qp.problem import QP
from namlcp.qp.solve import solve_checked
from namlcp.residuals import UNDEFINED, Residuals
from namlcp.status import Status

STATUSES = tuple(Status)
MATRICES = ("P", "G", "A")
# The matrix that has as many rows as a vector has entries.
SIZED_BY = {"q": "P", "h": "G", "b": "A", "lb": "P", "ub": "P"}
# Chunks of items for each thread: enough that all threads end at about the same time.
CHUNKS = 8
# Operations of one compiled call at most, about: until its end Ctrl-C is not seen.
MOST_WORK = 1e8
# Time between two looks at Ctrl-C, which on Windows ends no wait [s].
LOOK = 0.1


@dataclass(frozen=True, eq=False)
class Outcomes:
    """How the items of a batch ended, as `BatchResult` has it.

    closest: the `Nearest` of infeasible items, or its `ClosestPoint`.
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
    closest: dict[int, Any]

    @classmethod
    def empty(cls, size: int, qp: QP) -> "Outcomes":
        """Return those of `size` items with the sizes of `qp`, still to be written."""
        n, p, m = qp.q.size, qp.b.size, qp.h.size
        x, y, z, z_box = (np.empty((size, k)) for k in (n, p, m, n))
        kinds = np.int8, float, [(k, float) for k in Residuals._fields], np.int64, "U12"
        codes, obj, residuals, counts, form = (np.empty(size, kind) for kind in kinds)
        return cls(codes, x, y, z, z_box, obj, residuals, counts, form, {}, {})

    def put(self, i: int, answer: Outcome) -> None:
        """Write the answer to item i."""
        self.codes[i] = STATUSES.index(answer.status)
        self.x[i], self.y[i], self.z[i], self.z_box[i] = answer.point
        self.obj[i] = objective_of(answer)
        self.residuals[i] = answer.residuals
        self.iterations[i], self.form[i] = answer.iterations, answer.method
        if answer.message:
            self.messages[i] = answer.message
        if answer.closest is not None:
            self.closest[i] = answer.closest

    def refuse(self, i: int, error: Exception) -> None:
        """Write that item i could not be solved."""
        self.codes[i] = STATUSES.index(Status.INVALID)
        for array in (self.x, self.y, self.z, self.z_box, self.obj):
            array[i] = np.nan
        self.residuals[i], self.iterations[i], self.form[i] = UNDEFINED, 0, ""
        self.messages[i] = str(error) or repr(error)


def as_vectors(name: str, value: Any, other: str, matrix: Any) -> np.ndarray:
    """Return vectors of a batch as an (N, size) array, one for all as (size,).

    Columns and rows are flattened, and a number is as good as a vector of bounds.
    `other`, the `matrix` of an item, has `size` rows.
    """
    array = real_array(name, value)
    shape, size = array.shape, 1 if matrix.ndim == 1 else matrix.shape[0]
    if array.ndim == 0 and name in ("lb", "ub"):
        return array
    if size > 1 and shape == (size, 1):
        return array.ravel()
    if shape[1:] in ((size, 1), (1, size)):
        array = array.reshape(shape[0], size)
    if array.ndim in (1, 2) and array.shape[-1] == size:
        return array
    raise ValueError(
        f"{name} must have shape ({size},), or (N, {size}) for N items, to match "
        f"{other} of shape {matrix.shape}, got {shape}"
    )


class Items:
    """The QPs of a batch; an argument without a batch axis belongs to all of them."""

    def __init__(self, arguments: dict[str, Any]) -> None:
        """Raise unless the shapes fit, and what is shared is sound."""
        self.stacked: dict[str, np.ndarray] = {}
        one = dict(arguments)
        for name in MATRICES:
            if one[name] is None or sp.issparse(one[name]):
                continue
            array = one[name] = real_array(name, one[name])
            if array.ndim not in (1, 2, 3):
                raise ValueError(
                    f"{name} must have two dimensions, or three with the items first, "
                    f"got shape {array.shape}"
                )
            if array.ndim == 3:
                self.stacked[name] = array
                one[name] = np.zeros(array.shape[1:])  # for the checks of the shapes
        for name, other in SIZED_BY.items():
            if one[name] is None or one[other] is None or sp.issparse(one[name]):
                continue
            array = as_vectors(name, one[name], other, one[other])
            if array.ndim == 2:
                self.stacked[name] = array
                array = np.zeros(array.shape[1])
            one[name] = array
        self.size = self.common_size()
        self.given = tuple(one[name] for name in MATRICES)
        self.shared = qp_data(**one)
        self.has_shared_matrices = self.stacked.keys().isdisjoint(MATRICES)
        self.stamps = stamps_of_items(tuple(self.stacked.values()), self.size)
        self.shared_stamp = stamp_of(self.shared)
        if "P" not in self.stacked:
            check_convex(self.shared.P)

    def common_size(self) -> int:
        """Return the number of items, 1 if no argument is stacked.

        Raises unless all stacked arguments have it.
        """
        sizes = {name: len(array) for name, array in self.stacked.items()}
        name, size = next(iter(sizes.items()), ("", 1))
        for other, its in sizes.items():
            if its != size:
                raise ValueError(
                    f"{other} must have {size} items to match {name}, got {its}"
                )
        return size

    def are_unchanged(self, items: slice) -> bool:
        """Tell whether the numbers of these items are as they were at the beginning."""
        parts, old = (v[items] for v in self.stacked.values()), self.stamps[items]
        return self.shared_stamp == stamp_of(self.shared) and bool(
            (stamps_of_items(tuple(parts), old.size) == old).all()
        )

    def item(self, i: int) -> tuple[QP, tuple[Any, ...]]:
        """Return item i, checked, and (P, G, A) as they were given."""
        parts = {name: array[i] for name, array in self.stacked.items()}
        qp = qp_data(**{**self.shared._asdict(), **parts})
        pairs = zip(MATRICES, self.given, strict=True)
        return qp, tuple(parts.get(name, M) for name, M in pairs)

    def solve(self, i: int, options: Options, warm_start: Any) -> Outcome:
        """Solve item i; raise if it is malformed or not convex."""
        start = time.perf_counter()
        qp, given = self.item(i)
        # The memory is of this item alone: no other has a part in it.
        memory = Memory.of(qp) if self.has_shared_matrices else None
        guess = make_guess(qp, None, warm_start)
        return solve_checked(qp, options, guess, start, memory=memory, given=given)


def solve_items(
    items: Items, starts: Sequence[Any] | None, options: Options, threads: int
) -> Outcomes:
    """Solve all items on threads; `starts`: the warm start of each, if there are."""
    outcomes = Outcomes.empty(items.size, items.shared)

    def solve_one(i: int) -> None:
        try:
            start = None if starts is None else starts[i]
            outcomes.put(i, items.solve(i, options, start))
        except Exception as error:  # of any kind: it is the result of this item
            outcomes.refuse(i, error)

    left = np.arange(items.size)
    if starts is None and options.time_limit == np.inf:
        left = solve_stack(items, outcomes, options, threads)
    on_threads(lambda k: solve_one(left[k]), left.size, threads)
    return outcomes


def solve_stack(
    items: Items, outcomes: Outcomes, options: Options, threads: int
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
    numbers = outcomes.residuals.view(float)
    outs = outcomes.x, outcomes.y, outcomes.z, outcomes.z_box, numbers
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
            space = DenseActiveSet()
            attach(space, *firsts, True)
        end = min(starts[k] + length, size)
        solve_dense_items(
            space, arrays, stacked, starts[k], end, options.settings, outs, codes,
            outcomes.iterations,
        )  # fmt: skip
        spaces.append(space)

    with blas_threads(1, order):
        on_threads(solve_chunk, len(starts), threads)
    outcomes.obj[:] = outcomes.residuals["objective"]
    outcomes.form[:], left = "dual", np.full(size, True)
    for code, status in OUTCOMES.items():
        found = codes == code
        outcomes.codes[found] = STATUSES.index(status)
        if status in OBJECTIVE:
            outcomes.obj[found] = OBJECTIVE[status]
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
