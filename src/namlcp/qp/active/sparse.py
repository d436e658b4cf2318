"""Sparse QPs: the base problem of `engine` by the factors of its KKT matrix.

The base problem min 1/2 x'Px + q'x, A x = b is the system K u = (-q, b) with

    K = [P  A'],    K~ = K + [R   0],    u = (x, y).
        [A  0 ]              [0  -D]

K~ = L D L' is factored once, with small diagonal matrices R and D, so that it needs no
pivoting. A solve with K is a solve with K~ and `passes` of iterative refinement. K is
held by its upper triangle in CSC, as in `qp.kkt`: column n + i is row i of A, and the
diagonal is the last entry of a column. G is held by rows.

Where P and A together do not determine x, P + W takes the place of P, see `rounds`.
"""

import cython
import numpy as np
from cython import Py_ssize_t
from cython.cimports.libc.math import INFINITY, cos, fabs, sqrt
from scipy.sparse import csr_array

from namlcp.linalg.csc import by_rows
from namlcp.qp.kkt import KKT, equilibrate

# Entries of R and D for rows equilibrated to a largest entry of 1.
SHIFT = 1e-9
# Residual of a solve with K, over the right-hand side, at which it is not refined
# further; the gain that a pass must have; the residual that has to be reached.
ACCURATE, GAIN, REACHED = 1e-11, 0.5, 1e-9
# Curvature of a row, in equilibrated units, over the largest one of a trial solve, up
# to which the equations fix the row.
FIXED = 1e-11
# Operations for each entry of K, G, L and a vector from which on another method is
# quicker: the interior-point method takes about a microsecond for an entry.
MOST_OPERATIONS = 2000.0


class SparseActiveSet:
    """A QP with sparse matrices."""

    def lay_out(self):
        self.size = self.n + self.p
        self.most = self.n - self.p
        lay_out_rows(self)
        self.unit, self.rest = reals(self, self.size), reals(self, self.size)
        self.cost = reals(self, self.n)

    def set_values(self, rhs, values):
        self.since += self.response_operations
        solve_base(self, rhs, values, self.passes)

    def make_response(self, row):
        """Make the response to a row, one pass more accurate than what changes."""
        self.operations += self.response_operations
        self.since += self.response_operations
        fill(self.rhs, 0.0, self.size)
        if row < self.m:
            for t in range(self.G.indptr[row], self.G.indptr[row + 1]):
                self.rhs[self.G.indices[t]] = self.G.data[t]
        else:
            self.rhs[row - self.m] = 1.0
        solve_base(self, self.rhs, claim_place(self, row), self.passes + 1)

    def set_products(self, is_base):
        n, x, G, A = self.n, self.x, cython.address(self.G), cython.address(self.A)
        self.times_cost(x, self.Px)
        times_both(G, self.m, n, x, self.Gx, self.z, self.Gtz)
        times_both(A, self.p, n, x, self.Ax, self.y, self.Aty)

    def decide(self):
        return solve_at_hand(self) if is_fit(self) else STUCK

    def set_up(self):
        """Factor P + W; apart from `decide`, as what has such a block takes the GIL."""
        if self.rho == 0.0:
            return False
        self.rho = wanted_rho(self)
        for j in range(self.n):
            self.weight[j] = self.rho * self.shape[j]
            self.base[self.indptr[j + 1] - 1] = self.cost[j] + self.weight[j]
        with cython.gil:
            try:
                self.is_ready = self.factor_and_try()
            except MemoryError:
                self.is_ready = False
            except BaseException as error:  # as Ctrl-C
                self.is_ready, self.interrupted, self.error = False, True, error
        forget_responses(self)
        return self.is_ready

    def times_cost(self, x, Px):
        indptr, indices, base = self.indptr, self.indices, self.base
        for j in range(self.n):
            k, count = indptr[j], indptr[j + 1] - 1 - indptr[j]
            total = self.cost[j] * x[j]  # K has the diagonal of P + W
            Px[j] = add_line(total, base + k, indices + k, count, x, x[j], Px)

    def attach(self, P, G, A):
        """Take matrices, and make what depends on them; an old pattern saves time."""
        self.n, self.m, self.p = P.shape[0], G.shape[0], A.shape[0]
        self.matrices = rows, equations = by_rows(G), by_rows(A)
        take_columns(rows, self.m, cython.address(self.G))
        take_columns(equations, self.p, cython.address(self.A))
        self.kkt = kkt = KKT(P, equations, csr_array((0, self.n)), self.kkt)
        make_room(self)
        self.indptr = places(kkt.indptr, self.size + 1)
        count: Py_ssize_t = self.indptr[self.size]
        self.indices = places(kkt.indices, count)
        self.base, self.data = numbers(kkt.base, count), numbers(kkt.data, count)
        for j in range(self.n):
            self.cost[j] = self.base[self.indptr[j + 1] - 1]
        factors = kkt.plan()
        if not isinstance(factors, SparseFactors):
            return
        self.factors = factors
        unit = np.ones(self.size)
        equilibrate(kkt.indptr, kkt.indices, kkt.base.copy(), unit)
        copy(data_of(unit), self.unit, self.size)
        entries = self.factors.entries + kkt.base.size + G.nnz + self.length
        self.most_operations = MOST_OPERATIONS * entries
        self.is_ready = True
        if not self.factor_and_try():  # prepare W, of which the first solve chooses rho
            copy(self.cost, self.shape, self.n)
            self.largest = largest_entry(self.cost, self.n)
            set_shape(self)
            self.rho = INFINITY
        else:
            for j in range(self.n):
                self.scale[self.m + j] = 1.0 / self.unit[j]
        set_norms(self, cython.address(self.G), self.m, self.scale)
        set_norms(self, cython.address(self.A), self.p, self.reach)
        forget_responses(self)

    def factor_and_try(self):
        """Factor K~, and choose the passes; tell whether solves are accurate.

        The entries of the right-hand side of a trial solve have size 1 in equilibrated
        units, and signs that have no pattern.
        """
        copy(self.base, self.data, self.indptr[self.size])
        for j in range(self.size):
            shift = SHIFT / (self.unit[j] * self.unit[j])
            self.data[self.indptr[j + 1] - 1] += shift if j < self.n else -shift
        if not self.kkt.factor() or not is_quasi_definite(self):
            return False
        rhs, rest, unit, u = self.rhs, self.rest, self.unit, self.s + self.m
        for j in range(self.size):
            rhs[j] = (1.0 if cos(j) > 0.0 else -1.0) / unit[j]
        error: cython.double = 1.0
        passes: Py_ssize_t = -1
        while error > ACCURATE and passes < MOST_PASSES:
            solve_base(self, rhs, self.s, passes + 1)
            copy(rhs, rest, self.size)
            subtract_product(self, u, rest)
            new = 0.0
            for j in range(self.size):
                size = fabs(rest[j] * unit[j])
                new = max(new, size) if size < INFINITY else INFINITY
            if not new < GAIN * error:
                break
            error, passes = new, passes + 1
        self.passes, largest = max(passes, 0), 0.0
        for j in range(self.n):
            largest = max(largest, fabs(u[j] / unit[j]))
        self.least_curvature = FIXED * largest
        entries = self.most_operations / MOST_OPERATIONS
        self.response_operations = 2.0 * (self.passes + 2) * entries
        return error <= REACHED


# ---- the operator


def solve_base(m, rhs, values, passes):
    u = values + m.m
    m.factors.solve_into(rhs, u)
    for _ in range(passes):
        copy(rhs, m.rest, m.size)
        subtract_product(m, u, m.rest)
        m.factors.solve_into(m.rest, m.rest)
        add_scaled(1.0, m.rest, u, m.size)
    fill(values, 0.0, m.m)
    columns_times_transposed(cython.address(m.G), m.m, u, values)


def subtract_product(m, u, r):
    """Set r -= K u."""
    indptr, indices, base = m.indptr, m.indices, m.base
    for j in range(m.size):
        k, last = indptr[j], indptr[j + 1] - 1
        total = base[last] * u[j] - r[j]
        r[j] = -add_line(total, base + k, indices + k, last - k, u, -u[j], r)


def times_both(M, count, n, x, Mx, y, Mty):
    """Set Mx = M x and Mty = M'y, for the rows of M."""
    fill(Mty, 0.0, n)
    for i in range(count):
        k, entries = M.indptr[i], M.indptr[i + 1] - M.indptr[i]
        Mx[i] = add_line(0.0, M.data + k, M.indices + k, entries, x, y[i], Mty)


# ---- the factors


def is_quasi_definite(m):
    """Tell whether the pivots of x are positive, and those of y negative."""
    place, inverse = m.factors.place, m.factors.inverse
    for j in range(m.size):
        pivot = inverse[place[j]]
        if (pivot <= 0.0) if j < m.n else (pivot >= 0.0):
            return False
    return True


def set_norms(m, M, count, norm):
    """Set 1 over the norms of rows of M, for those of x at hand; 1 of an empty row."""
    for i in range(count):
        squares = 0.0
        for t in range(M.indptr[i], M.indptr[i + 1]):
            entry = M.data[t] / m.scale[m.m + M.indices[t]]
            squares += entry * entry
        norm[i] = 1.0 / sqrt(squares) if squares > 0.0 else 1.0
