"""Gradients of all items of a batch, on several threads."""

from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp

from namlcp.checks import real_array
from namlcp.derivatives.gradients import QPGradients
from namlcp.derivatives.qp import QPDerivative
from namlcp.options import check_count
from namlcp.qp import BatchResult, Point, available_cores, on_threads


class BatchGradients:
    """Gradients of a scalar in the data of a batch of QPs.

    Attributes
    ----------
    P, q, G, h, A, b, lb, ub : array or sparse array
        With a leading axis of the items where the argument had one; else, as it was
        shared, the sum over all items. P, G and A are formed at the first access.
    used : (N,) bool array
        Which items were solved; the others have gradients 0.
    weak : (N,) array
        As in `QPGradients`, for each item.
    singular : (N,) bool array
        The same.
    """

    def __init__(self, items: list[QPGradients | None], batch: BatchResult) -> None:
        """Take the gradients of the items, None where an item was not solved."""
        self.items, self.stacked = items, batch.problem.stacked
        self.shared = dict(zip("PGA", batch.problem.given, strict=True))
        found = [item for item in items if item is not None]
        self.used = np.array([item is not None for item in items])
        self.weak = np.zeros(self.used.size, dtype=np.int64)
        self.singular = np.zeros(self.used.size, dtype=bool)
        self.weak[self.used] = [item.weak for item in found]
        self.singular[self.used] = [item.singular for item in found]
        sizes = {"q": batch.x, "h": batch.z, "b": batch.y, "lb": batch.x, "ub": batch.x}
        self.q, self.h, self.b, self.lb, self.ub = (
            self.joined(name, np.zeros(part.shape[1:])) for name, part in sizes.items()
        )

    def joined(self, name: str, zero: Any) -> Any:
        """Return the gradients of all items in one argument, stacked or added."""
        parts = [None if g is None else getattr(g, name) for g in self.items]
        if name in self.stacked:
            return np.stack([zero if part is None else part for part in parts])
        return sum((part for part in parts if part is not None), zero)

    def matrix(self, name: str, columns: int) -> Any:
        """Return the gradients in P, G or A."""
        own = self.stacked.get(name, self.shared[name])
        if own is None:
            return np.zeros((0, columns))
        zero = own * 0.0 if sp.issparse(own) else np.zeros(np.shape(own)[-2:])
        return self.joined(name, zero)

    @cached_property
    def P(self) -> Any:
        """The gradient in P."""
        return self.matrix("P", self.q.shape[-1])

    @cached_property
    def G(self) -> Any:
        """The gradient in G."""
        return self.matrix("G", self.q.shape[-1])

    @cached_property
    def A(self) -> Any:
        """The gradient in A."""
        return self.matrix("A", self.q.shape[-1])


def differentiate_batch(
    batch: BatchResult, cotangents: dict[str, Any], threads: int | None
) -> BatchGradients:
    """Return the gradients of a batch from those in x, y, z and z_box of its items."""
    if batch.problem is None:
        raise ValueError(
            "derivatives need the result of solve_batch itself: a pickled or copied "
            "one has lost the problems"
        )
    threads = available_cores() if threads is None else threads
    check_count("threads", threads)
    given = [checked_gradient(name, value, batch) for name, value in cotangents.items()]
    items: list[QPGradients | None] = [None] * len(batch)
    solved = np.flatnonzero(batch.solved)

    def work(k: int) -> None:
        i = solved[k]
        point = Point(batch.x[i], batch.y[i], batch.z[i], batch.z_box[i])
        qp, matrices = batch.problem.item(i)
        items[i] = QPDerivative(qp, matrices, point).backward(
            *(None if array is None else array[i] for array in given)
        )

    on_threads(work, solved.size, threads)
    return BatchGradients(items, batch)


def checked_gradient(name: str, value: Any, batch: BatchResult) -> np.ndarray | None:
    """Return gradients in x, y, z or z_box of all items checked, None if absent."""
    if value is None:
        return None
    array, own = real_array(name, value), getattr(batch, name[1:])
    if array.shape != own.shape:
        raise ValueError(
            f"{name} must have shape {own.shape} to match {name[1:]}, got {array.shape}"
        )
    return array
