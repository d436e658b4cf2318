"""The problem that a result solved, or an error that says why there is none."""

from typing import Any

from namlcp.qp import QP, ClosestPoint, qp_arrays
from namlcp.result import LCPResult, QPResult
from namlcp.status import Status


def problem_of(result: QPResult | LCPResult | ClosestPoint) -> Any:
    """Return the problem kept in a result; raise ValueError if it has no derivative."""
    if result.status is not Status.SOLVED:
        raise ValueError(
            f"derivatives need a result of status solved, got {result.status.value}"
        )
    if result.problem is None:
        raise ValueError(
            "derivatives need the result of the solve itself: a pickled or copied one "
            "has lost the problem"
        )
    problem = result.problem
    if callable(problem):
        return problem()
    if len(problem) == len(QP._fields):  # the arguments of `solve_qp`
        P, _, G, _, A, *_ = problem
        return qp_arrays(*problem), (P, G, A)
    if len(problem) == 3:  # the matrices, the vectors, and P, G, A of a `Solver`
        matrices, vectors, given = problem
        return QP.of(matrices, vectors), given
    return problem
