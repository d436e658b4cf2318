"""Both stages, and the judgement of what they find on the user's own data."""

from typing import NamedTuple

import numpy as np

from namlcp.limits import Limits
from namlcp.options import Relaxation
from namlcp.qp.closest.face import Face
from namlcp.qp.closest.rows import Rows, rows_of
from namlcp.qp.closest.stage_one import Solve, solve_exactly, stage_one
from namlcp.qp.guess import NO_GUESS, make_guess
from namlcp.qp.problem import QP, Point
from namlcp.residuals import UNDEFINED, Residuals, qp_residuals
from namlcp.status import Status

NO_NEAREST = "No shift helps: the constraints that must stay contradict each other. "
NOT_LEAST = "The search for the least shifts ended with status {}: these are larger. "
NOT_MINIMISED = (
    "The shifts are the least ones, but the search for the least cost ended with "
    "status {}: x is some point with these shifts, its multipliers are not known. "
)
UNPROVED = (
    "The shifts are the least ones; that x has the least cost with them is not proved: "
    "the multipliers are so large that rounding leaves a primal residual of {:.1e}, a "
    "dual one of {:.1e} and a gap of {:.1e}. "
)


class Nearest(NamedTuple):
    """What the search for the nearest feasible problem found, named as `ClosestPoint`.

    stages, with SOLVED: the face of all x with these shifts, the QP of stage 2 and its
    solution.
    """

    status: Status
    x: np.ndarray
    y: np.ndarray
    z: np.ndarray
    z_box: np.ndarray
    residuals: Residuals
    shift_h: np.ndarray
    shift_b: np.ndarray
    shift_lb: np.ndarray
    shift_ub: np.ndarray
    norm: int
    message: str
    stages: tuple[Face, QP, Point] | None = None


def nearest(qp: QP, relaxation: Relaxation, limits: Limits, solve: Solve) -> Nearest:
    """Return the solution of the feasible problem nearest to an infeasible QP.

    `solve` solves both stages, each under the same limits.
    """
    stage = stage_one(rows_of(qp, relaxation), limits, solve)
    rows, x = stage.rows, stage.x
    status, message = stage.answer.status, stage.answer.message
    if status is Status.PRIMAL_INFEASIBLE:
        nothing = np.full(rows.d.size, np.nan)
        return reported(
            qp, rows, unknown(rows, x), nothing, status, NO_NEAREST + message
        )
    if status is not Status.SOLVED:
        r = rows.violations(x)
        message = NOT_LEAST.format(status.value) + message
        return reported(qp, rows, unknown(rows, x), r, status, message)
    found = least_cost(qp, stage.face(), x, limits, solve)
    if found.status is Status.STALLED:
        sharper = stage.sharpened(limits, solve)
        if sharper is stage:
            return found
        other = least_cost(qp, sharper.face(), x, limits, solve)
        if other.status in (Status.SOLVED, Status.DUAL_INFEASIBLE):
            return other
    return found


def contradiction(qp: QP, limits: Limits, solve: Solve) -> Point | None:
    """Return multipliers of the least shifts, which prove that a QP needs some.

    They are as exact as rounding allows, and not yet tested: see `namlcp.qp.judge`.
    """
    stage = stage_one(rows_of(qp, Relaxation()), limits, solve)
    stage = stage.sharpened(limits, solve)
    if stage.answer.status is not Status.SOLVED:
        return None
    return stage.rows.point(stage.x, stage.v, stage.v_box)


def least_cost(
    qp: QP, face: Face, x: np.ndarray, limits: Limits, solve: Solve
) -> Nearest:
    """Return the point of least cost on a face; x is some point of it."""
    rows, easier = face.rows, face.problem(qp)
    # The rows active at x are those of the solution only if they leave x no freedom.
    settled = face.held.size + np.count_nonzero(face.v_box) >= x.size
    guess = make_guess(easier, x, None) if settled else NO_GUESS
    second = solve_exactly(easier, guess, limits, solve)
    status, message = second.status, second.message
    if status is Status.DUAL_INFEASIBLE:
        return reported(qp, rows, second.point, face.shifts(x), status, message)
    if status is Status.SOLVED:
        point, r = face.point(second.point), face.shifts(second.point.x)
        found = reported(qp, rows, point, r, status, message)
        residuals = found.residuals
        if residuals.solved(*limits.tolerances):
            return found._replace(stages=(face, easier, second.point))
        if residuals._replace(dual=0.0, gap=0.0).solved(*limits.tolerances):
            x = found.x
        message = UNPROVED.format(*residuals[:3]) + message
    else:
        message = NOT_MINIMISED.format(status.value) + message
    if status not in (Status.TIME_LIMIT, Status.MAX_ITER):
        status = Status.STALLED
    return reported(qp, rows, unknown(rows, x), face.shifts(x), status, message)


def unknown(rows: Rows, x: np.ndarray) -> Point:
    """Return x with multipliers that are NaN."""
    v, v_box = np.full(rows.d.size, np.nan), np.full(x.size, np.nan)
    return rows.point(x, v, v_box)


def reported(
    qp: QP, rows: Rows, point: Point, r: np.ndarray, status: Status, message: str
) -> Nearest:
    """Return a point and shifts of the rows as the user wants them, with residuals."""
    h, b, lb, ub = rows.shifts(r)
    shifted = qp._replace(h=qp.h + h, b=qp.b + b, lb=qp.lb + lb, ub=qp.ub + ub)
    solved = status is Status.SOLVED
    residuals = qp_residuals(*shifted, *point) if solved else UNDEFINED
    shifts, message = (h, b, lb, ub), message.strip()
    return Nearest(status, *point, residuals, *shifts, rows.norm, message)
