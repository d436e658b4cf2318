"""Dense QPs differentiated backward: the regular case of `namlcp.derivatives.qp`.

The strictly active constraints are found, their KKT system is factored and solved. A
singular one is left to others. A single QP whose solve has left its factors is solved
with these, `kept`, if they are those of the strictly active constraints.
"""

import cython
import numpy as np
from cython import Py_ssize_t
from cython.cimports.libc.math import INFINITY, fabs
from cython.cimports.libc.stdlib import calloc, free
from cython.cimports.namlcp.derivatives.rank_two import write_rank_two
from cython.cimports.namlcp.derivatives.systems.cholesky import (
    CholeskySystem,
    factor_held,
    hold_strict,
    solve_held,
)
from cython.cimports.namlcp.derivatives.systems.kept import serves, solve_kept
from cython.cimports.namlcp.derivatives.systems.marks import (
    locate,
    mark_dense,
    set_solved,
    sizes_of,
)
from cython.cimports.namlcp.linalg.arrays import indices, numbers, signs
from cython.cimports.namlcp.linalg.vectors import fill
from cython.cimports.namlcp.qp.active.dense import DenseActiveSet

from namlcp.checks import refuse_number

# AT_ONCE: entries of the gradients in P, G and A together, up to which they are made
# with the others: that takes less time than the call that would make one of them later.
# ARRAYS: data, solution and gradients in the solution.


class DenseItem:
    """One dense QP with its solution, or one after another of the same sizes."""

    def __cinit__(self, n: Py_ssize_t, m: Py_ssize_t, p: Py_ssize_t):
        qp = cython.address(self.qp)
        qp.n, qp.m, qp.p = n, m, p
        most, length = max(n, max(m, p)), 4 * (n + m + p)
        self.memory = cython.cast(
            cython.p_char, calloc(8 * (most + length) + 2 * (n + m) + 8, 1)
        )
        if self.memory == cython.NULL:
            raise MemoryError("a derivative of this size needs more memory")
        self.zero = cython.cast(cython.p_double, self.memory)
        self.work = self.zero + most
        self.strict = cython.cast(cython.p_schar, self.work + length)
        self.whole = self.strict + n + m

    def __dealloc__(self):
        free(self.memory)

    def take(self, qp, point, kept):
        """Note a single QP, its solution, and the factors of its solve or None."""
        start = cython.declare(cython.p_double[12])
        step = cython.declare(Py_ssize_t[12])
        self.arrays = *qp, *point
        own = cython.address(self.qp)
        locate(self.arrays, sizes_of(own.n, own.m, own.p), 1, start, step)
        set_solved(own, start, step, 0)
        if isinstance(kept, DenseActiveSet):
            self.kept = kept

    def backward(self, cotangents):
        """Return the gradients in q, h, b, lb, ub, in P, G, A, and the count of weak.

        Those in P, G and A are there if they are small, else none of them. None: the
        system is singular. Raises ValueError if a cotangent is not finite.
        """
        n, m, p = self.qp.n, self.qp.m, self.qp.p
        start = cython.declare(cython.p_double[4])
        step = cython.declare(Py_ssize_t[4])
        self.weak = mark_dense(
            cython.address(self.qp), self.work, self.strict, self.whole
        )
        if self.kept is not None and not serves(self.kept, self.strict):
            self.kept = None
        if self.kept is None and self.factors is None:
            self.factors = factors_of(self)
            if self.factors is None:
                return None
        q, h, b = np.empty(n), np.empty(m), np.empty(p)
        lb, ub = np.empty(n), np.empty(n)
        locate(cotangents, (n, p, m, n), 1, start, step)
        set_cotangents(self, start, step, 0)
        set_gradients(
            self, numbers(q, n), numbers(h, m), numbers(b, p), numbers(lb, n),
            numbers(ub, n),
        )  # fmt: skip
        if not are_finite(self):
            refuse_faults(cotangents)
        solve_item(self)
        matrices = ()
        if (n + m + p) * n <= AT_ONCE:
            matrices = np.empty((n, n)), np.empty((m, n)), np.empty((p, n))
            write_matrices(self, matrices)
        return (q, h, b, lb, ub), matrices, self.weak


def factors_of(m):
    """Return the factors for the strictly active constraints, None if singular."""
    qp, found = cython.address(m.qp), False
    factors: CholeskySystem = CholeskySystem(qp.n, qp.m, qp.p, qp.n, qp.m + qp.p)
    hold_strict(factors, qp, m.strict)
    with cython.nogil:  # nobody else has these factors yet
        found = factor_held(factors)
    return factors if found else None


def refuse_faults(cotangents):
    """Raise a ValueError that names the cotangent which is not finite, if one is."""
    for name, value in zip(("x", "y", "z", "z_box"), cotangents, strict=True):
        if value is not None:
            refuse_number(f"d{name}", value, False)


def differentiate_items(chosen, arrays, found):
    """Write the gradients of the chosen items to their rows of `found`.

    arrays: P, q, G, h, A, b, lb, ub, x, y, z, z_box and the gradients in these four,
    each with the numbers of one item after another, or of one item that stands for all,
    or (gradients) None. found: a `Found` of zeros; an item that is singular remains so.
    """
    count: Py_ssize_t = found.q.shape[0]
    n: Py_ssize_t = found.q.shape[1]
    m: Py_ssize_t = found.h.shape[1]
    p: Py_ssize_t = found.b.shape[1]
    start = cython.declare(cython.p_double[ARRAYS])
    step = cython.declare(Py_ssize_t[ARRAYS])
    item: DenseItem = DenseItem(n, m, p)
    item.factors = CholeskySystem(n, m, p, n, m + p)
    locate(arrays, (*sizes_of(n, m, p), n, p, m, n), count, start, step)
    q, h = numbers(found.q, count * n), numbers(found.h, count * m)
    b, lb = numbers(found.b, count * p), numbers(found.lb, count * n)
    ub, weak = numbers(found.ub, count * n), indices(found.weak, count)
    side = signs(found.sides, count * (m + n))
    regular = signs(found.regular.view(np.int8), count)
    length: Py_ssize_t = chosen.size
    qp = cython.address(item.qp)
    which = indices(chosen, length)
    with cython.nogil:
        for t in range(length):
            i = which[t]
            set_solved(qp, start, step, i)
            set_cotangents(item, start + 12, step + 12, i)
            set_gradients(item, q + i * n, h + i * m, b + i * p, lb + i * n, ub + i * n)
            weak[i] = mark_dense(qp, item.work, item.strict, item.whole)
            hold_strict(item.factors, qp, item.strict)
            regular[i] = factor_held(item.factors)
            if regular[i]:
                solve_item(item)
            for k in range(m + n):
                side[i * (m + n) + k] = item.strict[k]


def set_cotangents(m, start, step, i):
    """Let the right-hand sides be the gradients in the solution of item i."""
    eq = cython.address(m.equations)
    eq.r = start[0] + i * step[0] if start[0] != cython.NULL else m.zero
    eq.e = start[1] + i * step[1] if start[1] != cython.NULL else m.zero
    eq.d = start[2] + i * step[2] if start[2] != cython.NULL else m.zero
    m.of_box = start[3] + i * step[3] if start[3] != cython.NULL else m.zero


def set_gradients(m, q, h, b, lb, ub):
    """Let the unknowns be where the gradients in the vectors are to be."""
    eq = cython.address(m.equations)
    eq.u, eq.lam, eq.nu, eq.rest, m.upper = q, h, b, lb, ub


def solve_item(m):
    """Write the gradients in the vectors."""
    qp, eq = cython.address(m.qp), cython.address(m.equations)
    fill(eq.u, 0.0, qp.n)
    fill(eq.lam, 0.0, qp.m)
    fill(eq.nu, 0.0, qp.p)
    fill(eq.rest, 0.0, qp.n)
    if m.kept is not None:
        solve_kept(m.kept, eq, m.of_box, m.work, m.work + qp.n)
    else:
        for j in range(qp.n):
            if m.strict[qp.m + j] != 0:
                eq.u[j] = m.of_box[j]
        solve_held(m.factors, eq)
    complete(m)


def are_finite(m):
    """Tell whether the gradients in the solution are finite."""
    qp, eq = cython.address(m.qp), cython.address(m.equations)
    return (
        is_finite(eq.r, qp.n)
        and is_finite(eq.e, qp.p)
        and is_finite(eq.d, qp.m)
        and is_finite(m.of_box, qp.n)
    )


def is_finite(v, n):
    """Tell whether no entry of v is NaN or infinite."""
    fine: cython.bint = True
    for i in range(n):
        fine = fine and fabs(v[i]) < INFINITY
    return fine


def complete(m):
    """Make the unknowns of the equations gradients in q, lb and ub."""
    u, lower, upper = m.equations.u, m.equations.rest, m.upper
    side = m.strict + m.qp.m
    for j in range(m.qp.n):
        u[j] = 0.0 - u[j]
        upper[j] = lower[j] if side[j] > 0 else 0.0
        lower[j] = lower[j] if side[j] < 0 else 0.0


def write_matrices(m, matrices):
    """Write the gradients in P, G and A: those of `product_of`."""
    qp, eq = cython.address(m.qp), cython.address(m.equations)
    n, (P, G, A) = qp.n, matrices
    u, x = eq.u, qp.x
    write_rank_two(0.5, u, x, 0.5, x, u, n, n, numbers(P, n * n))
    write_rank_two(1.0, qp.z, u, -1.0, eq.lam, x, qp.m, n, numbers(G, qp.m * n))
    write_rank_two(1.0, qp.y, u, -1.0, eq.nu, x, qp.p, n, numbers(A, qp.p * n))
    return 0
