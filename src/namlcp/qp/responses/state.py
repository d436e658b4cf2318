"""The numbers and vectors of the active-set method on responses, by name.

Compiled functions take them as one record `m` of numbers and addresses, as those of
`qp/path` do: ``floats(m.s, m.length)`` is the vector s. `lay_out` gives every vector
its place in one piece of memory, so that a small QP needs no allocation at all.
"""

import ctypes

import numpy as np

from namlcp.compiled import address_of, fields, part, record_at
from namlcp.limits import WATCH_SIZE
from namlcp.linalg import FACTORS

# Addresses of vectors: those of the problem and of the result, set by `attach`, ...
GIVEN = "P q G h A b lb ub out"
# Bytes from one item of a batch to the next, 0 for what all share; items left, and the
# place of their codes.
ITEMS = "".join(f"{name}_step " for name in GIVEN.split()) + "items_left codes"
# ... and those in the memory of the record, set by `lay_out`.
OWN = (
    # Values of the rows, see `active`, at the base point and at the present one, and
    # their change for a multiplier that grows; 1 over the norms of the rows, see also
    # `weight`.
    "s0 s direction scale "
    # The active rows: their index, multiplier and the triangle L with L L' = S; side of
    # every row: 1 at h or ub, -1 at lb, 0 if not active. The same of the last solved
    # QP, where kept_active and kept_side have one entry for each active row.
    "active multiplier triangle side kept_active kept_side kept_triangle "
    # L^-1 w, S^-1 w, right-hand sides of S, and the cosines and sines of `remove`.
    "coefficient ratio work cosines sines "
    # Responses, the place of each row's (-1 for none), and the row of each place.
    "responses place owner "
    # Products of the judgement; the right-hand side and the change of a refinement.
    "Px Gx Ax Gtz Aty rhs change best best_multiplier "
    # The operator of a dense base problem, see `dense`: L or V, the rows of W, and U;
    # four vectors V r, and one of a product with U.
    "factor equations schur halves schur_work "
    # Where most variables are at bounds, see `free`: the free variables, the factor of
    # their part of P, the held rows divided by it and the factor of their products;
    # the product of P with the active bounds; right-hand sides of the face; the
    # multipliers of bounds by variable, and their change.
    "free free_triangle held_rows held_triangle load free_part held_part "
    "bound_multiplier bound_ratio "
    # Of `proximal`: W, and what it is made of, see `weight`; the centre of a round; the
    # direction of conjugate gradients, with the values of rows, and P times it.
    "weight shape reach centre along Palong "
    # The state of `limits.is_over`.
    "watch"
)
# Addresses of a sparse base problem, see `sparse`: its KKT matrix, a vector of its
# order, and the rows of G. Its factors are the fields FACTORS.
SPARSE = "indptr indices base rest g_starts g_columns g_values"
NUMBERS = (
    # Sizes of the QP; rows = m + n inequalities and bounds; length = rows + p; the most
    # active rows, the most responses; equations that depend on others.
    "n m p rows length most capacity skipped "
    # Active rows now and in the last solved QP; whether they changed in this solve;
    # changes since L was computed from S, now and then; rows of a hint, and how many of
    # them have been tried; whether no other solve follows.
    "k kept_k changed age kept_age hints hinted is_single "
    # The row that becomes active (-1: none), its side, and the row whose response is
    # asked for; the place of the next response.
    "entering entering_side asked next_place "
    "pivots max_iter is_ready is_inverted memory memory_size memory_end "
    # The stamp of the numbers of a single QP.
    "stamp "
    # Whether factors are made by LAPACK; rounds of `proximal`.
    "is_large rounds "
    # Whether the next solve has the form of `free`; free variables there, and at most;
    # active rows of G; changes of the factor since it was computed anew; whether it is
    # that of the last solved QP.
    "is_free free_count most_free held face_age face_is_kept "
    # Order of a sparse KKT matrix, passes of refinement of a solve with it; whether
    # there is one.
    "size passes is_sparse "
    # Where `course` is: its stage, how the pivots ended, passes of refinement left, and
    # where values are to be set.
    "stage found passes_left target"
)
REALS = (
    # The multiplier of the entering row so far.
    "own "
    # The violation over the moduli of its terms that counts as rounding.
    "level "
    # Curvature c'Hc of a row c of norm 1 up to which it counts as fixed by equations.
    "least_curvature "
    # How strongly the equations are added to a singular P, see `dense`; 0 for not.
    "pull "
    # Of `proximal`: rho in W, 0 without W; what it is to be over that of the data, 0
    # for W only where P has no good factor, NO_WEIGHT for never; the largest diagonal
    # entry of P.
    "rho wanted largest "
    # The error of the point, see `judgement`.
    "error "
    # Operations so far, those from which on the method gives up, and those of making a
    # response, where these count.
    "operations most_operations response_operations "
    "eps_abs eps_rel"
)


class ResponseState(ctypes.Structure):
    """Numbers and addresses: attributes in Python, fields in compiled code."""

    _fields_ = fields(
        (GIVEN, int),
        (ITEMS, int),
        (OWN, int),
        (SPARSE, int),
        (FACTORS, int),
        (NUMBERS, int),
        (REALS, float),
    )


state_at = record_at(ResponseState)
# Most numbers that all responses may take: 64 MB. There are no more active rows.
MOST_NUMBERS = 8_000_000
# Least variables for the form of `free`; with fewer it would gain nothing.
LEAST_FREE = 32


@part
def taken(m, size):
    """Return the address of the next `size` numbers of the memory."""
    found = m.memory_end
    m.memory_end += 8 * max(size, 1)
    return found


@part
def lay_out(m, is_dense):
    """Give every vector of `OWN` its place from m.memory on, for the sizes n, m, p.

    Writes nothing to memory; tells whether it is large enough, up to m.memory_size
    bytes.
    """
    m.rows = m.m + m.n
    m.length = m.rows + m.p
    most = m.n if is_dense else m.n - m.p  # there, equations may depend on others
    m.most = max(min(most, m.rows, MOST_NUMBERS // max(m.length, 1)), 0)
    m.capacity = min(m.rows, max(m.most + 4, MOST_NUMBERS // max(m.length, 1)))
    takes_free = is_dense and LEAST_FREE <= m.n <= m.most + m.p
    m.most_free = 2 * m.n // 3 if takes_free else 0
    m.memory_end = m.memory
    triangle = m.most * (m.most + 1) // 2
    m.s0, m.s = taken(m, m.length), taken(m, m.length)
    m.direction, m.scale = taken(m, m.length), taken(m, m.rows)
    m.best, m.change = taken(m, m.length), taken(m, m.length)
    m.best_multiplier = taken(m, m.most + 1)
    m.active, m.side = taken(m, m.most + 1), taken(m, m.rows)
    m.multiplier, m.triangle = taken(m, m.most + 1), taken(m, triangle)
    m.kept_active, m.kept_side = taken(m, m.most + 1), taken(m, m.most + 1)
    m.kept_triangle = taken(m, triangle)
    m.coefficient, m.ratio = taken(m, m.most + 1), taken(m, m.most + 1)
    m.work = taken(m, m.most + 1)
    m.cosines, m.sines = taken(m, m.most), taken(m, m.most)
    m.place, m.owner = taken(m, m.rows), taken(m, m.capacity)
    m.Px, m.Gx, m.Ax = taken(m, m.n), taken(m, m.m), taken(m, m.p)
    m.Gtz, m.Aty = taken(m, m.n), taken(m, m.n)
    m.rhs = taken(m, 4 * (m.n + m.p))
    m.watch = taken(m, WATCH_SIZE)
    face = m.most_free * (m.most_free + 1) // 2
    m.free, m.free_triangle = taken(m, m.most_free), taken(m, face)
    m.held_rows, m.held_triangle = taken(m, m.most_free**2), taken(m, face)
    m.free_part, m.held_part = taken(m, m.most_free), taken(m, m.most_free)
    m.load, m.bound_multiplier = taken(m, m.n), taken(m, m.n)
    m.bound_ratio = taken(m, m.n)
    m.weight, m.reach, m.centre = taken(m, m.n), taken(m, m.p), taken(m, m.n)
    m.along, m.Palong = taken(m, m.length), taken(m, m.n)
    if is_dense:
        m.factor, m.equations = taken(m, m.n * m.n), taken(m, m.p * m.n)
        m.schur, m.schur_work = taken(m, m.p * m.p), taken(m, m.p)
        m.halves = taken(m, 4 * m.n)
        m.shape = taken(m, m.n)
    m.responses = taken(m, m.capacity * m.length)
    return m.memory_end - m.memory <= m.memory_size


def allocate(now: ResponseState) -> np.ndarray:
    """Return memory of the size that `lay_out` has found to be needed."""
    memory = np.empty((now.memory_end - now.memory) // 8)
    now.memory, now.memory_size = address_of(memory), memory.nbytes
    return memory
