"""The numbers and vectors of the dual active-set method, by name.

Compiled functions take them as one record `m` of numbers and addresses, as those of
`qp/path` do: ``floats(m.x, m.n)`` is the vector x, ``floats(m.L, (m.n, m.n))`` the
factor L.
"""

import ctypes

from namlcp.compiled import fields, longs, part, record_at
from namlcp.limits import WATCH_SIZE

# The vectors in the memory of the record, by the numbers that each one has:
KINDS = (
    # n + 1:
    # The active rows (int64) and their multipliers, see `active_rows`.
    "active multiplier "
    # u = L'x, and its value at the unconstrained minimum; the diagonal of W; c.
    "u u0 weight centre "
    # The solution of steps 2 and 3 before step 4 refines it.
    "point "
    # The constraint looked at, see `set_row`, and L^-1 times it; the part of that which
    # is orthogonal to the active rows, its coefficients by them, and these by R^-1.
    "row v rest coefficients ratios "
    # The next point and multipliers of `refinement`, and the step that leads to them;
    # the gradient there.
    "trial trial_multiplier change multiplier_change gradient "
    # Products of the result with P, G' and A'.
    "Px Gtz Aty",
    # As many as G has rows: their norms, and G x.
    "norms Gx",
    # As many as A has rows.
    "Ax",
    # n^2: the factor of P + W = L L', and those of the active rows, Q'R.
    "L Q R",
    # WATCH_SIZE.
    "watch",
)
OWN = " ".join(KINDS)
COUNTS = tuple(len(names.split()) for names in KINDS)
PLACES = sum(COUNTS)
# Addresses of the problem, a list of rows that are probably active, and the result: x,
# y, z, z_box and the numbers of `Residuals`, one after another.
GIVEN = "P q G h A b lb ub hint out x y z z_box"


class DualState(ctypes.Structure):
    """Numbers and addresses: attributes in Python, fields in compiled code."""

    _fields_ = fields(
        (OWN, int),
        (GIVEN, int),
        # Variables, rows of G, rows of A, rows of `hint`.
        ("n m p hints", int),
        # Active rows; pivots so far, and at most.
        ("k pivots max_iter", int),
        # Whether W = 0.
        ("is_definite", bool),
        # The violation relative to its terms that counts as rounding; pivots in a row
        # that hardly exceeded it.
        ("level", float),
        ("idle", int),
    )


state_at = record_at(DualState)


def numbers_needed(n: int, m: int, p: int) -> int:
    """Return how many numbers `lay_out` finds a place for."""
    sizes = n + 1, m, p, n * n, WATCH_SIZE
    return sum(count * size for count, size in zip(COUNTS, sizes, strict=True))


@part
def lay_out(address, memory):
    """Give every vector of `OWN` its place from `memory` on, for the sizes n, m, p.

    Their addresses are the first fields of the record.
    """
    m = state_at(address)
    places, i = longs(address, PLACES), 0
    sizes = m.n + 1, m.m, m.p, m.n * m.n, WATCH_SIZE
    for kind in range(len(COUNTS)):
        for _ in range(COUNTS[kind]):
            places[i] = memory
            memory += 8 * sizes[kind]
            i += 1
