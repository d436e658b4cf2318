"""Scaling: the presolved QP in equilibrated form, and the exact way back.

Symmetric Ruiz scaling of K = [[P, C'], [C, 0]], C = [A; G]: ROUNDS rounds divide rows
and columns by the square roots of their largest entries, until those are nearly 1
(D. Ruiz, RAL-TR-2001-034). With d the factors of the columns and e those of the rows,
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
from cython.cimports.namlcp.linalg.vectors import dot

from namlcp.linalg import columns
from namlcp.qp.kkt import KKT

# Most rounds of `equilibrate`, and the largest |1 - largest entry| that ends it: with
# 1e-3 there are twice as many rounds, and as many iterations; with 0.1 two problems of
# the Maros-Meszaros collection need more restarts.
EQUAL = 0.03
# Range of the products of the factors of all rounds, against over- and underflow.
LEAST_FACTOR, MOST_FACTOR = 1e-8, 1e8
# Most conjugate gradient steps of `even_out`, and the squared residual, relative to the
# first one, that ends them.
REDUCTION = 1e-6
# Largest |log| of a factor of `even_out`.
LARGEST = 20.0
# In place of 0 where a size is divided by.
LEAST_DIVISOR = columns.LEAST_DIVISOR


class ScaledQP:
    """min 1/2 x'Px + q'x, Ax = b, sign * t[place] <= c.

    The one-sided constraints are of four kinds: upper and lower sides of rows, upper
    and lower bounds. `finite` has the rows or variables of each kind. `small` is the
    presolved problem; the scaled P, A and G are kept in `kkt` alone.
    """

    def __init__(self, small, last=None):
        """Scale the presolved problem; the matrices of `last` are not scaled again."""
        n, p = small.q.size, small.b.size
        self.small = small
        self.kkt: KKT
        self.scale: np.ndarray
        self.n, self.p = n, p
        if last is not None and small.has_matrices_of(last.small):
            self.kkt, self.scale = last.kkt, last.scale
        else:
            old = None if last is None else last.kkt
            self.kkt = KKT(small.P, small.A, small.G, old)
            self.scale = np.ones(self.kkt.size)
            matrix = self.kkt.indptr, self.kkt.indices, self.kkt.base
            if not small.P.data.any():
                even_out(*matrix, self.scale)
            equilibrate(*matrix, self.scale)
        self.bounds = small.upper, small.lower, small.ub, small.lb
        most = 2 * (small.upper.size + n)
        self.place, sides = np.empty(most, dtype=np.int32), np.empty((2, most))
        self.ends = one_sided(*self.bounds, n + p, self.place, sides[0], sides[1])
        *_, m = self.ends
        self.place, self.sign, self.side = self.place[:m], sides[0, :m], sides[1, :m]
        self.scale_vectors()

    def scale_vectors(self):
        """Set unit, q, b, c and the values of K~."""
        n, rows, small, scale = self.n, self.n + self.p, self.small, self.scale
        self.kkt.data[:] = self.kkt.base
        self.unit = scale.copy()
        self.unit[n:] = 1.0 / scale[n:]
        self.q, self.b = small.q * scale[:n], small.b * scale[n:rows]
        self.c = self.side / self.unit[self.place]

    @property
    def finite(self):
        """The rows or variables of each kind of one-sided constraint."""
        n, p = self.n, self.p
        parts = np.split(self.place, self.ends[:3])
        return [at - o for at, o in zip(parts, (n + p, n + p, 0, 0), strict=True)]

    def of_finite(self, values):
        """Return the values at the one-sided constraints from those of each kind."""
        parts = zip(values, self.finite, strict=True)
        return np.concatenate([value[at] for value, at in parts])

    def point(self, x, y, Z):
        """Return the (x, y, z_upper, z_lower, z_box) of the presolved problem."""
        z_upper, z_lower = np.zeros((2, self.small.upper.size))
        found = np.empty(self.n), np.empty(self.p), z_upper, z_lower, np.zeros(self.n)
        unscale(self.unit, self.place, self.ends, x, y, Z, *found)
        return found

    def primal(self, x):
        """Return the x of the presolved problem."""
        return x * self.unit[: self.n]

    def ray(self, d):
        """Return the direction of the x of the presolved problem."""
        return d * self.unit[: self.n]

    def certificate(self, y, Z):
        """Return the (y, z_upper, z_lower) of the presolved problem."""
        return self.point(np.zeros(self.n), y, Z)[1:4]

    def guess(self, guess):
        """Return the scaled (x, y, Z) of a guess and which constraints are active."""
        x, y, z_upper, z_lower, z_box, active = guess
        bounds = np.maximum(z_box, 0), np.maximum(-z_box, 0)
        Z = self.of_finite((z_upper, z_lower, *bounds))
        return (
            x / self.unit[: self.n],
            y * self.unit[self.n : self.n + self.p],
            Z * self.unit[self.place],
            self.of_finite(active),
        )

    def relax(self, t):
        """Relax b, and c of rows of G, to what the scaled t = (x, Ax, Gx) satisfies."""
        row = self.place >= self.n + self.p
        self.b = t[self.n : self.n + self.p].copy()
        self.c = np.where(row, np.maximum(self.c, self.sign * t[self.place]), self.c)


def one_sided(upper, lower, ub, lb, rows, place, sign, side):
    """List the finite sides: upper and lower ones of rows, upper and lower bounds.

    `rows` is the place of the first row. Sets the places, the signs and sign * side;
    returns the ends of the four lists.
    """
    a = list_finite(upper, rows, 1.0, 0, place, sign, side)
    b = list_finite(lower, rows, -1.0, a, place, sign, side)
    c = list_finite(ub, 0, 1.0, b, place, sign, side)
    d = list_finite(lb, 0, -1.0, c, place, sign, side)
    return a, b, c, d


def list_finite(values, first, s, k, place, sign, side):
    """Append the finite values to the lists, which have k entries; return how many."""
    for i in range(values.shape[0]):
        if fabs(values[i]) < INFINITY:
            place[k] = first + i
            sign[k] = s
            side[k] = s * values[i]
            k += 1
    return k


def unscale(unit, place, ends, x, y, Z, x_out, y_out, upper, lower, box):
    """Set (x, y, z_upper, z_lower, z_box) from scaled x, y and Z.

    z_upper, z_lower and z_box are 0 on entry.
    """
    a: Py_ssize_t
    b: Py_ssize_t
    c: Py_ssize_t
    a, b, c, _ = ends
    n = x.shape[0]
    rows = n + y.shape[0]
    for j in range(n):
        x_out[j] = x[j] * unit[j]
    for i in range(y.shape[0]):
        y_out[i] = y[i] / unit[n + i]
    for k in range(Z.shape[0]):
        j = place[k]
        z = Z[k] / unit[j]
        if k < a:
            upper[j - rows] = z
        elif k < b:
            lower[j - rows] = z
        elif k < c:
            box[j] = z
        else:
            box[j] -= z


def equilibrate(indptr, indices, data, scale):
    """Equilibrate a symmetric matrix (upper triangle in CSC); overwrite data and scale.

    `scale` has factors to begin with, which are not in `data` yet, or 1; it is clipped
    to [LEAST_FACTOR, MOST_FACTOR]; an empty row keeps its factor.
    """
    size = scale.shape[0]
    largest: cython.double[::1] = np.empty(size)
    for _ in range(ROUNDS):
        for j in range(size):
            largest[j] = 0.0
        for j in range(size):
            most, factor = largest[j], scale[j]
            for t in range(indptr[j], indptr[j + 1]):
                i = indices[t]
                value = fabs(data[t]) * factor * scale[i]
                largest[i] = max(largest[i], value)
                most = max(most, value)
            largest[j] = most
        off = 0.0
        for j in range(size):
            factor = 1.0
            if largest[j] > 0.0:
                off = max(off, fabs(1.0 - largest[j]))
                factor = 1.0 / sqrt(largest[j])
            largest[j] = min(max(factor * scale[j], LEAST_FACTOR), MOST_FACTOR)
        if off <= EQUAL:
            break
        for j in range(size):
            scale[j] = largest[j]
    for j in range(size):
        for t in range(indptr[j], indptr[j + 1]):
            data[t] *= scale[j] * scale[indices[t]]


def even_out(indptr, indices, data, scale):
    """Multiply scale by the factors s that minimise sum log(|k_ij| s_i s_j)^2.

    The minimum does not depend on how rows and columns were scaled before. The
    normal equations are solved by conjugate gradients, preconditioned by the numbers of
    entries (A.R. Curtis and J.K. Reid, J. Inst. Maths Applics 10, 1972).
    """
    size = scale.shape[0]
    count: cython.double[::1] = np.zeros(size)
    r: cython.double[::1] = np.zeros(size)
    p: cython.double[::1] = np.zeros(size)
    Mp: cython.double[::1] = np.zeros(size)
    s: cython.double[::1] = np.zeros(size)
    for j in range(size):
        for t in range(indptr[j], indptr[j + 1]):
            if data[t] != 0.0:
                i, value = indices[t], log(fabs(data[t]))
                count[j] += 1.0
                r[j] -= value
                if i != j:
                    count[i] += 1.0
                    r[i] -= value
    first, last = 0.0, 0.0
    for k in range(STEPS):
        rho = 0.0
        for j in range(size):
            rho += r[j] * r[j] / max(count[j], 1.0)
        if k == 0:
            first = last = rho
        if rho <= REDUCTION * first:
            break
        for j in range(size):
            p[j] = r[j] / max(count[j], 1.0) + rho / last * p[j]
            Mp[j] = count[j] * p[j]
        last = rho
        for j in range(size):
            for t in range(indptr[j], indptr[j + 1]):
                if data[t] != 0.0:
                    i = indices[t]
                    Mp[j] += p[i]
                    if i != j:
                        Mp[i] += p[j]
        step = rho / max(
            dot(cython.address(p[0]), cython.address(Mp[0]), size), LEAST_DIVISOR
        )
        for j in range(size):
            s[j] += step * p[j]
            r[j] -= step * Mp[j]
    for j in range(size):
        scale[j] *= exp(min(max(s[j], -LARGEST), LARGEST))
