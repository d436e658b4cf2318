"""The number of threads of BLAS: one during a solve, unless more are asked for.

The threads of OpenBLAS wait for each other in every small factorisation: if another
process occupies the core of one, a solve takes many times as long. On an idle machine a
second thread saves 5 to 15 % of the time of dense QPs with 600 to 1800 variables and
rows. In a large sparse QP the `fronts` have the threads, each with a BLAS of one.

The setting belongs to the process. Of solves that run at once in several threads of
Python, the last to end restores the setting that the first one found.
"""

import contextlib
import contextvars
import ctypes
import functools
import os
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import scipy.linalg

# Orders of the largest dense matrix up to which the setting is left alone, as threads
# make no difference, and from which on more than one may pay.
UNTOUCHED_ORDER, WORTH_ORDER = 100, 600
# Functions of the BLAS libraries that set and return their number of threads.
NAMES = (
    ("scipy_openblas_set_num_threads", "scipy_openblas_get_num_threads"),
    ("scipy_openblas_set_num_threads64_", "scipy_openblas_get_num_threads64_"),
    ("openblas_set_num_threads", "openblas_get_num_threads"),
    ("openblas_set_num_threads64_", "openblas_get_num_threads64_"),
    ("MKL_Set_Num_Threads", "MKL_Get_Max_Threads"),
    ("bli_thread_set_num_threads", "bli_thread_get_num_threads"),
)

Setting = tuple[Callable[[int], None], Callable[[], int]]

THREADS = contextvars.ContextVar("threads", default=1)
"""How many threads a solve may use beside those of BLAS."""

# What the blocks that run ask of BLAS, and what the first one found.
ASKED: list[int] = []
BEFORE: list[int] = []
LOCK = threading.Lock()


@functools.cache
def settings() -> list[Setting]:
    """Return these functions of NumPy's and SciPy's BLAS, where they can be found."""
    names = (
        "numpy._core._multiarray_umath",
        "numpy.core._multiarray_umath",  # before NumPy 2
        "scipy.linalg._fblas",
    )
    modules = [sys.modules[name] for name in names if name in sys.modules]
    files: list[Any] = [module.__file__ for module in modules if module.__file__]
    if os.name == "nt":  # where symbols of linked libraries are not found through these
        for package in (np, scipy):
            files += Path(f"{package.__path__[0]}.libs").glob("*openblas*")
    found: dict[int | None, Setting] = {}
    for file in files:
        with contextlib.suppress(OSError):
            library = ctypes.CDLL(str(file))  # loaded, with the BLAS it is linked to
            for put_name, get_name in NAMES:
                put, get = (getattr(library, n, None) for n in (put_name, get_name))
                if put is not None and get is not None:
                    put.argtypes, put.restype = [ctypes.c_int], None
                    address = ctypes.cast(put, ctypes.c_void_p).value
                    found[address] = put, get
                    break
    return list(found.values())


@contextlib.contextmanager
def limited(threads: int, blas: int) -> Iterator[None]:
    """Be a block of a solve with so many threads, of which BLAS may use its own number.

    Of blocks that run at once, the one that asks most of BLAS counts.
    """
    outer = THREADS.set(threads)
    with LOCK:
        if not ASKED:
            BEFORE[:] = [get() for _, get in settings()]
        ASKED.append(blas)
        put_threads()
    try:
        yield
    finally:
        THREADS.reset(outer)
        with LOCK:
            if blas in ASKED:  # not so in a child of fork
                ASKED.remove(blas)
                put_threads()


def put_threads() -> None:
    """Set the largest number asked for, or the number before the first block."""
    for (put, get), before in zip(settings(), BEFORE, strict=True):
        wanted = max(ASKED, default=before)
        if get() != wanted:
            put(wanted)


def forget() -> None:
    """Start anew in a forked process, which has none of the threads that solved."""
    global LOCK
    LOCK = threading.Lock()
    if ASKED:
        ASKED.clear()
        put_threads()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=forget)


def blas_threads(
    threads: int, order: int, dense: bool = True
) -> contextlib.AbstractContextManager[None]:
    """Let BLAS use `threads` threads in a `with` block, one where more do not pay.

    `order`: of the largest matrix that may be dense; up to UNTOUCHED_ORDER nothing is
    set. Unless it is `dense`, BLAS has one, and the others are left: `THREADS`.
    """
    if order <= UNTOUCHED_ORDER:
        return contextlib.nullcontext()
    blas = threads if dense and order >= WORTH_ORDER else 1
    return limited(threads // blas, blas)
