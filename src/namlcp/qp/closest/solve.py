"""Both stages, and the judgement of what they find on the user's own data."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from namlcp.limits import Limits
from namlcp.options import Relaxation
from namlcp.qp.closest.face import Face, face_of
from namlcp.qp.closest.rows import Rows, least_shifts, rows_of
from namlcp.qp.problem import NO_GUESS, QP, Guess, Point, make_guess
from namlcp.residuals import UNDEFINED, Residuals, qp_residuals
from namlcp.status import Outcome, Status

Solve = Callable[..., Outcome]
"""Solves a QP: (qp, guess, limits), see `namlcp.qp.route`."""

STAGE_TOLERANCES = 1e-9, 1e-13
"""eps_abs and eps_rel of both stages, at most: what is active is read from the last
digits of multipliers. A looser eps_rel leaves products of multipliers and slacks of
1e-6 and more where objectives are large, and takes the same time."""

FINEST = {"eps_abs": 1e-11, "eps_rel": 1e-15}
"""The same where stage 2 fails on what stage 1 says is active: many multipliers and
slacks that both vanish are left near the square root of their products."""

LARGER = 1.0 + 1e-7
"""Weighted sum of least shifts over that of stage 1, at most."""

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


StageOne = tuple[Rows, Outcome, Face | None]
"""The rows, the answer of stage 1, and all its solutions if it is solved."""


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
    exactly = partial(solve_exactly, limits=limits, solve=solve)
    rows, answer, face = stage or stage_one(rows_of(qp, relaxation), exactly)
    if face is None:
        x, status, message = answer.point.x[: qp.q.size], answer.status, answer.message
        if status is Status.PRIMAL_INFEASIBLE:
            r, message = np.full(rows.d.size, np.nan), NO_NEAREST + message
        else:
            r, message = rows.violations(x), NOT_LEAST.format(status.value) + message
        return reported(qp, rows, x, r, status, message)
    found = least_cost(qp, face, limits, exactly)
    finer = partial(solve_exactly, limits=limits._replace(**FINEST), solve=solve)
    tries = (lambda: face.refined(exactly)), (lambda: stage_one(rows, finer)[-1])
    for sharpened in tries if found.status is Status.STALLED else ():
        sharper = sharpened()
        if sharper is not None:
            other = least_cost(qp, sharper, limits, exactly)
            # rows let go wrongly would leave a solution with larger shifts
            most = LARGER * rows.cost(face.x) + limits.eps_abs
            is_least = other.status is Status.SOLVED and rows.cost(other.x) <= most
            if is_least or other.status is Status.DUAL_INFEASIBLE:
                return other
    return found


def contradiction(
    qp: QP, limits: Limits, solve: Solve
) -> tuple[Point | None, StageOne]:
    """Return multipliers of the least shifts, which prove that a QP needs some.

    They are as exact as rounding allows, and not yet tested: see `namlcp.qp.judge`.
    """
    exactly = partial(solve_exactly, limits=limits, solve=solve)
    rows, _, face = stage = stage_one(rows_of(qp, Relaxation()), exactly)
    if face is None:
        return None, stage
    face = face.refined(exactly) or face
    return rows.point(face.x, face.v, face.v_box), stage


def stage_one(rows: Rows, exactly: Callable[[QP], Outcome]) -> StageOne:
    answer, n = exactly(least_shifts(rows)), rows.lb.size
    if answer.status is not Status.SOLVED:
        return rows, answer, None
    x, y, z, z_box = answer.point
    return rows, answer, face_of(rows, x[:n], np.concatenate((z, y)), z_box[:n])


def solve_exactly(
    qp: QP, limits: Limits, solve: Solve, guess: Guess = NO_GUESS
) -> Outcome:
    """Return the answer of `solve` to STAGE_TOLERANCES, or to those of the limits."""
    eps_abs, eps_rel = np.minimum(limits.tolerances, STAGE_TOLERANCES).tolist()
    answer = solve(qp, guess, limits._replace(eps_abs=eps_abs, eps_rel=eps_rel))
    if answer.status is Status.STALLED and answer.residuals.solved(*limits.tolerances):
        return answer._replace(status=Status.SOLVED)
    return answer


def least_cost(
    qp: QP, face: Face, limits: Limits, exactly: Callable[..., Outcome]
) -> Nearest:
    rows, x, easier = face.rows, face.x, face.problem(qp)
    # The rows active at x are those of the solution only if they leave x no freedom.
    settled = face.held.size + np.count_nonzero(face.v_box) >= x.size
    guess = make_guess(easier, x, None) if settled else NO_GUESS
    second, multipliers = exactly(easier, guess=guess), None
    status, message = second.status, second.message
    r = face.shifts(x)
    if status is Status.DUAL_INFEASIBLE:
        x = second.point.x
    elif status is Status.SOLVED:
        x, *multipliers = face.point(second.point)
        r = face.shifts(x)
    else:
        message = NOT_MINIMISED.format(status.value) + message
        if status not in (Status.TIME_LIMIT, Status.MAX_ITER):
            status = Status.STALLED
    found = reported(qp, rows, x, r, status, message, multipliers)
    residuals = found.residuals
    if status is not Status.SOLVED:
        return found
    if residuals.solved(*limits.tolerances):
        return found._replace(stages=(face, easier, second.point))
    if not residuals._replace(dual=0.0, gap=0.0).solved(*limits.tolerances):
        x, r = face.x, face.shifts(face.x)
    message = UNPROVED.format(*residuals[:3]) + message
    return reported(qp, rows, x, r, Status.STALLED, message)


def reported(
    qp: QP,
    rows: Rows,
    x: np.ndarray,
    r: np.ndarray,
    status: Status,
    message: str,
    multipliers: Sequence[np.ndarray] | None = None,
) -> Nearest:
    """Return a point and shifts of the rows as the user wants them, with residuals.

    Without multipliers, which a solution has, these and the residuals are NaN.
    """
    h, b, lb, ub = rows.shifts(r)
    shifted = qp._replace(h=qp.h + h, b=qp.b + b, lb=qp.lb + lb, ub=qp.ub + ub)
    if multipliers is None:
        y, z, z_box = (np.full(v.size, np.nan) for v in (qp.b, qp.h, qp.q))
        residuals = UNDEFINED
    else:
        y, z, z_box = multipliers
        residuals = qp_residuals(*shifted, x, y, z, z_box)
    norm, message = rows.norm, message.strip()
    return Nearest(status, x, y, z, z_box, residuals, h, b, lb, ub, norm, message)
