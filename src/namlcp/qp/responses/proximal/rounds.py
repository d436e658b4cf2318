"""The rounds: a QP with a proximal term each, see the door of this room."""

from namlcp.compiled import floats, longs, part
from namlcp.limits import WATCH_SIZE, begin_watch
from namlcp.linalg import copy
from namlcp.qp.responses.active import (
    CONTRADICTION,
    DONE,
    LATE,
    RESPONSE,
    ROUND_ROUNDING,
    STUCK,
    admit_hints,
    drop_wrong_signs,
    keep,
    pivot,
    recall,
    set_multipliers,
    set_values,
)
from namlcp.qp.responses.course import SUMMED
from namlcp.qp.responses.judgement import (
    is_certain,
    is_solved,
    measure,
    parts_of_result,
    set_contradiction,
    set_result,
)
from namlcp.qp.responses.proximal.face import FACE_SOLVED, LOST, RAY, descend
from namlcp.qp.responses.proximal.operator import (
    make_responses,
    set_other_products,
    set_products,
    set_values_of,
)

# A code of the end: z_box is a candidate for a ray.
UNBOUNDED = 23
MOST_ROUNDS = 20


@part
def solve_by_rounds(m, clock):
    """Solve the QP at the addresses of m: a code of `active` or `course`, or UNBOUNDED.

    clock: see `Deadline.run`.
    """
    begin_watch(longs(m.watch, WATCH_SIZE), clock)
    centre = floats(m.centre, m.n)
    for j in range(m.n):
        centre[j] = 0.0
    m.rounds, m.pivots = 0, 0
    if is_on_old_face(m):
        return DONE if is_certain(m) else SUMMED
    while m.rounds < MOST_ROUNDS:
        found = minimise(m)
        if found == LATE:
            set_result(m)
            set_products(m)
            measure(m)
        elif found == CONTRADICTION:
            set_contradiction(m)
        if found != DONE:
            return found
        m.rounds += 1
        end = descend(m)
        if end == RAY:
            return UNBOUNDED
        if end == LOST:
            return STUCK
        if end == FACE_SOLVED and settle(m):
            keep(m)
            return DONE if is_certain(m) else SUMMED
        copy(floats(m.s, m.length)[m.m : m.rows], centre)
        set_base_values(m)
    return STUCK


@part
def set_base_values(m):
    """Set s0, the base solution with the proximal term of this centre."""
    rhs, q, b = floats(m.rhs, m.n + m.p), floats(m.q, m.n), floats(m.b, m.p)
    centre, weight = floats(m.centre, m.n), floats(m.weight, m.n)
    for j in range(m.n):
        rhs[j] = weight[j] * centre[j] - q[j]
    copy(b, rhs[m.n :])
    set_values_of(m, rhs, floats(m.s0, m.length))


@part
def is_on_old_face(m):
    """Begin with the active rows of the last QP, or a hint; True if these solve it.

    The rounds would first come to those of the QP with the proximal term.
    """
    set_base_values(m)
    recall(m)
    m.hinted = 0
    while admit_hints(m) == RESPONSE:
        make_responses(m)
    m.hints, m.level = 0, ROUND_ROUNDING
    if m.k == 0:
        return False
    set_multipliers(m)
    set_values(m)
    if descend(m) != FACE_SOLVED or not settle(m):
        return False
    keep(m)
    return True


@part
def minimise(m):
    """Solve the QP with the proximal term of this centre: a code of `active`."""
    m.entering, m.changed = -1, 0
    drop_wrong_signs(m)
    found = pivot(m)
    while found == RESPONSE:
        make_responses(m)
        found = pivot(m)
    if found == DONE and m.changed:
        set_multipliers(m)
        set_values(m)
    return found


@part
def settle(m):
    """Take multipliers of the right signs; tell whether the QP is solved.

    The products at hand are those of the point with multipliers of either sign.
    """
    z = parts_of_result(m)[2]
    negative = False
    for i in range(m.m):
        if z[i] < 0.0:
            z[i], negative = 0.0, True
    if negative:
        set_other_products(m)
    measure(m)
    return is_solved(m)
