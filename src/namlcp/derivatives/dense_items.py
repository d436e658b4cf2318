"""Dense QPs of the same sizes differentiated backward, item by item in compiled code.

One call finds the active constraints of an item, factors its KKT system and solves it:
the regular case of `namlcp.derivatives.qp`, without Python. Items that are singular are
left to that. A single QP whose solve has left its factors is solved with these: they
are those of the whole P with active bounds as rows, see `namlcp.qp.responses`.
"""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from namlcp.checks import refuse_number
from namlcp.compiled import floats, kernel, longs, part, uncounted
from namlcp.derivatives.gradients import write_rank_two
from namlcp.derivatives.systems import (
    INACTIVE,
    LEAST_PIVOT,
    SOLVES,
    STRICT,
    factor_dense,
    mark_dense,
    memory_size,
    solve_dense,
)
from namlcp.linalg import add_scaled, dot
from namlcp.qp import (
    QP,
    Held,
    Point,
    least_pivot,
    parts_of_result,
    solve_held,
    state_at,
)

SINGULAR, REGULAR, FAULTY = range(3)
"""Codes of an item: the KKT system of the strictly active constraints has no Cholesky
factors; all is done; a gradient in the solution is not finite."""

AT_ONCE = 2000
"""Entries of the gradients in P, G and A together, up to which they are made with the
others: that takes less time than the call that would make one of them later."""

NOTHING = np.empty(0)
ALONE = np.zeros(1, dtype=np.int64)
"""The number of the only item."""


class Found(NamedTuple):
    """What `differentiate` finds, its parts named as the data whose gradients they are.

    With a leading axis of the items: q, lb, ub (n,), h (m,), b (p,); held (m,), 1 for
    rows of G that are held; side (n,), -1 for variables held at the lower bound, 1 at
    the upper one; weak, code: numbers.
    """

    q: np.ndarray
    h: np.ndarray
    b: np.ndarray
    lb: np.ndarray
    ub: np.ndarray
    held: np.ndarray
    side: np.ndarray
    weak: np.ndarray
    code: np.ndarray


def parts_of(out: np.ndarray, sizes: tuple[int, int, int]) -> Found:
    """Return what `differentiate` has written to the rows of `out`, one for an item."""
    n, m, p = sizes
    columns, end = out.T, 3 * n + m + p
    held, side = columns[end : end + m], columns[end + m : end + m + n]
    parts = *vectors_of(columns, sizes), held, side, columns[-2], columns[-1]
    return Found(*(part.T for part in parts))


def vectors_of(
    row: np.ndarray, sizes: tuple[int, int, int]
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return the gradients in q, h, b, lb and ub in what is written for one item."""
    n, m, p = sizes
    b, lb = n + m, n + m + p
    ub = lb + n
    return row[:n], row[n:b], row[b:lb], row[lb:ub], row[ub : ub + n]


def width_of(sizes: tuple[int, int, int]) -> int:
    """Return how many numbers `differentiate` writes for an item."""
    n, m, p = sizes
    return 4 * n + 2 * m + p + 2


class OneItem:
    """A single QP and its solution.

    Attributes
    ----------
    held : Held or None
        The factors of the solve, as long as they serve.
    factors : array or None
        Those of the strictly active constraints, once they are made here.
    """

    def __init__(self, qp: QP, point: Point, held: Held | None) -> None:
        self.qp, self.point, self.held = qp, point, held
        self.sizes = qp.q.size, qp.h.size, qp.b.size
        self.factors: np.ndarray | None = None

    def differentiate(
        self, cotangents: tuple[np.ndarray, ...]
    ) -> tuple[tuple[np.ndarray, ...], tuple[np.ndarray, ...], int] | None:
        """Return the gradients in q, h, b, lb, ub, in P, G, A, and the count of weak.

        Those in P, G and A are there if they are small (`AT_ONCE`), else none of them.
        None: K is singular. Raises ValueError if a cotangent is not finite.
        """
        n, m, p = self.sizes
        out, rows = np.empty((1, width_of(self.sizes))), n + m + p
        matrices = np.empty((rows if rows * n <= AT_ONCE else 0, n))
        row, code = out[0], SINGULAR
        address = 0 if self.held is None else self.held.address
        if address:
            code = differentiate_held(address, *cotangents, row, matrices)
        if code == SINGULAR:
            self.held = None
            self.differentiate_anew(cotangents, out)
            write_matrices(row, tuple(self.point), matrices)
            code = row[-1]
        if code == FAULTY:
            refuse_faults(cotangents)
        if code == SINGULAR:
            return None
        made: tuple[np.ndarray, ...] = ()
        if matrices.size:
            made = matrices[:n], matrices[n : n + m], matrices[n + m :]
        return vectors_of(row, self.sizes), made, int(row[-2])

    def differentiate_anew(
        self, cotangents: tuple[np.ndarray, ...], out: np.ndarray
    ) -> None:
        """Differentiate with factors that are made here, and kept for the next call."""
        n, m, p = self.sizes
        P, q, G, h, A, b, lb, ub = self.qp
        data = P.reshape(-1), q, G.reshape(-1), h, A.reshape(-1), b, lb, ub
        memory, is_factored = self.factors, self.factors is not None
        if memory is None:
            memory = np.empty(memory_size(n, m + p))
        problem = self.sizes, data, tuple(self.point)
        differentiate(ALONE, *problem, cotangents, memory, is_factored, out)
        if out[0, -1] == REGULAR:
            self.factors = memory


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
        u, lam, nu, rest = unknowns_in(row, sizes)
        for j in range(n):
            u[j] = of_box[j] if side[j] != 0 else 0.0
        solve_dense(matrices, places, memory, (r, d, e), (u, lam, nu, rest))
        complete(row, sizes, state, side)


@part
def unknowns_in(row, sizes):
    """Return where u, lam, nu and rest are to be written before `complete`."""
    n, m, p = sizes
    end = n + m + p
    return row[:n], row[n : n + m], row[n + m : end], row[end : end + n]


@part
def complete(row, sizes, state, side):
    """Write what follows from the unknowns of the KKT system, see `Found`."""
    n, m, p = sizes
    u, _, _, lower = unknowns_in(row, sizes)
    start = 2 * n + m + p
    upper, held = row[start : start + n], row[start + n :]
    for k in range(m):
        held[k] = 1.0 if state[k] == STRICT else 0.0
    for j in range(n):
        held[m + j] = side[j]
        u[j] = 0.0 - u[j]
        upper[j] = lower[j] if side[j] > 0 else 0.0
        lower[j] = lower[j] if side[j] < 0 else 0.0
    row[row.size - 1] = REGULAR


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


@kernel
def write_matrices(row, point, matrices):
    """Write the gradients in P, G and A, one below the other, unless there are none.

    row: what `differentiate` has written; matrices (n + m + p, n), or (0, n). The
    gradients are those of `product_of`, whose terms stand here again: a function that
    returned them to both would lengthen the compilation by a twentieth.
    """
    x, y, z, _ = point
    n, m = x.size, z.size
    if matrices.size == 0:
        return
    of_q, of_h, of_b = row[:n], row[n : n + m], row[n + m : n + m + y.size]
    write_rank_two(0.5, of_q, x, 0.5, x, of_q, matrices[:n])
    write_rank_two(1.0, z, of_q, -1.0, of_h, x, matrices[n : n + m])
    write_rank_two(1.0, y, of_q, -1.0, of_b, x, matrices[n + m :])


@kernel
def differentiate_held(address, gx, gy, gz, gz_box, row, matrices):
    """Do `differentiate` for a QP whose solve has left its factors at an address.

    It does `write_matrices`, too. Returns the code. SINGULAR: the factors are not those
    of the strictly active constraints, or not good enough.
    """
    m = state_at(address)
    n, p, size = m.n, m.p, m.n + m.p
    P, G, A = floats(m.P, (n, n)), floats(m.G, (m.m, n)), floats(m.A, (p, n))
    vectors = floats(m.q, n), floats(m.h, m.m), floats(m.lb, n), floats(m.ub, n)
    state, sides = np.empty(m.m, dtype=np.int8), np.empty((2, n), dtype=np.int8)
    row[:] = 0.0
    point = parts_of_result(m)
    weak = mark_dense((P, G, A), vectors, point, state, sides)
    row[row.size - 2], side = weak, sides[0]
    if not holds(m, state, side) or least_pivot(m) < LEAST_PIVOT:
        return SINGULAR
    zero = np.zeros(max(n, m.m, p))
    r, e = item_or_zero(gx, 0, zero[:n]), item_or_zero(gy, 0, zero[:p])
    d, of_box = item_or_zero(gz, 0, zero[: m.m]), item_or_zero(gz_box, 0, zero[:n])
    if not (is_finite(r) and is_finite(e) and is_finite(d) and is_finite(of_box)):
        row[row.size - 1] = FAULTY
        return FAULTY
    sizes = n, m.m, p
    u, lam, nu, mu = unknowns_in(row, sizes)
    active = longs(m.kept_active, m.most + 1)
    goals, values, load = np.empty(m.kept_k), np.empty(m.length), floats(m.rhs, size)
    for _ in range(SOLVES):
        set_load((P, G, A), (r, e), (u, lam, nu, mu), load)
        for i in range(m.kept_k):
            k = active[i]
            goals[i] = d[k] - dot(G[k], u) if k < m.m else of_box[k - m.m] - u[k - m.m]
        solve_held(m, goals, values)
        add_scaled(1.0, values[m.m : m.rows], u)
        add_scaled(1.0, values[m.rows :], nu)
        for i in range(m.kept_k):
            if active[i] < m.m:
                lam[active[i]] += goals[i]
            else:
                mu[active[i] - m.m] += goals[i]
    complete(row, sizes, state, side)
    write_matrices(row, point, matrices)
    return REGULAR


@part
def holds(m, state, side):
    """Tell whether the active rows of the solve are the strictly active constraints."""
    active = longs(m.kept_active, m.most + 1)
    count = 0
    for i in range(state.size):
        count += state[i] == STRICT
    for j in range(side.size):
        count += side[j] != 0
    same = count == m.kept_k
    for i in range(m.kept_k):
        k = active[i]
        same = same and (state[k] == STRICT if k < m.m else side[k - m.m] != 0)
    return same


@part
def set_load(matrices, right, unknowns, load):
    """Set load = (r - P u - G'lam - A'nu - mu, e - A u)."""
    P, G, A = matrices
    r, e = right
    u, lam, nu, mu = unknowns
    n = r.size
    first = load[:n]
    for j in range(n):
        first[j] = r[j] - dot(P[j], u) - mu[j]
    for i in range(lam.size):
        if lam[i] != 0.0:
            add_scaled(-lam[i], G[i], first)
    for i in range(e.size):
        add_scaled(-nu[i], A[i], first)
        load[n + i] = e[i] - dot(A[i], u)
