"""The forms a QP may have, smallest first, and the solver of each.

Bounds alone make a box LCP with A = P; a small or full QP is dense and goes to dual
pivots on its multipliers' LCP; everything else to the interior-point method, which also
takes over where another form does not finish.
"""

from namlcp.limits import Limits
from namlcp.qp.answer import Answer, better
from namlcp.qp.bounds import is_box_open, solve_bounds
from namlcp.qp.dense import solve_dense
from namlcp.qp.guess import NO_GUESS, Guess
from namlcp.qp.memory import Memory
from namlcp.qp.path import solve_path
from namlcp.qp.problem import QP

# Variables up to which the dense form is quicker than the box LCP for bounds alone.
DENSE_BOX = 50
# Variables, and entries of P, G and A, up to which pivots on a dense QP do not take
# many seconds.
DENSE_VARIABLES, DENSE_ENTRIES = 2000, 16_000_000
# Entries of P, G and A, zeros included, up to which a sparse QP is quicker as a dense
# one.
SPARSE_ENTRIES = 10_000
# Part of these entries, from which on a sparse QP counts as full.
FULL = 0.3


def is_small(qp: QP) -> bool:
    """Tell whether the dense form fits."""
    n = qp.q.size
    entries = n * (n + qp.h.size + qp.b.size)
    if n > DENSE_VARIABLES or entries > DENSE_ENTRIES:
        return False
    if qp.is_dense or entries <= SPARSE_ENTRIES:
        return True
    return qp.P.nnz + qp.G.nnz + qp.A.nnz >= FULL * entries


def is_box(qp: QP) -> bool:
    """Tell whether there are bounds and nothing else."""
    return qp.h.size == 0 and qp.b.size == 0 and is_box_open(qp.lb, qp.ub)


def solve_smallest_form(qp: QP, guess: Guess, limits: Limits, memory: Memory) -> Answer:
    """Try the smallest form that fits, then the interior-point method.

    Returns the better answer.
    """
    answer = None
    small = is_small(qp)
    if is_box(qp) and not (small and qp.q.size <= DENSE_BOX):
        with limits.deadline.listening():
            answer = solve_bounds(qp, guess, limits, memory)
    starts = [guess, NO_GUESS] if guess.x.size else [NO_GUESS]
    while small and starts and not (answer and answer.ends):
        # a wrong guess may cost the time of a second solve, but not the answer
        found = solve_dense(qp, starts.pop(0), limits)
        if found is None:
            break
        answer = found if answer is None else better(answer, found, limits)
    if answer is not None and answer.ends:
        return answer
    with limits.deadline.listening():
        other = solve_path(qp, guess, limits, memory)
    return other if answer is None else better(answer, other, limits)
