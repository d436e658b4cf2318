"""Sequences of QPs by responses, dense or sparse: what their tests share."""

import numpy as np

from namlcp.limits import Limits
from namlcp.status import Status

LIMITS = Limits(1e-9, 1e-10, 1000)
FINAL = (Status.SOLVED, Status.PRIMAL_INFEASIBLE)


def solve(responses, qp, limits=LIMITS):
    """Return the answer to the QP with the vectors of `qp`, None if left to others."""
    return responses.answer(*responses.run(qp.joined(), limits), qp, limits)


def walked(responses, steps, assert_agrees):
    """Solve the steps; return the statuses, less those of steps left to others.

    Each answer is final, agrees, and has the same bits as that of fresh responses.
    """
    seen = []
    for qp in steps:
        answer, fresh = solve(responses, qp), solve(type(responses).of(qp), qp)
        if answer is None:
            assert fresh is None
            continue
        seen.append(answer.status)
        assert answer.status in FINAL
        assert_agrees(answer, qp)
        if answer.status is Status.SOLVED:  # bit by bit: the way there leaves no trace
            for mine, other in zip(answer.point, fresh.point, strict=True):
                np.testing.assert_array_equal(mine, other)
    return seen
