"""The memory of one solve by pivoting: one object, one allocation.

"Scaled" refers to the problem with a unit diagonal.
"""

import cython
from cython.cimports.libc.stdlib import free
from cython.cimports.namlcp.linalg.arrays import data_of, new_vector, numbers, places
from cython.cimports.namlcp.linalg.vectors import copy, fill
from cython.cimports.namlcp.watch import Watched, begin_watch


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

    def best_between(self, lower, upper):
        return best_point(self, numbers(lower, self.n), numbers(upper, self.n))

    def vector(self, k):
        """Return vector k as `allocate` lays them out, a view."""
        return self.memory[k * self.n : (k + 1) * self.n]

    def state(self):
        return self.memory[10 * self.n + self.entries :].view("i4")[: self.n]


def reals(m, count):
    found = m.end
    m.end += count
    return found


def flags(m, count):
    return cython.cast(cython.p_int, reals(m, (count + 1) // 2))


def allocate(m):
    """Allocate the memory for n and `entries`, with zeros, and no place in a system."""
    n = m.n
    size = 10 * n + m.entries + 11 * ((n + 1) // 2)
    m.memory = new_vector(size)
    m.end = data_of(m.memory)
    fill(m.end, 0.0, size)
    # `driver` knows the places of the first three and of `scaled`.
    m.root, m.own_z, m.own_rhs = reals(m, n), reals(m, n), reals(m, n)
    m.q, m.lower, m.upper = reals(m, n), reals(m, n), reals(m, n)
    m.w, m.centre, m.best = reals(m, n), reals(m, n), reals(m, n)
    m.y, m.scaled = reals(m, n), reals(m, m.entries)
    m.side, m.goal, m.unit = flags(m, n), flags(m, n), flags(m, n)
    m.sequence, m.local = flags(m, n), flags(m, n)
    m.order, m.parent, m.counts = flags(m, n), flags(m, n), flags(m, n)
    m.pattern, m.flag, m.pivots = flags(m, n), flags(m, n), flags(m, n)
    for i in range(n):
        m.local[i] = -1
    return 0


def best_point(m, lower, upper):
    """Return the best z so far, in the caller's scaling, between these bounds."""
    point = new_vector(m.n)
    z = data_of(point)
    for i in range(m.n):
        z[i] = min(max(m.best[i] * m.root[i], lower[i]), upper[i])
    return point
