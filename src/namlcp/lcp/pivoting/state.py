"""The memory of one solve by pivoting: one object, one allocation.

"Scaled" refers to the problem with a unit diagonal.
"""

import cython
import numpy as np
from cython.cimports.libc.stdlib import free
from cython.cimports.namlcp.linalg.arrays import data_of, new_vector, numbers, places
from cython.cimports.namlcp.linalg.vectors import copy, fill
from cython.cimports.namlcp.watch import Watched, begin_watch
from scipy import sparse


class Pivoting(Watched):
    """A box LCP and the state of `pivot`; `driver.Attempt` has what is in Python."""

    def __init__(self, columns, vectors, symmetric, until):
        """Take the user's matrix, by its columns, and copy (q, lower, upper, z).

        z, the start, may be empty; until: a value of time.perf_counter().
        """
        dense, indptr, indices, data = self.given = columns
        q, lower, upper, start = vectors
        n: cython.Py_ssize_t = q.size
        self.n, self.symmetric, self.is_dense = n, symmetric, dense.shape[0] == n
        begin_watch(self, until)
        self.entries = n * n if self.is_dense else indices.size
        if self.is_dense:
            self.values = numbers(dense, self.entries)
        else:
            self.values = numbers(data, self.entries)
            self.indptr = places(indptr, n + 1)
            self.indices = places(indices, self.entries)
        allocate(self)
        copy(numbers(q, n), self.q, n)
        copy(numbers(lower, n), self.lower, n)
        copy(numbers(upper, n), self.upper, n)
        if start.size:
            copy(numbers(start, n), self.own_z, n)

    def __dealloc__(self):
        free(self.factor)

    def solve_free_system(self):
        """Write to z the solution for rhs, NaN if there is none; with is_external."""
        raise NotImplementedError

    def is_unsolvable(self):
        """Tell whether rhs leads to a proof that there is no solution."""
        return False

    def report(self):
        """Report a factorisation."""

    @property
    def z(self):
        return reals_of(self, self.own_z, self.n)

    @property
    def rhs(self):
        return reals_of(self, self.own_rhs, self.n)

    @property
    def d(self):
        """The diagonal of D, where D A D is the scaled matrix."""
        return reals_of(self, self.root, self.n)

    @property
    def state(self):
        first = cython.cast(cython.p_double, self.side) - self.begin
        return self.memory[first:].view(np.int32)[: self.n]

    @property
    def scaled_matrix(self):
        """The scaled matrix, where it is compressed."""
        data = reals_of(self, self.scaled, self.entries)
        _, indptr, indices, _ = self.given
        return sparse.csc_array((data, indices, indptr), shape=(self.n, self.n))

    def best_point(self, lower, upper):
        """Return the best z so far, in the caller's scaling, between these bounds."""
        n: cython.Py_ssize_t = self.n
        point = np.empty(n)
        write_best(self, numbers(lower, n), numbers(upper, n), numbers(point, n))
        return point


def reals(m, count):
    """Return the place of the next numbers."""
    found = m.end
    m.end += count
    return found


def flags(m, count):
    """Return the place of the next integers."""
    return cython.cast(cython.p_int, reals(m, (count + 1) // 2))


def allocate(m):
    """Allocate the memory for n and `entries`, with zeros, and no place in a system."""
    n = m.n
    size = 10 * n + m.entries + 11 * ((n + 1) // 2)
    m.memory = new_vector(size)
    m.begin = m.end = data_of(m.memory)
    fill(m.begin, 0.0, size)
    m.q, m.lower, m.upper, m.root = reals(m, n), reals(m, n), reals(m, n), reals(m, n)
    m.own_z, m.w, m.centre, m.best = (
        reals(m, n), reals(m, n), reals(m, n), reals(m, n),
    )  # fmt: skip
    m.own_rhs, m.y = reals(m, n), reals(m, n)
    m.scaled = reals(m, m.entries)
    m.side, m.goal, m.unit = flags(m, n), flags(m, n), flags(m, n)
    m.sequence, m.local = flags(m, n), flags(m, n)
    m.order, m.parent, m.counts = flags(m, n), flags(m, n), flags(m, n)
    m.pattern, m.flag, m.pivots = flags(m, n), flags(m, n), flags(m, n)
    for i in range(n):
        m.local[i] = -1
    return 0


def write_best(m, lower, upper, z):
    """Write the best z so far, in the caller's scaling, between these bounds."""
    for i in range(m.n):
        z[i] = min(max(m.best[i] * m.root[i], lower[i]), upper[i])


def reals_of(m, vector, count):
    """Return a vector as an array, a view."""
    first = vector - m.begin
    return m.memory[first : first + count]
