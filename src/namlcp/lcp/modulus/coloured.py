"""Multithreaded sweeps by block colouring, with results independent of the threads.

The rows are cut into blocks of consecutive rows. Blocks that no entry of A couples may
be swept at the same time. So the graph of the blocks is coloured greedily, and the
colours are swept one after the other; rows keep their order within a block. This is a
sweep in another order of the unknowns, where L has the entries of earlier colours and
of earlier rows of the same block. Every method of `sweeps` and every theorem about it
holds with the L and U of this order.

If A is banded, as for meshes numbered row by row, blocks longer than the bandwidth are
coupled with their neighbours alone, and two or three colours suffice. Blocks depend on
A alone: they have 2^12 rows, or twice as many until there are few colours. If the
entries of A are scattered a single block remains, that is, the natural order on one
thread; `scipy.sparse.csgraph.reverse_cuthill_mckee` can reorder such an A.

Adams and Jordan, SIAM J. Sci. Stat. Comput. 7 (1986) 490-506, compare such orders.
"""

import threading
from typing import Any, NamedTuple

import numba
import numpy as np
from numba import prange

from namlcp.compiled import kernel
from namlcp.lcp.modulus.kernels import sweep_rows
from namlcp.lcp.modulus.methods import Method
from namlcp.linalg import arrays_of
from namlcp.options import check_count

LEAST_SHIFT = 12
"""log2 of the least number of rows in a block: 4096 rows take some 30 us."""

BLOCKS_A_COLOUR = 4
"""Least number of blocks for each colour, on average."""

ONE_LAUNCH = threading.Lock()
"""Held during a parallel kernel: Numba's workqueue aborts on concurrent launches."""


def coloured_sweep(A: Any, method: Method, threads: int) -> "BlockSweep":
    """Return the sweep of A on some threads; raise if A or the method has none."""
    check_count("threads", threads)
    if method.factored or isinstance(A, np.ndarray):
        raise ValueError(
            "threads is for a sparse A and a triangular method, got a "
            f"{'dense' if isinstance(A, np.ndarray) else 'sparse'} A and a method that "
            f"{'factors' if method.factored else 'sweeps'}"
        )
    return BlockSweep(A, threads)


class Colours(NamedTuple):
    """Blocks of 2^shift rows and the colour of each.

    The blocks of colour c are order[starts[c]:starts[c + 1]]. `sums` is work space, one
    number for each block.
    """

    shift: int
    colour: np.ndarray
    order: np.ndarray
    starts: np.ndarray
    sums: np.ndarray


class BlockSweep:
    """One sweep over a csr_array on several threads, in blocks of >= 2^shift rows.

    Column indices are ascending and unique in each row. Numba's own limit on threads
    holds, too.
    """

    def __init__(self, A: Any, threads: int, shift: int = LEAST_SHIFT):
        self.A = arrays_of(A)
        self.threads = min(threads, numba.config.NUMBA_NUM_THREADS)
        while True:
            colour, colours = coloured(A, shift)
            if colour.size == 1 or colour.size >= BLOCKS_A_COLOUR * colours:
                break
            shift += 1
        order = np.argsort(colour, kind="stable")
        starts = np.searchsorted(colour[order], np.arange(colours + 1))
        self.colours = Colours(shift, colour, order, starts, np.empty(colour.size))

    def __call__(self, *arguments: Any) -> float:
        """Do what `sweep_csr` does, for its arguments from `vectors` on."""
        with ONE_LAUNCH:
            before = numba.get_num_threads()
            numba.set_num_threads(self.threads)
            try:
                return sweep_blocks(self.A, *arguments, self.colours)
            finally:
                numba.set_num_threads(before)


def coloured(A: Any, shift: int) -> tuple[np.ndarray, int]:
    """Return the colour of each block of 2^shift rows, and the number of colours.

    Each block in turn gets the least colour that no earlier block coupled with it has.
    """
    blocks = max((A.shape[0] + (1 << shift) - 1) >> shift, 1)
    coupled = np.zeros((blocks, blocks), dtype=np.bool_)
    couple(A.indices, A.indptr, shift, coupled)
    coupled |= coupled.T
    colour = np.zeros(blocks, dtype=np.int64)
    for b in range(1, blocks):
        taken = colour[:b][coupled[b, :b]]
        free = np.ones(b + 1, dtype=np.bool_)
        free[taken] = False
        colour[b] = np.argmax(free)
    return colour, int(colour.max()) + 1


@kernel
def couple(indices, indptr, shift, coupled):
    """Set coupled[b, c] if a row of block b has an entry in block c."""
    for i in range(indptr.size - 1):
        for k in range(indptr[i], indptr[i + 1]):
            coupled[i >> shift, indices[k] >> shift] = True


@kernel(parallel=True)
def sweep_blocks(A, vectors, G, H, old, new, colours):
    """Do what `kernels.sweep_csr` does, colour by colour; A is `Compressed`."""
    order, starts, sums = colours.order, colours.starts, colours.sums
    for c in range(starts.size - 1):
        for t in prange(starts[c], starts[c + 1]):
            b = order[t]
            sums[b] = sweep_rows(A, vectors, G, H, old, new, colours, b)
    total = 0.0
    for b in range(sums.size):  # in an order that does not depend on the threads
        total += sums[b]
    return np.sqrt(total)
