"""Stage 1: the least shifts, as exactly as they can be had."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from namlcp.limits import Limits
from namlcp.outcome import Outcome
from namlcp.qp.closest.face import Face, face_of
from namlcp.qp.closest.rows import Rows
from namlcp.qp.closest.shifts import least_shifts
from namlcp.qp.guess import NO_GUESS, Guess
from namlcp.qp.problem import QP, Point
from namlcp.status import Status

Solve = Callable[..., Outcome]
"""Solves a QP: (qp, guess, limits), see `namlcp.qp.route`."""

STAGE_TOLERANCES = 1e-9, 1e-13
"""eps_abs and eps_rel of both stages, at most: what is active is read from the last
digits of multipliers. A looser eps_rel leaves products of multipliers and slacks of
1e-6 and more where objectives are large, and takes the same time."""


class StageOne(NamedTuple):
    """The rows, and the answer of stage 1, whose point may lack the shifts."""

    rows: Rows
    answer: Outcome

    @property
    def x(self) -> np.ndarray:
        """An x that has the least shifts."""
        return self.answer.point.x[: self.rows.lb.size]

    @property
    def v(self) -> np.ndarray:
        """The multipliers of the rows."""
        return np.concatenate((self.answer.point.z, self.answer.point.y))

    @property
    def v_box(self) -> np.ndarray:
        """The multipliers of the bounds."""
        return self.answer.point.z_box[: self.rows.lb.size]

    def face(self) -> Face:
        """Return all solutions."""
        return face_of(self.rows, self.x, self.v, self.v_box)

    def sharpened(self, limits: Limits, solve: Solve) -> "StageOne":
        """Return stage 1 with multipliers that balance to rounding, if that is done."""
        if self.answer.status is not Status.SOLVED:
            return self
        face = self.face().refined(
            lambda qp: solve_exactly(qp, NO_GUESS, limits, solve)
        )
        if face is None:
            return self
        m = face.v.size - self.rows.p
        point = Point(self.x, face.v[m:], face.v[:m], face.v_box)
        return self._replace(answer=self.answer._replace(point=point))


def stage_one(rows: Rows, limits: Limits, solve: Solve) -> StageOne:
    """Return the least shifts of the rows."""
    return StageOne(rows, solve_exactly(least_shifts(rows), NO_GUESS, limits, solve))


def solve_exactly(qp: QP, guess: Guess, limits: Limits, solve: Solve) -> Outcome:
    """Return the answer of `solve` to STAGE_TOLERANCES, or to those of the limits."""
    eps_abs, eps_rel = np.minimum(limits.tolerances, STAGE_TOLERANCES).tolist()
    answer = solve(qp, guess, limits._replace(eps_abs=eps_abs, eps_rel=eps_rel))
    if answer.status is Status.STALLED and answer.residuals.solved(*limits.tolerances):
        return answer._replace(status=Status.SOLVED)
    return answer
