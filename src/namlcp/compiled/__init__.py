"""Decorators of compiled functions, and the files that keep their machine code.

`kernel` compiles a function that Python calls, `part` one that only compiled functions
call, `pasted` one that is inlined into its callers. Machine code is kept in files,
under a hash of all sources (the stamp): a changed package never runs old code.
`sources` computes the stamp, `store` reads and writes the files, `decorators` chooses
compiler and cache, `internals`, `compiler`, `passes`, `lowering` and `functions` hold
all use of numba's private parts, `signatures` reads the list of all kernels
(`kernels.txt`), `ahead` compiles them before their first call, `views` makes arrays
without reference counts, and pointers, and `records` lays out the numbers and addresses
of a solve.
"""

import functools
from collections.abc import Callable
from typing import Any

from numba import config

from namlcp.compiled.decorators import compile_time, compiled, is_at_hand
from namlcp.compiled.records import (
    Fields,
    address_of,
    fields,
    new_record,
    record_at,
)
from namlcp.compiled.store import kept_in
from namlcp.compiled.views import (
    entries,
    floats,
    floats_at,
    ints,
    ints_at,
    longs,
    longs_at,
)

__all__ = [
    "address_of",
    "ahead",
    "compile_time",
    "entries",
    "fields",
    "floats",
    "floats_at",
    "ints",
    "ints_at",
    "is_at_hand",
    "kept_in",
    "kernel",
    "longs",
    "longs_at",
    "new_record",
    "part",
    "pasted",
    "record_at",
    "record_of",
    "signatures",
]  # ahead and signatures are modules that only `namlcp.warmup` needs


def kernel(function: Callable[..., Any] | None = None, **options: Any) -> Any:
    """Compile a function that Python calls; options are those of `numba.njit`."""
    if function is None:
        return functools.partial(kernel, **options)
    return compiled(function, nogil=True, no_cfunc_wrapper=True, **options)


def part(function: Callable[..., Any] | None = None, **options: Any) -> Any:
    """Compile a function that only compiled functions call, into their machine code.

    It has no machine code of its own: a call from Python raises TypeError. Options are
    those of `numba.njit`; error_model is "numpy" unless given.
    """
    if function is None:
        return functools.partial(part, **options)
    options = {"error_model": "numpy", **options}
    return compiled(function, is_part=True, nogil=True, **options)


def pasted(function: Callable[..., Any]) -> Any:
    """Compile a function that numba inlines into its compiled callers.

    numba translates it anew for each of them. ``part(forceinline=True)`` leaves that to
    LLVM, and compiles in two thirds of the time: this is for functions that return a
    record or a view, which would be a copy, or be counted.
    """
    return compiled(function, nogil=True, error_model="numpy", inline="always")


def first(state: Any) -> Any:
    """Return the record of an array of one record."""
    return state[0]


record_of = Fields if config.DISABLE_JIT else pasted(first)
