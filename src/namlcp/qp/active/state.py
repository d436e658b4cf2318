"""The memory of the active-set method: one object a problem, one allocation.

`ActiveSet` has what the method of `steps` needs whatever the matrices are stored as; a
subclass, `dense.DenseActiveSet` or `sparse.SparseActiveSet`, has the operators, the
five methods below, and vectors of its own.
"""

import cython
from cython.cimports.libc.math import INFINITY
from cython.cimports.libc.stdlib import free, malloc
from cython.cimports.namlcp.watch import Watched

# Most numbers that all responses may take: 64 MB. There are no more active rows.
MOST_NUMBERS = 8_000_000


class ActiveSet(Watched):
    """A QP, its active rows, and what is kept from solve to solve."""

    def __cinit__(self):
        self.most_operations = INFINITY

    def __dealloc__(self):
        free(self.memory)

    def lay_out(self):
        """Give every vector its place, for the sizes n, m, p and `most`."""

    def set_values(self, rhs, values):
        """Set values = (G x, x, y) for (x, y) = K^-1 rhs, see `steps`."""

    def make_response(self, row):
        """Make the response to a row."""

    def set_products(self, is_base):
        """Set the products of the point with P, G and A.

        is_base: it is that of the base problem, whose values s0 have G x.
        """

    def set_row_products(self):
        """Set the products with A, G' and A' alone, perhaps the others, too."""

    def times_cost(self, x, Px):
        """Set Px = P x."""


def reals(m, count):
    """Return the place of the next `count` numbers of the memory.

    Without memory, at first, that only counts them.
    """
    found = cython.cast(cython.p_double, m.memory + m.memory_end)
    m.memory_end += 8 * max(count, 1)
    return found


def indices(m, count):
    """Return the place of the next `count` indices of the memory."""
    return cython.cast(cython.p_Py_ssize_t, reals(m, count))


def lay_out_rows(m):
    """Give the vectors of any storage their places; m.most is set."""
    n, p = m.n, m.p
    rows = m.m + n
    length = rows + p
    m.rows, m.length = rows, length
    places = MOST_NUMBERS // max(length, 1)
    m.most = most = max(min(m.most, min(rows, places)), 0)
    m.capacity = min(rows, max(most + 4, places))
    size = most * (most + 1) // 2
    m.s0, m.s, m.direction = reals(m, length), reals(m, length), reals(m, length)
    m.best, m.change, m.scale = reals(m, length), reals(m, length), reals(m, rows)
    m.best_multiplier, m.multiplier = reals(m, most + 1), reals(m, most + 1)
    m.active, m.side = indices(m, most + 1), indices(m, rows)
    m.kept_active, m.kept_side = indices(m, most + 1), indices(m, most + 1)
    m.triangle, m.kept_triangle = reals(m, size), reals(m, size)
    m.coefficient, m.ratio = reals(m, most + 1), reals(m, most + 1)
    m.work = reals(m, most + 1)
    m.cosines, m.sines = reals(m, most), reals(m, most)
    m.place, m.owner = indices(m, rows), indices(m, m.capacity)
    m.Px, m.Gx, m.Ax = reals(m, n), reals(m, m.m), reals(m, p)
    m.Gtz, m.Aty, m.rhs = reals(m, n), reals(m, n), reals(m, 4 * (n + p))
    m.weight, m.shape, m.reach = reals(m, n), reals(m, n), reals(m, p)
    m.centre, m.along, m.Palong = reals(m, n), reals(m, length), reals(m, n)
    m.responses = reals(m, m.capacity * length)


def make_room(m):
    """Take memory for the sizes at hand, and forget what an earlier QP has left."""
    memory, m.memory, m.memory_end = m.memory, cython.NULL, 0
    most = m.most
    m.lay_out()
    if m.memory_end > m.memory_size or memory == cython.NULL:
        free(memory)
        m.memory_size = 0
        memory = cython.cast(cython.p_char, malloc(m.memory_end))
        if memory == cython.NULL:
            raise MemoryError("a QP of this size needs more memory than there is")
        m.memory_size = m.memory_end
    m.memory, m.memory_end, m.most = memory, 0, most
    m.lay_out()
    m.is_ready, m.skipped, m.rho = False, 0, 0.0
    m.k, m.kept_k, m.hints, m.kept_age = 0, 0, 0, 0
    return 0
