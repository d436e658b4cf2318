"""Symbolic analysis for a sparse factorisation: order, elimination tree, supernodes.

The parent of a column of L in the elimination tree is the row of its first entry below
the diagonal; below that row, the pattern of a column is a subset of its parent's.
Columns of L with nearly the same pattern form a *supernode*, a dense block for BLAS.
The order is that of `minimum_degree`, or METIS's nested dissection. Tree and counts: J.
Liu, SIAM J. Matrix Anal. Appl. 11 (1990) 134-172; supernodes are relaxed as in CHOLMOD
(Chen, Davis, Hager, Rajamanickam, ACM Trans. Math. Softw. 35, 2008). Of a symmetric
matrix, in CSC, only the upper triangle is read.
"""

from typing import NamedTuple

import numpy as np
from scipy.sparse import csc_matrix

from namlcp.checks import refuse_size, transposed
from namlcp.linalg.elimination import (
    merged,
    permuted,
    postordered_tree,
    row_patterns,
)

MERGE = np.array(((4, 0.5), (16, 0.3), (48, 0.1), (1 << 30, 0.05)))
"""(Columns, fraction): supernodes are merged into one of at most so many columns if at
most that fraction of its entries are explicit zeros."""


class Order(NamedTuple):
    """A fill-reducing order in which every column follows its descendants.

    place (n,) has the new position of every row, -1 for those left out, parent (size,)
    the elimination tree in new positions, counts (size,) the entries of L below the
    diagonal.
    """

    place: np.ndarray
    parent: np.ndarray
    counts: np.ndarray

    @property
    def work(self) -> float:
        """Multiplications of a factorisation, about half of them in the updates."""
        counts = self.counts.astype(np.float64)
        return float(counts @ counts)


class Supernodes(NamedTuple):
    """The layout of L; all indices are positions in the order.

    Supernode s has the columns first[s] : first[s + 1], its rows are rows[starts[s] :
    starts[s + 1]], ascending, its own columns first. Its block, row-major, is
    panels[s] : panels[s + 1] of the values, parent[s] the supernode of its first row
    below the block, -1 if there is none. node (size,) tells the supernode of a column.
    Column j of the matrix has the entries data[source[t]] in the rows below[t], for t
    in lower[j] : lower[j + 1], the diagonal included.
    """

    first: np.ndarray
    parent: np.ndarray
    node: np.ndarray
    starts: np.ndarray
    rows: np.ndarray
    panels: np.ndarray
    lower: np.ndarray
    below: np.ndarray
    source: np.ndarray


def nested_dissection(indptr: np.ndarray, indices: np.ndarray) -> Order | None:
    """Order a symmetric matrix by METIS; None without pymetis (the extra `large`).

    Separators come last (A. George, SIAM J. Numer. Anal. 10, 1973): for large matrices
    without structure this causes less fill than minimum degree, in ten times the time.
    """
    try:
        import pymetis  # here, because few problems are so large
    except ImportError:
        return None
    size = indptr.size - 1
    if size == 0:  # METIS would divide by zero
        return None
    upper = csc_matrix((np.ones(indices.size), indices, indptr), shape=(size, size))
    graph = (upper + upper.T).tocsr()
    graph.setdiag(0.0)
    graph.eliminate_zeros()
    adjacency = pymetis.CSRAdjacency(graph.indptr, graph.indices)
    _, place = pymetis.nested_dissection(adjacency)
    return postordered(indptr, indices, np.array(place, dtype=np.int32))


def postordered(indptr: np.ndarray, indices: np.ndarray, place: np.ndarray) -> Order:
    """Return the postordered equivalent of the order `place`, which is overwritten."""
    return Order(place, *postordered_tree(indptr, indices, place))


def supernodes(indptr: np.ndarray, indices: np.ndarray, order: Order) -> Supernodes:
    """Return the layout of L for a symmetric matrix in this order."""
    size = order.parent.size
    columns, upper, source = permuted(indptr, indices, order.place, size, False)
    lower, below, source = transposed(columns, upper, source.astype(float), size)
    source = source.astype(np.int32)
    first = merged(order.parent, order.counts, lower, below, MERGE)
    last = first[1:] - 1
    k = np.diff(first).astype(np.int64)
    f = k + order.counts[last]
    starts = np.concatenate(([0], np.cumsum(f)))
    panels = np.concatenate(([0], np.cumsum(f * k)))
    refuse_size("the factors", int(panels[-1]))
    node = np.repeat(np.arange(k.size, dtype=np.int32), k)
    above = order.parent[last]
    parent = np.where(above < 0, -1, node[above]).astype(np.int32)
    rows = np.empty(starts[-1], dtype=np.int32)
    row_patterns(columns, upper, starts, parent, node, rows)
    return Supernodes(first, parent, node, starts, rows, panels, lower, below, source)
