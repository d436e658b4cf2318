"""A dense tableau of w = A z + q (+ z_0 d), and complementary pivoting in it.

Names of the variables: w_i is i, z_i is n + i, and Lemke's z_0 is 2 n. At any time n of
them are basic, x_B = b + T x_N, the others x_N are 0, and no complementary pair has two
basic variables but one: w_k and z_k if z_0 is absent or not basic, else none. A step
enters the complement of the variable that has just left. Which variable leaves is
chosen by the lexicographic order of the rows of [b, B^-1], as if q had been perturbed
by (e, e^2, ..., e^n) with a tiny e: no basis can then come twice.

References
----------
Cottle, Pang and Stone, The Linear Complementarity Problem (1992), sections 4.4, 4.9.
"""

import cython
import numpy as np
from cython.cimports.libc.math import fabs

# Modulus of an entry of T, relative to the largest of its column, that counts as 0.
LEAST_PIVOT = 1e-11

# Two ratios x and y are equal up to rounding if |x - y| <= TIE (|x| + |y|) + TINY_TIE;
# max |q_i| is 1.
TIE, TINY_TIE = 1e-11, 1e-13


class Tableau:
    """x_B = b + T x_N, rows: [b, T], (n, 1 + m).

    basic (n,), nonbasic (1 + m,): names of the variables that the rows and columns
    stand for; nonbasic[0] has no meaning. position (2n + 1,): of each variable its row,
    or -1 minus its column.
    """

    def __init__(self, rows, basic, nonbasic, position):
        self.rows, self.basic = rows, basic
        self.nonbasic, self.position = nonbasic, position
        self.n, self.width = rows.shape
        self.entry = numbers(rows, self.n * self.width)
        self.in_row = indices(basic, self.n)
        self.in_column = indices(nonbasic, self.width)
        self.place = indices(position, 2 * self.n + 1)

    def copy(self):
        parts = self.rows, self.basic, self.nonbasic, self.position
        return Tableau(*[part.copy() for part in parts])

    def values(self):
        x = np.zeros(self.position.size)
        x[self.basic] = self.rows[:, 0]
        return x

    def direction(self, name):
        x = np.zeros(self.position.size)
        x[self.basic] = self.rows[:, -1 - int(self.position[name])]
        x[name] = 1.0
        return x


def tableau_of(A, q, *d):
    n = q.size
    rows = np.ascontiguousarray(np.column_stack((q, A, *d)))
    position = np.empty(2 * n + 1, np.intp)
    position[:n] = np.arange(n)
    position[n:] = -2 - np.arange(n + 1)
    nonbasic = np.arange(n - 1, n + rows.shape[1] - 1, dtype=np.intp)
    return Tableau(rows, np.arange(n, dtype=np.intp), nonbasic, position)


def exchange(t, row, column):
    pivot_row = t.entry + row * t.width
    inverse = 1.0 / pivot_row[column]
    for j in range(t.width):
        pivot_row[j] *= -inverse
    pivot_row[column] = inverse
    for i in range(t.n):
        other = t.entry + i * t.width
        factor = other[column]
        if i != row and factor != 0.0:
            other[column] = 0.0
            add_scaled(factor, pivot_row, other, t.width)
    leaves, enters = t.in_row[row], t.in_column[column]
    t.in_row[row], t.in_column[column] = enters, leaves
    t.place[leaves], t.place[enters] = -1 - column, row


def inverse_entry(t, row, j):
    """Return the entry of B^-1 in a row and the column of w_j."""
    place = t.place[j]
    if place < 0:
        return -t.entry[row * t.width - 1 - place]
    return 1.0 if place == row else 0.0


def order(x, y):
    if fabs(x - y) <= TIE * (fabs(x) + fabs(y)) + TINY_TIE:
        return 0
    return 1 if x > y else -1


def comes_before(t, i, k, column):
    one, other = t.entry + i * t.width, t.entry + k * t.width
    over_i, over_k = -1.0 / one[column], -1.0 / other[column]
    sign = order(one[0] * over_i, other[0] * over_k)
    j: cython.Py_ssize_t = 0
    while sign == 0 and j < t.n:
        sign = order(inverse_entry(t, i, j) * over_i, inverse_entry(t, k, j) * over_k)
        j += 1
    return sign < 0


def leaving_row(t, column, wanted, or_wanted):
    """Return the row that limits a column first, -1 if none, a wanted one of equals."""
    entry, width, largest = t.entry, t.width, 0.0
    for i in range(t.n):
        largest = max(largest, fabs(entry[i * width + column]))
    first: cython.Py_ssize_t = -1
    for i in range(t.n):
        if entry[i * width + column] < -LEAST_PIVOT * largest:
            if first < 0 or comes_before(t, i, first, column):
                first = i
    for k in range(2):
        i = t.place[or_wanted if k else wanted]
        if i >= 0 and entry[i * width + column] < -LEAST_PIVOT * largest:
            ratio = entry[first * width] / entry[first * width + column]
            if order(entry[i * width] / entry[i * width + column], ratio) == 0:
                return i
    return first


def pivot_until(t, entering, last, most):
    """Pivot until one of the two variables `last` leaves, `most` times at most.

    Return how that ended, the variable to enter next, and the number of pivots.
    """
    end, n, enters = MORE, t.n, entering
    count: cython.Py_ssize_t = 0
    wanted: cython.Py_ssize_t = last[0]
    or_wanted: cython.Py_ssize_t = last[1]
    with cython.nogil:
        while end == MORE and count < most:
            column = -1 - t.place[enters]
            row = leaving_row(t, column, wanted, or_wanted)
            if row < 0:
                end = RAY
                break
            leaves = t.in_row[row]
            exchange(t, row, column)
            enters = leaves + n if leaves < n else leaves - n
            count += 1
            if leaves == wanted or leaves == or_wanted:
                end = DONE
    return end, enters, count
