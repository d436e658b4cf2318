"""Dense QPs of the same sizes differentiated backward, item by item in compiled code.

One call finds the active constraints of an item, factors its KKT system and solves it:
the regular case of `namlcp.derivatives.qp`, without Python. Items that are singular are
left to that.
"""

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from namlcp.checks import refuse_number
from namlcp.compiled import kernel, part, uncounted
from namlcp.derivatives.systems import (
    INACTIVE,
    STRICT,
    factor_dense,
    mark_dense,
    memory_size,
    solve_dense,
)
from namlcp.qp import QP, Point

SINGULAR, REGULAR, FAULTY = range(3)
"""Codes of an item: the KKT system of the strictly active constraints has no Cholesky
factors; all is done; a gradient in the solution is not finite."""

NOTHING = np.empty(0)
ALONE = np.zeros(1, dtype=np.int64)
"""The number of the only item."""


class Found(NamedTuple):
    """What `differentiate` finds, its parts named as the data whose gradients they are.

    With a leading axis of the items, or without: q, lb, ub (n,), h (m,), b (p,); held
    (m,), 1 for rows of G that are held; side (n,), -1 for variables held at the lower
    bound, 1 at the upper one; weak, code: numbers.
    """

    q: np.ndarray
    h: np.ndarray
    b: np.ndarray
    lb: np.ndarray
    ub: np.ndarray
    held: np.ndarray
    side: np.ndarray
    weak: Any
    code: Any


def parts_of(row: np.ndarray, sizes: tuple[int, int, int]) -> Found:
    """Return what `differentiate` has written for items of these sizes, or for one."""
    n, m, p = sizes
    after_b = n + m + p
    after_ub = after_b + 2 * n
    return Found(
        row[..., :n],
        row[..., n : n + m],
        row[..., n + m : after_b],
        row[..., after_b : after_b + n],
        row[..., after_b + n : after_ub],
        row[..., after_ub : after_ub + m],
        row[..., after_ub + m : after_ub + m + n],
        row[..., -2],
        row[..., -1],
    )


def width_of(sizes: tuple[int, int, int]) -> int:
    """Return how many numbers `differentiate` writes for an item."""
    n, m, p = sizes
    return 4 * n + 2 * m + p + 2


class OneItem:
    """A single QP and its solution; the factors are kept for the next call."""

    def __init__(self, qp: QP, point: Point) -> None:
        P, q, G, h, A, b, lb, ub = qp
        self.data = P.reshape(-1), q, G.reshape(-1), h, A.reshape(-1), b, lb, ub
        self.points = tuple(point)
        self.sizes = n, m, p = q.size, h.size, b.size
        self.memory = np.empty(memory_size(n, m + p))
        self.is_factored = False

    def differentiate(self, cotangents: tuple[np.ndarray, ...]) -> Found:
        """Return the gradients; raise ValueError if a cotangent is not finite."""
        out = np.empty((1, width_of(self.sizes)))
        problem = self.sizes, self.data, self.points
        differentiate(ALONE, *problem, cotangents, self.memory, self.is_factored, out)
        found = parts_of(out[0], self.sizes)
        if found.code == FAULTY:
            refuse_faults(cotangents)
        self.is_factored = found.code == REGULAR
        return found

    @property
    def factors(self) -> np.ndarray | None:
        """The factors of the strictly active constraints, None if they are not made."""
        return self.memory if self.is_factored else None


def refuse_faults(cotangents: Iterable[np.ndarray]) -> None:
    """Raise a ValueError that names the cotangent which is not finite, if one is."""
    for name, value in zip(Point._fields, cotangents, strict=True):
        refuse_number(f"d{name}", value, False)


@part
def item_of(array, i, size):
    """Return the part of item i, or that of all items."""
    start = i * size if array.size > size else 0
    return uncounted(array)[start : start + size]


@part
def item_or_zero(array, i, zero):
    """Return the part of item i, `zero` where there is none."""
    return item_of(array, i, zero.size) if array.size > 0 else zero


@part
def is_finite(v):
    """Tell whether no entry of v is NaN or infinite."""
    fine = True
    for i in range(v.size):
        fine = fine and abs(v[i]) < np.inf
    return fine


@kernel
def differentiate(chosen, sizes, data, points, cotangents, memory, is_factored, out):
    """Write the gradients of the chosen items to their rows of `out`, see `Found`.

    sizes = (n, m, p). data = (P, q, G, h, A, b, lb, ub), points = (x, y, z, z_box) and
    cotangents, the gradients of a scalar in these, are vectors that have the numbers of
    one item after another, or of one item that stands for all, or (cotangents) none.
    memory has `memory_size` numbers; is_factored: they are the factors of the item.
    """
    n, m, p = sizes
    zero, equalities = np.zeros(max(n, m, p)), np.arange(p)
    state, sides = np.empty(m, dtype=np.int8), np.empty((2, n), dtype=np.int8)
    for i in chosen:
        P = item_of(data[0], i, n * n).reshape((n, n))
        G = item_of(data[2], i, m * n).reshape((m, n))
        A = item_of(data[4], i, p * n).reshape((p, n))
        q, h = item_of(data[1], i, n), item_of(data[3], i, m)
        lb, ub = item_of(data[6], i, n), item_of(data[7], i, n)
        x, y = item_of(points[0], i, n), item_of(points[1], i, p)
        z, z_box = item_of(points[2], i, m), item_of(points[3], i, n)
        matrices, row = (P, G, A), out[i]
        row[:] = 0.0
        weak = mark_dense(matrices, (q, h, lb, ub), (x, y, z, z_box), state, sides)
        row[row.size - 2] = weak
        row[row.size - 1] = SINGULAR
        side = sides[0]
        places = equalities, places_with(state, STRICT), places_with(side, INACTIVE)
        if not (is_factored or factor_dense(matrices, places, memory)):
            continue
        r = item_or_zero(cotangents[0], i, zero[:n])
        e = item_or_zero(cotangents[1], i, zero[:p])
        d = item_or_zero(cotangents[2], i, zero[:m])
        of_box = item_or_zero(cotangents[3], i, zero[:n])
        row[row.size - 1] = FAULTY
        if not (is_finite(r) and is_finite(e) and is_finite(d) and is_finite(of_box)):
            continue
        row[row.size - 1] = REGULAR
        first, second = n + m, n + m + p
        u, lam, nu = row[:n], row[n:first], row[first:second]
        lower, upper = row[second : second + n], row[second + n : second + 2 * n]
        for j in range(n):
            u[j] = of_box[j] if side[j] != 0 else 0.0
        solve_dense(matrices, places, memory, (r, d, e), (u, lam, nu, lower))
        held = row[second + 2 * n :]
        for k in range(m):
            held[k] = 1.0 if state[k] == STRICT else 0.0
        for j in range(n):
            held[m + j] = side[j]
            u[j] = 0.0 - u[j]
            upper[j] = lower[j] if side[j] > 0 else 0.0
            lower[j] = lower[j] if side[j] < 0 else 0.0


@part
def places_with(states, state):
    """Return the places of a state, in rising order."""
    count = 0
    for i in range(states.size):
        count += states[i] == state
    places = np.empty(count, dtype=np.int64)
    count = 0
    for i in range(states.size):
        if states[i] == state:
            places[count] = i
            count += 1
    return places
