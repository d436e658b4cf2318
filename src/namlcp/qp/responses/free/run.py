"""The kernel for dense QPs with most variables at bounds: as `run`, with `steps`."""

from namlcp.compiled import floats, kernel, part
from namlcp.qp.responses.active import (
    CONTRADICTION,
    DONE,
    STUCK,
    VIOLATION_ROUNDING,
    excuse,
)
from namlcp.qp.responses.course import PIVOTS, PRODUCTS, SUMMED, VALUES, begin, judge
from namlcp.qp.responses.dense import set_products_of_rows
from namlcp.qp.responses.free.face import add_free_columns, set_free_part
from namlcp.qp.responses.free.steps import (
    WIDE,
    clear_sides,
    correct_on_face,
    finish_on_face,
    leave_wrong_signs,
    list_active,
    pivot_on_face,
    recall_face,
)
from namlcp.qp.responses.judgement import set_contradiction
from namlcp.qp.responses.run import FAULTY, attach_vectors, is_faulty, sum_anew
from namlcp.qp.responses.state import state_at


@kernel(error_model="numpy")
def run_free(address, vectors, out, clock):
    """Do as `run`, from the active rows of the last solved QP; WIDE: `run` has to."""
    m = state_at(address)
    attach_vectors(m, vectors, out)
    m.pivots = 0
    if is_faulty(m):
        return FAULTY
    begin(m, clock)
    m.found = find_face(m)
    if m.found == WIDE or m.found == STUCK:
        clear_sides(m)
        return m.found
    list_active(m)
    if m.found == CONTRADICTION:
        set_contradiction(m)
        return m.found
    m.stage = PIVOTS
    found = judge(m)
    while True:
        if found == PRODUCTS:
            set_products_on_face(m)
        elif found == VALUES:
            correct_on_face(m)
        else:
            break
        found = judge(m)
    if found == SUMMED:
        found = sum_anew(m)
    if found == DONE:
        m.face_is_kept = 1
    return found


@part
def find_face(m):
    """Find the face of the solution, and the point on it."""
    if not recall_face(m):
        return WIDE
    m.level, found = VIOLATION_ROUNDING, DONE
    while found == DONE:
        if not leave_wrong_signs(m):
            return WIDE
        found = pivot_on_face(m)
        if found == DONE:
            return DONE if finish_on_face(m) else WIDE
        if found == CONTRADICTION:
            found = excuse(m)
    return found


@part
def set_products_on_face(m):
    """Set the products of the result with P, G and A: P x from the load."""
    Px, load = floats(m.Px, m.n), floats(m.load, m.n)
    for j in range(m.n):
        Px[j] = load[j]
    f = floats(m.free_part, m.free_count)
    set_free_part(m, floats(m.out, m.n), f)
    add_free_columns(m, 1.0, f, Px)
    set_products_of_rows(m)
