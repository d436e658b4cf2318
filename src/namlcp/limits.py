"""When a solve ends: tolerances, a count, a time limit or Ctrl-C.

Loops in Python check the deadline between two iterations; compiled ones are `Watched`.
"""

import time
from typing import NamedTuple

import cython
from cython.cimports.libc.math import INFINITY

from namlcp.status import now

# Operations between two looks at the clock of compiled loops: some milliseconds.
OFTEN = 4_000_000
PASS = 3e-8
"""Seconds for an entry of the matrices that some passes over them take, about: what
prepares a solve is not begun where it would end too late."""


class OutOfTime(Exception):
    """The deadline was reached before any method began."""


class Deadline:
    """The end of a solve: a value of time.perf_counter().

    Loops call `reached` between two iterations, and return the best point after it;
    what prepares a solve calls `check` between two steps.
    """

    def __init__(self, at=INFINITY):
        self.at = at

    def reached(self, seconds=0.0):
        """Tell whether the deadline is reached, or will be in so many seconds."""
        return time.perf_counter() + seconds >= self.at

    def check(self, seconds=0.0):
        if self.reached(seconds):
            raise OutOfTime


NEVER = Deadline()


class Limits(NamedTuple):
    """When a solve ends, and who is told of its iterations.

    eps_abs, eps_rel: tolerances as `Options` and `solve_lcp` define them. max_iter:
    iterations at most; None is the default of the method that runs. report: called
    for every iteration as `Progress.row`, unless None.
    """

    eps_abs: object = 0.0
    eps_rel: object = 0.0
    max_iter: object = None
    deadline: object = NEVER
    report: object = None

    @property
    def tolerances(self):
        return self[:2]


class Watched:
    """What looks at the clock while it runs."""

    def __cinit__(self):
        self.until = INFINITY


def begin_watch(m, until):
    m.since, m.until, m.over, m.interrupted = 0.0, until, False, False


def is_over(m, operations):
    """Count operations; tell whether to stop: time is over, or Ctrl-C came."""
    m.since += operations
    if m.since >= OFTEN and not m.over:
        look_at_clock(m)
    return m.over


def look_at_clock(m):
    """Set whether to stop.

    The call of `now` raises what the handler of a signal does, or another thread. Apart
    from `is_over`, as a function with a block like this takes the GIL whenever it ends.
    """
    m.since = 0.0
    with cython.gil:
        try:
            m.over = now() >= m.until
        except BaseException as error:
            m.over = m.interrupted = True
            m.error = error


def raise_kept(m):
    """Raise what the handler of a signal raised while `m` ran."""
    if m.interrupted:
        error, m.error, m.interrupted = m.error, None, False
        raise error
    return 0
