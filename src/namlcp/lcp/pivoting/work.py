"""The arrays and scalars of one solve by pivoting, by name.

A kernel takes an `Arena` of few arrays, since each array costs 0.1 us per call from
Python. The kernel calls `opened`, which returns the rows of the arena as a `Work` for
all other compiled functions. In Python, `PivotMemory` has the same names.
"""

import ctypes
from typing import Any, NamedTuple

import numpy as np

from namlcp.compiled import fields, new_record, part, pasted, uncounted
from namlcp.linalg import Columns


class Scalars(ctypes.Structure):
    """The numbers of one solve: attributes in Python, fields in compiled code.

    "Scaled" refers to the problem with a unit diagonal.
    """

    _fields_ = fields(
        # Tolerances; scaled Res at clip(0); least scaled Res so far.
        ("eps_abs eps_rel size best_residual", float),
        # The proximal parameter, and what counts as 0 in z and w (scaled).
        ("rho tolerance", float),
        # On the interior path: scaled Res, mean product of slack and multiplier now,
        # at most and aimed at, longest step.
        ("path_residual mu largest_mu target_mu step", float),
        # Factorisations, proximal steps, elimination orders made, unknowns in order.
        ("factorisations outer_steps orderings ordered", int),
        # Fewest wrong signs so far; changes of states left until there must be fewer.
        ("fewest_wrong patience", int),
        # Given: A = A'; the caller solves the free systems; find out `convex`.
        ("symmetric external_solve ask_convex", bool),
        # Found: the tolerance is met; A is not a P-matrix; A is semidefinite.
        ("solved not_p convex", bool),
        # Progress: scaled; an interior path was followed; changes of states are
        # searched; states or rho have changed.
        ("started path_followed line_search must_factor", bool),
    )


class Arena(NamedTuple):
    """The arrays of a solve: the scaled matrix, rows of `Work` and `Path`, scalars."""

    scaled: Columns
    vectors: np.ndarray
    marks: np.ndarray
    scalars: np.ndarray


class Work(NamedTuple):
    """The problem scaled to a unit diagonal, and the state of its solution.

    scaled: D A D. q, lower, upper, d (n,): the scaled problem, d the diagonal of D.
    z, w, centre, best: iterate, w = A z + q, proximal point, best z so far.
    rhs, shift: right-hand side and diagonal shift of the free system.
    x, s: see `line_search`.
    state: -1 at the lower bound, 1 at the upper one, 0 free; goal: the states that the
    signs of z and w ask for. has_unit: 1 where a_ii > 0, elsewhere d = 1.
    sequence: the first now.ordered entries are unknowns in elimination order; rank:
    their place in it, -1 for others; local: work array, -1 between its uses.
    now: the record of `Scalars`.
    """

    scaled: Columns
    q: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    d: np.ndarray
    z: np.ndarray
    w: np.ndarray
    centre: np.ndarray
    best: np.ndarray
    rhs: np.ndarray
    shift: np.ndarray
    x: np.ndarray
    s: np.ndarray
    state: np.ndarray
    goal: np.ndarray
    has_unit: np.ndarray
    sequence: np.ndarray
    rank: np.ndarray
    local: np.ndarray
    now: Any


class Path(NamedTuple):
    """A point of the interior path and the step from it.

    z, wl, wu: the point, multipliers of its lower and upper bounds, 0 where the bound
    is infinite or l = u. dz, dwl, dwu: the direction. low, high: second-order terms of
    the products, to be subtracted. old_...: the direction before the last corrector.
    """

    z: np.ndarray
    wl: np.ndarray
    wu: np.ndarray
    dz: np.ndarray
    dwl: np.ndarray
    dwu: np.ndarray
    low: np.ndarray
    high: np.ndarray
    old_dz: np.ndarray
    old_dwl: np.ndarray
    old_dwu: np.ndarray


def row_of(row: int) -> Any:
    """Return a property of `PivotMemory`: one row of its vectors."""
    return property(lambda self: self.vectors[row])


class PivotMemory:
    """The arrays of a problem of order n for Python, with the names of `Work`."""

    def __init__(self, columns: Columns, n: int) -> None:
        """Allocate; `columns` are those of the user's matrix."""
        dense, indptr, indices, data = columns
        self.n = n
        self.now, scalars = new_record(Scalars)
        self.vectors = np.zeros((23, n))
        self.marks = np.zeros((6, n), dtype=np.int32)
        self.marks[4:] = -1  # rank and local
        self.scaled = Columns(
            np.empty_like(dense), indptr, indices, np.empty_like(data)
        )
        self.arena = Arena(self.scaled, self.vectors, self.marks, scalars)

    q, lower, upper, d, z, w, centre, best, rhs, shift, x, s = map(row_of, range(12))
    path_dz = row_of(15)
    state = property(lambda self: self.marks[0])
    has_unit = property(lambda self: self.marks[2])


@pasted  # numba returns no record from a function
def opened(arena):
    """Return the `Work` of an arena in compiled code."""
    A, v, m = arena.scaled, uncounted(arena.vectors), uncounted(arena.marks)
    scaled = Columns(
        uncounted(A.dense), uncounted(A.indptr), uncounted(A.indices), uncounted(A.data)
    )
    return Work(
        scaled, v[0], v[1], v[2], v[3], v[4], v[5], v[6], v[7], v[8], v[9], v[10],
        v[11], m[0], m[1], m[2], m[3], m[4], m[5], arena.scalars[0],
    )  # fmt: skip


@part
def path_in(arena):
    """Return the `Path` of an arena in compiled code."""
    v = uncounted(arena.vectors)
    return Path(
        v[12], v[13], v[14], v[15], v[16], v[17], v[18], v[19], v[20], v[21], v[22]
    )
