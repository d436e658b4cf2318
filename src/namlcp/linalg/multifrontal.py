"""L D L' of a large quasi-definite matrix by the multifrontal method.

A supernode, k columns of L on f rows, is kept as one dense block, the panel.
Eliminating it leaves an update matrix of order f - k, which its parent in the
elimination tree adds to its own front. Where all its rows are columns of the parent, it
is added to the parent's panel at once. Nearly all operations are then matrix products
by BLAS, ten times faster than a factorisation entry by entry. No pivoting is needed:
every symmetric permutation of a quasi-definite matrix has an L D L' (R. Vanderbei, SIAM
J. Optim. 5 (1995) 100-113). The method: Duff and Reid, ACM Trans. Math. Softw. 9 (1983)
302-325.
"""

import numpy as np

from namlcp.compiled import kernel, part, pasted
from namlcp.limits import NEVER, WATCH_SIZE, begin_watch, is_over
from namlcp.linalg.lapack import add_scaled, copy, dot, product, solve_rows
from namlcp.linalg.ordering import Order, supernodes
from namlcp.linalg.sparse_ldl import Factors

# Columns eliminated at a time, and rows of a lower triangle updated by one product.
BLOCK, ROW_STRIP = 48, 96
# Entries of L below the panel's square up to which loops are faster than BLAS.
SMALL_PRODUCT = 512


class Multifrontal(Factors):
    """`Factors` by dense fronts."""

    def __init__(self, indptr: np.ndarray, indices: np.ndarray, order: Order) -> None:
        super().__init__(indptr)
        self.place = order.place
        self.nodes = nodes = supernodes(indptr, indices, order)
        k = np.diff(nodes.first).astype(np.int64)
        f = np.diff(nodes.starts)
        last = nodes.rows[nodes.starts[1:] - 1]
        is_inside = last < nodes.first[nodes.parent + 1]  # false at a root
        self.L, self.entries = np.empty(nodes.panels[-1]), nodes.panels[-1]
        self.D = np.empty(order.place.size)
        self.places = np.empty((2, order.place.size), dtype=np.int32)
        self.stack = np.empty(stack_size(nodes.parent, np.where(is_inside, 0, f - k)))
        self.front = np.empty(((f - k) ** 2).max())
        self.work = np.empty(max((f * np.minimum(k, BLOCK)).max(), ((f - k) * k).max()))

    def refactor(self, data: np.ndarray) -> None:
        """Factor the matrix with these values."""
        if not NEVER.run(  # to see Ctrl-C
            factorise, self.nodes, data, self.L, self.D, self.places, self.stack,
            self.front, self.work,
        ):  # fmt: skip
            raise ValueError("a pivot vanishes")

    def solve(self, rhs: np.ndarray) -> np.ndarray:
        """Return the solution for a right-hand side."""
        u = np.empty(rhs.size)
        u[self.place] = rhs
        solve_fronts(self.nodes, self.L, self.D, u)
        return u[self.place]


@pasted
def panel_of(nodes, values, s):
    """Return the block of supernode s, (rows, columns)."""
    height = nodes.starts[s + 1] - nodes.starts[s]
    width = np.int64(nodes.first[s + 1] - nodes.first[s])
    return values[nodes.panels[s] : nodes.panels[s + 1]].reshape(height, width)


@pasted
def rows_below(nodes, s):
    """Return the rows of supernode s that are not columns of it."""
    begin = nodes.starts[s] + nodes.first[s + 1] - nodes.first[s]
    return nodes.rows[begin : nodes.starts[s + 1]]


@part
def solve_unit_lower(nodes, L, x):
    """Overwrite x, in elimination order, by L^-1 x; the unit diagonal is not read."""
    for s in range(nodes.first.size - 1):
        own = nodes.rows[nodes.starts[s] : nodes.starts[s + 1]]
        panel = panel_of(nodes, L, s)
        f, k = panel.shape
        block = x[nodes.first[s] : nodes.first[s + 1]]
        for i in range(1, k):
            block[i] -= dot(panel[i, :i], block[:i])
        for i in range(k, f):
            x[own[i]] -= dot(panel[i], block)


@kernel(error_model="numpy")
def factorise(nodes, data, L, D, places, stack, front, work, clock):
    """Set L and D; return False if a pivot is zero, or after Ctrl-C.

    places (2, size), stack, front and work are overwritten. When a supernode is
    eliminated, the updates of its children are in its panel, or on top of the stack.
    """
    first, parent, starts, rows = nodes.first, nodes.parent, nodes.starts, nodes.rows
    number = first.size - 1
    watch = np.empty(WATCH_SIZE, dtype=np.int64)
    begin_watch(watch, clock)
    waiting = np.zeros(number, dtype=np.int32)
    left = np.empty(number, dtype=np.int32)  # supernodes whose update is on the stack
    count = 0
    top = 0
    position, place = places
    assemble_panels(nodes, data, position, L)
    for s in range(number):
        own, above = rows[starts[s] : starts[s + 1]], parent[s]
        panel, pivots = panel_of(nodes, L, s), D[first[s] : first[s + 1]]
        f, k = panel.shape
        u = f - k
        # All its rows are columns of its parent; never at a root, whose parent is -1.
        is_inside = own[f - 1] < first[above + 1]
        adds = waiting[s] > 0
        update = front[: u * u].reshape(u, u)
        if adds:
            for i in range(f):
                position[own[i]] = i
            for i in range(u):
                for j in range(i + 1):
                    update[i, j] = 0.0
        elif not is_inside:
            update = stack[top : top + u * u].reshape(u, u)
        for _ in range(waiting[s]):
            count -= 1
            child = left[count]
            theirs = rows_below(nodes, child)
            top -= theirs.size * theirs.size
            for i in range(theirs.size):
                place[i] = position[theirs[i]]
            extend_add(stack[top:], place[: theirs.size], panel, update)
        if not eliminate_panel(panel, pivots, work, watch):
            return False
        if u == 0:
            continue
        if is_inside:
            into = panel_of(nodes, L, above)
            for i in range(u):
                place[i] = own[k + i] - first[above]
            if not adds and u * k <= SMALL_PRODUCT:
                subtract_product(panel, pivots, place[:u], into)
                continue
        complement(panel, pivots, adds, update, work, watch)
        if is_inside:
            add_lower(update, place[:u], into)
            continue
        if adds:
            copy(front[: u * u], stack[top:])
        top += u * u
        left[count] = s
        count += 1
        waiting[above] += 1
    return True


@part
def assemble_panels(nodes, data, position, L):
    """Set the panels to the entries of the matrix; position is overwritten."""
    first, starts, rows = nodes.first, nodes.starts, nodes.rows
    lower, below, source = nodes.lower, nodes.below, nodes.source
    for t in range(L.size):
        L[t] = 0.0
    for s in range(first.size - 1):
        panel = panel_of(nodes, L, s)
        for i in range(panel.shape[0]):
            position[rows[starts[s] + i]] = i
        for j in range(panel.shape[1]):
            for t in range(lower[first[s] + j], lower[first[s] + j + 1]):
                panel[position[below[t]], j] = data[source[t]]


@part
def subtract_product(panel, D, place, into):
    """Subtract L D L', L the panel below row k, at these places of a panel above."""
    f, k = panel.shape
    for i in range(f - k):
        line = into[place[i]]
        for p in range(k):
            x = panel[k + i, p] * D[p]
            for j in range(i + 1):
                line[place[j]] -= x * panel[k + j, p]


@part
def add_lower(update, place, into):
    """Add the lower triangle of an update at these places of a panel above."""
    u = place.size
    if place[u - 1] - place[0] == u - 1:
        for i in range(u):
            line = into[place[i], place[0] :]
            for j in range(i + 1):
                line[j] += update[i, j]
        return
    for i in range(u):
        line = into[place[i]]
        for j in range(i + 1):
            line[place[j]] += update[i, j]


@kernel
def stack_size(parent, order):
    """Return the largest number of entries of updates on the stack at a time."""
    waiting = np.zeros(parent.size, dtype=np.int64)
    size, most = 0, 1
    for s in range(parent.size):
        entries = order[s] * order[s]
        size += entries - waiting[s]
        most = max(most, size)
        if parent[s] >= 0:
            waiting[parent[s]] += entries
    return most


@part
def extend_add(child, place, panel, update):
    """Add the lower triangle of a child's update, at these places of the front."""
    u, k = place.size, panel.shape[1]
    split = 0
    while split < u and place[split] < k:
        split += 1
    consecutive = split < u and place[u - 1] - place[split] == u - 1 - split
    for i in range(u):
        line, row = child[i * u : i * u + i + 1], place[i]
        for j in range(min(split, i + 1)):
            panel[row, place[j]] += line[j]
        if i < split:
            continue
        if consecutive:  # several at a time, without indices
            to, rest = update[row - k, place[split] - k :], line[split:]
            for j in range(rest.size):
                to[j] += rest[j]
        else:
            to = update[row - k]
            for j in range(split, i + 1):
                to[place[j] - k] += line[j]


@part
def eliminate_panel(panel, D, work, watch):
    """Overwrite the panel (f, k) by its columns of L, set D; False if a pivot is 0."""
    f, k = panel.shape
    for start in range(0, k, BLOCK):
        if is_over(watch, f * BLOCK * BLOCK):
            return False
        stop = min(start + BLOCK, k)
        width = stop - start
        for j in range(start, stop):
            # row j of the block: first L D, then L
            for i in range(start, j):
                panel[j, i] -= dot(panel[j, start:i], panel[i, start:i])
            pivot = panel[j, j]
            for i in range(start, j):
                x = panel[j, i]
                panel[j, i] = x / D[i]
                pivot -= x * panel[j, i]
            if not abs(pivot) > 0.0:
                return False
            D[j] = pivot
        if stop == f:
            break
        block = work[: (f - stop) * width].reshape(f - stop, width)
        solve_rows(panel[start:stop, start:stop], True, panel[stop:f, start:stop])
        for i in range(f - stop):
            for j in range(width):
                x = panel[stop + i, start + j]
                block[i, j] = x
                panel[stop + i, start + j] = x / D[start + j]
        for row in range(stop, f, ROW_STRIP):
            if stop < k and not is_over(watch, ROW_STRIP * width * (k - stop)):
                end = min(row + ROW_STRIP, f)
                last = min(end, k)
                product(
                    -1.0, block[row - stop : end - stop, :width],
                    panel[stop:last, start:stop], 1.0, panel[row:end, stop:last],
                )  # fmt: skip
    return True


@part
def complement(panel, D, adds, update, work, watch):
    """Set the update's lower triangle to - L D L', L the panel below row k.

    With `adds` it is subtracted from the update.
    """
    f, k = panel.shape
    u = f - k
    if u * k <= SMALL_PRODUCT:
        for i in range(u):
            for j in range(i + 1):
                update[i, j] = update[i, j] if adds else 0.0
            for p in range(k):
                x = panel[k + i, p] * D[p]
                for j in range(i + 1):
                    update[i, j] -= x * panel[k + j, p]
        return
    beta = 1.0 if adds else 0.0
    scaled = work[: u * k].reshape(u, k)
    for i in range(u):
        for p in range(k):
            scaled[i, p] = panel[k + i, p] * D[p]
    for row in range(0, u, ROW_STRIP):
        end = min(row + ROW_STRIP, u)
        if is_over(watch, ROW_STRIP * k * end):
            return
        product(-1.0, scaled[row:end], panel[k : k + end], beta, update[row:end, :end])


@kernel(error_model="numpy")
def solve_fronts(nodes, L, D, u):
    """Overwrite u, in elimination order, by the solution of L D L' x = u."""
    first, starts, rows = nodes.first, nodes.starts, nodes.rows
    solve_unit_lower(nodes, L, u)
    for j in range(u.size):
        u[j] /= D[j]
    for s in range(first.size - 2, -1, -1):
        own = rows[starts[s] : starts[s + 1]]
        panel = panel_of(nodes, L, s)
        f, k = panel.shape
        block = u[first[s] : first[s + 1]]
        for i in range(k, f):
            add_scaled(-u[own[i]], panel[i], block)
        for i in range(k - 1, 0, -1):
            add_scaled(-block[i], panel[i, :i], block[:i])
