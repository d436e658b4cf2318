"""The course of a solve, whatever the matrices are stored as.

`begin` and `advance` return what the caller has to do before it calls `advance` again,
as only it knows the matrices: VALUES, RESPONSE or PRODUCTS; or else a code of `active`:
the end. The stages are those of `active`, then the judgement of the point, and passes
of refinement as long as it is not accurate and they pay.
"""

import numpy as np

from namlcp.compiled import floats, longs, part
from namlcp.limits import WATCH_SIZE, begin_watch
from namlcp.qp.responses.active import (
    CONTRADICTION,
    DONE,
    LATE,
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
from namlcp.qp.responses.judgement import (
    GAIN,
    PASSES,
    correct,
    exchange_best,
    is_accurate,
    is_certain,
    is_solved,
    measure,
    note_best,
    set_contradiction,
    set_correction,
    set_result,
)

# What the caller has to do, beside RESPONSE: set the values at m.target to (G x, x, y)
# for (x, y) = K^-1 m.rhs; set the products of the result with P, G and A.
VALUES, PRODUCTS = 20, 21
# A code of the end: as DONE, but with terms so large that the point may not be within
# tolerance if their sums are taken in another order.
SUMMED = 22
# Stages: what `advance` begins with.
RECALL, HINTS, PIVOTS, MEASURE, CORRECT = range(5)


@part
def begin(m, clock):
    """Begin to solve the QP with the vectors at hand; clock: see `Deadline.run`."""
    begin_watch(longs(m.watch, WATCH_SIZE), clock)
    rhs, q, b = floats(m.rhs, m.n + m.p), floats(m.q, m.n), floats(m.b, m.p)
    for j in range(m.n):
        rhs[j] = -q[j]
    for i in range(m.p):
        rhs[m.n + i] = b[i]
    m.target, m.stage, m.entering = m.s0, RECALL, -1
    return VALUES


@part
def advance(m):
    """Go on until the caller has to do something, or to the end.

    The result is complete after DONE and SUMMED; after LATE it is the best point, after
    CONTRADICTION it has x and the multipliers y and z of a candidate for a certificate.
    """
    if m.stage == RECALL:
        recall(m)
        m.hinted, m.stage = 0, HINTS
    if m.stage == HINTS:
        if m.operations > m.most_operations:
            return STUCK
        if admit_hints(m) == RESPONSE:
            return RESPONSE
        drop_wrong_signs(m)
        m.hints, m.pivots = 0, 0
        m.level, m.stage = VIOLATION_ROUNDING, PIVOTS
    if m.stage == PIVOTS:
        m.found = pivot(m)
        if m.found == RESPONSE or m.found == STUCK:
            return m.found
        if m.found == CONTRADICTION:
            set_contradiction(m)
            return CONTRADICTION
        if m.found == DONE and not finish(m):
            return STUCK
    elif m.stage == CORRECT:
        correct(m)
    return judge(m)


@part
def is_base_solution(m):
    """Tell whether the result is the solution of the base problem, as it was found."""
    return m.k == 0 and m.pivots == 0 and m.passes_left == PASSES


@part
def judge(m):
    """Let the point be judged and refined: as `advance`, from the end of the pivots.

    After VALUES the caller has to `correct` the point, too.
    """
    if m.stage == PIVOTS:
        m.error, m.passes_left = np.inf, PASSES
    if m.stage != MEASURE:
        set_result(m)
        m.stage = MEASURE
        return PRODUCTS
    before, m.error = m.error, measure(m)
    if m.found == LATE:
        return LATE
    if not m.error < before:
        exchange_best(m)
        set_result(m)
        m.error, m.passes_left = np.inf, 0
        return PRODUCTS
    pays = m.passes_left > 0 and m.error <= GAIN * before
    if pays and not is_accurate(m, m.error):
        note_best(m)
        set_correction(m)
        m.passes_left -= 1
        m.target, m.stage = m.change, CORRECT
        return VALUES
    if not is_solved(m):
        return STUCK
    keep(m)
    return DONE if is_certain(m) else SUMMED
