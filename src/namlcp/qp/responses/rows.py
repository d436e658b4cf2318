"""The rows of `active`: their right-hand sides, and the responses that have been made.

Responses are kept in places, each as long as the values s. There are as many places as
rows if memory allows, and always more than rows can be active.
"""

from namlcp.compiled import floats, longs, part
from namlcp.linalg import add_scaled
from namlcp.qp.responses.matrices import triangle_solve, triangle_solve_transposed


@part
def goal_of(m, row, side):
    """Return the right-hand side of a row at one of its sides."""
    if row < m.m:
        return floats(m.h, m.m)[row]
    if side < 0:
        return floats(m.lb, m.n)[row - m.m]
    return floats(m.ub, m.n)[row - m.m]


@part
def violation_of(m, row, value):
    """Return by how much the value of a row exceeds the nearer one of its sides."""
    if row < m.m:
        return value - floats(m.h, m.m)[row]
    j = row - m.m
    return max(value - floats(m.ub, m.n)[j], floats(m.lb, m.n)[j] - value)


@part
def response_of(m, row):
    """Return the response to a row, which has been made."""
    start = m.responses + 8 * m.length * longs(m.place, m.rows)[row]
    return floats(start, m.length)


@part
def has_response(m, row):
    """Tell whether the response to a row has been made."""
    return longs(m.place, m.rows)[row] >= 0


@part
def claim_place(m, row):
    """Return the vector that the response to `row` is to be written to, at once.

    With all places taken, the response of a row that is not active is forgotten.
    """
    owner, place = longs(m.owner, m.capacity), longs(m.place, m.rows)
    side = longs(m.side, m.rows)
    at = m.next_place
    while owner[at] >= 0 and (side[owner[at]] != 0 or owner[at] == m.entering):
        at = (at + 1) % m.capacity
    if owner[at] >= 0:
        place[owner[at]] = -1
    owner[at], place[row] = row, at
    m.next_place = (at + 1) % m.capacity
    return floats(m.responses + 8 * m.length * at, m.length)


@part
def forget_responses(m):
    """Forget all responses; the active rows of the last solve become a hint."""
    owner, place = longs(m.owner, m.capacity), longs(m.place, m.rows)
    side = longs(m.side, m.rows)
    for i in range(m.capacity):
        owner[i] = -1
    for i in range(m.rows):
        place[i], side[i] = -1, 0
    m.next_place, m.k = 0, 0
    m.hints += m.kept_k
    m.kept_k, m.kept_age = 0, 0


@part
def is_pinned(m, row):
    """Tell whether the two sides of a row are one, so that its multiplier is free."""
    j = row - m.m
    return j >= 0 and floats(m.lb, m.n)[j] == floats(m.ub, m.n)[j]


@part
def are_most_at_bounds(m):
    """Tell whether the form of `free` is the smaller one: its order, see there."""
    count = 0
    active = longs(m.active, m.most + 1)
    for i in range(m.k):
        if active[i] >= m.m:
            count += 1
    return m.most_free > 0 and m.n - count + m.p < count


@part
def subtract_responses(m, factor, k, s):
    """Set s -= sum over i < k of factor[i] times the response to active row i.

    Four rows at a time, because reading and writing s would take most of the time.
    """
    active = longs(m.active, m.most + 1)
    i = 0
    while i + 4 <= k:
        a, b = response_of(m, active[i]), response_of(m, active[i + 1])
        c, d = response_of(m, active[i + 2]), response_of(m, active[i + 3])
        fa, fb, fc, fd = factor[i], factor[i + 1], factor[i + 2], factor[i + 3]
        for j in range(s.size):
            s[j] -= (fa * a[j] + fb * b[j]) + (fc * c[j] + fd * d[j])
        i += 4
    while i < k:
        add_scaled(-factor[i], response_of(m, active[i]), s)
        i += 1


@part
def solve_active(m, v):
    """Overwrite v by S^-1 v, S = L L' as in `active`."""
    triangle = floats(m.triangle, m.most * (m.most + 1) // 2)
    triangle_solve(triangle, m.k, v)
    triangle_solve_transposed(triangle, m.k, v)


@part
def subtract_active(m, values):
    """Set m.work = S^-1 m.work, and values -= sum of m.work_i w_i over active rows."""
    work = floats(m.work, m.most + 1)
    solve_active(m, work)
    subtract_responses(m, work, m.k, values)


@part
def hold_active(m, values):
    """Set m.work = S^-1 values_F and subtract these responses: then values_F = 0."""
    active, work = longs(m.active, m.most + 1), floats(m.work, m.most + 1)
    for i in range(m.k):
        work[i] = values[active[i]]
    subtract_active(m, values)
