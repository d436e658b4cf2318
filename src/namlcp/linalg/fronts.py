"""L D L' or L D U of a large sparse matrix by the multifrontal method.

A supernode, k columns of L on f rows, is kept as one dense column-major block, the
panel. Eliminating it leaves an update of order u = f - k, which its parent in the
elimination tree adds to its own front. Nearly all operations are products by BLAS. The
method: Duff and Reid, ACM Trans. Math. Softw. 9 (1983) 302-325.

K is symmetric, or its pattern is. Then a second panel has U', and with the lower
triangles of two updates, of K and of K', both sides are computed alike:

    K_below -= L D U_below'    and, the sides exchanged,    K'_below -= U' D L_below'.

Pivots are taken from the diagonal in the order given. Every symmetric permutation of a
quasi-definite matrix has an L D L' (R. Vanderbei, SIAM J. Optim. 5 (1995) 100-113); for
other matrices this is justified by measurement alone (`lcp.general.cones`).

Updates are kept on two stacks that grow towards each other, one for supernodes of even
depth, one for odd depth: so those of the children are at the end of the one while that
of their parent is set at the end of the other.
"""

import cython
import numpy as np
from cython import Py_ssize_t
from cython.cimports.libc.math import isfinite
from cython.cimports.libc.string import memset
from cython.cimports.namlcp.linalg.arrays import indices as longs
from cython.cimports.namlcp.linalg.arrays import numbers, places
from cython.cimports.namlcp.linalg.sparse_ldl import Factors
from cython.cimports.namlcp.linalg.vectors import (
    add_scaled,
    copy,
    dot,
    fill,
    four_dots,
    subtract_sum,
)
from cython.cimports.namlcp.watch import is_over
from cython.cimports.scipy.linalg.cython_blas import dgemm, dtrsm

from namlcp.linalg.ordering import supernodes

# Smallest pivot that is not 0 for us: the reciprocals of smaller ones may overflow.
LEAST = float(np.finfo(np.float64).tiny)


class Fronts(Factors):
    """`Factors` by dense fronts."""

    def __init__(self, indptr, indices, order, pairs=None):
        """Lay out L for a matrix K, the upper triangle of its pattern given.

        If K is not symmetric, entry t of this triangle stands for data[pairs[0, t]]
        below the diagonal, in the order of elimination, and data[pairs[1, t]] above it.
        """
        Factors.__init__(self, indptr)
        nodes = supernodes(indptr, indices, order)
        sources = nodes.source[None] if pairs is None else pairs[:, nodes.source]
        sources = np.ascontiguousarray(sources, np.int32)
        self.sides, size = sources.shape
        if pairs is not None:
            self.nnz = 2 * self.nnz - self.n
        k, n, number = np.diff(nodes.first), self.n, nodes.parent.size
        f = np.diff(nodes.starts)
        u = f - k
        length = nodes.rows.size
        ints, above = np.empty((2, number), np.int32), np.empty(length, np.int32)
        at, target = np.empty(number, np.intp), np.empty(size, np.intp)
        scaled = np.empty(max((u * np.minimum(k, DEPTH)).max(), BLOCK * f.max()))
        vectors = np.empty(f.max() + 3 + n)
        t = cython.address(self.t)
        t.number = number
        t.place, t.first = places(order.place, n), places(nodes.first, number + 1)
        t.parent, t.rows = places(nodes.parent, number), places(nodes.rows, length)
        t.lower, t.below = places(nodes.lower, n + 1), places(nodes.below, size)
        t.starts = longs(nodes.starts, number + 1)
        t.panels = longs(nodes.panels, number + 1)
        t.child, t.sibling = places(ints[0], number), places(ints[1], number)
        t.above, t.at = places(above, length), longs(at, number)
        t.target, t.scaled = longs(target, size), numbers(scaled, scaled.size)
        t.x = numbers(vectors, vectors.size)
        t.w = t.x + n
        for side in range(self.sides):
            self.sources[side] = places(sources[side], size)
        position, held = np.empty(n, np.int32), np.zeros(number, np.intp)
        most = lay_out(t, self.sides, places(position, n), longs(held, number))
        self.stack = most
        stack = np.empty(most)
        t.stack = numbers(stack, most)
        self.arrays = nodes, order, sources, ints, above, at, target, stack, scaled
        self.arrays += (vectors,)
        self.allocate()

    def allocate(self):
        size: Py_ssize_t = self.t.panels[self.t.number]
        self.values, self.pivots = np.empty((self.sides, size)), np.empty(self.n)
        for side in range(self.sides):
            self.panels[side] = numbers(self.values[side], size)
        self.D, self.entries = numbers(self.pivots, self.n), self.sides * size

    def another(self):
        """Return factors of the same layout and work space, for other values."""
        other: Fronts = Fronts.__new__(Fronts)
        other.n, other.nnz, other.t = self.n, self.nnz, self.t
        other.sides, other.arrays = self.sides, self.arrays
        other.sources[0], other.sources[1] = self.sources[0], self.sources[1]
        other.allocate()
        return other

    def factor_values(self, data, watch):
        t = cython.address(self.t)
        for s in range(t.number):
            v = front_at(t, s)
            if is_over(watch, v.k * v.f * v.f):
                return False
            open_panels(self, s, data)
            for side in range(self.sides):
                assemble(self, s, side)
            if not eliminate(self, v, watch):
                return False
            for side in range(self.sides):
                complement(self, s, side, watch)
        return not watch.over

    def solve_into(self, rhs, x):
        place, y = self.t.place, self.t.x
        for j in range(self.n):
            y[place[j]] = rhs[j]
        forward(self, self.panels[0], y)
        for j in range(self.n):
            y[j] /= self.D[j]
        backward(self, self.panels[self.sides - 1], y)
        for j in range(self.n):
            x[j] = y[place[j]]


# ---- the layout


def lay_out(t, sides, position, held):
    """Set places, lists of children and stacks; return the size of the stacks.

    held, zeros, is overwritten by what the children of a supernode have on their stack.
    """
    for s in range(t.number):
        t.child[s] = -1
    for s in range(t.number - 1, -1, -1):
        v, g = front_at(t, s), t.parent[s]
        t.at[s] = 0 if g < 0 else 1 - t.at[g]  # the stack, for now
        if v.u > 0:
            t.sibling[s] = t.child[g]
            t.child[g] = s
    height = cython.declare(Py_ssize_t[2])
    height[0] = height[1] = 0
    most: Py_ssize_t = 0
    for s in range(t.number):
        v, g = front_at(t, s), t.parent[s]
        rows = t.rows + t.starts[s]
        for i in range(v.f):
            position[rows[i]] = i
        for j in range(v.k):
            for e in range(t.lower[v.first + j], t.lower[v.first + j + 1]):
                t.target[e] = position[t.below[e]] + j * v.f
        i: Py_ssize_t = 0
        for p in range(t.starts[s] + v.k, t.starts[s + 1]):
            while t.rows[t.starts[g] + i] != t.rows[p]:
                i += 1
            t.above[p] = i
        size = sides * v.u * v.u
        stack = t.at[s]
        t.at[s] = height[stack] if stack == 0 else -height[stack] - size
        height[stack] += size
        most = max(most, height[0] + height[1])
        height[1 - stack] -= held[s]
        if g >= 0:
            held[g] += size
    for s in range(t.number):
        if t.at[s] < 0:
            t.at[s] += most
    return most


def front_at(t, s):
    """Return the sizes and rows of supernode s."""
    v = cython.declare(Front)
    v.first, v.panel = t.first[s], t.panels[s]
    v.k, v.f = t.first[s + 1] - v.first, t.starts[s + 1] - t.starts[s]
    v.u = v.f - v.k
    v.rows, v.above = t.rows + t.starts[s] + v.k, t.above + t.starts[s] + v.k
    return v


# ---- one front


def open_panels(f, s, data):
    """Set the panels of a supernode to the entries of K."""
    t = cython.address(f.t)
    begin, end = t.lower[t.first[s]], t.lower[t.first[s + 1]]
    size = t.panels[s + 1] - t.panels[s]
    for side in range(f.sides):
        L, source = f.panels[side] + t.panels[s], f.sources[side]
        memset(L, 0, size * cython.sizeof(cython.double))
        for e in range(begin, end):
            L[t.target[e]] = data[source[e]]


def update_of(f, s, side):
    """Return where the update of a supernode begins, a square of order u."""
    u = front_at(cython.address(f.t), s).u
    return f.t.stack + f.t.at[s] + side * u * u


def assemble(f, s, side):
    """Add the updates of the children to the front."""
    u, c = front_at(cython.address(f.t), s).u, f.t.child[s]
    U = update_of(f, s, side)
    if c >= 0:
        for j in range(u):
            memset(U + j * (u + 1), 0, (u - j) * cython.sizeof(cython.double))
    while c >= 0:
        extend_add(f, c, side)
        c = f.t.sibling[c]


def extend_add(f, c, side):
    """Add the update of c, a lower triangle, to the front of its parent."""
    t = cython.address(f.t)
    s = t.parent[c]
    child, v = front_at(t, c), front_at(t, s)
    m, place = child.u, child.above
    C, U = update_of(f, c, side), update_of(f, s, side)
    for j in range(m):
        column, r = C + j * m, place[j]
        if r < v.k:
            to = f.panels[side] + v.panel + r * v.f
        else:
            to = U + (r - v.k) * v.u - v.k
        if place[m - 1] - r == m - 1 - j:  # several at a time, without indices
            to = to + r - j
            for i in range(j, m):
                to[i] += column[i]
        else:
            for i in range(j, m):
                to[place[i]] += column[i]


def eliminate(f, v, watch):
    """Overwrite the panels by those of L and U', set D; False if a pivot is 0."""
    D, w = f.D + v.first, f.t.w
    start: Py_ssize_t = 0
    while start < v.k:
        stop = min(start + BLOCK, v.k)
        width = stop - start
        is_small: cython.bint = (v.f - stop) * width * width <= SMALL or width <= 4
        end = v.f if is_small else stop
        if is_over(watch, (v.f - start) * width * (v.k - start)):
            return False
        for j in range(start, stop):
            for side in range(f.sides):
                L = f.panels[side] + v.panel
                U = f.panels[f.sides - 1 - side] + v.panel
                for p in range(start, j):
                    w[p - start] = D[p] * U[j + p * v.f]
                subtract(
                    L + j * (v.f + 1), L + j + start * v.f, v.f, w, j - start, end - j
                )
            pivot = f.panels[0][v.panel + j * (v.f + 1)]
            if not (LEAST <= abs(pivot) and isfinite(pivot)):
                return False
            D[j] = pivot
            inverse = 1.0 / pivot
            for side in range(f.sides):
                column = f.panels[side] + v.panel + j * v.f
                for i in range(j + 1, end):
                    column[i] *= inverse
        for side in range(f.sides):
            if not is_small:
                L = f.panels[side] + v.panel
                U = f.panels[f.sides - 1 - side] + v.panel
                solve_below(v, L, U, D, start, stop)
        for side in range(f.sides):
            if stop < v.k:
                L = f.panels[side] + v.panel
                U = f.panels[f.sides - 1 - side] + v.panel
                update_columns(v, L, U, D, start, stop, f.t.scaled)
        start = stop
    return True


def solve_below(v, L, U, D, start, stop):
    """Solve with D U of the block start : stop for the rows of L below it."""
    m: cython.int = v.f - stop
    n: cython.int = stop - start
    ld: cython.int = v.f
    one: cython.double = 1.0
    dtrsm(
        b"R", b"L", b"T", b"U", cython.address(m), cython.address(n),
        cython.address(one), cython.cast(cython.p_double, U) + start * (v.f + 1),
        cython.address(ld), L + stop + start * v.f, cython.address(ld),
    )  # fmt: skip
    for p in range(start, stop):
        column = L + p * v.f
        inverse = 1.0 / D[p]
        for i in range(stop, v.f):
            column[i] *= inverse


def update_columns(v, L, U, D, start, stop, scaled):
    """Subtract the product of the columns start : stop from those to the right."""
    m = v.f - stop
    scale(L + stop + start * v.f, v.f, D + start, m, stop - start, scaled)
    a = stop
    while a < v.k:
        subtract_product(
            v.f - a, min(STRIP, v.k - a), stop - start, scaled + a - stop, m,
            U + a + start * v.f, v.f, 1.0, L + a * (v.f + 1), v.f,
        )  # fmt: skip
        a += STRIP


def complement(f, s, side, watch):
    """Subtract L D U of the rows below from the update, a lower triangle."""
    t = cython.address(f.t)
    v = front_at(t, s)
    u, C = v.u, update_of(f, s, side)
    L = f.panels[side] + v.panel + v.k
    U = f.panels[f.sides - 1 - side] + v.panel + v.k
    beta = 1.0 if t.child[s] >= 0 else 0.0
    start: Py_ssize_t = 0
    while start < v.k:
        depth = min(DEPTH, v.k - start)
        scale(L, v.f, f.D + v.first + start, u, depth, t.scaled)
        a: Py_ssize_t = 0
        while a < u:
            if is_over(watch, STRIP * depth * (u - a)):
                return
            subtract_product(
                u - a, min(STRIP, u - a), depth, t.scaled + a, u, U + a, v.f,
                beta, C + a * (u + 1), u,
            )  # fmt: skip
            a += STRIP
        start, L, U, beta = start + DEPTH, L + DEPTH * v.f, U + DEPTH * v.f, 1.0


# ---- solution


def forward(f, L, x):
    """Overwrite x, in the order of elimination, by L^-1 x."""
    t = cython.address(f.t)
    y = t.w
    for s in range(t.number):
        v = front_at(t, s)
        own, P = x + v.first, L + v.panel
        if v.k == 1:
            for i in range(v.u):
                x[v.rows[i]] -= P[i + 1] * own[0]
            continue
        copy(own, y, v.k)
        fill(y + v.k, 0.0, v.u)
        j: Py_ssize_t = 0
        while j < v.k:
            end = min(j + 4, v.k)
            for p in range(j, end):
                for i in range(p + 1, end):
                    y[i] -= P[i + p * v.f] * y[p]
            subtract(y + end, P + end + j * v.f, v.f, y + j, end - j, v.f - end)
            j = end
        copy(y, own, v.k)
        for i in range(v.u):
            x[v.rows[i]] += y[v.k + i]


def backward(f, U, x):
    """Overwrite x by U^-1 x."""
    t = cython.address(f.t)
    y = t.w
    sums = cython.declare(cython.double[4])
    for s in range(t.number - 1, -1, -1):
        v = front_at(t, s)
        own, P = x + v.first, U + v.panel
        if v.k == 1:
            for i in range(v.u):
                own[0] -= P[i + 1] * x[v.rows[i]]
            continue
        copy(own, y, v.k)
        for i in range(v.u):
            y[v.k + i] = x[v.rows[i]]
        end = v.k
        while end > 0:
            j = max(end - 4, 0)
            a, m, ld = P + end + j * v.f, v.f - end, v.f
            if j + 4 == end:
                four_dots(y + end, a, a + ld, a + 2 * ld, a + 3 * ld, m, sums)
            else:
                for p in range(end - j):
                    sums[p] = dot(a + p * ld, y + end, m)
            for p in range(end - 1, j - 1, -1):
                y[p] -= sums[p - j]
                for i in range(p + 1, end):
                    y[p] -= P[i + p * ld] * y[i]
            end = j
        copy(y, own, v.k)


# ---- products


def scale(L, ld, D, m, n, out):
    """Set out (m, n) to L D."""
    for p in range(n):
        column, to, d = L + p * ld, out + p * m, D[p]
        for i in range(m):
            to[i] = column[i] * d


def subtract(out, L, ld, w, k, m):
    """Subtract from out (m,) the product of L (m, k) and w."""
    p: Py_ssize_t = 0
    while p + 4 <= k:
        a = L + p * ld
        subtract_sum(
            w[p], a, w[p + 1], a + ld, w[p + 2], a + 2 * ld, w[p + 3], a + 3 * ld,
            out, m,
        )  # fmt: skip
        p += 4
    if p + 2 <= k:
        a = L + p * ld
        b, w_a, w_b = a + ld, w[p], w[p + 1]
        for i in range(m):
            out[i] -= a[i] * w_a + b[i] * w_b
        p += 2
    if p < k:
        add_scaled(-w[p], L + p * ld, out, m)


def subtract_product(m, n, k, A, lda, B, ldb, beta, C, ldc):
    """Set C (m, n) to beta C - A B'."""
    rows: cython.int = m
    columns: cython.int = n
    inner: cython.int = k
    step_A: cython.int = lda
    step_B: cython.int = ldb
    step_C: cython.int = ldc
    minus: cython.double = -1.0
    dgemm(
        b"N", b"T", cython.address(rows), cython.address(columns),
        cython.address(inner), cython.address(minus), cython.cast(cython.p_double, A),
        cython.address(step_A), cython.cast(cython.p_double, B), cython.address(step_B),
        cython.address(beta), C, cython.address(step_C),
    )  # fmt: skip
