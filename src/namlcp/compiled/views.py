"""Views of memory without a reference count, and pointers, for compiled functions."""

import ctypes
from collections.abc import Callable
from typing import Any

import numba
import numpy as np
from llvmlite import ir
from numba import config, from_dtype, types
from numba.extending import intrinsic

from namlcp.compiled.decorators import is_known


def itself(array: Any) -> Any:
    """Return the array."""
    return array


def interpreted(kind: Any) -> Callable[[int, Any], np.ndarray]:
    """Return `arrays_at` for functions that are not compiled."""

    def at(address: int, shape: Any) -> np.ndarray:
        size = int(np.prod(shape)) * np.dtype(kind).itemsize
        memory: Any = (ctypes.c_char * size).from_address(int(address))
        return np.frombuffer(memory, kind).reshape(shape)

    return at


def portable(kind: Any) -> Any:
    """Return `arrays_at` without private parts of numba."""

    @intrinsic
    def pointer(typingctx: Any, address: Any) -> Any:
        def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            return builder.inttoptr(arguments[0], ir.IntType(8).as_pointer())

        return types.voidptr(types.int64), codegen

    @numba.njit
    def at(address, shape):
        return numba.carray(pointer(address), shape, kind)

    return at


def pointers_to(kind: Any) -> Any:
    """Return the compiled function of (address, size) for a pointer to such entries.

    A pointer p has the entries p[i] for i >= 0, and no size: it is one value, an array
    seven. With NUMBA_BOUNDSCHECK, and in functions that are not compiled, it is a
    vector of that size.
    """
    if config.DISABLE_JIT or config.BOUNDSCHECK:
        return arrays_at(kind)
    pointer = types.CPointer(from_dtype(np.dtype(kind)))

    @intrinsic
    def at(typingctx: Any, address: Any, size: Any) -> Any:
        def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            return builder.inttoptr(arguments[0], context.get_value_type(pointer))

        return pointer(types.int64, types.int64), codegen

    return at


def chosen() -> tuple[Any, Any]:
    """Return `entries` and `arrays_at`."""
    if config.DISABLE_JIT:
        return itself, interpreted
    if is_known():
        from namlcp.compiled import internals

        pointer = numba.njit(itself) if config.BOUNDSCHECK else internals.entries
        return pointer, internals.arrays_at
    return numba.njit(itself), portable


entries, arrays_at = chosen()
floats, ints, longs = map(arrays_at, (np.float64, np.int32, np.int64))
floats_at, ints_at, longs_at = map(pointers_to, (np.float64, np.int32, np.int64))
