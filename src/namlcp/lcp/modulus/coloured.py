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
from typing import Any

import numba
import numpy as np
from numba import prange

from namlcp.compiled import kernel
from namlcp.lcp.modulus.kernels import FUSED, ONE, clip
from namlcp.lcp.modulus.methods import Method
from namlcp.options import check_count

SHIFT = 12
"""Blocks have 2^12 = 4096 rows at the least: work for some 30 us."""

SHARE = 4
"""Blocks of a colour, in the mean, at the least."""

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


class BlockSweep:
    """One sweep over a csr_array on several threads, called as a kernel of `kernels`.

    Parameters
    ----------
    A : (n, n) csr_array
        Column indices ascending and unique in each row.
    threads : int
        Threads at most; Numba may have been given fewer.
    shift : int
        Blocks have 2^shift rows at the least.
    """

    def __init__(self, A: Any, threads: int, shift: int = SHIFT):
        self.A = A.data, A.indices, A.indptr
        self.threads = min(threads, numba.config.NUMBA_NUM_THREADS)
        while True:
            colour, colours = coloured(A, shift)
            if colour.size == 1 or colour.size >= SHARE * colours:
                break
            shift += 1
        self.shift, self.colour = shift, colour
        self.order = np.argsort(colour, kind="stable")
        self.starts = np.searchsorted(colour[self.order], np.arange(colours + 1))
        self.sums = np.empty(colour.size)

    def __call__(self, *arguments: Any) -> float:
        """Do what `sweep_csr` does without its first three arguments."""
        blocks = self.shift, self.colour, self.order, self.starts, self.sums
        with ONE_LAUNCH:
            before = numba.get_num_threads()
            numba.set_num_threads(self.threads)
            try:
                return sweep_blocks(*self.A, *arguments, *blocks)
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
def sweep_blocks(
    data,
    indices,
    indptr,
    q,
    lower,
    upper,
    omega,
    inverse,
    G,
    H,
    s,
    z,
    s_next,
    z_next,
    change,
    shift,
    colour,
    order,
    starts,
    sums,
):
    """Do what `kernels.sweep_csr` does, colour by colour.

    Parameters
    ----------
    data, ..., change :
        As in `kernels.sweep_csr`.
    shift : int
        A block has 2^shift rows.
    colour : (blocks,) array
        Colour of each block.
    order, starts : arrays
        The blocks of colour c are order[starts[c]:starts[c + 1]].
    sums : (blocks,) array
        Work; no meaning on return.
    """
    for c in range(starts.size - 1):
        for t in prange(starts[c], starts[c + 1]):
            b = order[t]
            sums[b] = sweep_block(
                data,
                indices,
                indptr,
                q,
                lower,
                upper,
                omega,
                inverse,
                G,
                H,
                s,
                z,
                s_next,
                z_next,
                change,
                shift,
                colour,
                b,
            )
    total = 0.0
    for b in range(sums.size):  # in this order, whichever thread came first
        total += sums[b]
    return np.sqrt(total)


@kernel(fastmath=FUSED)
def sweep_block(
    data,
    indices,
    indptr,
    q,
    lower,
    upper,
    omega,
    inverse,
    G,
    H,
    s,
    z,
    s_next,
    z_next,
    change,
    shift,
    colour,
    b,
):
    """Sweep the rows of block b; return their part of Res(z)^2."""
    own = colour[b]
    start = b << shift
    stop = min((b + 1) << shift, s.size)
    total = 0.0
    boxed = lower.size > 0
    l = 0.0
    u = np.inf
    last = 0.0  # G ds + H dz of the row above
    k = np.uintp(indptr[start])
    for row in range(start, stop):
        i = np.uintp(row)
        end = np.uintp(indptr[i + ONE])
        above = max(row - 1, start - 1)
        if boxed:
            l = lower[i]
            u = upper[i]
        zi = z[i]
        si = s[i]
        r = q[i]
        known = 0.0  # terms of the changes of earlier rows, but for the one above
        neighbour = 0.0  # a_{i, i-1}, 0 in the first row of the block
        j = np.int64(indices[k])
        while j < start:  # blocks before this one
            a = data[k]
            r += a * z[np.uintp(j)]
            if colour[j >> shift] < own:
                known += a * change[np.uintp(j)]
            k += ONE
            j = np.int64(indices[k])
        while j < above:
            a = data[k]
            r += a * z[np.uintp(j)]
            known += a * change[np.uintp(j)]
            k += ONE
            j = np.int64(indices[k])
        if j == above:
            neighbour = data[k]
        while k < end:
            r += data[k] * z[np.uintp(indices[k])]
            k += ONE
        back = end - ONE
        j = np.int64(indices[back])
        while j >= stop:  # blocks after this one
            if colour[j >> shift] < own:
                known += data[back] * change[np.uintp(j)]
            back -= ONE
            j = np.int64(indices[back])
        x = clip(zi - r, l, u)
        total += (zi - x) * (zi - x)
        inv = inverse[i]
        ds = (2.0 * (omega[i] * (zi - si) - r) - known) * inv
        x = (si + ds) - (neighbour * inv) * last
        s_next[i] = x
        y = clip(x, l, u)
        z_next[i] = y
        last = G * (x - si) + H * (y - zi)
        change[i] = last
    return total
