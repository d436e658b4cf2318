"""The kernels for dense QPs: addresses in, one solve, the active rows kept.

`run` solves the QP whose vectors `attach_vectors` has noted: it checks them, computes M
if that is missing, starts from the active rows of the last solved QP, or from a hint,
and judges the point. Its codes are those of `active`, and those below.
"""

import numpy as np

from namlcp.checks import has_huge_bound, is_bad
from namlcp.compiled import floats, kernel, longs, part, record_of
from namlcp.qp.responses.active import (
    CONTRADICTION,
    DONE,
    RESPONSE,
    STUCK,
    VIOLATION_ROUNDING,
    admit_hints,
    drop_wrong_signs,
    finish,
    keep,
    pivot,
    recall,
)
from namlcp.qp.responses.dense import (
    judge,
    judge_refined,
    make_response,
    set_up,
    set_values_of,
)
from namlcp.qp.responses.judgement import is_solved, set_contradiction
from namlcp.qp.responses.state import lay_out

# Further codes of `run`. UNSUITED: the form does not take these matrices. FAULTY: a
# number in a vector is not allowed; HUGE: a side of h, lb or ub is finite, but means
# none; OPPOSED: two sides of a row contradict each other.
UNSUITED, FAULTY, HUGE, OPPOSED = range(5, 9)


@kernel
def attach_matrices(state, P, G, A):
    """Note the matrices of a new QP; tell whether the memory is large enough for it."""
    m = record_of(state)
    m.n, m.m, m.p = P.shape[0], G.shape[0], A.shape[0]
    m.P, m.G, m.A = P.ctypes.data, G.ctypes.data, A.ctypes.data
    m.is_ready, m.k, m.kept_k, m.hints = 0, 0, 0, 0
    m.most_operations = np.inf
    size = m.n + m.p
    return lay_out(m, size * size)


@kernel
def attach_vectors(state, vectors, out):
    """Note the vectors (q, h, b, lb, ub), and where the result is to be written."""
    m = record_of(state)
    q, h, b, lb, ub = vectors
    m.q, m.h, m.b = q.ctypes.data, h.ctypes.data, b.ctypes.data
    m.lb, m.ub, m.out = lb.ctypes.data, ub.ctypes.data, out.ctypes.data


@kernel
def take_hint(state, active):
    """Note rows that are probably active, as `Guess.active` has them, to start from."""
    m = record_of(state)
    kept, kept_side = longs(m.kept_active, m.most + 1), longs(m.kept_side, m.most + 1)
    m.kept_k, m.hints = 0, 0
    for i in range(m.m + 2 * m.n):
        if active[i] and m.hints < m.most:
            kept[m.hints] = i if i < m.rows else i - m.n
            kept_side[m.hints] = -1 if m.m <= i < m.rows else 1
            m.hints += 1


@part
def fault_of(m):
    """Return FAULTY, HUGE, OPPOSED or DONE for the vectors."""
    allowed = np.bool_(True)  # not a literal, which would compile is_bad once more
    h, lb, ub = floats(m.h, m.m), floats(m.lb, m.n), floats(m.ub, m.n)
    bad = is_bad(floats(m.q, m.n), not allowed) or is_bad(floats(m.b, m.p), not allowed)
    bad = bad or is_bad(h, allowed) or is_bad(lb, allowed) or is_bad(ub, allowed)
    if bad:
        return FAULTY
    if has_huge_bound(h) or has_huge_bound(lb) or has_huge_bound(ub):
        return HUGE
    for i in range(m.m):
        if h[i] == -np.inf:
            return OPPOSED
    for j in range(m.n):
        if lb[j] > ub[j] or lb[j] == np.inf or ub[j] == -np.inf:
            return OPPOSED
    return DONE


@kernel(error_model="numpy")
def run(state, clock):
    """Solve the QP; clock: see `Deadline.run`.

    The result is complete after DONE; after LATE it is the best point, after
    CONTRADICTION it has x and the multipliers y and z of a candidate for a certificate.
    """
    m = record_of(state)
    fault = fault_of(m)
    if fault != DONE:
        return fault
    watch = longs(m.watch, 3)
    watch[0], watch[1], watch[2] = clock, 0, 0
    if not m.is_ready and not set_up(m):
        return UNSUITED
    m.is_ready = 1
    set_base_point(m)
    recall(m)
    m.hinted = 0
    while admit_hints(m) == RESPONSE:
        make_response(m, m.asked)
    m.hints = 0
    drop_wrong_signs(m)
    m.entering, m.pivots, m.level = -1, 0, VIOLATION_ROUNDING
    found = pivot(m)
    while found == RESPONSE:
        make_response(m, m.asked)
        found = pivot(m)
    if found == CONTRADICTION:
        set_contradiction(m)
    elif found == DONE:
        if finish(m):
            judge_refined(m)
            if is_solved(m):
                keep(m)
                return DONE
        return STUCK
    else:
        judge(m)
    return found


@part
def set_base_point(m):
    """Set s0 to the values of M (-q, b)."""
    rhs, q, b = floats(m.rhs, m.n + m.p), floats(m.q, m.n), floats(m.b, m.p)
    for j in range(m.n):
        rhs[j] = -q[j]
    for i in range(m.p):
        rhs[m.n + i] = b[i]
    set_values_of(m, rhs, floats(m.s0, m.length))
