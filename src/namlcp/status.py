"""How a solve ended: one Enum for LCPs and QPs, and what every engine returns."""

from enum import StrEnum
from typing import Any, NamedTuple

import numpy as np


class Status(StrEnum):
    """Outcome of a solve: a string for machines, with an `explanation` for people.

    Examples
    --------
    >>> from namlcp import Status
    >>> Status.SOLVED == "solved"
    True
    >>> Status("time_limit").explanation
    'Time limit reached; the best point is returned. Raise time_limit.'
    """

    explanation: str

    SOLVED = "solved", "All residuals on the user's own data are within tolerance."
    PRIMAL_INFEASIBLE = (
        "primal_infeasible",
        "No x satisfies the constraints; y, z, z_box prove it (Farkas) for every x of "
        "1-norm below the reciprocal of the certificate's residual.",
    )
    DUAL_INFEASIBLE = (
        "dual_infeasible",
        "The objective falls without bound along the ray x: the problem is unbounded "
        "if any x is feasible.",
    )
    MAX_ITER = (
        "max_iter",
        "Iteration limit reached; the best point is returned. "
        "Raise max_iter or loosen eps_abs.",
    )
    TIME_LIMIT = (
        "time_limit",
        "Time limit reached; the best point is returned. Raise time_limit.",
    )
    STALLED = (
        "stalled",
        "Rounding errors stop further progress, or the method has come to its end; the "
        'best point is returned. Loosen eps_abs or eps_rel; LCP: method="auto", which '
        "may leave it open whether there is a solution.",
    )
    DIVERGED = (
        "diverged",
        "The sweeps diverge or cycle on this matrix; the best point is returned. "
        'Use method="auto", or another omega and alpha.',
    )
    UNSOLVABLE = (
        "unsolvable",
        "The LCP has no solution: a ray proves it, or `message` says how it was found.",
    )
    NUMERICAL_ERROR = (
        "numerical_error",
        "A factorisation broke down, or a product was not finite; NaN is returned.",
    )
    INVALID = (
        "invalid",
        "Of an item of a batch: an argument is malformed, or P not positive "
        "semidefinite; the message says which. Alone it would have raised an error.",
    )

    def __new__(cls, value: str, explanation: str) -> "Status":
        member = str.__new__(cls, value)
        member._value_ = value
        member.explanation = explanation
        return member


FINAL = (
    Status.SOLVED,
    Status.PRIMAL_INFEASIBLE,
    Status.DUAL_INFEASIBLE,
    Status.UNSOLVABLE,
)
"""Statuses that decide a problem."""
ENDS = (*FINAL, Status.TIME_LIMIT)
"""Statuses after which no other method is to be tried."""

OBJECTIVE = {Status.PRIMAL_INFEASIBLE: np.inf, Status.DUAL_INFEASIBLE: -np.inf}
"""Objective of a QP with a certificate."""


class Outcome(NamedTuple):
    """How the solve of a QP or an LCP ended, and which method found that.

    point: the `Point` of a QP, a certificate if the status is proved by one; the
    `LCPPoint` of an LCP. residuals: those on the data of the problem, `Residuals` of a
    QP, Res(z) of an LCP. ray: with UNSOLVABLE the proof of an LCP, beside its best
    point. closest: the `Nearest` of an infeasible QP, if that was asked for. factors:
    those that derivatives of a QP can use.
    """

    status: Status
    point: Any
    residuals: Any
    iterations: int
    method: str
    message: str = ""
    ray: np.ndarray | None = None
    closest: Any = None
    factors: Any = None
