"""How a solve goes on, and how it ended: the same for LCPs and QPs, and all engines."""

import time
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


# ---- the table of the progress, printed when verbose and kept for the history

SILENCE = 2.0
"""Time [s] since the last printed row after which the next row is always printed."""

QP_COLUMNS = ("iter", "primal", "dual", "gap", "step", "active")
LCP_COLUMNS = ("iter", "residual", "active")
COUNTS = ("iter", "active")
"""Columns of integers; the others are of floats."""


def now() -> float:
    """Return time.perf_counter() [s], for compiled code.

    As it is a function in Python, handlers of signals run when it is called, and a
    thread takes an exception that another one has raised in it.
    """
    return time.perf_counter()


class Progress:
    """Rows of one solve; the time [s] since its start is added as the last column."""

    def __init__(self, columns: tuple[str, ...], verbose: bool):
        self.columns, self.verbose = (*columns, "time"), verbose
        self.rows: list[tuple] = []
        self.start, self.last = time.perf_counter(), 0.0  # last: of a printed row

    def say(self, text: str) -> None:
        if self.verbose:
            print(text, flush=True)

    def row(self, iteration: int, *values: float) -> None:
        row = (iteration, *values, time.perf_counter() - self.start)
        if not self.rows:
            names = ("time [s]" if c == "time" else c for c in self.columns)
            self.say("".join(f"{name:>10}" for name in names))
        self.rows.append(row)
        if row[-1] > self.last + SILENCE or is_shown(iteration):
            self.show(row)

    def show(self, row: tuple) -> None:
        self.last = row[-1]
        cells = (
            f"{value:10d}" if name in COUNTS else f"{value:10.2e}"
            for name, value in zip(self.columns, row, strict=True)
        )
        self.say("".join(cells))

    def close(self, answer: Outcome, start: float) -> None:
        if self.rows and self.rows[-1][-1] > self.last:
            self.show(self.rows[-1])
        r, seconds = answer.residuals, time.perf_counter() - start
        if isinstance(r, float):
            found = f"residual {r:.1e}"
        else:
            found = f"primal {r.primal:.0e}, dual {r.dual:.0e}, gap {r.gap:.0e}"
        ending = f"{answer.method}, {answer.iterations} it, {seconds:.1e} s, {found}"
        self.say(f"{answer.status}: {ending}")

    def history(self) -> np.ndarray:
        kinds = [(name, "i8" if name in COUNTS else "f8") for name in self.columns]
        return np.array(self.rows, dtype=kinds)


def is_shown(iteration: int) -> bool:
    """Tell whether to print a row: all below 20, every 10th below 200, and so on."""
    while iteration >= 20:
        if iteration % 10:
            return False
        iteration //= 10
    return True
