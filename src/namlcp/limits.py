"""When a solve ends: tolerances, a count, a time limit or Ctrl-C.

Loops in Python check the deadline between two iterations. Compiled loops look at the
clock, see `watch`, by a call of `now`.
"""

import math
import time
from typing import NamedTuple

from namlcp.progress import Report

OFTEN = 4_000_000
"""Operations of compiled code between two looks at the clock: some milliseconds."""


def now() -> float:
    """Return time.perf_counter() [s].

    As it is a function in Python, handlers of signals run when it is called, and a
    thread takes an exception that another one has raised in it.
    """
    return time.perf_counter()


class OutOfTime(Exception):
    """The deadline was reached before any method began."""


class Deadline:
    """The end of a solve: a value of time.perf_counter().

    Loops call `reached` between two iterations, and return the best point after it;
    what prepares a solve calls `check` between two steps.
    """

    def __init__(self, at: float = math.inf) -> None:
        self.at = at

    def reached(self) -> bool:
        """Tell whether to stop."""
        return time.perf_counter() >= self.at

    def check(self) -> None:
        """Raise OutOfTime if the deadline is reached."""
        if self.reached():
            raise OutOfTime


NEVER = Deadline()


class Limits(NamedTuple):
    """When a solve ends, and who is told of its iterations.

    eps_abs, eps_rel: tolerances as `Options` and `solve_lcp` define them. max_iter:
    iterations at most; None is the default of the method that runs. report: called
    for every iteration as `Progress.row`, unless None.
    """

    eps_abs: float = 0.0
    eps_rel: float = 0.0
    max_iter: int | None = None
    deadline: Deadline = NEVER
    report: Report = None

    @property
    def tolerances(self) -> tuple[float, float]:
        """The pair (eps_abs, eps_rel)."""
        return self.eps_abs, self.eps_rel
