"""The KKT matrix K of a presolved QP: equilibration, varying diagonal, L D L' factors.

        [P  A'  G']          [P + dx   A'   G']
    K = [A  0   0 ],   K~ =  [A       -dy    0],   dx, dy, dv > 0 (quasi-definite).
        [G  0   0 ]          [G        0   -dv]

K is kept as the upper triangle in CSC, so column n + i is row i of C = [A; G] and the
diagonal is the last entry of every column.

Symmetric Ruiz scaling: rounds divide rows and columns of K by the square roots of their
largest entries, until those are nearly 1 (D. Ruiz, RAL-TR-2001-034). With d the factors
of the columns and e those of the rows, x = d x_scaled, y = e y_scaled, z_box =
z_box_scaled / d; the cost is not scaled. The result depends on how K was scaled before:
a linear program, in whose K no entry of P ties the units of the columns to the cost, is
first scaled by `even_out`.

Every finite bound or side of a row is one one-sided constraint: sign * t[place] <= c,
where t = (x, Ax, Gx) has the layout of K. Unscaled, t is unit * t, and the multipliers
are divided by `unit`.
"""

import cython
import numpy as np
from cython import Py_ssize_t
from cython.cimports.libc.math import INFINITY, exp, fabs, log, sqrt

from namlcp.arrays import constant, refuse_size
from namlcp.limits import NEVER
from namlcp.linalg.csc import add_transposed, times
from namlcp.linalg.factors import plan_factors
from namlcp.qp.problem import Point

# Rows are condensed, without the last variables of one entry each, if this part of
# their entries is not zero, and they are as many as variables or P is diagonal.
FULL = 0.5
# The largest |1 - largest entry| that ends the rounds: with 1e-3 there are twice as
# many, with 0.1 two problems of the Maros-Meszaros collection need more restarts.
EQUAL = 0.03
# Range of the products of the factors of all rounds, against over- and underflow.
LEAST_FACTOR, MOST_FACTOR = 1e-8, 1e8
# Largest |log| of a factor of `even_out`. With 4 of its SWEEPS over rows and columns,
# bnl2 of the Netlib collection takes 338 iterations in place of 35.
LARGEST = 20.0
# Change of all logs that ends them.
STILL = 1e-12


class KKT:
    """K for P (both triangles stored), A and G, with the factors of K~.

    base: the values of K, all diagonal entries stored. data: those of K~, of which the
    caller writes data[diagonal]. factored: the data[diagonal] that `factors`, those of
    `last` if it has the same pattern, belong to. n, size: the orders of P and K.
    """

    def __init__(self, P, A, G, last=None):
        self.n = P.indptr.size - 1
        self.size = self.n + A.indptr.size + G.indptr.size - 2
        entries = P.data.size + A.data.size + G.data.size + self.size
        refuse_size("the KKT matrix", entries)
        self.indptr = new_places(self.size + 1)
        self.indices, self.base = new_places(entries), new_vector(entries)
        upper_triangle(P, A, G, self.indptr, self.indices, self.base)
        entries = self.indptr[self.size]
        self.indices, self.base = self.indices[:entries], self.base[:entries]
        self.diagonal = self.indptr[1:] - 1
        self.data, self.factors = new_vector(entries), None
        self.factored = constant(self.size, np.nan)  # unlike any numbers
        if last is not None and (
            np.array_equal(last.indptr, self.indptr)
            and np.array_equal(last.indices, self.indices)
        ):
            self.factors = last.factors

    def plan(self, condense=False, deadline=NEVER):
        """Return the factors, which are not computed yet if they are new.

        condense: whether they may be `Condensed`. Raises OutOfTime.
        """
        if self.factors is None and condense:
            self.factors = self.condensed()
        if self.factors is None:
            self.factors = plan_factors(self.indptr, self.indices, deadline)
        return self.factors

    def condensed(self):
        """Return factors that condense the rows, None where that does not suit."""
        n, rows = self.n, self.size - self.n
        width = first_alone(self.indptr, self.indices, n)
        entries = self.indptr[self.size] - self.indptr[n] - rows - (n - width)
        suits = width <= rows or self.indptr[width] == width
        if suits and entries >= FULL * width * rows > 0:
            return Condensed(self.indptr, self.indices, n, width)
        return None

    def factor(self):
        """Factor K~; False if a pivot vanishes."""
        try:
            self.plan().refactor(self.data)
        except ValueError:
            return False
        return True


class Condensed(Factors):
    """K~ = [H C'; C -V] with full rows by a Cholesky factor of order n or that of V.

    The rows are eliminated, S = H + R'R with R = D C, D^2 = 1 / V, sign = 1; or, where
    they are fewer than variables and H is diagonal, the variables, S = V + R R' with
    R = C D, D^2 = 1 / H, sign = -1. All diagonal entries of H and V are positive.
    Before, lone variables are, the last ones, like the shifts of soft rows: one with
    the diagonal entry d and the coefficient c in its row adds c^2 / d to V there.
    """

    def __init__(self, indptr, indices, variables, n):
        Factors.__init__(self, indptr)
        rows, lone, start = self.n - variables, variables - n, indptr[variables]
        self.variables, self.columns, self.rows = variables, n, rows
        self.width, self.others = min(n, rows), max(n, rows)
        self.kept, self.gone = (0, variables) if n <= rows else (variables, 0)
        self.sign = 1.0 if n <= rows else -1.0
        self.entries = self.width * self.n
        of_rows = indices[start:]
        at = start + np.flatnonzero((of_rows >= n) & (of_rows < variables))
        at = at[np.argsort(indices[at])].astype(np.intp)
        row = np.searchsorted(indptr, at, "right") - 1
        square, full = self.width * self.width, rows * n
        parts = np.empty(square), np.zeros(full), np.ones(self.n), np.empty(3 * self.n)
        self.arrays = indptr, indices, at, row, *parts
        self.indptr = places(indptr, self.n + 1)
        self.indices = places(indices, self.nnz)
        self.entry, self.row = longs(at, lone), longs(row, lone)
        self.S, self.R = numbers(parts[0], square), numbers(parts[1], full)
        self.D, self.y = numbers(parts[2], self.n), numbers(parts[3], 3 * self.n)
        self.u, self.slope = self.y + self.n, self.y + 2 * self.n

    def factor_values(self, data, watch):
        n, width, S, R, D = self.columns, self.width, self.S, self.R, self.D
        kept, gone, others, indptr = self.kept, self.gone, self.others, self.indptr
        first = self.variables
        for i in range(self.n):
            D[i] = data[indptr[i + 1] - 1]
        for k in range(first - n):
            i, c = self.row[k], data[self.entry[k]]
            self.slope[k] = c / D[n + k]
            D[i] -= c * self.slope[k]
            D[n + k] = 1.0 / D[n + k]
        fill(S, 0.0, width * width)
        for j in range(width):
            for t in range(indptr[j], indptr[j + 1] - 1 if kept == 0 else 0):
                S[j * width + self.indices[t]] = data[t]
            S[j * width + j], D[kept + j] = self.sign * D[kept + j], 1.0
        for i in range(gone, gone + others):
            D[i] = sqrt(-self.sign / D[i])
        for i in range(self.rows):
            row, start = R + i * n, indptr[first + i]
            count = indptr[first + i + 1] - 1 - start
            if count == n and self.indices[start + n - 1] == n - 1:  # by vectors
                for j in range(n):
                    row[j] = D[first + i] * D[j] * data[start + j]
                continue
            for t in range(start, start + count):
                j = self.indices[t]
                if j < n:
                    row[j] = D[first + i] * D[j] * data[t]
        begin: Py_ssize_t = 0
        while begin < others:
            count = min(BLOCK, others - begin)
            if is_over(watch, count * width * width):
                return False
            if kept == 0:
                add_gram(R + begin * n, count, n, n, b"N", 1.0, S, n)
            else:
                add_gram(R + begin, width, count, n, b"T", 1.0, S, width)
            begin += count
        return cholesky(S, width)

    def solve_into(self, rhs, x):
        n, rows, D, y, u = self.columns, self.rows, self.D, self.y, self.u
        kept, gone, width, others = self.kept, self.gone, self.width, self.others
        lone = self.variables - n
        copy(rhs, x, self.n)
        for k in range(lone):
            x[self.row[k]] -= self.slope[k] * x[n + k]
        for i in range(others):
            y[i] = D[gone + i] * x[gone + i]
        blas_times(self.R, rows, n, y, u, b"N" if kept == 0 else b"T")
        for j in range(width):
            u[j] += self.sign * x[kept + j]
        forward_solve(self.S, width, u)
        backward_solve(self.S, width, u)
        copy(u, x + kept, width)
        blas_times(self.R, rows, n, x + kept, u, b"T" if kept == 0 else b"N")
        for i in range(others):
            x[gone + i] = self.sign * D[gone + i] * (u[i] - y[i])
        for k in range(lone):
            x[n + k] = D[n + k] * x[n + k] - self.slope[k] * x[self.row[k]]


def first_alone(indptr, indices, n):
    """Return from where on variables are in one row each, and not tied by P."""
    most: Py_ssize_t = indices.size
    counts = same_places(n, 0)
    count, index = places(counts, n), places(indices, most)
    start = places(indptr, indptr.size)
    for t in range(most):
        if index[t] < n:
            count[index[t]] += 1
    while n > 0 and start[n] - start[n - 1] == 1 and count[n - 1] == 2:
        n -= 1
    return n


def upper_triangle(P, A, G, starts, rows, values):
    """Write the upper triangle of K from P in CSC (both triangles), A and G in CSR."""
    M: Columns
    n: Py_ssize_t = P.indptr.size - 1
    column, k = n, cython.cast(Py_ssize_t, 0)
    most: Py_ssize_t = rows.size
    indptr, indices = places(starts, starts.size), places(rows, most)
    data = numbers(values, most)
    take_columns(P, n, cython.address(M))
    indptr[0] = 0
    for j in range(n):
        diagonal = 0.0
        for t in range(M.indptr[j], M.indptr[j + 1]):
            if M.indices[t] < j:
                indices[k], data[k] = M.indices[t], M.data[t]
                k += 1
            elif M.indices[t] == j:
                diagonal = M.data[t]
        indices[k], data[k] = j, diagonal
        k += 1
        indptr[j + 1] = k
    for C in (A, G):
        count: Py_ssize_t = C.indptr.size - 1
        take_columns(C, count, cython.address(M))  # the columns of C'
        for i in range(count):
            for t in range(M.indptr[i], M.indptr[i + 1]):
                indices[k], data[k] = M.indices[t], M.data[t]
                k += 1
            indices[k], data[k] = column, 0.0
            k += 1
            column += 1
            indptr[column] = k
    return 0


# ---- scaling


class ScaledQP:
    """min 1/2 x'Px + q'x, Ax = b, sign * t[place] <= c.

    The one-sided constraints are the finite ones of the upper and lower sides of all
    rows, then of the upper and lower bounds. `small` is the presolved problem; the
    scaled P, A and G are kept in `kkt` alone. `giver` are the numbers of the rows of
    G, lower and upper bounds, one after another, that the constraints were before.
    """

    def __init__(self, small, last=None):
        n, p = small.q.size, small.b.size
        self.small, self.n, self.p = small, n, p
        if last is not None and small.A is last.small.A:  # as are P and G then
            self.kkt, self.scale = last.kkt, last.scale
        else:
            old = None if last is None else last.kkt
            self.kkt = KKT(small.P, small.A, small.G, old)
            self.scale = constant(self.kkt.size, 1.0)
            matrix = self.kkt.indptr, self.kkt.indices, self.kkt.base
            if not np.count_nonzero(small.P.data):
                even_out(*matrix, self.scale, self.kkt.data)
            equilibrate(*matrix, self.scale)
            if self.kkt.factors and np.array_equal(old.base, self.kkt.base):
                self.kkt.factored = old.factored
        self.kkt.data[:] = self.kkt.base
        self.unit = self.scale.copy()
        self.unit[n:] = 1.0 / self.scale[n:]
        self.q, self.b = small.q * self.scale[:n], small.b * self.scale[n : n + p]
        self.giver, self.place, self.sign, self.c = find_finite(small, self.unit)

    def point(self, x, y, Z, data=1.0):
        """Return the point of the QP before presolve."""
        small, qp = self.small, self.small.qp
        x, y_full, z, z_box = qp.point(x * self.unit[: self.n])
        hand_on(self, y, Z, y_full, z, z_box)
        if not small.fixed.size:
            return Point(x, y_full, z, z_box)
        full = np.empty(qp.q.size)
        full[small.kept], full[small.fixed] = x, data * small.x_fixed
        gradient = times(qp.P, full) + data * qp.q
        add_transposed(qp.A, y_full, gradient)
        add_transposed(qp.G, z, gradient)
        z_box[small.fixed] = -gradient[small.fixed]
        return Point(full, y_full, z, z_box)

    def guess(self, guess):
        """Return the scaled (x, y, Z) of a guess and which constraints are active."""
        small, n, rows, box = self.small, self.n, self.n + self.p, guess.z_box
        y = (guess.y * small.A_groups.ratio)[small.b_of]
        y[1, small.b_of[0] == small.b_of[1]] = 0.0
        z = guess.z * np.abs(small.G_groups.ratio)
        Z = np.concatenate((z, np.maximum(-box, 0), np.maximum(box, 0)))[self.giver]
        return (
            guess.x[small.kept] / self.unit[:n],
            y.sum(0) * self.unit[n:rows],
            Z * self.unit[self.place],
            guess.active[self.giver],
        )

    def relax(self, t):
        """Relax b, and c of rows of G, to what the scaled t = (x, Ax, Gx) satisfies."""
        row = self.place >= self.n + self.p
        self.b = t[self.n : self.n + self.p].copy()
        self.c = np.where(row, np.maximum(self.c, self.sign * t[self.place]), self.c)


def hand_on(problem, y, Z, y_full, z_full, z_box):
    """Add scaled multipliers to those of the rows and bounds that give the constraints.

    Both extreme rows of an equation have half of its multiplier.
    """
    small = problem.small
    m: Py_ssize_t = Z.size
    p: Py_ssize_t = y.size
    n: Py_ssize_t = problem.n
    rows: Py_ssize_t = z_full.size
    columns: Py_ssize_t = z_box.size
    unit, place = numbers(problem.unit, problem.unit.size), places(problem.place, m)
    giver, row = longs(problem.giver, m), longs(small.b_of, 2 * p)
    of_A = numbers(small.A_groups.ratio, y_full.size)
    of_G = numbers(small.G_groups.ratio, rows)
    equal, values = numbers(y, p), numbers(Z, m)
    to_y, to_z = numbers(y_full, y_full.size), numbers(z_full, rows)
    bounds = numbers(z_box, columns)
    for k in range(2 * p):
        i = k if k < p else k - p
        to_y[row[k]] += 0.5 * (equal[i] / unit[n + i]) / of_A[row[k]]
    for k in range(m):
        value, i = values[k] / unit[place[k]], giver[k]
        if i < rows:
            to_z[i] = value / fabs(of_G[i])
        elif i < rows + columns:
            bounds[i - rows] -= value
        else:
            bounds[i - rows - columns] += value
    return 0


def find_finite(small, units):
    """Return the givers of the finite sides, their places, signs and scaled values."""
    n: Py_ssize_t = small.q.size
    p: Py_ssize_t = small.b.size
    rows: Py_ssize_t = small.sides.size // 2
    lower: Py_ssize_t = small.qp.h.size
    upper: Py_ssize_t = lower + small.qp.q.size
    size = 2 * (rows + n)
    sides, unit = numbers(small.sides, 2 * rows), numbers(units, n + p + rows)
    row, column = longs(small.side_of, 2 * rows), longs(small.kept, n)
    ub, lb = numbers(small.ub, n), numbers(small.lb, n)
    givers, where = new_indices(size), new_places(size)
    giver, place = longs(givers, size), places(where, size)
    signs, values = new_vector(size), new_vector(size)
    sign, c = numbers(signs, size), numbers(values, size)
    count: Py_ssize_t = 0
    for i in range(size):
        j = i - 2 * rows
        is_upper: cython.bint = i < rows or 0 <= j < n
        if j < 0:
            side, by = sides[i], row[i]
            j = n + p + (i if is_upper else i - rows)
        elif is_upper:
            side, by = ub[j], upper + column[j]
        else:
            j -= n
            side, by = -lb[j], lower + column[j]
        if fabs(side) < INFINITY:
            giver[count], place[count] = by, j
            sign[count], c[count] = 1.0 if is_upper else -1.0, side / unit[j]
            count += 1
    return givers[:count], where[:count], signs[:count], values[:count]


def equilibrate(indptr, indices, data, scale):
    """Equilibrate a symmetric matrix (upper triangle in CSC); overwrite data and scale.

    `scale` has factors to begin with, which are not in `data` yet.
    """
    K: Matrix
    size: Py_ssize_t = scale.size
    work, factor = new_vector(size), numbers(scale, size)
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

    P may be its upper triangle; parts that are NULL count as 0. largest: work space.
    """
    size = n + p + m
    for _ in range(ROUNDS):
        fill(largest, 0.0, size)
        note_entries(P, units, units, largest, largest)
        note_entries(A, units + n, units, largest + n, largest)
        note_entries(G, units + n + p, units, largest + n + p, largest)
        off = 0.0
        for k in range(size):
            if largest[k] > 0.0:
                off = max(off, fabs(1.0 - largest[k]))
        for k in range(size):  # a loop of its own, for two roots at a time
            factor = 1.0 / sqrt(largest[k]) if largest[k] > 0.0 else 1.0
            largest[k] = min(max(factor * units[k], LEAST_FACTOR), MOST_FACTOR)
        if off <= EQUAL:
            break
        copy(largest, units, size)


def note_entries(M, rows, columns, of_rows, of_columns):
    """Note the largest entries of the rows and columns of M scaled by two vectors."""
    if M == cython.NULL:
        return
    is_dense: cython.bint = M.starts == cython.NULL
    along, across = (of_rows, of_columns) if is_dense else (of_columns, of_rows)
    for line in range(M.lines):
        largest = 0.0
        for t in range(first_of(M, line), first_of(M, line + 1)):
            i, j = place_of(M, line, t)
            value = fabs(M.values[t]) * columns[j] * rows[i]
            largest = max(largest, value)
            k = j if is_dense else i
            across[k] = max(across[k], value)
        along[line] = max(along[line], largest)


def take_matrix(M, array):
    """Note a matrix, dense or in CSC; return the array that has its numbers."""
    if type(array) is np.ndarray:
        array = np.ascontiguousarray(array, float)
        M.lines, M.width, M.starts = array.shape[0], array.shape[1], cython.NULL
        M.values = numbers(array, array.size)
    else:
        M.lines, size = array.shape[1], array.indices.size
        M.starts = places(array.indptr, M.lines + 1)
        M.others, M.values = places(array.indices, size), numbers(array.data, size)
    return array


def first_of(M, line):
    return line * M.width if M.starts == cython.NULL else M.starts[line]


def place_of(M, line, t):
    """Return the row and the column of an entry."""
    if M.starts == cython.NULL:
        return line, t - line * M.width
    return M.others[t], line


def even_out(indptr, indices, data, scale, logs):
    """Divide columns and rows by the geometric means of their entries, in turn; P = 0.

    Each time that minimises sum log(|k_ij| s_i s_j)^2, of which the minimum does not
    depend on how rows and columns were scaled before (A.R. Curtis and J.K. Reid, J.
    Inst. Maths Applics 10, 1972). Multiplies scale by s; reads the upper triangle.
    logs: work space.
    """
    size = scale.shape[0]
    counts: cython.double[:, ::1] = np.zeros((2, size))
    total: cython.double[::1] = np.empty(size)
    s: cython.double[::1] = np.zeros(size)
    for j in range(size):
        for t in range(indptr[j], indptr[j + 1]):
            if data[t] != 0.0:
                logs[t] = log(fabs(data[t]))
                counts[0, j] += 1.0
                counts[1, indices[t]] += 1.0
    for k in range(2 * SWEEPS):
        change = 0.0
        count, total[:] = counts[k % 2], 0.0
        for j in range(size):
            own = 0.0
            for t in range(indptr[j], indptr[j + 1]):
                if data[t] == 0.0:
                    continue
                if k % 2 == 0:
                    own += logs[t] + s[indices[t]]
                else:
                    total[indices[t]] += logs[t] + s[j]
            total[j] += own
        for j in range(size):
            if count[j] > 0.0:
                change = max(change, fabs(s[j] + total[j] / count[j]))
                s[j] = -total[j] / count[j]
        if k > 0 and change <= STILL:  # after the first sweep if all entries are stored
            break
    for j in range(size):
        scale[j] *= exp(min(max(s[j], -LARGEST), LARGEST))
    return 0
