"""The rows of `steps`: their right-hand sides, and the responses that have been made.

Responses are kept in places, each as long as the values s. There are as many places as
rows if memory allows, and always more than rows can be active.
"""

from cython import Py_ssize_t
from cython.cimports.namlcp.linalg.dense import (
    triangle_solve,
    triangle_solve_transposed,
)
from cython.cimports.namlcp.linalg.vectors import add_four, add_scaled


def goal_of(m, row, side):
    """Return the right-hand side of a row at one of its sides."""
    if row < m.m:
        return m.h[row]
    return m.lb[row - m.m] if side < 0 else m.ub[row - m.m]


def response_of(m, row):
    """Return the response to a row, which has been made."""
    return m.responses + m.length * m.place[row]


def claim_place(m, row):
    """Return the vector that the response to `row` is to be written to, at once.

    With all places taken, the response of a row that is not active is forgotten.
    """
    at = m.next_place
    while m.owner[at] >= 0 and (m.side[m.owner[at]] != 0 or m.owner[at] == m.entering):
        at = (at + 1) % m.capacity
    if m.owner[at] >= 0:
        m.place[m.owner[at]] = -1
    m.owner[at], m.place[row] = row, at
    m.next_place = (at + 1) % m.capacity
    return m.responses + m.length * at


def forget_responses(m):
    """Forget all responses; the active rows of the last solve become a hint."""
    for i in range(m.capacity):
        m.owner[i] = -1
    for i in range(m.rows):
        m.place[i], m.side[i] = -1, 0
    m.next_place, m.k = 0, 0
    m.hints += m.kept_k
    m.kept_k, m.kept_age = 0, 0


def is_pinned(m, row):
    """Tell whether the two sides of a row are one, so that its multiplier is free."""
    j = row - m.m
    return j >= 0 and m.lb[j] == m.ub[j]


def subtract_responses(m, factor, k, s):
    """Set s -= sum over i < k of factor[i] times the response to active row i.

    Four rows at a time, because reading and writing s would take most of the time.
    """
    active = m.active
    i: Py_ssize_t = 0
    while i + 4 <= k:
        add_four(
            -factor[i], response_of(m, active[i]),
            -factor[i + 1], response_of(m, active[i + 1]),
            -factor[i + 2], response_of(m, active[i + 2]),
            -factor[i + 3], response_of(m, active[i + 3]), s, m.length,
        )  # fmt: skip
        i += 4
    while i < k:
        add_scaled(-factor[i], response_of(m, active[i]), s, m.length)
        i += 1


def solve_active(m, v):
    """Overwrite v by S^-1 v, S = L L' as in `steps`."""
    triangle_solve(m.triangle, m.k, v)
    triangle_solve_transposed(m.triangle, m.k, v)


def subtract_active(m, values):
    """Set m.work = S^-1 m.work, and values -= sum of m.work_i w_i over active rows."""
    solve_active(m, m.work)
    subtract_responses(m, m.work, m.k, values)


def hold_active(m, values):
    """Set m.work = S^-1 values_F and subtract these responses: then values_F = 0."""
    for i in range(m.k):
        m.work[i] = values[m.active[i]]
    subtract_active(m, values)
