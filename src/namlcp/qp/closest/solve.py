"""Both stages, and the judgement of what they find on the user's own data."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from namlcp.limits import Limits
from namlcp.options import Relaxation
from namlcp.outcome import Outcome
from namlcp.qp.closest.face import Face, face_of
from namlcp.qp.closest.rows import Rows, least_shifts, rows_of
from namlcp.qp.guess import NO_GUESS, Guess, make_guess
from namlcp.qp.problem import QP, Point
from namlcp.residuals import UNDEFINED, Residuals, qp_residuals
from namlcp.status import Status

Solve = Callable[..., Outcome]
"""Solves a QP: (qp, guess, limits), see `namlcp.qp.route`."""

STAGE_TOLERANCES = 1e-9, 1e-13
"""eps_abs and eps_rel of both stages, at most: what is active is read from the last
digits of multipliers. A looser eps_rel leaves products of multipliers and slacks of
1e-6 and more where objectives are large, and takes the same time."""

FINEST = 1e-11, 1e-15
"""The same where stage 2 fails on what stage 1 says is active: many multipliers and
slacks that both vanish are left near the square root of their products."""

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


class StageOne(NamedTuple):
    """The rows, the answer of stage 1, and all its solutions if it is solved."""

    rows: Rows
    answer: Outcome
    face: Face | None


def nearest(
    qp: QP,
    relaxation: Relaxation,
    limits: Limits,
    solve: Solve,
    stage: StageOne | None = None,
) -> Nearest:
    """Return the solution of the feasible problem nearest to an infeasible QP.

    `solve` solves both stages, each under the same limits; `stage` is the first, if it
    has been solved before.
    """
    stage = stage or stage_one(rows_of(qp, relaxation), limits, solve)
    rows, (status, point, *_), face = stage
    if face is None:
        x, message = point.x[: qp.q.size], stage.answer.message
        if status is Status.PRIMAL_INFEASIBLE:
            r, message = np.full(rows.d.size, np.nan), NO_NEAREST + message
        else:
            r, message = rows.violations(x), NOT_LEAST.format(status.value) + message
        return reported(qp, rows, unknown(rows, x), r, status, message)
    found = least_cost(qp, face, limits, solve)
    for sharpened in (balanced, solved_finer) if found.status is Status.STALLED else ():
        sharper = sharpened(face, limits, solve)
        if sharper is not None:
            other = least_cost(qp, sharper, limits, solve)
            if other.status in (Status.SOLVED, Status.DUAL_INFEASIBLE):
                return other
    return found


def contradiction(
    qp: QP, limits: Limits, solve: Solve
) -> tuple[Point | None, StageOne]:
    """Return multipliers of the least shifts, which prove that a QP needs some.

    They are as exact as rounding allows, and not yet tested: see `namlcp.qp.judge`.
    """
    stage = stage_one(rows_of(qp, Relaxation()), limits, solve)
    if stage.face is None:
        return None, stage
    face = balanced(stage.face, limits, solve) or stage.face
    return face.rows.point(face.x, face.v, face.v_box), stage


def stage_one(rows: Rows, limits: Limits, solve: Solve) -> StageOne:
    answer, n = solve_exactly(least_shifts(rows), limits, solve), rows.lb.size
    if answer.status is not Status.SOLVED:
        return StageOne(rows, answer, None)
    x, y, z, z_box = answer.point
    face = face_of(rows, x[:n], np.concatenate((z, y)), z_box[:n])
    return StageOne(rows, answer, face)


def balanced(face: Face, limits: Limits, solve: Solve) -> Face | None:
    """Return a face with multipliers that balance to rounding, if that is done."""
    return face.refined(lambda qp: solve_exactly(qp, limits, solve))


def solved_finer(face: Face, limits: Limits, solve: Solve) -> Face | None:
    """Return the face of stage 1 solved to FINEST, if that is done."""
    eps_abs, eps_rel = FINEST
    finer = limits._replace(eps_abs=eps_abs, eps_rel=eps_rel)
    return stage_one(face.rows, finer, solve).face


def solve_exactly(
    qp: QP, limits: Limits, solve: Solve, guess: Guess = NO_GUESS
) -> Outcome:
    """Return the answer of `solve` to STAGE_TOLERANCES, or to those of the limits."""
    eps_abs, eps_rel = np.minimum(limits.tolerances, STAGE_TOLERANCES).tolist()
    answer = solve(qp, guess, limits._replace(eps_abs=eps_abs, eps_rel=eps_rel))
    if answer.status is Status.STALLED and answer.residuals.solved(*limits.tolerances):
        return answer._replace(status=Status.SOLVED)
    return answer


def least_cost(qp: QP, face: Face, limits: Limits, solve: Solve) -> Nearest:
    rows, x, easier = face.rows, face.x, face.problem(qp)
    # The rows active at x are those of the solution only if they leave x no freedom.
    settled = face.held.size + np.count_nonzero(face.v_box) >= x.size
    guess = make_guess(easier, x, None) if settled else NO_GUESS
    second = solve_exactly(easier, limits, solve, guess)
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
