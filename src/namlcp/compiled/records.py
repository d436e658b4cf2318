"""Records: the numbers and addresses of a solve, which compiled functions take as one.

A record is a `ctypes.Structure`: Python has its fields as attributes. Compiled code
finds the same memory by its address (`record_at`), or as an array of one entry
(`new_record`, `record_of`).
"""

import ctypes
import functools
from collections.abc import Callable
from typing import Any, TypeVar

import numba
import numpy as np
from numba import config

from namlcp.compiled.views import arrays_at

FIELD_TYPES = {int: ctypes.c_int64, float: ctypes.c_double, bool: ctypes.c_bool}
"""Types of fields. Addresses are int64 too."""

S = TypeVar("S", bound=ctypes.Structure)


def fields(*rows: tuple[str, type]) -> tuple[tuple[str, Any], ...]:
    """Return the `_fields_` of a structure.

    A row has names with blanks between them, and the type of these fields: int, float
    or bool.
    """
    return tuple(
        (name, FIELD_TYPES[kind]) for names, kind in rows for name in names.split()
    )


@functools.cache  # NumPy takes half a millisecond for hundreds of fields
def dtype_of(structure: type[ctypes.Structure]) -> np.dtype:
    """Return the dtype of the records of this structure."""
    return np.dtype((np.record, np.dtype(structure)))


def new_record(structure: type[S]) -> tuple[S, np.ndarray]:
    """Return an empty record, as an object and as an array of one entry for kernels."""
    record = structure()
    return record, np.frombuffer(memoryview(record), dtype_of(structure))


def address_of(array: np.ndarray) -> int:
    """Return where the entries of an array begin."""
    return array.__array_interface__["data"][0]


class Fields:
    """The record state[0] for functions that are not compiled.

    The fields of NumPy's own records are hidden by attributes such as `size`.
    """

    def __init__(self, state: np.ndarray) -> None:
        object.__setattr__(self, "_record", state)  # no field begins with _

    def __getattr__(self, name: str) -> Any:
        """Return a field."""
        return self._record[name][0]

    def __setattr__(self, name: str, value: Any) -> None:
        """Set a field."""
        self._record[name][0] = value


def record_at(structure: type[ctypes.Structure]) -> Callable[[int], Any]:
    """Return the compiled function of an address for the record of this kind there.

    An array of one record takes 0.16 us longer to pass from Python than its address.
    """
    at = arrays_at(dtype_of(structure))
    if config.DISABLE_JIT:
        return lambda address: Fields(at(address, 1))

    @numba.njit(inline="always")
    def record(address):
        return at(address, 1)[0]

    return record
