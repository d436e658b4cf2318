"""The memory of one solve of `pivoting`, and what stands where in it."""

from typing import NamedTuple

import numpy as np

from namlcp.compiled import part
from namlcp.lcp.pivoting.faces import Ordering
from namlcp.linalg import Columns

# Rows of `Work.vectors`; Q, LOWER, UPPER belong to the scaled problem.
Q, LOWER, UPPER, D, Z, W, CENTRE, BEST_Z, RHS, SHIFT, PATH, WL, WU = range(13)
X, S = 13, 14  # see `search`
# Rows of `Work.marks`.
STATE, GOAL, UNIT, SEQUENCE, RANK, LOCAL = range(6)
# Places in `Work.counter`.
STARTED, FACTORED, OUTER, FEWEST, PATIENCE, STALE, PATHED, OUTSIDE = range(8)
ORDERED, ORDERINGS = 8, 9
CURVATURE, ASKED, CONVEX, SEARCHING = 10, 11, 12, 13
# Places in `Work.scalar`.
RHO, TOLERANCE, SIZE, EPS_ABS, EPS_REL, BEST, MET, FIRST_MU = range(8)


class Work(NamedTuple):
    """All memory of one solve, made by `workspace`; the rows and places are above.

    scaled: the matrix with a unit diagonal. vectors (15, n), marks (6, n) int32,
    counter (14,) int64, scalar (8,).
    """

    scaled: Columns
    vectors: np.ndarray
    marks: np.ndarray
    counter: np.ndarray
    scalar: np.ndarray


class Problem(NamedTuple):
    """Box LCP scaled by d to a unit diagonal; where that failed d = 1, unit = 0."""

    columns: Columns
    symmetric: bool
    q: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    d: np.ndarray
    unit: np.ndarray


def workspace(columns: Columns, n: int) -> Work:
    """Return the memory for a problem of order n, nothing begun."""
    scaled = columns._replace(
        dense=np.empty_like(columns.dense), data=np.empty_like(columns.data)
    )
    marks = np.zeros((6, n), dtype=np.int32)
    marks[RANK:] = -1
    return Work(
        scaled,
        np.zeros((15, n)),
        marks,
        np.zeros(14, dtype=np.int64),
        np.zeros(8),
    )


@part
def problem_in(work, symmetric):
    """Return the scaled problem as views of the workspace."""
    v = work.vectors
    return Problem(
        work.scaled, symmetric, v[Q], v[LOWER], v[UPPER], v[D], work.marks[UNIT]
    )


@part
def ordering_in(work):
    """Return the elimination order as views of the workspace."""
    m = work.marks
    return Ordering(m[SEQUENCE], m[RANK], m[LOCAL], work.counter[ORDERED:])
