"""The numbers and vectors of one solve by pivoting, by name.

Compiled functions take them as one record `m` of numbers and addresses:
``floats(m.z, m.n)`` is the vector z. In Python, `PivotMemory` has the same names.
"Scaled" refers to the problem with a unit diagonal.
"""

import ctypes
from typing import Any

import numpy as np
from scipy import sparse

from namlcp.compiled import fields, floats, ints, kernel, longs, part, record_at
from namlcp.linalg.columns import Columns
from namlcp.linalg.lapack import copy

# Vectors of n numbers.
VECTORS = (
    # The scaled problem D A D, q, lower, upper; d is the diagonal of D.
    "q lower upper d "
    # The iterate, w = A z + q, the proximal point, and the best z so far.
    "z w centre best "
    # Right-hand side and diagonal shift of the free system.
    "rhs shift"
)
# Vectors of n int32.
FLAGS = (
    # -1 at the lower bound, 1 at the upper one, 0 free; the states that the signs of z
    # and w ask for; 1 where a_ii > 0, elsewhere d = 1.
    "state goal has_unit "
    # The first m.ordered entries are unknowns in elimination order; their positions in
    # it, -1 for others; -1 between its uses as work array.
    "sequence rank local"
)
FLAG_NAMES = FLAGS.split()
# All vectors, in the order of their addresses: each has room for n float64.
NAMES = (*VECTORS.split(), *FLAG_NAMES)
COUNT = len(NAMES)


class PivotState(ctypes.Structure):
    """Numbers and addresses: attributes in Python, fields in compiled code."""

    _fields_ = fields(
        (VECTORS, int),
        (FLAGS, int),
        # Unknowns; entries of the matrix unless it is dense; whether it is.
        ("n entries", int),
        ("is_dense", bool),
        # The matrix by `Columns`: its pattern unless it is dense, its values, and these
        # scaled.
        ("indptr indices values scaled", int),
        # Tolerances; scaled Res at clip(0); least scaled Res so far.
        ("eps_abs eps_rel size best_residual", float),
        # The proximal parameter, and what counts as 0 in z and w (scaled).
        ("rho tolerance", float),
        # Factorisations, proximal steps, elimination orders made, unknowns in order.
        ("factorisations outer_steps orderings ordered", int),
        # Fewest wrong signs so far; changes of states left until there must be fewer.
        ("fewest_wrong patience", int),
        # Given: A = A'; the caller solves the free systems; find out `convex`.
        ("symmetric external_solve ask_convex", bool),
        # Found: the tolerance is met; A is semidefinite.
        ("solved convex", bool),
        # Progress: scaled; states or rho have changed.
        ("started must_factor", bool),
    )


state_at = record_at(PivotState)


class PivotMemory:
    """The state of a solve; `now` has the numbers, and vectors are attributes.

    `address` is that of the record, which compiled functions take.
    """

    def __init__(self, columns: Columns, *vectors: np.ndarray) -> None:
        """Allocate for the user's matrix; `vectors` as for `lay_out_vectors`."""
        self.now = PivotState()
        self.address = ctypes.addressof(self.now)
        self.columns, self.n = columns, vectors[0].size
        size = COUNT * self.n + columns.dense.size + columns.data.size
        self.memory = np.zeros(size)
        lay_out_vectors(self.address, columns, vectors, self.memory)

    @property
    def scaled(self) -> sparse.csc_array:
        """The scaled matrix, where it is compressed."""
        data, columns = self.memory[COUNT * self.n :], self.columns
        arrays = data, columns.indices, columns.indptr
        return sparse.csc_array(arrays, shape=(self.n, self.n))

    def __getattr__(self, name: str) -> Any:
        """Return the vector of this name, a view of the memory of compiled code."""
        if name not in NAMES:
            raise AttributeError(f"pivoting has no vector {name!r}")
        start = self.n * NAMES.index(name)
        vector = self.memory[start : start + self.n]
        return vector.view(np.int32)[: self.n] if name in FLAG_NAMES else vector


@kernel
def lay_out_vectors(address, columns, vectors, memory):
    """Note where the matrix is, and give every vector its place in `memory`, all 0.

    vectors = (q, lower, upper, z), which are copied; z, the start, may be empty.
    """
    m = state_at(address)
    dense, indptr, indices, data = columns
    q, lower, upper, start = vectors
    m.n, m.is_dense, m.entries = q.size, dense.shape[0] > 0, data.size
    m.indptr, m.indices = indptr.ctypes.data, indices.ctypes.data
    m.values = dense.ctypes.data if m.is_dense else data.ctypes.data
    addresses = longs(address, COUNT)
    for i in range(COUNT):
        addresses[i] = memory.ctypes.data + 8 * m.n * i
    m.scaled = memory.ctypes.data + 8 * m.n * COUNT
    copy(q, floats(m.q, m.n))
    copy(lower, floats(m.lower, m.n))
    copy(upper, floats(m.upper, m.n))
    copy(start, floats(m.z, m.n))
    rank, local = ints(m.rank, m.n), ints(m.local, m.n)
    for i in range(m.n):
        rank[i] = -1
        local[i] = -1


@kernel
def best_point(address, lower, upper):
    """Return the best z so far, in the caller's scaling and between these bounds."""
    m = state_at(address)
    best, d = floats(m.best, m.n), floats(m.d, m.n)
    z = np.empty(m.n)
    for i in range(m.n):
        z[i] = min(max(best[i] * d[i], lower[i]), upper[i])
    return z


@part
def matrix_of(m, values):
    """Return the `Columns` that have the pattern of the matrix and these values."""
    rows, ends = (m.n, 0) if m.is_dense else (0, m.n + 1)
    return Columns(
        floats(values, (rows, m.n)),
        ints(m.indptr, ends),
        ints(m.indices, m.entries),
        floats(values, m.entries),
    )


@part
def bounds_of(m):
    return floats(m.lower, m.n), floats(m.upper, m.n)
