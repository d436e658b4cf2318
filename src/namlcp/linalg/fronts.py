"""L D L' or L D U of a large sparse matrix by the multifrontal method.

A supernode, k columns of L on f rows, is one dense column-major block, the panel.
Eliminating it leaves an update of order u = f - k, which its parent in the elimination
tree adds to its own front (Duff and Reid, ACM Trans. Math. Softw. 9 (1983) 302-325).

K is symmetric, or its pattern is. Then a second panel has U', and with the lower
triangles of two updates, of K and of K', both sides are computed alike:

    K_below -= L D U_below'    and, the sides exchanged,    K'_below -= U' D L_below'.

Pivots are taken from the diagonal in the order given, which for the matrices of
`lcp.general.cones`, not quasi-definite, measurements alone justify.

Updates are kept on two stacks that grow towards each other, one for supernodes of even
depth, one for odd depth: so those of the children are at the end of the one while that
of their parent is set at the end of the other.

Threads share the work by *pieces*: subtrees, each with stacks of its own, and at last
all other supernodes, which one thread does alone. A front takes what its children pass
on in their order: so the bits are the same for any number of threads.
"""

import cython
import numpy as np
from cython import Py_ssize_t, address, cast, p_double, p_void
from cython.cimports.libc.math import isfinite
from cython.cimports.libc.string import memset
from cython.cimports.scipy.linalg.cython_blas import dgemm, dtrsm

from namlcp.linalg.ordering import supernodes

# Work of a factorisation, the sum of k f^2, from which on it is divided.
WORTH = 3e8


class Fronts(Factors):
    """`Factors` by dense fronts."""

    def __init__(self, indptr, indices, order, pairs=None, threads=1):
        """Lay out L for a matrix K, of whose pattern the upper triangle is read.

        If K is not symmetric, entry t of the pattern stands for data[pairs[0, t]] below
        the diagonal, in the order of elimination, and data[pairs[1, t]] above it.
        """
        Factors.__init__(self, indptr)
        nodes = supernodes(indptr, indices, order)
        sources = nodes.source[None] if pairs is None else pairs[:, nodes.source]
        sources = np.ascontiguousarray(sources, np.int32)
        self.sides, size = sources.shape
        n, number, length = self.n, nodes.parent.size, nodes.rows.size
        ints, above = np.empty((2, number), np.int32), np.empty(length, np.int32)
        at, target = np.zeros(number, np.intp), np.empty(size, np.intp)
        x, passed = np.empty(n), np.empty(length)
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
        t.passed = numbers(passed, length)
        for side in range(self.sides):
            self.sources[side] = places(sources[side], size)
        self.arrays = nodes, order, sources, ints, above, at, target, x, passed
        self.allocate()
        position = np.empty(n, np.int32)
        lay_out(self, places(position, n))
        self.share(nodes, min(threads, MOST_THREADS))

    def allocate(self):
        size: Py_ssize_t = self.t.panels[self.t.number]
        self.values, self.pivots = np.empty((self.sides, size)), np.empty(self.n)
        for side in range(self.sides):
            self.panels[side] = numbers(self.values[side], size)
        self.D, self.entries = numbers(self.pivots, self.n), self.sides * size

    def share(self, nodes, threads):
        t, n, number = address(self.t), self.n, self.t.number
        k, f = np.diff(nodes.first), np.diff(nodes.starts)
        sequence, bounds = pieces_of(nodes.parent, k * f.astype(float) ** 2)
        t.pieces = bounds.size - 1
        t.sequence, t.bounds = longs(sequence, number), longs(bounds, bounds.size)
        held = np.empty(number, np.intp)
        self.stack = stack_updates(self, longs(held, number))
        threads = threads if t.pieces > 1 else 1
        width: Py_ssize_t = f.max()
        room = max(((f - k) * k).max(), BLOCK * width) + width
        stack, work = np.empty(self.stack), np.empty((threads, room))
        z = np.zeros((threads, n))
        t.stack = numbers(stack, self.stack)
        self.shared = sequence, bounds, stack, work, z
        for i in range(threads):
            desk = self.desks + i
            desk.number, desk.owner, desk.z = i, cast(p_void, self), numbers(z[i], n)
            desk.w = numbers(work[i], room)
            desk.scaled = desk.w + width
            if i > 0:
                desk.done = PyThread_allocate_lock()
                PyThread_acquire_lock(desk.done, 1)
        self.guard, self.threads = PyThread_allocate_lock(), threads

    def __dealloc__(self):
        if self.guard != cython.NULL:
            PyThread_free_lock(self.guard)
        for i in range(1, self.threads):
            PyThread_free_lock(self.desks[i].done)

    def another(self):
        """Return factors of the same layout and work space, on one thread."""
        other: Fronts = Fronts.__new__(Fronts)
        other.n, other.nnz, other.t = self.n, self.nnz, self.t
        other.sides, other.arrays, other.shared = self.sides, self.arrays, self.shared
        other.sources[0], other.sources[1] = self.sources[0], self.sources[1]
        other.desks[0], other.threads = self.desks[0], 1
        other.guard = PyThread_allocate_lock()
        other.allocate()
        return other

    def factor_values(self, data, watch):
        self.data, self.failed = data, False
        do_tasks(self, FACTOR, watch)
        do_piece(self, self.t.pieces - 1, watch, self.desks)
        return not (self.failed or watch.over)

    def solve_into(self, rhs, x):
        t, desk = address(self.t), self.desks
        place, y, top = t.place, t.x, t.pieces - 1
        for j in range(self.n):
            y[place[j]] = rhs[j]
        self.failed = False
        do_tasks(self, FORWARD, None)
        for p in range(top):
            v = front_at(self, t.sequence[t.bounds[p + 1] - 1])
            for i in range(v.u):
                y[v.rows[i]] += v.passed[i]
        do_piece(self, top, None, desk)
        for j in range(self.n):
            y[j] /= self.D[j]
        self.work = BACKWARD
        do_piece(self, top, None, desk)
        do_tasks(self, BACKWARD, None)
        for j in range(self.n):
            x[j] = y[place[j]]


# ---- the layout


def lay_out(f, position):
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
    total: Py_ssize_t = 0
    for s in range(t.number - 1, -1, -1):
        t.at[s] = 0 if t.parent[s] < 0 else 1 - t.at[t.parent[s]]  # the stack, for now
        held[s] = 0
    for p in range(t.pieces):
        begin, end = t.bounds[p], t.bounds[p + 1]
        height[0] = height[1] = 0
        most: Py_ssize_t = 0
        for i in range(begin, end):
            s = t.sequence[i]
            v, g = front_at(f, s), t.parent[s]
            size, stack = f.sides * v.u * v.u, t.at[s]
            t.at[s] = height[stack] if stack == 0 else -height[stack] - size
            height[stack] += size
            most = max(most, height[0] + height[1])
            height[1 - stack] -= held[s]
            if g >= 0 and (i + 1 < end or p + 1 == t.pieces):  # of this piece
                held[g] += size
        for i in range(begin, end):
            s = t.sequence[i]
            t.at[s] += total if t.at[s] >= 0 else total + most
        total += most
    return total


def pieces_of(parent, work):
    """Return the supernodes of all pieces, and where each piece begins.

    Subtrees, the largest first, have at most 1 / PARTS of the work; there is but one
    piece where threads are not worth it.
    """
    number: Py_ssize_t = parent.shape[0]
    pieces, works = np.full(number, number, np.intp), np.append(work, 0.0)
    piece: Py_ssize_t[::1] = pieces
    whole: cython.double[::1] = works
    for s in range(number):  # the last one is the sum of all trees
        whole[parent[s] if parent[s] >= 0 else number] += whole[s]
    most = whole[number] / PARTS if whole[number] >= WORTH else 0.0
    whole[number] = 0.0
    for s in range(number - 1, -1, -1):
        if parent[s] >= 0 and piece[parent[s]] < number:
            piece[s] = piece[parent[s]]
        elif whole[s] <= most:
            piece[s] = s
    sequence = np.lexsort((pieces, -works[pieces]))
    ends = np.flatnonzero(np.diff(pieces[sequence])) + 1
    return sequence, np.concatenate(([0], ends, [number]))


def front_at(f, s):
    t, v = address(f.t), cython.declare(Front)
    start = t.starts[s]
    v.first = t.first[s]
    v.k, v.f = t.first[s + 1] - v.first, t.starts[s + 1] - start
    v.u = v.f - v.k
    v.rows, v.above = t.rows + start + v.k, t.above + start + v.k
    v.panels[0], v.panels[1] = f.panels[0] + t.panels[s], f.panels[1] + t.panels[s]
    v.update, v.passed = t.stack + t.at[s], t.passed + start + v.k
    return v


# ---- pieces, on threads


def do_tasks(f, work, watch):
    """Do all pieces but the last one, on all threads."""
    f.work, f.next = work, 0
    if f.t.pieces == 1:
        return
    for i in range(1, f.threads):
        f.desks[i].watch = cast(p_void, watch)
        if PyThread_start_new_thread(help_along, f.desks + i) == -1:
            PyThread_release_lock(f.desks[i].done)
    take_tasks(f, watch, f.desks)
    for i in range(1, f.threads):
        while PyThread_acquire_lock_timed(f.desks[i].done, PATIENCE, 0) != 1:
            if watch is not None:
                is_over(watch, OFTEN)


def help_along(own):
    desk = cast(cython.pointer(Desk), own)
    take_tasks(cast(Fronts, desk.owner), cast(Watched, desk.watch), desk)
    PyThread_release_lock(desk.done)


def take_tasks(f, watch, desk):
    while not f.failed:
        PyThread_acquire_lock(f.guard, 1)
        p = f.next
        f.next += 1
        PyThread_release_lock(f.guard)
        if p + 1 >= f.t.pieces:
            break
        do_piece(f, p, watch, desk)


def do_piece(f, p, watch, desk):
    begin, end = f.t.bounds[p], f.t.bounds[p + 1]
    if f.work == FACTOR:
        for i in range(begin, end):
            if f.failed or not factor_front(f, f.t.sequence[i], watch, desk):
                f.failed = True
                break
    elif f.work == BACKWARD:
        for i in range(end - 1, begin - 1, -1):
            backward(f, f.t.sequence[i], desk)
    else:
        root = front_at(f, f.t.sequence[end - 1])
        for i in range(begin, end):
            forward(f, f.t.sequence[i], root.first + root.k, desk)
        for i in range(root.u):
            root.passed[i] = desk.z[root.rows[i]]
            desk.z[root.rows[i]] = 0.0


def stops(watch, desk, operations):
    """Tell whether to stop: the first thread looks at the clock."""
    return is_over(watch, operations) if desk.number == 0 else watch.over


# ---- one front


def factor_front(f, s, watch, desk):
    """Assemble and eliminate a supernode; False if a pivot is 0, or it is time."""
    t, v = address(f.t), front_at(f, s)
    if stops(watch, desk, v.k * v.f * v.f):
        return False
    begin, end = t.lower[v.first], t.lower[v.first + v.k]
    for side in range(f.sides):
        L, source = v.panels[side], f.sources[side]
        memset(L, 0, v.k * v.f * cython.sizeof(cython.double))
        for e in range(begin, end):
            L[t.target[e]] = f.data[source[e]]
        assemble(f, s, side)
    if not eliminate(f, v, watch, desk):
        return False
    # the update: what the children left less L D U of the rows below
    beta = 1.0 if t.child[s] >= 0 else 0.0
    for side in range(f.sides):
        if stops(watch, desk, v.k * v.u * v.u):
            return False
        L, U = v.panels[side] + v.k, v.panels[f.sides - 1 - side] + v.k
        scale(L, v.f, f.D + v.first, v.u, v.k, desk.scaled)
        subtract_product(
            v.u, v.u, v.k, desk.scaled, U, v.f, beta,
            v.update + side * v.u * v.u, v.u,
        )  # fmt: skip
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


def eliminate(f, v, watch, desk):
    """Overwrite the panels by those of L and U', set D; False if a pivot is 0."""
    D, w = f.D + v.first, desk.w
    start: Py_ssize_t = 0
    while start < v.k:
        stop = min(start + BLOCK, v.k)
        width = stop - start
        is_small: cython.bint = (v.f - stop) * width * width <= SMALL or width <= 4
        end = v.f if is_small else stop
        if stops(watch, desk, (v.f - start) * width * (v.k - start)):
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
                scale(L + to, v.f, D + start, m, width, desk.scaled)
                subtract_product(
                    m, v.k - stop, width, desk.scaled, U + to, v.f, 1.0,
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


# ---- solution


def forward(f, s, end, desk):
    """Solve with the columns of L of a supernode, in desk.z for rows from `end` on."""
    v, x = front_at(f, s), f.t.x
    own, P, y = x + v.first, v.panels[0], desk.w
    if v.k == 1:
        subtract_below(v.rows, v.u, P + 1, own[0], x, desk.z, end)
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
    subtract_below(v.rows, v.u, y + v.k, -1.0, x, desk.z, end)


def subtract_below(rows, u, column, factor, x, z, end):
    """Subtract a multiple of a column from u rows of x, from `end` on of z."""
    inside = u
    while inside > 0 and rows[inside - 1] >= end:
        inside -= 1
    for i in range(inside):
        x[rows[i]] -= column[i] * factor
    for i in range(inside, u):
        z[rows[i]] -= column[i] * factor


def backward(f, s, desk):
    """Solve with the rows of U of a supernode."""
    v, x = front_at(f, s), f.t.x
    own, P, y = x + v.first, v.panels[f.sides - 1], desk.w
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
