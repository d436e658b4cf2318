"""Gradients of many QPs of the same sizes, on several threads.

`differentiate_items` has those of each item, `BatchGradients` those in the arguments of
a batch, which its items may share.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from namlcp.checks import clean_copy, real_array, refuse_number
from namlcp.derivatives.dense import differentiate_items as differentiate_part
from namlcp.derivatives.gradients import QPGradients, product_of
from namlcp.derivatives.qp import QPDerivative
from namlcp.options import check_count
from namlcp.qp import Items, Point, available_cores, chunks_of, on_threads


class Found(NamedTuple):
    """Gradients in the data of items, one after another, and what they hold.

    sides (N, m + n): 1 for rows of G that are held; -1 for variables held at the lower
    bound, 1 at the upper one; else 0. weak (N,): constraints with a multiplier 0;
    regular (N,): whether the KKT system of the strictly active constraints is regular.
    """

    q: np.ndarray
    h: np.ndarray
    b: np.ndarray
    lb: np.ndarray
    ub: np.ndarray
    sides: np.ndarray
    weak: np.ndarray
    regular: np.ndarray


def differentiate_items(
    items: Items,
    solutions: Point,
    which: np.ndarray,
    cotangents: tuple[np.ndarray | None, ...],
    threads: int,
) -> tuple[Found, Point]:
    """Return the gradients of each item, and the solutions with the multipliers used.

    Items that are not in `which` (N,) have gradients and solutions 0. `solutions` and
    `cotangents` have a leading axis.
    """
    shown = which[:, None]
    points = Point(*(np.where(shown, v, 0.0) for v in solutions))
    parts = tuple(None if v is None else np.where(shown, v, 0.0) for v in cotangents)
    for name, part in zip(Point._fields, parts, strict=True):
        if part is not None:
            refuse_number(f"d{name}", part, False)
    n, m, p = points.x.shape[1], points.z.shape[1], points.y.shape[1]
    count, chosen = which.size, np.flatnonzero(which)
    q, h, b, lb, ub = (np.zeros((count, size)) for size in (n, m, p, n, n))
    sides, weak = np.zeros((count, m + n), np.int8), np.zeros(count, np.intp)
    found = Found(q, h, b, lb, ub, sides, weak, np.zeros(count, bool))
    if items.shared.is_dense:
        given = (items.shared._asdict() | items.stacked).values()
        clean = (clean_copy(v) for v in given)
        arrays, dense = (*clean, *points, *parts), chosen
        chunks = chunks_of(dense.size, (n + m + p) * n * n, threads)

        def work_on_part(k: int) -> None:
            differentiate_part(dense[chunks[k]], arrays, found)

        on_threads(work_on_part, len(chunks), threads)
        chosen = dense[~found.regular[dense]]

    def work(k: int) -> None:
        i = chosen[k]
        point = Point(*(v[i] for v in points))
        derivative = QPDerivative(items.item(i)[0], point)
        vectors, _ = derivative.solve(tuple(v if v is None else v[i] for v in parts))
        for own, vector in zip(found, vectors, strict=False):
            own[i] = vector
        found.weak[i], found.regular[i] = derivative.weak, not derivative.singular
        found.sides[i] = derivative.held[p:]
        _, points.y[i], points.z[i], _ = derivative.point

    on_threads(work, chosen.size, threads)
    return found, points


@dataclass(eq=False, repr=False)
class BatchGradients(QPGradients):
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

    used: np.ndarray


def differentiate_batch(
    items: Items,
    points: Point,
    used: np.ndarray,
    cotangents: tuple[Any, ...],
    threads: int | None,
) -> BatchGradients:
    """Return the gradients of the used items from those in their points."""
    threads = available_cores() if threads is None else threads
    check_count("threads", threads)
    pairs = zip(Point._fields, cotangents, points, strict=True)
    given = tuple(checked_gradient(*pair) for pair in pairs)
    found, points = differentiate_items(items, points, used, given, threads)

    def matrix(name: str) -> Any:
        product = product_of(found, points, name)
        if name in items.stacked:
            return product.stacked()
        return product.on(items.given["PGA".index(name)])

    q, h, b, lb, ub = (
        v.copy() if name in items.stacked else v.sum(axis=0)
        for name, v in zip(("q", "h", "b", "lb", "ub"), found, strict=False)
    )
    singular = used & ~found.regular
    return BatchGradients(q, h, b, lb, ub, found.weak, singular, matrix, used)


def checked_gradient(name: str, value: Any, own: np.ndarray) -> np.ndarray | None:
    """Return gradients in a part of all points checked, None if absent."""
    if value is None:
        return None
    array = real_array(f"d{name}", value)
    if array.shape != own.shape:
        raise ValueError(
            f"d{name} must have shape {own.shape} to match {name}, got {array.shape}"
        )
    return array
