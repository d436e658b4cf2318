"""The memory of one solve by pivoting, and its free systems (A_FF + shift I) x = b.

"Scaled" refers to the problem with a unit diagonal. F is the set of free unknowns,
state 0. Sparse symmetric systems are factored by L D L' where that takes less time, all
others by dense Cholesky or LU. L D L' is row by row, read from the columns of the whole
matrix. An elimination order of the whole matrix, restricted to a submatrix, causes no
more fill there than in the matrix: one order serves all.
"""

import cython
from cython import Py_ssize_t
from cython.cimports.libc.math import INFINITY
from cython.cimports.libc.stdlib import free, malloc

from namlcp.lcp import data
from namlcp.linalg import factors

SMALL_ORDER, PSD_SLACK = data.SMALL_ORDER, factors.PSD_SLACK

# Added to the unit diagonal where Cholesky fails, so that a singular A_FF succeeds.
JITTER = 1e-11
# Pivot of L D L', for a unit diagonal, below which A_FF counts as indefinite; and to
# which smaller ones are raised, as they count as rounding.
LEAST_PIVOT, PIVOT_FLOOR = -1e-7, 1e-14
# Cost of a dense factorisation beside its multiplications, counted in these; speed of
# dense multiplications relative to sparse ones.
CALL, DENSE_SPEED = 5000.0, 10.0


class Pivoting(Watched):
    """A box LCP and the state of `pivot`; `driver.Attempt` has what is in Python.

    columns: those of A, as `Prepared` has them; vectors: q, the bounds, and the start,
    which may be empty; until: a value of time.perf_counter().
    """

    def __init__(self, columns, vectors, symmetric, until):
        q, lower, upper, start = vectors
        n: cython.Py_ssize_t = q.size
        self.n, self.symmetric, self.given = n, symmetric, (columns, vectors)
        self.is_dense = not isinstance(columns, tuple)
        begin_watch(self, until)
        if self.is_dense:
            self.entries = n * n
            self.values = numbers(columns, self.entries)
        else:
            indptr, indices, data = columns
            self.entries = indices.size
            self.values = numbers(data, self.entries)
            self.indptr = places(indptr, n + 1)
            self.indices = places(indices, self.entries)
        allocate(self)
        self.low, self.high = numbers(lower, n), numbers(upper, n)
        copy(numbers(q, n), self.q, n)
        copy(self.low, self.lower, n)
        copy(self.high, self.upper, n)
        if start.size:
            copy(numbers(start, n), self.own_z, n)

    def __dealloc__(self):
        free(self.factor)

    def best_point(self):
        """Return the best z so far, in the caller's scaling and between his bounds."""
        point = new_vector(self.n)
        z = data_of(point)
        for i in range(self.n):
            z[i] = min(max(self.best[i] * self.root[i], self.low[i]), self.high[i])
        return point

    def vector(self, k):
        """Return a view of vector k as `allocate` lays them out."""
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


# ---- the free system


def factor_free(m, shift):
    """Factor the matrix; tell whether it is regular, definite if it is symmetric."""
    m.shift = shift
    set_order(m)
    for k in range(m.count):
        m.local[m.order[k]] = k
    plan(m)
    regular: cython.bint = False
    if not m.is_short:
        regular = factor_sparse(m) >= LEAST_PIVOT if m.is_sparse else factor_dense(m)
    for k in range(m.count):
        m.local[m.order[k]] = -1
    return regular


def solve_free(m):
    """Write the solution for the right-hand side to the free entries of z alone."""
    x = m.y
    for k in range(m.count):
        x[k] = m.own_rhs[m.order[k]]
    if m.is_sparse:
        solve_sparse(m, x)
    elif m.symmetric:
        forward_solve(m.dense, m.count, x)
        backward_solve(m.dense, m.count, x)
    else:
        lu_solve(m.dense, m.count, m.pivots, x)
    for k in range(m.count):
        m.own_z[m.order[k]] = x[k]


# ---- the unknowns of the system


def set_order(m):
    """Set `order` to the free unknowns, in elimination order if L D L' is possible."""
    side, rank = m.side, m.pattern
    count: Py_ssize_t = 0
    for i in range(m.n):
        count += side[i] == 0
    m.is_sparse = m.symmetric and not m.is_dense and count > SMALL_ORDER
    if m.is_sparse and not m.is_ordered:
        if not order_by_degree(m.indptr, m.indices, m.n, rank, None):
            m.is_short = True
            return
        for i in range(m.n):
            m.sequence[rank[i]] = i
        m.is_ordered = True
    m.count = 0
    for k in range(m.n):
        i: Py_ssize_t = m.sequence[k] if m.is_sparse else k
        if side[i] == 0:
            m.order[m.count] = i
            m.count += 1


def plan(m):
    """Choose the cheaper kind of factors, and take memory for them."""
    count = m.count
    entries: Py_ssize_t = 0
    size = 8.0 * count * count
    if m.is_sparse:
        most = (count * (count * (count / 3.0)) + CALL) / DENSE_SPEED
        m.is_sparse = analyse(m) <= most
    if m.is_sparse:
        for k in range(count):
            entries += m.counts[k]
        size = 16.0 * (count + 1) + 12.0 * entries
    wanted = cython.cast(cython.size_t, size)
    if wanted > m.factor_size:
        free(m.factor)
        m.factor = cython.cast(cython.p_char, malloc(wanted))
        m.factor_size = wanted
        if m.factor == cython.NULL:
            m.factor_size, m.is_short = 0, True
    if m.is_short:
        return
    m.dense = m.D = cython.cast(cython.p_double, m.factor)
    if m.is_sparse:
        m.starts = cython.cast(cython.p_Py_ssize_t, m.D + count)
        m.L = cython.cast(cython.p_double, m.starts + count + 1)
        m.rows = cython.cast(cython.p_int, m.L + entries)
        m.starts[0] = 0
        for k in range(count):
            m.starts[k + 1] = m.starts[k] + m.counts[k]


# ---- dense factors


def gather(m, out):
    """Write A_FF + shift I to out, by columns, half of it if symmetric."""
    count, order, local = m.count, m.order, m.local
    if m.is_dense:
        for k in range(count):
            column, to = m.scaled + order[k] * m.n, out + k * count
            for t in range(k + 1 if m.symmetric else count):
                to[t] = column[order[t]]
    else:
        fill(out, 0.0, count * count)
        for k in range(count):
            for p in range(m.indptr[order[k]], m.indptr[order[k] + 1]):
                i: Py_ssize_t = local[m.indices[p]]
                if i >= 0:
                    out[k * count + i] = m.scaled[p]
    for k in range(count):
        out[k * (count + 1)] += m.shift


def factor_dense(m):
    M, count = m.dense, m.count
    gather(m, M)
    if not m.symmetric:
        return lu(M, count, m.pivots)
    if cholesky(M, count):
        return True
    gather(m, M)
    for k in range(count):
        M[k * (count + 1)] += JITTER
    if not cholesky(M, count):
        for k in range(count):  # not a factor of A_FF, but a solve stays possible
            M[k * (count + 1)] = max(M[k * (count + 1)], JITTER)
    return False


# ---- sparse factors


def analyse(m):
    """Set the elimination tree and the counts of L; return the flops to factor."""
    order, local, parent, counts, flag = m.order, m.local, m.parent, m.counts, m.flag
    for k in range(m.count):
        parent[k] = -1
        counts[k] = 0
        flag[k] = k
        for p in range(m.indptr[order[k]], m.indptr[order[k] + 1]):
            i: Py_ssize_t = local[m.indices[p]]
            if i >= k:
                continue
            while i >= 0 and flag[i] != k:
                flag[i] = k
                counts[i] += 1
                if parent[i] < 0:
                    parent[i] = k
                i = parent[i]
    flops = 0.0
    for k in range(m.count):
        flops += counts[k] * (counts[k] + 3.0)
    return flops


def factor_sparse(m):
    """Factor, with pivots below `PIVOT_FLOOR` raised to it; return the smallest one."""
    y, rows, values, D, starts = m.y, m.rows, m.L, m.D, m.starts
    local, parent, pattern, flag = m.local, m.parent, m.pattern, m.flag
    count, filled = m.count, m.counts  # entries that the columns have so far
    for k in range(count):
        y[k] = 0.0
        filled[k] = 0
    smallest: cython.double = INFINITY
    for k in range(count):
        flag[k] = k
        top = count
        j: Py_ssize_t = m.order[k]
        pivot = m.shift
        for p in range(m.indptr[j], m.indptr[j + 1]):
            i: Py_ssize_t = local[m.indices[p]]
            if i < 0 or i > k:
                continue
            if i == k:
                pivot += m.scaled[p]
                continue
            y[i] = m.scaled[p]
            length: Py_ssize_t = 0
            while flag[i] != k:
                pattern[length] = i
                length += 1
                flag[i] = k
                i = parent[i]
            while length > 0:
                length -= 1
                top -= 1
                pattern[top] = pattern[length]
        for t in range(top, count):
            i = pattern[t]
            y_i = y[i]
            y[i] = 0.0
            end = starts[i] + filled[i]
            for p in range(starts[i], end):
                y[rows[p]] -= values[p] * y_i
            l_ki = y_i / D[i]
            pivot -= l_ki * y_i
            rows[end] = k
            values[end] = l_ki
            filled[i] += 1
        smallest = min(smallest, pivot)
        D[k] = max(pivot, PIVOT_FLOOR)
    return smallest


def solve_sparse(m, x):
    """Overwrite x, in elimination order, by the solution of L D L' x = b."""
    starts, rows, values = m.starts, m.rows, m.L
    for j in range(m.count):
        x_j = x[j]
        for p in range(starts[j], starts[j + 1]):
            x[rows[p]] -= values[p] * x_j
    for j in range(m.count - 1, -1, -1):
        x_j = x[j] / m.D[j]
        for p in range(starts[j], starts[j + 1]):
            x_j -= values[p] * x[rows[p]]
        x[j] = x_j


# ---- is A semidefinite?


def is_definite(m):
    """Tell whether A + PSD_SLACK I is positive definite; False where an a_ii <= 0."""
    if not m.has_unit:
        return False
    for i in range(m.n):
        m.side[i] = 0
    return factor_free(m, PSD_SLACK)
