"""The decorators of every compiled function, and where its machine code is kept.

`kernel` is for functions that Python calls, `part` for those that only compiled
functions call, `pasted` for a stretch of one long function. Machine code is kept in
files, or comes with the package, under a stamp over all sources: a changed package
never runs old code. `sources` has the stamp, `store` the files; `decorators` chooses
compiler and cache, `internals` has all use of numba's inner parts; `signatures` has the
list of all kernels, `ahead` and `prebuilt` compile them before their use.
"""

import functools
from collections.abc import Callable
from typing import Any

from namlcp.compiled.decorators import compile_time, compiled, is_at_hand
from namlcp.compiled.store import kept_in
from namlcp.compiled.views import uncounted

__all__ = [
    "ahead",
    "compile_time",
    "is_at_hand",
    "kept_in",
    "kernel",
    "part",
    "pasted",
    "signatures",
    "uncounted",
]  # ahead and signatures are modules of `warmup`'s own


def kernel(function: Callable[..., Any] | None = None, **options: Any) -> Any:
    """Compile a function that is called from Python; its machine code is kept.

    Options are those of `numba.njit`: error_model, fastmath, parallel.
    """
    if function is None:
        return functools.partial(kernel, **options)
    return compiled(function, nogil=True, no_cfunc_wrapper=True, **options)


def part(function: Callable[..., Any] | None = None, **options: Any) -> Any:
    """Compile a function that only compiled functions call; Python may not.

    It has no machine code of its own: it is part of that of its callers.
    """
    if function is None:
        return functools.partial(part, **options)
    options = {"error_model": "numpy", **options}
    return compiled(function, is_part=True, nogil=True, **options)


def pasted(function: Callable[..., Any]) -> Any:
    """Compile a stretch of one long compiled function as if it stood in its place."""
    return compiled(function, nogil=True, error_model="numpy", inline="always")
