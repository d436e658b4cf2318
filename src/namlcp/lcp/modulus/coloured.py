"""Sweeps on several threads: blocks of rows, coloured; threads never change a digit.

The rows are cut into blocks of consecutive rows. Blocks that no entry of A couples may
be swept at once, so the graph of the blocks is coloured greedily and the colours are
swept one after the other; inside a block the rows keep their order. That is a
Gauss-Seidel sweep in another order of the unknowns, "lower" meaning an earlier colour,
or an earlier row of the same block: every method of `sweeps` and every theorem about it
stays as it is, with the L and U of this order, and which thread takes which block does
not matter. A is read where it is, contiguously, and only once; the only new arrays are
as long as there are blocks.

Where A has a band, as in meshes numbered row by row, blocks longer than the band couple
with their neighbours alone and two or three colours do. Blocks are chosen from A alone:
2^12 rows each, and twice as many until there are few colours. An A whose numbering is
scattered ends with a single block, that is, in natural order on one thread (order it by
`scipy.sparse.csgraph.reverse_cuthill_mckee`).

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
from namlcp.lcp.relaxation import rows_of
from namlcp.options import check_count

LEAST_SHIFT = 12
"""Blocks have 2^12 = 4096 rows at the least: work for some 30 us."""

BLOCKS_A_COLOUR = 4
"""Blocks of each colour at the least, on average."""

ONE_LAUNCH = threading.Lock()
"""Numba's own pool of threads ends the process where two launches meet."""


def coloured_sweep(A: Any, method: Method, threads: int) -> "BlockSweep":
    """Return the sweep of A on that many threads; raise if there is none."""
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

    The blocks of colour c are order[starts[c]:starts[c + 1]]. sums: work, a number for
    each block.
    """

    shift: int
    colour: np.ndarray
    order: np.ndarray
    starts: np.ndarray
    sums: np.ndarray


class BlockSweep:
    """One sweep over a csr_array on several threads.

    Parameters
    ----------
    A : (n, n) csr_array
        Column indices ascending and unique in each row.
    threads : int
        Threads at most; Numba may have been given fewer.
    shift : int
        Blocks have 2^shift rows at the least.
    """

    def __init__(self, A: Any, threads: int, shift: int = LEAST_SHIFT):
        self.A = rows_of(A)
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
        """Do what `sweep_csr` does without its first three arguments."""
        with ONE_LAUNCH:
            before = numba.get_num_threads()
            numba.set_num_threads(self.threads)
            try:
                return sweep_blocks(self.A, *arguments, self.colours)
            finally:
                numba.set_num_threads(before)


def coloured(A: Any, shift: int) -> tuple[np.ndarray, int]:
    """Return the colour of each block of 2^shift rows, and how many colours there are.

    Greedily, in order: the least colour that no coupled block before has.
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
    """Set coupled[b, c] where a row of block b has an entry in block c."""
    for i in range(indptr.size - 1):
        for k in range(indptr[i], indptr[i + 1]):
            coupled[i >> shift, indices[k] >> shift] = True


@kernel(parallel=True)
def sweep_blocks(A, vectors, G, H, old, new, colours):
    """Do what `kernels.sweep_csr` does, colour by colour."""
    order, starts, sums = colours.order, colours.starts, colours.sums
    for c in range(starts.size - 1):
        for t in prange(starts[c], starts[c + 1]):
            b = order[t]
            sums[b] = sweep_rows(A, vectors, G, H, old, new, colours, b)
    total = 0.0
    for b in range(sums.size):  # in this order, whichever thread came first
        total += sums[b]
    return np.sqrt(total)
