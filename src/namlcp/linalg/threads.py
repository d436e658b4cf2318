"""How many threads BLAS may use: one, unless more are asked for.

OpenBLAS lets the threads of one small factorisation wait for each other. Where another
process keeps one of them off its core all of them wait, and a solve takes many times as
long. On an idle machine with two cores a second thread gains 5 to 15 % of dense QPs
with 600 to 1800 variables and rows, and nothing below or of dense LCPs. So a solve runs
on one thread, a QP of that size on more where they are asked for, and the user's own
setting is restored after it.

The setting is one of the whole process. Solves that run at once in several threads of
Python count themselves: the last one out restores what the first one found.
"""

import contextlib
import ctypes
import functools
import os
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import scipy.linalg

# Orders of the largest dense matrix up to which the setting is left alone, as threads
# change nothing, and from which on more threads than one may pay.
SMALL_ORDER, WORTH_ORDER = 100, 600
# How the BLAS libraries set and tell their number of threads.
NAMES = (
    ("scipy_openblas_set_num_threads", "scipy_openblas_get_num_threads"),
    ("scipy_openblas_set_num_threads64_", "scipy_openblas_get_num_threads64_"),
    ("openblas_set_num_threads", "openblas_get_num_threads"),
    ("openblas_set_num_threads64_", "openblas_get_num_threads64_"),
    ("MKL_Set_Num_Threads", "MKL_Get_Max_Threads"),
    ("bli_thread_set_num_threads", "bli_thread_get_num_threads"),
)

Setting = tuple[Callable[[int], None], Callable[[], int]]


@functools.cache
def settings() -> list[Setting]:
    """Return how to set and read the number of threads, for NumPy's and SciPy's BLAS.

    A library whose functions cannot be found is left alone.
    """
    found: dict[int | None, Setting] = {}
    for file in extension_modules():
        with contextlib.suppress(OSError):
            library = ctypes.CDLL(file)  # it is loaded already; its own libraries too
            for put_name, get_name in NAMES:
                put, get = (getattr(library, n, None) for n in (put_name, get_name))
                if put is not None and get is not None:
                    put.argtypes, put.restype = [ctypes.c_int], None
                    address = ctypes.cast(put, ctypes.c_void_p).value
                    found[address] = put, get
                    break
    return list(found.values())


def extension_modules() -> Iterator[str]:
    """Yield files that are linked with NumPy's BLAS and with SciPy's.

    On Windows a search of such a file does not reach the libraries it is linked with;
    they lie in a folder beside the package.
    """
    for name in (
        "numpy._core._multiarray_umath",
        "numpy.core._multiarray_umath",  # before NumPy 2
        "scipy.linalg._fblas",
    ):
        module = sys.modules.get(name)
        if module is not None and module.__file__:
            yield module.__file__
    if os.name == "nt":
        for package in (np, scipy):
            folder = Path(f"{package.__path__[0]}.libs")
            yield from map(str, folder.glob("*openblas*"))


class BlasThreads:
    """Counts the solves that run, and sets what the largest of them asks for."""

    def __init__(self) -> None:
        self.lock = threading.Lock()
        self.asked: list[int] = []
        self.before: list[int] = []

    def enter(self, threads: int) -> None:
        """Begin a solve with this number of threads."""
        with self.lock:
            if not self.asked:
                self.before = [get() for _, get in settings()]
            self.asked.append(threads)
            self.put()

    def leave(self, threads: int) -> None:
        """End a solve with this number of threads."""
        with self.lock:
            if threads in self.asked:  # not so in a child of fork
                self.asked.remove(threads)
                self.put()

    def put(self) -> None:
        """Set the number of threads: what is asked for, or what it was before."""
        for (put, get), before in zip(settings(), self.before, strict=True):
            wanted = max(self.asked, default=before)
            if get() != wanted:
                put(wanted)

    def forget(self) -> None:
        """Begin anew in a child of fork, where the threads that solved are not."""
        self.lock = threading.Lock()
        if self.asked:
            self.asked.clear()
            self.put()


BLAS_THREADS = BlasThreads()
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=BLAS_THREADS.forget)


NOTHING: contextlib.AbstractContextManager[None] = contextlib.nullcontext()


@contextlib.contextmanager
def limited(threads: int) -> Iterator[None]:
    """Let BLAS use so many threads in a block."""
    BLAS_THREADS.enter(threads)
    try:
        yield
    finally:
        BLAS_THREADS.leave(threads)


def blas_threads(threads: int, order: int) -> contextlib.AbstractContextManager[None]:
    """Let BLAS use up to `threads` threads in a block, one where more do not pay.

    `order` is that of the largest matrix that may be dense; nothing is set for a small
    one.
    """
    if order <= SMALL_ORDER or not settings():
        return NOTHING
    return limited(threads if order >= WORTH_ORDER else 1)
