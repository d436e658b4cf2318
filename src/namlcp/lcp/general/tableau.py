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

from typing import NamedTuple

import numpy as np

from namlcp.compiled import kernel, part

LEAST_PIVOT = 1e-11
"""Modulus of an entry of T, relative to the largest of its column, that counts as 0."""

TIE, TINY_TIE = 1e-11, 1e-13
"""Two ratios x and y are equal up to rounding if |x - y| <= TIE (|x| + |y|) + TINY_TIE.
(The problem is scaled to max |q_i| = 1.)"""

MORE, DONE, RAY = 0, 1, 2
"""How `pivot_until` ends: after the pivots asked for, with the variable that it waits
for, or with an entering variable that nothing limits."""


class Tableau(NamedTuple):
    """The tableau x_B = b + T x_N.

    rows: [b, T], (n, 1 + m). basic (n,), nonbasic (1 + m,): names of the variables that
    the rows and columns stand for; nonbasic[0] has no meaning. position (2n + 1,): of
    each variable its row, or -1 minus its column.
    """

    rows: np.ndarray
    basic: np.ndarray
    nonbasic: np.ndarray
    position: np.ndarray

    @classmethod
    def of(cls, A: np.ndarray, q: np.ndarray, *d: np.ndarray) -> "Tableau":
        """Return the tableau of w = A z + q + z_0 d, or without z_0 if d is absent."""
        n = q.size
        rows = np.column_stack((q, A, *d))
        position = np.empty(2 * n + 1, dtype=np.int64)
        position[:n] = np.arange(n)
        position[n:] = -2 - np.arange(n + 1)
        nonbasic = np.arange(n - 1, n + rows.shape[1] - 1)
        return cls(rows, np.arange(n), nonbasic, position)

    def values(self) -> np.ndarray:
        """Return the (2n + 1,) values of all variables, where the nonbasic are 0."""
        x = np.zeros(self.position.size)
        x[self.basic] = self.rows[:, 0]
        return x

    def direction(self, name: int) -> np.ndarray:
        """Return how all variables change where the nonbasic `name` grows."""
        x = np.zeros(self.position.size)
        x[self.basic] = self.rows[:, -1 - self.position[name]]
        x[name] = 1.0
        return x


@kernel(error_model="numpy")
def exchange(tableau, row, column):
    """Make the variable of a column basic in place of that of a row."""
    rows, basic, nonbasic, position = tableau
    pivot_row = rows[row]
    inverse = 1.0 / pivot_row[column]
    for j in range(pivot_row.size):
        pivot_row[j] *= -inverse
    pivot_row[column] = inverse
    for i in range(basic.size):
        factor = rows[i, column]
        if i != row and factor != 0.0:
            other = rows[i]
            other[column] = 0.0
            for j in range(pivot_row.size):
                other[j] += factor * pivot_row[j]
    leaves, enters = basic[row], nonbasic[column]
    basic[row], nonbasic[column] = enters, leaves
    position[leaves], position[enters] = -1 - column, row


@part
def inverse_entry(tableau, row, j):
    """Return the entry of B^-1 in a row and the column of w_j."""
    position = tableau.position[j]
    if position < 0:
        return -tableau.rows[row, -1 - position]
    return 1.0 if position == row else 0.0


@part
def order(x, y):
    """Return the sign of x - y, 0 where they are equal up to rounding."""
    if abs(x - y) <= TIE * (abs(x) + abs(y)) + TINY_TIE:
        return 0
    return 1 if x > y else -1


@part
def comes_before(tableau, i, k, column):
    """Tell whether row i limits the variable of a column before row k does."""
    rows = tableau.rows
    over_i, over_k = -1.0 / rows[i, column], -1.0 / rows[k, column]
    sign = order(rows[i, 0] * over_i, rows[k, 0] * over_k)
    j = 0
    while sign == 0 and j < tableau.basic.size:
        x, y = inverse_entry(tableau, i, j), inverse_entry(tableau, k, j)
        sign = order(x * over_i, y * over_k)
        j += 1
    return sign < 0


@part
def leaving_row(tableau, column, last):
    """Return the row that limits the variable of a column first, -1 if none does.

    Where a variable in `last` is among several that limit it equally, that one leaves.
    """
    rows, basic = tableau.rows, tableau.basic
    largest = 0.0
    for i in range(basic.size):
        largest = max(largest, abs(rows[i, column]))
    first = -1
    for i in range(basic.size):
        if rows[i, column] < -LEAST_PIVOT * largest:
            if first < 0 or comes_before(tableau, i, first, column):
                first = i
    for name in last:
        i = tableau.position[name]
        if i >= 0 and rows[i, column] < -LEAST_PIVOT * largest:
            ratio = rows[first, 0] / rows[first, column]
            if order(rows[i, 0] / rows[i, column], ratio) == 0:
                return i
    return first


@kernel(error_model="numpy")
def pivot_until(tableau, entering, last, most):
    """Pivot until one of the two variables `last` leaves, `most` times at most.

    Return how it ended, the variable to enter next (that of the ray with RAY), and the
    number of pivots.
    """
    n = tableau.basic.size
    for count in range(most):
        column = -1 - tableau.position[entering]
        row = leaving_row(tableau, column, last)
        if row < 0:
            return RAY, entering, count
        leaves = tableau.basic[row]
        exchange(tableau, row, column)
        entering = leaves + n if leaves < n else leaves - n
        if leaves == last[0] or leaves == last[1]:
            return DONE, entering, count + 1
    return MORE, entering, most
