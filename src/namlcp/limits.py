"""When a solve ends: tolerances, a count, a time limit or Ctrl-C.

Loops in Python check the deadline between two iterations, compiled functions that may
run long by `namlcp.watch`.
"""

import functools
import math
import time
from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar

from namlcp.progress import Report

OFTEN = 4_000_000
"""Operations of compiled code between two checks of the deadline: some milliseconds."""

F = TypeVar("F", bound=Callable[..., Any])


def now() -> float:
    """Return time.perf_counter() [s].

    As it is a function in Python, handlers of signals run when it is called, and a
    thread takes an exception that another one has raised in it.
    """
    return time.perf_counter()


class Deadline:
    """The end of a solve: a value of time.perf_counter().

    Loops call `reached` between two iterations, and return the best point after it.
    """

    def __init__(self, at: float = math.inf) -> None:
        self.at = at

    def reached(self) -> bool:
        """Tell whether to stop."""
        return time.perf_counter() >= self.at


NEVER = Deadline()


def silent(kernel: Any) -> None:
    """Do nothing, in place of `Progress.announce`."""


class Limits(NamedTuple):
    """When a solve ends, and who is told of its iterations.

    eps_abs, eps_rel: tolerances as `Options` and `solve_lcp` define them. max_iter:
    iterations at most; None is the default of the method that runs. report: called
    for every iteration as `Progress.row`, unless None. announce: called with the first
    kernel of a method before that runs, as `Progress.announce`.
    """

    eps_abs: float = 0.0
    eps_rel: float = 0.0
    max_iter: int | None = None
    deadline: Deadline = NEVER
    report: Report = None
    announce: Callable[[Any], None] = silent

    @property
    def tolerances(self) -> tuple[float, float]:
        """The pair (eps_abs, eps_rel)."""
        return self.eps_abs, self.eps_rel


def cause_of(error: SystemError) -> BaseException:
    """Return KeyboardInterrupt if that is the cause of a chain of errors, else error.

    For `interruptible`, and for those who have no time for its wrapper.
    """
    cause: BaseException | None = error
    while isinstance(cause, SystemError):
        cause = cause.__cause__
    return KeyboardInterrupt() if isinstance(cause, KeyboardInterrupt) else error


def interruptible(function: F) -> F:
    """Raise KeyboardInterrupt where compiled code turned it into a SystemError.

    That happens if a signal's handler raises while compiled code returns its result;
    the KeyboardInterrupt may be the cause of a chain of such errors.
    """

    @functools.wraps(function)
    def guarded(*arguments: Any, **settings: Any) -> Any:
        try:
            return function(*arguments, **settings)
        except SystemError as error:
            raise cause_of(error) from None

    return guarded  # type: ignore[return-value]
