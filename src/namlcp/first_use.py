"""`warmup`: compile all kernels before the first solve, for containers and CI."""

import os
import time

from namlcp.compiled import ahead, kept_in, signatures
from namlcp.options import check_count, check_flag
from namlcp.progress import show_share


def warmup(progress: bool = True, processes: int | None = None) -> None:
    """Compile all kernels that have no machine code yet, and keep it.

    Otherwise a kernel is compiled when it is first called, which takes seconds, and its
    machine code is kept for later processes. It is kept beside the package, else in the
    user's folder for caches, or in NUMBA_CACHE_DIR alone where that is set. Where no
    folder can be written, everything is compiled for this process alone.

    Parameters
    ----------
    progress : bool
        Draw a bar on standard output.
    processes : int, optional
        How many processes compile at once; by default the number of cores.

    Raises
    ------
    TypeError, ValueError
        An argument is not of the types above, or processes < 1.
    RuntimeError
        A process that compiled ended early.

    Examples
    --------
    >>> import namlcp
    >>> namlcp.warmup()  # doctest: +SKIP
    [##############################] 105 of 105
    30.1 s; machine code in .../namlcp/__pycache__/kernels/2b9c...
    """
    check_flag("progress", progress)
    if processes is not None:
        check_count("processes", processes)
    start = time.perf_counter()
    total = len(signatures.listed())
    for done, _ in enumerate(
        ahead.compile_all(processes or os.cpu_count() or 1), start=1
    ):
        if progress:
            show_share(done, total)
    if progress:
        where = kept_in() or "memory alone: no folder can be written"
        print(f"{time.perf_counter() - start:.1f} s; machine code in {where}")
