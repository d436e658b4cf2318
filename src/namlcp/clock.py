"""The clock that compiled loops look at, see `watch`."""

import time


def now() -> float:
    """Return time.perf_counter() [s].

    As it is a function in Python, handlers of signals run when it is called, and a
    thread takes an exception that another one has raised in it.
    """
    return time.perf_counter()
