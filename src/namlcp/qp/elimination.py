"""What a factorisation will do, counted in advance: order, tree, supernodes.

The elimination tree has an edge from every column of L to the row of its first entry
below the diagonal; the pattern of a column is then a subset of its parent's. Columns of
L with nearly the same pattern form a *supernode*. The order is SuperLU's minimum degree
on the pattern of K; tree and counts: J. Liu, SIAM J. Matrix Anal. Appl. 11 (1990)
134-172; supernodes are relaxed as in CHOLMOD (Chen, Davis, Hager, Rajamanickam, ACM
Trans. Math. Softw. 35, 2008).
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import spilu

MERGE = (4, 1.0), (16, 0.8), (48, 0.1), (1 << 30, 0.05)
"""Two supernodes become one of so many columns if at most this share are zeros."""


class Order(NamedTuple):
    """A fill-reducing order in which every column follows its descendants.

    place (size,) has the new position of every row, parent (size,) the elimination tree
    in new positions, counts (size,) the entries of L below the diagonal.
    """

    place: np.ndarray
    parent: np.ndarray
    counts: np.ndarray

    @property
    def work(self) -> float:
        """Multiplications of a factorisation, about half of them in the updates."""
        return float((self.counts.astype(np.float64) ** 2).sum())


def minimum_degree(indptr: np.ndarray, indices: np.ndarray) -> Order:
    """Order a symmetric matrix, its upper triangle given in CSC."""
    size = indptr.size - 1
    ones = csc_matrix((np.ones(indices.size), indices, indptr), shape=(size, size))
    identity = (ones + ones.T).tocsc()
    identity.data -= 1.0  # the diagonal was there twice; zeros keep their places
    # Nothing is factored: everything but the diagonal is dropped.
    place = spilu(
        identity,
        drop_tol=1.0,
        fill_factor=1.0,
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    ).perm_c.astype(np.int32)
    return postordered(indptr, indices, place)


def postordered(indptr: np.ndarray, indices: np.ndarray, place: np.ndarray) -> Order:
    """Return the order `place` rearranged, with the same fill."""
    parent, _ = elimination_tree(*permuted(indptr, indices, place)[:2])
    place = postorder(parent)[place]
    return Order(place, *elimination_tree(*permuted(indptr, indices, place)[:2]))


@njit(cache=True, nogil=True)
def permuted(indptr, indices, place):
    """Return the permuted upper triangle in CSC, and where its entries come from."""
    size = place.size
    columns = np.zeros(size + 1, dtype=np.int32)
    for j in range(size):
        for t in range(indptr[j], indptr[j + 1]):
            columns[max(place[indices[t]], place[j]) + 1] += 1
    for j in range(size):
        columns[j + 1] += columns[j]
    next_entry = columns[:size].copy()
    rows = np.empty_like(indices)
    source = np.empty_like(indices)
    for j in range(size):
        for t in range(indptr[j], indptr[j + 1]):
            k = max(place[indices[t]], place[j])
            rows[next_entry[k]] = min(place[indices[t]], place[j])
            source[next_entry[k]] = t
            next_entry[k] += 1
    return columns, rows, source


@njit(cache=True, nogil=True)
def by_first(columns, rows, source):
    """Return the lower triangle in CSC from the upper one: column pointers, rows, t."""
    size = columns.size - 1
    lower = np.zeros(size + 1, dtype=np.int32)
    for i in rows:
        lower[i + 1] += 1
    for j in range(size):
        lower[j + 1] += lower[j]
    next_entry = lower[:size].copy()
    below = np.empty_like(rows)
    origin = np.empty_like(source)
    for j in range(size):
        for t in range(columns[j], columns[j + 1]):
            k = next_entry[rows[t]]
            below[k] = j
            origin[k] = source[t]
            next_entry[rows[t]] = k + 1
    return lower, below, origin


@njit(cache=True, nogil=True)
def elimination_tree(columns, rows):
    """Return the parent of every column, -1 at a root, and its entries of L."""
    size = columns.size - 1
    parent = np.full(size, -1, dtype=np.int32)
    count = np.zeros(size, dtype=np.int32)
    seen = np.full(size, -1, dtype=np.int32)
    for j in range(size):
        seen[j] = j
        for t in range(columns[j], columns[j + 1]):
            i = rows[t]
            while seen[i] != j:  # L[j, i] is an entry, and so on up the tree
                seen[i] = j
                count[i] += 1
                if parent[i] < 0:
                    parent[i] = j
                i = parent[i]
    return parent, count


@njit(cache=True, nogil=True)
def postorder(parent):
    """Return the position of every node when each follows its descendants."""
    size = parent.size
    head = np.full(size + 1, -1, dtype=np.int32)  # the last list: the roots
    following = np.empty(size, dtype=np.int32)
    for j in range(size - 1, -1, -1):
        k = parent[j] if parent[j] >= 0 else size
        following[j] = head[k]
        head[k] = j
    place = np.empty(size, dtype=np.int32)
    path = np.empty(size + 1, dtype=np.int32)
    path[0] = size
    depth = 0
    done = 0
    while depth >= 0:
        k = path[depth]
        child = head[k]
        if child >= 0:
            head[k] = following[child]
            depth += 1
            path[depth] = child
        else:
            if k < size:
                place[k] = done
                done += 1
            depth -= 1
    return place


@njit(cache=True, nogil=True)
def fundamental(parent, count):
    """Return the first columns of chains in which L loses one row a column."""
    size = parent.size
    starts = np.empty(size + 1, dtype=np.int32)
    children = np.zeros(size, dtype=np.int32)
    for j in range(size):
        if parent[j] >= 0:
            children[parent[j]] += 1
    found = 0
    for j in range(size):
        alone = j == 0 or parent[j - 1] != j or children[j] != 1
        if alone or count[j - 1] != count[j] + 1:
            starts[found] = j
            found += 1
    starts[found] = size
    return starts[: found + 1]


def supernodes(parent: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """Return the first column of every supernode, and the number of columns."""
    widths = np.array([width for width, _ in MERGE])
    shares = np.array([share for _, share in MERGE])
    return merged(fundamental(parent, counts), parent, counts, widths, shares)


@njit(cache=True, nogil=True)
def merged(starts, parent, count, widths, shares):
    """Merge a supernode with the next if that is its parent and few zeros arise."""
    number = starts.size - 1
    end = starts[1:].copy()  # of the group that begins here
    zeros = np.zeros(number)
    follower = np.empty(number, dtype=np.int32)  # the group to the right
    is_first = np.empty(number, dtype=np.bool_)
    for s in range(number):
        follower[s] = s + 1
        is_first[s] = True
    for s in range(number - 2, -1, -1):
        other = follower[s]
        above = parent[starts[s + 1] - 1]
        if other == number or above < starts[other] or above >= end[other]:
            continue
        left = starts[s + 1] - starts[s]
        width = end[other] - starts[s]
        below = count[end[other] - 1]
        new = left * (width - left + below - count[starts[s + 1] - 1])
        total = zeros[s] + zeros[other] + new
        entries = 0.5 * width * (width + 1.0) + width * below
        k = 0
        while width > widths[k]:
            k += 1
        if total <= shares[k] * entries:
            is_first[other] = False
            end[s] = end[other]
            follower[s] = follower[other]
            zeros[s] = total
    first = np.empty(number + 1, dtype=np.int32)
    found = 0
    for s in range(number):
        if is_first[s]:
            first[found] = starts[s]
            found += 1
    first[found] = starts[number]
    return first[: found + 1]


@njit(cache=True, nogil=True)
def row_patterns(lower, below, first, starts, parent, rows):
    """Set the rows of every supernode: its columns, its entries, its children's."""
    number = first.size - 1
    head = np.full(number, -1, dtype=np.int32)
    following = np.full(number, -1, dtype=np.int32)
    seen = np.full(first[number], -1, dtype=np.int32)
    for s in range(number):
        nnz = starts[s]
        for j in range(first[s], first[s + 1]):
            rows[nnz] = j
            seen[j] = s
            nnz += 1
        for j in range(first[s], first[s + 1]):
            for t in range(lower[j], lower[j + 1]):
                i = below[t]
                if seen[i] != s:
                    seen[i] = s
                    rows[nnz] = i
                    nnz += 1
        child = head[s]
        while child >= 0:
            width = first[child + 1] - first[child]
            for t in range(starts[child] + width, starts[child + 1]):
                i = rows[t]
                if seen[i] != s:
                    seen[i] = s
                    rows[nnz] = i
                    nnz += 1
            child = following[child]
        if parent[s] >= 0:
            following[s] = head[parent[s]]
            head[parent[s]] = s


def sort_parts(values: np.ndarray, starts: np.ndarray, size: int) -> None:
    """Sort values, all below `size`, between one start and the next."""
    part = np.repeat(np.arange(starts.size - 1), np.diff(starts))
    keys = part * size + values
    keys.sort()
    values[:] = keys - part * size


@njit(cache=True, nogil=True)
def stack_room(parent, order):
    """Return the entries of all updates that wait for their parents at a time."""
    waiting = np.zeros(parent.size, dtype=np.int64)
    room = 0
    most = 1
    for s in range(parent.size):
        entries = order[s] * order[s]
        room += entries - waiting[s]
        most = max(most, room)
        if parent[s] >= 0:
            waiting[parent[s]] += entries
    return most
