"""Checks of the user's arrays: each becomes a clean one, or an error names the fault.

Clean arrays are writeable float64: dense matrices C-contiguous, sparse ones canonical
(sorted, no duplicates) with int32 indices, vectors 1-D and contiguous. The caller's
arrays are never changed; those that are clean already are passed on without a copy.
"""

import functools
import math
import operator
from numbers import Number
from typing import Any

import numpy as np
import scipy.sparse as sp

from namlcp.arrays import (
    Order,
    compressed,
    constant,
    from_arrays,
    index_order,
    is_bad,
    narrowed,
    refuse_size,
    transposed,
)

INFINITE = 0.999e20
"""Bounds of at least this modulus mean "no bound". The QP collections write 1e20, and
some of these numbers have become slightly smaller by scaling."""

LEAST_DIVISOR = 1e-300
"""What a divisor >= 0 is raised to if it is smaller, so that 0 over it is 0."""


def clean_copy(array: np.ndarray) -> np.ndarray:
    if array.dtype == np.float64 and array.flags.carray:
        return array
    return np.array(array, np.float64, order="C")


def real_array(name: str, value: Any) -> np.ndarray:
    """Return `value` as a writeable C-contiguous float64 array, copied if need be."""
    refuse_view(name, value)
    if getattr(value, "requires_grad", None) is True:
        raise TypeError(
            f"{name} requires grad: namlcp.torch.solve_qp differentiates QPs of "
            f"tensors; or pass {name}.detach()"
        )
    if value is None or np.ma.is_masked(value):
        raise not_real(name, "None" if value is None else "masked entries")
    try:
        array = np.asarray(value)
    except (TypeError, ValueError) as error:
        reason = str(error).partition("\n")[0]
        raise not_real(name, f"{type(value).__name__} ({reason})") from None
    if array.dtype.kind == "O":
        array = exact_numbers(name, array)
    if array.dtype.kind not in "biuf":
        raise not_real(name, f"dtype {array.dtype}")
    return clean_copy(array)


def not_real(name: str, came: str) -> TypeError:
    return TypeError(f"{name} must be an array of real numbers, got {came}")


def exact_numbers(name: str, array: np.ndarray) -> np.ndarray:
    """Return an array of objects as one of float64; raise unless they are equal."""
    found = np.empty(array.shape)
    for place, value in np.ndenumerate(array):
        is_number = isinstance(value, Number)
        try:
            number = float(value) if is_number else None
        except (TypeError, ValueError, OverflowError):
            number = None
        if number is None or not (number == value or math.isnan(number)):
            came = f"{type(value).__name__} at ({', '.join(map(str, place))})"
            if number is not None:
                came += f" that is no float64; np.asarray({name}, float) rounds it"
            raise not_real(name, came)
        found[place] = number
    return found


def vector(
    name: str,
    value: Any,
    size: int,
    other: str,
    shape: tuple[int, ...],
    finite: bool = False,
) -> np.ndarray:
    """Return `value` as a clean (size,) array; columns and rows are flattened.

    `other`, of `shape`, is the argument that sets the size. Raises unless all of it is
    finite, if asked to.
    """
    if sp.issparse(value) and math.prod(value.shape) == size:
        checked_order(name, value)
        value = value.toarray()
    array = value
    if not sp.issparse(value):  # one of another size is not made dense
        array = real_array(name, value)
        if array.ndim == 2 and 1 in array.shape:
            array = array.ravel()
    if array.shape != (size,):
        raise ValueError(
            f"{name} must have shape ({size},) to match {other} of shape {shape}, "
            f"got {np.shape(value)}"
        )
    if finite:
        refuse_number(name, array, False)
    return array


def number_or_vector(name: str, value: Any, n: int, other: str = "A") -> np.ndarray:
    """Return `value` as `vector` does, a number for all n entries."""
    if not sp.issparse(value):
        value = real_array(name, value)
        if value.ndim == 0:
            return constant(n, float(value))
    return vector(name, value, n, other, (n, n))


def checked_order(name: str, C: Any) -> tuple[Any, Any]:
    """Return the `index_order` of a sparse matrix, and its (indptr, indices) in int32.

    They are `Order.UNSORTED` and None for formats that are not compressed. Raises a
    ValueError if it is corrupt, which SciPy does not check.
    """
    order, places = Order.UNSORTED, None
    if C.format == "coo":
        sides = zip(C.coords, C.shape, strict=True)
        if not all(0 <= k.min() <= k.max() < n for k, n in sides if k.size):
            order = Order.CORRUPT
    elif C.format in ("csr", "csc", "bsr") and C.ndim == 2:
        major, minor = C.shape if C.format != "csc" else C.shape[::-1]
        if C.format == "bsr":
            major, minor = major // C.blocksize[0], minor // C.blocksize[1]
        places = narrow(C.indptr), narrow(first(C.indices, C.data.shape[0]))
        order = Order.CORRUPT
        if places[0] is not None and places[1] is not None:
            order = index_order(*places, major, minor)
    if order == Order.CORRUPT:
        raise ValueError(
            f"{name} must have indices within its shape {C.shape}, got others "
            "(a corrupt sparse matrix)"
        )
    return order, places


def first(array: np.ndarray, count: int) -> np.ndarray:
    """Return the first entries, the very array where these are all."""
    return array if array.size == count else array[:count]


def narrow(indices: np.ndarray) -> np.ndarray | None:
    """Return indices as clean int32 ones, None if one does not fit."""
    if indices.dtype == np.int32 and indices.flags.carray:
        return indices
    if indices.dtype.kind not in "iu":
        return None
    return narrowed(np.ascontiguousarray(indices, np.int64))


def refuse_view(name: str, value: Any) -> None:
    """Raise a MemoryError for a matrix too large, which may be a view of one number."""
    if isinstance(value, np.ndarray) and value.ndim <= 2:
        refuse_size(name, value.size)


def sparse_matrix(name: str, value: Any, layout: str) -> Any:
    """Return `value` as a canonical sparse array or matrix of float64."""
    order, places = checked_order(name, value)
    if value.dtype.kind not in "biuf":
        raise TypeError(f"{name} must hold real numbers, got dtype {value.dtype}")
    refuse_size(name, max(*value.shape, value.nnz))
    wrap = sp.csr_array if layout == "csr" else sp.csc_array
    if places is not None and value.format != "bsr":
        indptr, indices = places
        indices, data = (first(v, indptr[-1]) for v in (indices, value.data))
        parts: Any = indptr, indices, clean_copy(data)
        own = value.indptr, value.indices, value.data
        is_sorted = order == Order.CANONICAL
        turns = 2 * (not is_sorted) if value.format == layout else 1
        if turns == 0 and all(map(operator.is_, parts, own)):
            return value  # SciPy takes 13 us to make another
        minor, major = value.shape if value.format == "csc" else value.shape[::-1]
        for _ in range(turns):  # each sorts, in the other layout
            parts = transposed(*parts, minor)
            minor, major = major, minor
        if is_sorted or index_order(*parts[:2], major, minor) == Order.CANONICAL:
            return from_arrays(parts, value.shape, wrap)
    value = wrap(value.reshape(1, -1) if value.ndim == 1 else value, copy=True)
    value.sum_duplicates()
    return sparse_matrix(name, value, layout)


@functools.lru_cache(maxsize=16)
def no_rows(n: int) -> sp.csc_array:
    """Return the (0, n) matrix of absent constraints, which is shared: read only."""
    return sp.csc_array((0, n))


def matrix(name: str, value: Any, layout: str) -> Any:
    """Return `value` as a clean 2-D array, or as a canonical sparse array.

    A vector is one row.
    """
    if sp.issparse(value):
        return sparse_matrix(name, value, layout)
    array = real_array(name, value)
    if array.ndim == 1:
        array = array.reshape(1, -1)
    if array.ndim != 2:
        raise ValueError(f"{name} must have two dimensions, got shape {array.shape}")
    return array


def finite_square_matrix(name: str, value: Any, layout: str) -> Any:
    C = matrix(name, value, layout)
    rows, columns = C.shape
    if rows != columns:
        raise ValueError(f"{name} must be square, got shape {np.shape(value)}")
    refuse_number(name, C, False)
    return C


def refuse_number(name: str, values: Any, infinite_allowed: bool) -> None:
    """Raise a ValueError that says where the first NaN or forbidden infinity is."""
    is_sparse = sp.issparse(values)
    flat = (values.data if is_sparse else values).ravel()
    if is_bad(flat, infinite_allowed):
        i = np.argmax(np.isnan(flat) if infinite_allowed else ~np.isfinite(flat))
        wanted = "must not hold NaN" if infinite_allowed else "must be finite"
        index: Any = (
            [places[i] for places in values.tocoo().coords]
            if is_sparse
            else np.unravel_index(i, values.shape)
        )
        place = ", ".join(map(str, index))
        raise ValueError(f"{name} {wanted}, got {flat[i]} at ({place})")


def without_huge(bounds: np.ndarray, sign: float) -> np.ndarray:
    """Return the bounds with each huge one that excludes nothing made infinite.

    sign is +1 for upper bounds and -1 for lower ones. Huge bounds of the opposite sign
    stay: x <= -1e21 is a constraint.
    """
    return np.where(sign * bounds >= INFINITE, sign * np.inf, bounds)


def as_sparse(C: Any) -> Any:
    if type(C) is not np.ndarray:
        return C
    refuse_size("a dense matrix as a sparse one", C.size)
    if C.shape[0] == 0:
        return no_rows(C.shape[1])
    return from_arrays(compressed(C), C.shape)
