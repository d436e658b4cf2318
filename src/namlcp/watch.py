"""When compiled code stops before its end: the time limit, or Ctrl-C."""

import cython
from cython.cimports.libc.math import INFINITY

from namlcp.clock import now

# Operations between two looks at the clock: some milliseconds.
OFTEN = 4_000_000


class Watched:
    """What looks at the clock while it runs."""

    def __cinit__(self):
        self.until = INFINITY


def begin_watch(m, until):
    """Begin to look at the clock; until: a value of time.perf_counter()."""
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
