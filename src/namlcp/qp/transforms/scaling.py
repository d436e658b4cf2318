"""Scaling: the presolved QP in equilibrated form, and the exact way back.

Symmetric Ruiz scaling of K = [[P, C'], [C, 0]], C = [A; G]: rounds divide rows and
columns by the square roots of their largest entries, until those are nearly 1 (D. Ruiz,
RAL-TR-2001-034). With d the factors of the columns and e those of the rows,
x = d x_scaled, y = e y_scaled, z_box = z_box_scaled / d; the cost is not scaled.
The result depends on how K was scaled before: a linear program, in whose K no entry of
P ties the units of the columns to the cost, is first scaled by `even_out`.

Every finite bound or side of a row is one one-sided constraint: sign * t[place] <= c,
where t = (x, Ax, Gx) has the layout of K. Unscaled, t is unit * t, and the multipliers
are divided by `unit`.
"""

import cython
import numpy as np
from cython import Py_ssize_t
from cython.cimports.libc.math import INFINITY, exp, fabs, log, sqrt
from cython.cimports.namlcp.linalg.arrays import numbers, places
from cython.cimports.namlcp.linalg.vectors import copy, fill

from namlcp.entries import constant
from namlcp.qp.kkt import KKT

# The largest |1 - largest entry| that ends the rounds: with 1e-3 there are twice as
# many, and as many iterations; with 0.1 two problems of the Maros-Meszaros collection
# need more restarts.
EQUAL = 0.03
# Range of the products of the factors of all rounds, against over- and underflow.
LEAST_FACTOR, MOST_FACTOR = 1e-8, 1e8
# Largest |log| of a factor of `even_out`. With 4 of its SWEEPS over rows and columns,
# bnl2 of the Netlib collection takes 338 iterations in place of 35.
LARGEST = 20.0


class ScaledQP:
    """min 1/2 x'Px + q'x, Ax = b, sign * t[place] <= c.

    The one-sided constraints are the `finite` ones of the upper and lower sides of all
    rows, then of the upper and lower bounds. `small` is the presolved problem; the
    scaled P, A and G are kept in `kkt` alone. The matrices of `last` are not scaled
    again.
    """

    def __init__(self, small, last=None):
        n, p = small.q.size, small.b.size
        self.small = small
        self.kkt: KKT
        self.scale: np.ndarray
        self.n, self.p = n, p
        if last is not None and all(
            getattr(small, name) is getattr(last.small, name) for name in "PAG"
        ):
            self.kkt, self.scale = last.kkt, last.scale
        else:
            old = None if last is None else last.kkt
            self.kkt = KKT(small.P, small.A, small.G, old)
            self.scale = constant(self.kkt.size, 1.0)
            matrix = self.kkt.indptr, self.kkt.indices, self.kkt.base
            if not small.P.data.any():
                even_out(*matrix, self.scale)
            equilibrate(*matrix, self.scale)
        side = np.concatenate((small.sides.ravel(), small.ub, -small.lb))
        self.finite, self.place, self.sign = find_finite(side, n, p)
        self.side = side[self.finite]
        self.scale_vectors()

    def scale_vectors(self):
        """Set unit, q, b, c and the values of K~."""
        n, rows, small, scale = self.n, self.n + self.p, self.small, self.scale
        self.kkt.data[:] = self.kkt.base
        self.unit = scale.copy()
        self.unit[n:] = 1.0 / scale[n:]
        self.q, self.b = small.q * scale[:n], small.b * scale[n:rows]
        self.c = self.side / self.unit[self.place]

    def point(self, x, y, Z, data=1.0):
        n, rows = self.n, self.small.sides.size
        z = np.zeros(rows + 2 * n)
        z[self.finite] = Z / self.unit[self.place]
        z_box = z[rows : rows + n] - z[rows + n :]
        x, y = x * self.unit[:n], y / self.unit[n : n + self.p]
        return x, y, z[:rows].reshape(2, -1), z_box

    def guess(self, guess):
        """Return the scaled (x, y, Z) of a guess and which constraints are active."""
        x, y, z, z_box, active = guess
        z = np.concatenate((z.ravel(), np.maximum(z_box, 0), np.maximum(-z_box, 0)))
        return (
            x / self.unit[: self.n],
            y * self.unit[self.n : self.n + self.p],
            z[self.finite] * self.unit[self.place],
            active[self.finite],
        )

    def relax(self, t):
        """Relax b, and c of rows of G, to what the scaled t = (x, Ax, Gx) satisfies."""
        row = self.place >= self.n + self.p
        self.b = t[self.n : self.n + self.p].copy()
        self.c = np.where(row, np.maximum(self.c, self.sign * t[self.place]), self.c)


def find_finite(side, n, p):
    """Return the numbers of the finite ones of all sides, their places and signs."""
    size = side.shape[0]
    width, finite = size // 2 - n, np.empty(size, np.intp)
    where, signs = np.empty(size, np.int32), np.empty(size)
    number: Py_ssize_t[::1] = finite
    place: cython.int[::1] = where
    sign: cython.double[::1] = signs
    count: Py_ssize_t = 0
    for i in range(size):
        if not fabs(side[i]) < INFINITY:
            continue
        j, first, length = i, n + p, width
        if i >= 2 * width:  # a bound
            j, first, length = i - 2 * width, 0, n
        number[count] = i
        place[count] = first + (j if j < length else j - length)
        sign[count] = 1.0 if j < length else -1.0
        count += 1
    return finite[:count], where[:count], signs[:count]


def equilibrate(indptr, indices, data, scale):
    """Equilibrate a symmetric matrix (upper triangle in CSC); overwrite data and scale.

    `scale` has factors to begin with, which are not in `data` yet, or 1.
    """
    K: Matrix
    size: Py_ssize_t = scale.size
    work, factor = np.empty(size), numbers(scale, size)
    K.lines, K.starts, count = size, places(indptr, size + 1), indices.size
    K.others, entry = places(indices, count), numbers(data, count)
    K.values = entry
    equilibrate_parts(
        cython.address(K), cython.NULL, cython.NULL, size, 0, 0, factor,
        numbers(work, size),
    )  # fmt: skip
    for j in range(size):
        for t in range(K.starts[j], K.starts[j + 1]):
            entry[t] *= factor[j] * factor[K.others[t]]
    return 0


def equilibrate_parts(P, A, G, n, p, m, units, largest):
    """Multiply units, of x, y and z, by factors that equilibrate K.

    P may be its upper triangle; parts that are NULL count as 0, and an empty row keeps
    its factor. largest: work space.
    """
    size = n + p + m
    for _ in range(ROUNDS):
        fill(largest, 0.0, size)
        note_entries(P, units, units, largest, largest)
        note_entries(A, units + n, units, largest + n, largest)
        note_entries(G, units + n + p, units, largest + n + p, largest)
        off = 0.0
        for k in range(size):
            factor = 1.0
            if largest[k] > 0.0:
                off = max(off, fabs(1.0 - largest[k]))
                factor = 1.0 / sqrt(largest[k])
            largest[k] = min(max(factor * units[k], LEAST_FACTOR), MOST_FACTOR)
        if off <= EQUAL:
            break
        copy(largest, units, size)


def note_entries(M, rows, columns, of_rows, of_columns):
    """Note the largest entries of the rows and columns of M scaled by two vectors."""
    for line in range(0 if M == cython.NULL else M.lines):
        for t in range(first_of(M, line), first_of(M, line + 1)):
            i, j = place_of(M, line, t)
            value = fabs(M.values[t]) * columns[j] * rows[i]
            of_rows[i] = max(of_rows[i], value)
            of_columns[j] = max(of_columns[j], value)


def first_of(M, line):
    return line * M.width if M.starts == cython.NULL else M.starts[line]


def place_of(M, line, t):
    """Return the row and the column of an entry."""
    if M.starts == cython.NULL:
        return line, t - line * M.width
    return M.others[t], line


def even_out(indptr, indices, data, scale):
    """Divide columns and rows by the geometric means of their entries, in turn; P = 0.

    Each time that minimises sum log(|k_ij| s_i s_j)^2, of which the minimum does not
    depend on how rows and columns were scaled before (A.R. Curtis and J.K. Reid, J.
    Inst. Maths Applics 10, 1972). Multiplies scale by s; reads the upper triangle.
    """
    size = scale.shape[0]
    count: cython.double[::1] = np.empty(size)
    total: cython.double[::1] = np.empty(size)
    s: cython.double[::1] = np.zeros(size)
    for k in range(2 * SWEEPS):
        count[:] = 0.0
        total[:] = 0.0
        for j in range(size):
            for t in range(indptr[j], indptr[j + 1]):
                if data[t] != 0.0:
                    own = j
                    if k % 2 == 1:
                        own = indices[t]
                    count[own] += 1.0
                    total[own] += log(fabs(data[t])) + s[j + indices[t] - own]
        for j in range(size):
            if count[j] > 0.0:
                s[j] = -total[j] / count[j]
    for j in range(size):
        scale[j] *= exp(min(max(s[j], -LARGEST), LARGEST))
    return 0
