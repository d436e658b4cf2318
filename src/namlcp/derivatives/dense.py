"""Active constraints, and the derivatives of dense QPs in compiled code.

A constraint is strictly active if its multiplier is not 0, weakly active if that is 0
although the constraint holds with equality; there the solution has a kink. Sides are 1
for a row and at ub, -1 at lb, 0 where a constraint is not active: `strict` those of
strictly active ones, `whole` of all. A pinned variable (lb_j = ub_j) always counts as
strictly active, at the bound that its multiplier presses on.

The regular case of `namlcp.derivatives.qp`: for P_FF = L L' and V = C_F L^-T the Schur
complement is S = V V', and

    [P_FF C_F'; C_F 0] (u, v) = (r, s):   S v = V L^-1 r - s,
                                          u = L^-T (L^-1 r - V'v).

The factors that a solve has left, `kept`, belong to the whole P, with active bounds as
rows (`namlcp.qp.active.engine`). They serve if their rows are the strictly active ones.
"""

import cython
import numpy as np
from cython import Py_ssize_t
from cython.cimports import numpy as cnp
from cython.cimports.libc.math import fabs, sqrt

from namlcp import checks
from namlcp.linalg.csc import times

# A multiplier counts as 0 if in no column of the stationarity condition its term
# exceeds this multiple of the largest term there; a slack counts as 0 up to this
# multiple of (1 + max |x|) times the norm of the row.
ACTIVE = 1e-8
# Factors are used if no pivot is below this multiple of its diagonal entry; a single
# step of refinement then removes the error of the Schur complement.
LEAST_PIVOT = 1e-8
LEAST_DIVISOR = checks.LEAST_DIVISOR
# SOLVES: solves with the factors for one right-hand side; the second refines the first.
# ARRAYS: data, solution and gradients in the solution.


# ---- active constraints


def sides_of(qp, point):
    """Return `strict` and `whole` (p + m + n,), and how many constraints are weak."""
    t: Terms
    (P, q, _, _, A, _, _, _), (x, y, z, z_box) = qp, point
    set_terms(cython.address(t), qp, point)
    n, m, p, G = t.n, t.m, t.p, checks.as_sparse(qp.G)
    size = np.abs((times(P, x), q, z_box, qp.G.T @ z, A.T @ y)).max(axis=0)
    np.divide(1.0, size, size, where=size > LEAST_DIVISOR)
    entries, share = np.abs(G.data), np.zeros(m)
    np.maximum.at(share, G.indices, entries * np.repeat(size, np.diff(G.indptr)))
    share *= z
    norms, Gx = np.sqrt(np.bincount(G.indices, entries * entries, m)), times(qp.G, x)
    sides = np.ones((2, p + m + n), np.int8)
    strict = signs(sides, 2 * (p + m + n)) + p
    t.Gx = numbers(Gx, m)
    weak = mark(
        cython.address(t), numbers(share, m), numbers(norms, m), numbers(size, n),
        strict, strict + p + m + n,
    )  # fmt: skip
    return *sides, weak


def sides_of_lcp(terms, lower, upper, slopes, z, w):
    """Return the sides `strict` and `whole` (2, n) of the unknowns of a solved LCP.

    terms: |A| |z| + |q|; w_i is 0 up to ACTIVE times that. z_i is at a bound with
    w_i != 0 if its distance is less than |w_i| over the slope of w_i in z_i.
    """
    n: Py_ssize_t = terms.size
    sides = np.empty((2, n), dtype=np.int8)
    strict, term, slope = signs(sides, 2 * n), numbers(terms, n), numbers(slopes, n)
    l, u = numbers(lower, n), numbers(upper, n)
    x, v = numbers(z, n), numbers(w, n)
    for i in range(n):
        zero, near = ACTIVE * term[i], ACTIVE * (1.0 + fabs(x[i]))
        side: cython.int = 0
        if l[i] == u[i]:
            side = 1 if v[i] < 0.0 else -1
        elif v[i] < -zero and slope[i] * (u[i] - x[i]) < -v[i]:
            side = 1
        elif v[i] > zero and slope[i] * (x[i] - l[i]) < v[i]:
            side = -1
        strict[i] = side
        if side == 0:
            side = 1 if u[i] - x[i] <= near else (-1 if x[i] - l[i] <= near else 0)
        strict[n + i] = side
    return sides


def mark(t, share, norms, size, strict, whole):
    """Set the sides; return how many constraints are weak.

    share: exceeds ACTIVE where z_i is not 0; norms: of the rows of G; size: 1 over the
    largest term of each column of the stationarity condition, or 0.
    """
    n, m = t.n, t.m
    weak: Py_ssize_t = 0
    near = ACTIVE * (1.0 + largest_entry(t.x, n))
    for i in range(m):
        strict[i] = share[i] > ACTIVE
        whole[i] = strict[i] or t.h[i] - t.Gx[i] <= near * norms[i]
        weak += whole[i] - strict[i]
    for j in range(n):
        side: cython.schar = 0
        if fabs(t.z_box[j]) * size[j] > ACTIVE or t.lb[j] == t.ub[j]:
            side = 1 if t.z_box[j] > 0.0 else -1
        strict[m + j] = side
        if side == 0:
            if t.ub[j] - t.x[j] <= near:
                side = 1
            elif t.x[j] - t.lb[j] <= near:
                side = -1
            weak += side != 0
        whole[m + j] = side
    return weak


# ---- dense QPs


class DenseItem:
    """One dense QP with its solution, or one after another of the same sizes."""

    def __cinit__(self, n: Py_ssize_t, m: Py_ssize_t, p: Py_ssize_t):
        qp = cython.address(self.qp)
        qp.n, qp.m, qp.p = n, m, p
        length, rows = 4 * (n + m + p), m + p
        k = min(n, rows)
        size = length + 2 * (n + rows) + n * n + k * (n + k)
        whole = size + (n + m) // 4 + 1  # in the end there are 2 (n + m) bytes
        self.memory = np.empty(whole)
        self.work = numbers(self.memory, whole)
        qp.Px, qp.Gtz, qp.Aty = self.work, self.work + n, self.work + 2 * n
        qp.Gx = self.work + 3 * n
        self.t = self.work + length
        self.s = self.t + n
        self.held = cython.cast(cython.p_Py_ssize_t, self.s + rows)
        self.free = self.held + rows
        self.L = cython.cast(cython.p_double, self.free + n)
        self.strict = cython.cast(cython.p_schar, self.work + size)
        self.whole = self.strict + n + m

    def take(self, qp, point, kept):
        """Take a single QP with what its solve has left; tell if K has good factors.

        The arrays are not owned.
        """
        set_terms(cython.address(self.qp), qp, point)
        n = self.qp.n
        self.P, self.G = numbers(qp.P, n * n), numbers(qp.G, self.qp.m * n)
        self.A = numbers(qp.A, self.qp.p * n)
        mark_item(self)
        if isinstance(kept, DenseActiveSet) and serves(kept, self):
            self.kept = kept
            return True
        with cython.nogil:  # nobody else has this item yet
            regular = factor(self)
        return regular

    def backward(self, cotangents):
        """Return the gradients in q, h, b, lb and ub."""
        n, m, p = self.qp.n, self.qp.m, self.qp.p
        h, b, lb, ub = n, n + m, n + m + p, 2 * n + m + p
        out = np.empty(ub + n)
        dx, dy, dz, dz_box = cotangents
        self.of_x, self.of_y = numbers(dx, n), numbers(dy, p)
        self.of_z, self.of_box = numbers(dz, m), numbers(dz_box, n)
        set_gradients(self, numbers(out, ub + n))
        solve_item(self)
        return out[:h], out[h:b], out[b:lb], out[lb:ub], out[ub:]


def differentiate_part(chosen, arrays, out, sides, weak, regular):
    """Write what is found of the chosen items, gradients to `out` unless K is singular.

    arrays: P, q, G, h, A, b, lb, ub, x, y, z, z_box and the gradients in these four, of
    each item, or of one that stands for all.
    """
    n: Py_ssize_t = arrays[1].shape[1]
    m: Py_ssize_t = arrays[3].shape[1]
    p: Py_ssize_t = arrays[5].shape[1]
    width: Py_ssize_t = out.shape[1]
    length: Py_ssize_t = chosen.size
    start = cython.declare(cython.p_double[ARRAYS])
    step = cython.declare(Py_ssize_t[ARRAYS])
    item: DenseItem = DenseItem(n, m, p)
    for k in range(ARRAYS):
        array: cnp.ndarray = arrays[k]
        start[k], step[k] = numbers(array, cnp.PyArray_SIZE(array)), 0
        if cnp.PyArray_DIM(array, 0) > 1:
            step[k] = cnp.PyArray_STRIDE(array, 0) // 8
    gradients, side = numbers(out, out.size), signs(sides, sides.size)
    weak_n, which = indices(weak, weak.size), indices(chosen, length)
    is_regular = signs(regular.view(np.int8), weak.size)
    with cython.nogil:
        for t in range(length):
            i = which[t]
            set_item(item, start, step, i)
            set_gradients(item, gradients + i * width)
            item.strict = side + i * (m + n)
            mark_item(item)
            weak_n[i], is_regular[i] = item.weak, factor(item)
            if is_regular[i]:
                solve_item(item)


def set_item(m, start, step, i):
    qp = cython.address(m.qp)
    m.P, qp.q = start[0] + i * step[0], start[1] + i * step[1]
    m.G, qp.h = start[2] + i * step[2], start[3] + i * step[3]
    m.A, qp.b = start[4] + i * step[4], start[5] + i * step[5]
    qp.lb, qp.ub = start[6] + i * step[6], start[7] + i * step[7]
    qp.x, qp.y = start[8] + i * step[8], start[9] + i * step[9]
    qp.z, qp.z_box = start[10] + i * step[10], start[11] + i * step[11]
    m.of_x, m.of_y = start[12] + i * step[12], start[13] + i * step[13]
    m.of_z, m.of_box = start[14] + i * step[14], start[15] + i * step[15]


def set_gradients(m, out):
    m.u, m.v = out, out + m.qp.n
    m.lower = m.v + m.qp.m + m.qp.p
    m.upper = m.lower + m.qp.n


def mark_item(m):
    qp = cython.address(m.qp)
    n, rows, size, share, norms = qp.n, qp.m, qp.Px, qp.Gx + qp.m, qp.Gx + 2 * qp.m
    times_rows(m.P, n, n, n, qp.x, size)
    fill(qp.Gtz, 0.0, 2 * n)
    add_times_transposed(m.A, qp.p, n, qp.y, qp.Aty)
    for i in range(rows):  # each row is read once: of a large G that is the time
        row = m.G + i * n
        norms[i], qp.Gx[i] = sqrt(dot(row, row, n)), dot(row, qp.x, n)
        if qp.z[i] != 0.0:
            add_scaled(qp.z[i], row, qp.Gtz, n)
    for j in range(n):
        large = max(fabs(size[j]), max(fabs(qp.q[j]), fabs(qp.z_box[j])))
        large = max(large, max(fabs(qp.Gtz[j]), fabs(qp.Aty[j])))
        size[j] = 1.0 / large if large > LEAST_DIVISOR else 0.0
    for i in range(rows):
        row, multiplier, share[i] = m.G + i * n, qp.z[i], 0.0
        if multiplier > 0.0:
            for j in range(n):
                share[i] = max(share[i], multiplier * fabs(row[j]) * size[j])
                if share[i] > ACTIVE:
                    break
    m.weak = mark(qp, share, norms, size, m.strict, m.whole)
    m.held_n, m.free_n = 0, 0
    for i in range(rows + qp.p):
        if i >= rows or m.strict[i] != 0:
            m.held[m.held_n] = i
            m.held_n += 1
    for j in range(n):
        if m.strict[rows + j] == 0:
            m.free[m.free_n] = j
            m.free_n += 1


def serves(own, m):
    """Tell whether a solve has left factors that serve: good ones, of the same rows."""
    strict = m.held_n - m.qp.p + m.qp.n - m.free_n
    if own.skipped > 0 or own.k != strict:
        return False
    last: Py_ssize_t = -1
    for i in range(own.k):
        row = own.active[i]
        last += i + 1
        root = own.triangle[last]
        if m.strict[row] == 0 or root * root < LEAST_PIVOT * response_of(own, row)[row]:
            return False
    return True


def factor(m):
    """Compute L, V and the factor of S; tell whether they exist."""
    n, k = m.free_n, m.held_n
    if k > n:
        return False
    m.V = m.L + n * n
    m.S = m.V + k * n
    for a in range(n):
        row = m.P + m.free[a] * m.qp.n
        for c in range(a + 1):
            m.L[a * n + c] = row[m.free[c]]
    for i in range(k):
        row = row_at(m, m.held[i])
        for c in range(n):
            m.V[i * n + c] = row[m.free[c]]
    if not has_factor(m.L, n):
        return False
    solve_rows(m.L, n, m.V, k)
    add_gram(m.V, k, n, n, b"T", 0.0, m.S, k)
    return has_factor(m.S, k)


def row_at(m, k):
    n, rows = m.qp.n, m.qp.m
    return m.G + k * n if k < rows else m.A + (k - rows) * n


def has_factor(M, n):
    """Factor the lower triangle of M; False if a pivot is too small."""
    if not cholesky(M, n):
        return False
    for i in range(n):
        row = M + i * n
        if not row[i] * row[i] >= LEAST_PIVOT * dot(row, row, i + 1):
            return False
    return True


def solve_item(m):
    qp, side = cython.address(m.qp), m.strict + m.qp.m
    fill(m.v, 0.0, qp.m + qp.p)
    for j in range(qp.n):
        m.u[j] = m.of_box[j] if side[j] != 0 else 0.0
    for k in range(SOLVES):
        set_remainder(m, k == 0 and m.free_n == qp.n)
        if m.kept is not None:
            correct_by_kept(m.kept, m)
        else:
            correct(m)
    if m.free_n < qp.n:
        set_remainder(m, False)  # for mu
    for j in range(qp.n):
        m.u[j] = 0.0 - m.u[j]
        m.upper[j] = m.lower[j] if side[j] > 0 else 0.0
        m.lower[j] = m.lower[j] if side[j] < 0 else 0.0


def set_remainder(m, are_zero):
    """Set lower = of_x - P u - (G' A') v, and s = (of_z - G u, of_y - A u)_held.

    are_zero: u and v are 0, and need no products.
    """
    qp, rest = cython.address(m.qp), m.lower
    n, rows = qp.n, qp.m
    fill(rest, 0.0, n)
    if not are_zero:
        add_times_transposed(m.P, n, n, m.u, rest)  # P = P'
    for i in range(m.held_n):
        k, row = m.held[i], row_at(m, m.held[i])
        m.s[i] = m.of_z[k] if k < rows else m.of_y[k - rows]
        if not are_zero:
            m.s[i] -= dot(row, m.u, n)
            add_scaled(m.v[k], row, rest, n)
    for j in range(n):
        rest[j] = m.of_x[j] - rest[j]


def correct(m):
    """Add the solution for the remainder to u_F and v, by L, V and S."""
    n, k, t, s = m.free_n, m.held_n, m.t, m.s
    for a in range(n):
        t[a] = m.lower[m.free[a]]
    forward_solve(m.L, n, t)
    for i in range(k):
        s[i] = dot(m.V + i * n, t, n) - s[i]
    forward_solve(m.S, k, s)
    backward_solve(m.S, k, s)
    for i in range(k):
        add_scaled(-s[i], m.V + i * n, t, n)
    backward_solve(m.L, n, t)
    for a in range(n):
        m.u[m.free[a]] += t[a]
    for i in range(k):
        m.v[m.held[i]] += s[i]


def correct_by_kept(own, m):
    """Do the same by the factors of the solve: C u = goals in its active rows.

    The multipliers of bounds need no correction.
    """
    qp = cython.address(m.qp)
    n, p, goals, values = qp.n, qp.p, m.work, m.work + qp.n
    for j in range(n):
        own.rhs[j] = m.lower[j] if m.strict[qp.m + j] == 0 else 0.0
    for i in range(p):
        own.rhs[n + i] = m.s[m.held_n - p + i]
    own.set_values(own.rhs, values)  # (G u, u, nu) without the active rows
    for i in range(own.k):
        k = own.active[i]
        if k < qp.m:
            goal = m.of_z[k] - dot(m.G + k * n, m.u, n)
        else:
            goal = m.of_box[k - qp.m] - m.u[k - qp.m]
        goals[i] = values[k] - goal
    triangle_solve(own.triangle, own.k, goals)
    triangle_solve_transposed(own.triangle, own.k, goals)
    for i in range(own.k):
        k = own.active[i]
        if own.length == own.rows + p:
            add_scaled(-goals[i], response_of(own, k) + qp.m, values + qp.m, n + p)
        if k < qp.m:
            m.v[k] += goals[i]
    own.set_x(own.rhs, goals, values)
    add_scaled(1.0, values + qp.m, m.u, n)
    add_scaled(1.0, values + own.rows, m.v + qp.m, p)


def rank_two(a, b, c, d):
    """Return a b' + c d'."""
    rows: Py_ssize_t = a.size
    columns: Py_ssize_t = b.size
    out = np.empty((rows, columns))
    of_a, of_b, of_c = numbers(a, rows), numbers(b, columns), numbers(c, rows)
    of_d, row = numbers(d, columns), numbers(out, rows * columns)
    for i in range(rows):
        first, second = of_a[i], of_c[i]
        for j in range(columns):
            row[j] = first * of_b[j] + second * of_d[j]
        row += columns
    return out


def add_rank_two_at(pattern, a, b, c, d, data):
    """Add the entries of a b' + c d' at the places of a matrix in CSC to data."""
    rows: Py_ssize_t = a.size
    columns: Py_ssize_t = b.size
    count: Py_ssize_t = data.size
    indptr = places(pattern.indptr, columns + 1)
    indices = places(pattern.indices, count)
    of_a, of_b, of_c = numbers(a, rows), numbers(b, columns), numbers(c, rows)
    of_d, out = numbers(d, columns), numbers(data, count)
    with cython.nogil:
        for j in range(columns):
            left, right = of_b[j], of_d[j]
            for k in range(indptr[j], indptr[j + 1]):
                i = indices[k]
                out[k] += of_a[i] * left + of_c[i] * right
