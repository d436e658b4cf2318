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
from cython import Py_ssize_t, address, cast, p_double
from cython.cimports.libc.math import isfinite
from cython.cimports.libc.string import memset
from cython.cimports.namlcp.linalg.arrays import indices as longs
from cython.cimports.namlcp.linalg.arrays import numbers, places
from cython.cimports.namlcp.linalg.sparse_ldl import LEAST, Factors
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
        n, number, length = self.n, nodes.parent.size, nodes.rows.size
        ints, above = np.empty((2, number), np.int32), np.empty(length, np.int32)
        at, target = np.zeros(number, np.intp), np.empty(size, np.intp)
        x = np.empty(n)
        t = address(self.t)
        t.number = number
        t.place, t.first = places(order.place, n), places(nodes.first, number + 1)
        t.parent, t.rows = places(nodes.parent, number), places(nodes.rows, length)
        t.lower, t.below = places(nodes.lower, n + 1), places(nodes.below, size)
        t.starts = longs(nodes.starts, number + 1)
        t.panels = longs(nodes.panels, number + 1)
        t.child, t.sibling = places(ints[0], number), places(ints[1], number)
        t.above, t.at = places(above, length), longs(at, number)
        t.target, t.x = longs(target, size), numbers(x, n)
        for side in range(self.sides):
            self.sources[side] = places(sources[side], size)
        self.allocate()
        position, held = np.empty(n, np.int32), np.empty(number, np.intp)
        lay_out(self, places(position, n))
        self.stack = stack_updates(self, longs(held, number))
        k, f = np.diff(nodes.first), np.diff(nodes.starts)
        width: Py_ssize_t = f.max() + 3
        room = max(((f - k) * np.minimum(k, DEPTH)).max(), BLOCK * f.max()) + width
        stack, work = np.empty(self.stack), np.empty(room)
        t.stack, t.w = numbers(stack, self.stack), numbers(work, room)
        t.scaled = t.w + width
        self.arrays = (
            nodes, order, sources, ints, above, at, target, x, stack, work,
        )  # fmt: skip

    def allocate(self):
        """Make room for the panels and D."""
        size: Py_ssize_t = self.t.panels[self.t.number]
        self.values, self.pivots = np.empty((self.sides, size)), np.empty(self.n)
        for side in range(self.sides):
            self.panels[side] = numbers(self.values[side], size)
        self.D, self.entries = numbers(self.pivots, self.n), self.sides * size

    def another(self):
        """Return factors of the same layout and work space."""
        other: Fronts = Fronts.__new__(Fronts)
        other.n, other.nnz, other.t = self.n, self.nnz, self.t
        other.sides, other.arrays = self.sides, self.arrays
        other.sources[0], other.sources[1] = self.sources[0], self.sources[1]
        other.allocate()
        return other

    def factor_values(self, data, watch):
        self.data = data
        for s in range(self.t.number):
            if not factor_front(self, s, watch):
                return False
        return not watch.over

    def solve_into(self, rhs, x):
        place, y = self.t.place, self.t.x
        for j in range(self.n):
            y[place[j]] = rhs[j]
        for s in range(self.t.number):
            forward(self, s)
        for j in range(self.n):
            y[j] /= self.D[j]
        for s in range(self.t.number - 1, -1, -1):
            backward(self, s)
        for j in range(self.n):
            x[j] = y[place[j]]


# ---- the layout


def lay_out(f, position):
    """Set the places of entries and rows, and the lists of children."""
    t = address(f.t)
    for s in range(t.number):
        t.child[s] = -1
    for s in range(t.number - 1, -1, -1):
        v, g = front_at(f, s), t.parent[s]
        if v.u > 0:
            t.sibling[s] = t.child[g]
            t.child[g] = s
    for s in range(t.number):
        v = front_at(f, s)
        rows = t.rows + t.starts[s]
        for i in range(v.f):
            position[rows[i]] = i
        for j in range(v.k):
            for e in range(t.lower[v.first + j], t.lower[v.first + j + 1]):
                t.target[e] = position[t.below[e]] + j * v.f
        i: Py_ssize_t = 0
        for p in range(t.starts[s] + v.k, t.starts[s + 1]):
            while t.rows[t.starts[t.parent[s]] + i] != t.rows[p]:
                i += 1
            t.above[p] = i


def stack_updates(f, held):
    """Give all updates their places; return the size of the stacks.

    held is overwritten by what the children of a supernode have on their stack.
    """
    t = address(f.t)
    height = cython.declare(Py_ssize_t[2])
    height[0] = height[1] = 0
    most: Py_ssize_t = 0
    for s in range(t.number - 1, -1, -1):
        t.at[s] = 0 if t.parent[s] < 0 else 1 - t.at[t.parent[s]]  # the stack, for now
        held[s] = 0
    for s in range(t.number):
        v, stack = front_at(f, s), t.at[s]
        size = f.sides * v.u * v.u
        t.at[s] = height[stack] if stack == 0 else -height[stack] - size
        height[stack] += size
        most = max(most, height[0] + height[1])
        height[1 - stack] -= held[s]
        if t.parent[s] >= 0:
            held[t.parent[s]] += size
    for s in range(t.number):
        if t.at[s] < 0:
            t.at[s] += most
    return most


def front_at(f, s):
    """Return the sizes and rows of supernode s, and where its numbers are."""
    t, v = address(f.t), cython.declare(Front)
    start = t.starts[s]
    v.first = t.first[s]
    v.k, v.f = t.first[s + 1] - v.first, t.starts[s + 1] - start
    v.u = v.f - v.k
    v.rows, v.above = t.rows + start + v.k, t.above + start + v.k
    v.panels[0], v.panels[1] = f.panels[0] + t.panels[s], f.panels[1] + t.panels[s]
    v.update = t.stack + t.at[s]
    return v


# ---- one front


def factor_front(f, s, watch):
    """Assemble and eliminate a supernode; False if a pivot is 0, or it is time."""
    t, v = address(f.t), front_at(f, s)
    if is_over(watch, v.k * v.f * v.f):
        return False
    begin, end = t.lower[v.first], t.lower[v.first + v.k]
    for side in range(f.sides):
        L, source = v.panels[side], f.sources[side]
        memset(L, 0, v.k * v.f * cython.sizeof(cython.double))
        for e in range(begin, end):
            L[t.target[e]] = f.data[source[e]]
        assemble(f, s, side)
    if not eliminate(f, v, watch):
        return False
    for side in range(f.sides):
        complement(f, s, side, watch)
    return True


def assemble(f, s, side):
    """Add the updates of the children, lower triangles, to the front."""
    v, c = front_at(f, s), f.t.child[s]
    U = v.update + side * v.u * v.u
    if c >= 0:
        for j in range(v.u):
            memset(U + j * (v.u + 1), 0, (v.u - j) * cython.sizeof(cython.double))
    while c >= 0:
        child = front_at(f, c)
        m, place = child.u, child.above
        for j in range(m):
            column, r = child.update + (side * m + j) * m, place[j]
            if r < v.k:
                to = v.panels[side] + r * v.f
            else:
                to = U + (r - v.k) * v.u - v.k
            for i in range(j, m):
                to[place[i]] += column[i]
        c = f.t.sibling[c]


def eliminate(f, v, watch):
    """Overwrite the panels by those of L and U', set D; False if a pivot is 0."""
    D, w, scaled = f.D + v.first, f.t.w, f.t.scaled
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
                L, U = v.panels[side], v.panels[f.sides - 1 - side]
                for p in range(start, j):
                    w[p - start] = D[p] * U[j + p * v.f]
                subtract(
                    L + j * (v.f + 1), L + j + start * v.f, v.f, w, j - start, end - j
                )
            pivot = v.panels[0][j * (v.f + 1)]
            if not (LEAST <= abs(pivot) and isfinite(pivot)):
                return False
            D[j] = pivot
            inverse = 1.0 / pivot
            for side in range(f.sides):
                column = v.panels[side] + j * v.f
                for i in range(j + 1, end):
                    column[i] *= inverse
        m, to = v.f - stop, start * v.f
        for side in range(f.sides):
            if not is_small:
                L, U = v.panels[side] + to, v.panels[f.sides - 1 - side] + to
                solve_below(m, width, U + start, D + start, L + stop, v.f)
        for side in range(f.sides):
            if stop < v.k:
                L, U = v.panels[side] + stop, v.panels[f.sides - 1 - side] + stop
                scale(L + to, v.f, D + start, m, width, scaled)
                subtract_product(
                    m, v.k - stop, width, scaled, U + to, v.f, 1.0,
                    L + stop * v.f, v.f,
                )  # fmt: skip
        start = stop
    return True


def solve_below(m, n, U, D, L, ld):
    """Set L (m, n) to L (D U)^-1; all columns have ld rows."""
    one: cython.double = 1.0
    dtrsm(
        b"R", b"L", b"T", b"U", address(m), address(n), address(one),
        cast(p_double, U), address(ld), L, address(ld),
    )  # fmt: skip
    for p in range(n):
        inverse = 1.0 / D[p]
        for i in range(m):
            L[i + p * cast(Py_ssize_t, ld)] *= inverse


def complement(f, s, side, watch):
    """Subtract L D U of the rows below from the update, a lower triangle."""
    v = front_at(f, s)
    L, U = v.panels[side] + v.k, v.panels[f.sides - 1 - side] + v.k
    beta = 1.0 if f.t.child[s] >= 0 else 0.0
    start: Py_ssize_t = 0
    while start < v.k:
        depth = min(DEPTH, v.k - start)
        if is_over(watch, depth * v.u * v.u):
            return
        scale(L, v.f, f.D + v.first + start, v.u, depth, f.t.scaled)
        subtract_product(
            v.u, v.u, depth, f.t.scaled, U, v.f, beta,
            v.update + side * v.u * v.u, v.u,
        )  # fmt: skip
        start, L, U, beta = start + DEPTH, L + DEPTH * v.f, U + DEPTH * v.f, 1.0


# ---- solution


def forward(f, s):
    """Solve with the columns of L of a supernode."""
    v, x = front_at(f, s), f.t.x
    own, P, y = x + v.first, v.panels[0], f.t.w
    if v.k == 1:
        for i in range(v.u):
            x[v.rows[i]] -= P[i + 1] * own[0]
        return
    copy(own, y, v.k)
    fill(y + v.k, 0.0, v.u)
    j: Py_ssize_t = 0
    while j < v.k:
        stop = min(j + 4, v.k)
        for p in range(j, stop):
            for i in range(p + 1, stop):
                y[i] -= P[i + p * v.f] * y[p]
        subtract(y + stop, P + stop + j * v.f, v.f, y + j, stop - j, v.f - stop)
        j = stop
    copy(y, own, v.k)
    for i in range(v.u):
        x[v.rows[i]] += y[v.k + i]


def backward(f, s):
    """Solve with the rows of U of a supernode."""
    v, x = front_at(f, s), f.t.x
    own, P, y = x + v.first, v.panels[f.sides - 1], f.t.w
    sums = cython.declare(cython.double[4])
    if v.k == 1:
        for i in range(v.u):
            own[0] -= P[i + 1] * x[v.rows[i]]
        return
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


def subtract_product(m, n, k, A, B, ldb, beta, C, ldc):
    """Set the first n columns of C, a lower triangle with m rows, to beta C - A B'.

    Of STRIP columns at a time, all rows from the first diagonal entry on are set. The
    columns of A follow each other.
    """
    minus: cython.double = -1.0
    a: Py_ssize_t = 0
    while a < n:
        rows: cython.int = m - a
        columns: cython.int = min(STRIP, n - a)
        dgemm(
            b"N", b"T", address(rows), address(columns), address(k), address(minus),
            cast(p_double, A) + a, address(m), cast(p_double, B) + a, address(ldb),
            address(beta), C + a * (ldc + 1), address(ldc),
        )  # fmt: skip
        a += STRIP
