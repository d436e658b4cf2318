"""Many QPs of the same sizes at once, on several threads.

Each item is solved alone and from nothing (or from its own warm start), so that its
answer does not depend on the others, nor on the number of threads.
"""

import ctypes
import os
import time
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from threading import get_ident
from types import SimpleNamespace
from typing import Any

import numpy as np
import scipy.sparse as sp

from namlcp.arrays import stamp_of, stamps_of_items
from namlcp.checks import real_array, vector
from namlcp.linalg.threads import blas_threads
from namlcp.options import Options
from namlcp.qp.active import solve as active
from namlcp.qp.active.dense import DenseActiveSet
from namlcp.qp.active.engine import Code
from namlcp.qp.intake import qp_data
from namlcp.qp.problem import QP, Point, check_convex, make_guess
from namlcp.qp.route import Memory, solve_checked
from namlcp.residuals import UNDEFINED, Residuals
from namlcp.status import OBJECTIVE, Outcome, Status

CHANGED = (
    "derivatives need the arrays as they were when the problem was solved: one has "
    "been changed in place since (pass a copy to the solve)"
)
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


def unanswered(size: int, qp: QP) -> SimpleNamespace:
    """Return the fields of `BatchResult` for QPs of these sizes, not yet written."""
    n, p, m = qp.q.size, qp.b.size, qp.h.size
    x, y, z, z_box = (np.empty((size, k)) for k in (n, p, m, n))
    kinds = np.int8, [(k, float) for k in Residuals._fields], np.int64, "U12"
    codes, residuals, iterations, form = (np.empty(size, kind) for kind in kinds)
    return SimpleNamespace(
        codes=codes, x=x, y=y, z=z, z_box=z_box, residuals=residuals,
        iterations=iterations, form=form, messages={}, closest={},
    )  # fmt: skip


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
            array, shape = real_array(name, one[name]), one[other].shape
            size = shape[0] if len(shape) == 2 else 1
            is_number = array.ndim == 0 and name in ("lb", "ub")
            one[name] = array
            if array.shape[1:] in ((size,), (size, 1), (1, size)):
                self.stacked[name] = array.reshape(len(array), size)
                one[name] = np.zeros(size)
            elif not is_number and array.shape not in ((size,), (size, 1)):
                raise ValueError(
                    f"{name} must have shape ({size},), or (N, {size}) for N items, to "
                    f"match {other} of shape {shape}, got {array.shape}"
                )
        sizes = {name: len(array) for name, array in self.stacked.items()}
        first, self.size = next(iter(sizes.items()), ("", 1))
        for name, size in sizes.items():
            if size != self.size:
                raise ValueError(
                    f"{name} must have {self.size} items to match {first}, got {size}"
                )
        self.given = tuple(one[name] for name in MATRICES)
        qp = self.shared = qp_data(**one)
        if "G" in self.stacked:  # its rows tell whether a huge h_i is no constraint
            h = vector("h", one["h"], qp.h.size, "G", qp.G.shape)
            self.shared = qp._replace(h=h)
        self.stamps = stamps_of_items(tuple(self.stacked.values()), self.size)
        self.shared_stamp = stamp_of(self.shared)
        if "P" not in self.stacked:
            with blas_threads(1, self.shared.q.size):
                check_convex(self.shared.P)

    def refuse_changes(self, items: slice) -> None:
        """Raise ValueError unless the numbers of these items are as they were."""
        parts, old = (v[items] for v in self.stacked.values()), self.stamps[items]
        stamps = stamps_of_items(tuple(parts), old.size)
        if self.shared_stamp != stamp_of(self.shared) or (stamps != old).any():
            raise ValueError(CHANGED)

    def item(self, i: int) -> tuple[QP, tuple[Any, ...]]:
        """Return item i, checked, and (P, G, A) as they were given."""
        self.refuse_changes(slice(i, i + 1))
        parts = {name: array[i] for name, array in self.stacked.items()}
        qp = qp_data(**{**self.shared._asdict(), **parts})
        pairs = zip(MATRICES, self.given, strict=True)
        return qp, tuple(parts.get(name, M) for name, M in pairs)


def solve_items(
    items: Items, starts: Sequence[Any] | None, options: Options, threads: int
) -> SimpleNamespace:
    """Return the fields of `BatchResult`; `starts`: warm starts of items, or None."""
    found = unanswered(items.size, items.shared)

    def solve_one(i: int) -> None:
        start = time.perf_counter()
        try:
            qp, given = items.item(i)
            guess = make_guess(qp, None, None if starts is None else starts[i])
            # Of this item alone: no other has a part in it.
            memory = None if "P" in items.stacked else Memory(qp.P)
            answer = solve_checked(qp, options, guess, start, None, memory, given)
        except Exception as error:  # of any kind: it is the result of this item
            nothing = Point(*np.full((4, 1), np.nan))
            message = str(error) or repr(error)
            answer = Outcome(Status.INVALID, nothing, UNDEFINED, 0, "", message)
        found.codes[i] = STATUSES.index(answer.status)
        found.x[i], found.y[i], found.z[i], found.z_box[i] = answer.point
        found.residuals[i] = answer.residuals
        found.iterations[i], found.form[i] = answer.iterations, answer.method
        if answer.message:
            found.messages[i] = answer.message
        if answer.closest is not None:
            found.closest[i] = answer.closest

    left = np.arange(items.size)
    if starts is None and options.time_limit == np.inf:
        left = solve_stack(items, found, options, threads)
    on_threads(lambda k: solve_one(int(left[k])), left.size, threads)
    found.obj = found.residuals["objective"].copy()
    for status, objective in OBJECTIVE.items():
        found.obj[found.codes == STATUSES.index(status)] = objective
    return found


def solve_stack(
    items: Items, found: SimpleNamespace, options: Options, threads: int
) -> np.ndarray:
    """Solve small dense items in compiled loops; return the items that are left."""
    qp, size = items.shared, items.size
    order = qp.q.size + qp.h.size + qp.b.size
    if size == 0 or not qp.is_dense or order > active.MOST_ORDER:
        return np.arange(size)
    arrays: Any = tuple(
        items.stacked.get(name, own) for name, own in qp._asdict().items()
    )
    stacked = tuple(name in items.stacked for name in QP._fields)
    codes = np.empty(size, np.int64)
    numbers = found.residuals.view(float)
    outs = found.x, found.y, found.z, found.z_box, numbers
    firsts = [M[0] if M.ndim > 2 else M for M in arrays[:6:2]]
    work = 4.0 * qp.q.size * (qp.q.size + qp.h.size) * (qp.q.size + order)
    chunks = chunks_of(size, work, threads)
    spaces = [DenseActiveSet() for _ in range(min(threads, len(chunks)))]
    for space in spaces:
        active.attach(space, *firsts, True)

    def solve_chunk(k: int) -> None:
        space = spaces.pop()
        active.solve_items(
            space, arrays, stacked, chunks[k].start, chunks[k].stop, options.settings,
            outs, codes, found.iterations,
        )  # fmt: skip
        spaces.append(space)

    with blas_threads(1, order):
        on_threads(solve_chunk, len(chunks), threads)
    found.form[:], left = "dual", np.full(size, True)
    for code, status in active.OUTCOMES.items():
        found.codes[codes == code] = STATUSES.index(status)
        left &= codes != code
    if options.relaxation:
        left |= codes == Code.CONTRADICTION
    return np.flatnonzero(left)


def chunks_of(size: int, work: float, threads: int) -> list[slice]:
    """Cut so many items into chunks for threads; an item takes `work` operations."""
    most = max(int(MOST_WORK / max(work, 1.0)), 1)
    length = max(min(-(-size // (CHUNKS * threads)), most), 1)
    return [slice(k, min(k + length, size)) for k in range(0, size, length)]


def on_threads(work: Callable[[int], None], size: int, threads: int) -> None:
    """Call work(i) for i < size on so many threads; Ctrl-C ends them soon."""
    if threads == 1 or size <= 1:  # a pool takes as long as 20 tiny QPs
        for i in range(size):
            work(i)
        return
    left, running = iter(range(size)), set[int]()

    def work_on() -> None:
        running.add(get_ident())
        try:
            for i in left:
                work(i)
        finally:
            deque(left, 0)  # takes what is left, after an error
            running.discard(get_ident())

    with ThreadPoolExecutor(threads) as pool:
        tasks = [pool.submit(work_on) for _ in range(min(threads, size))]
        try:
            while wait(tasks, LOOK).not_done:
                pass
        except BaseException:
            deque(left, 0)
            for thread in running.copy():  # as Ctrl-C does in the main one
                ctypes.pythonapi.PyThreadState_SetAsyncExc(
                    ctypes.c_ulong(thread), ctypes.py_object(KeyboardInterrupt)
                )
            raise
    for task in tasks:
        task.result()


def available_cores() -> int:
    has_affinity = hasattr(os, "sched_getaffinity")
    return len(os.sched_getaffinity(0)) if has_affinity else os.cpu_count() or 1
