"""The forms a QP may have, smallest first, and the solver of each.

A QP with bounds alone is a box LCP with A = P; a small or full QP is solved by a dense
dual active-set method; every other QP, and what these two leave unsolved, is solved by
the interior-point method.
"""

from typing import Any

import numpy as np

from namlcp.limits import Limits
from namlcp.qp.active import solve_once
from namlcp.qp.active.solve import FEW_ENTRIES, FULL, MOST_BOX
from namlcp.qp.answer import Answer, better
from namlcp.qp.bounds import is_box_open, solve_bounds
from namlcp.qp.guess import Guess
from namlcp.qp.memory import Memory
from namlcp.qp.path import solve_path
from namlcp.qp.problem import QP

# Most variables, and most entries of P, G and A, zeros included, of the dense form,
# which would take many seconds beyond.
DENSE_VARIABLES, DENSE_ENTRIES = 2000, 16_000_000
# Most entries, zeros included, of a sparse QP that the dense form solves before a
# substitution is looked for, which would take longer.
TINY_ENTRIES = 2000


def is_small(qp: QP) -> bool:
    """Tell whether the QP takes the dense form."""
    return are_full((qp.P, qp.G, qp.A), FEW_ENTRIES)


def are_full(matrices: tuple[Any, ...], few: int) -> bool:
    """Tell whether matrices of equally many columns are `few` entries, or full ones.

    Those with too many for the dense form are neither.
    """
    n = matrices[0].shape[1]
    entries = n * sum(M.shape[0] for M in matrices)
    if n > DENSE_VARIABLES or entries > DENSE_ENTRIES:
        return False
    if entries <= few:
        return True
    if isinstance(matrices[0], np.ndarray):
        filled = sum(int(np.count_nonzero(M)) for M in matrices)
    else:
        filled = sum(M.nnz for M in matrices)
    return 100 * filled >= FULL * entries


def is_tiny(qp: QP) -> bool:
    """Tell whether the QP takes the dense form as it came."""
    n = qp.q.size
    return n * (n + qp.h.size + qp.b.size) <= TINY_ENTRIES


def is_box(qp: QP) -> bool:
    """Tell whether the QP has bounds alone, and these have a finite point."""
    return qp.h.size == 0 and qp.b.size == 0 and is_box_open(qp.lb, qp.ub)


def solve_smallest_form(qp: QP, guess: Guess, limits: Limits, memory: Memory) -> Answer:
    """Return the better answer of the smallest form and the interior-point method.

    The latter does not run where the former decides, or time is over.
    """
    answer = None
    if is_box(qp) and (qp.q.size > MOST_BOX or not is_small(qp)):
        answer = solve_bounds(qp, guess, limits, memory)
        if answer is not None and answer.ends:
            return answer
    if is_small(qp) and not memory.in_vain:
        answer = solve_once(qp.in_dense_form(), guess, limits) or answer
    if answer is not None and answer.ends:
        return answer
    other = solve_path(qp, guess, limits, memory)
    return other if answer is None else better(answer, other, limits)
