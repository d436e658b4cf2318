"""Checks of the user's arrays: each becomes a clean one, or an error names the fault.

Clean arrays are writeable float64: dense matrices C-contiguous, sparse ones canonical
(sorted, no duplicates) with int32 indices, vectors 1-D and contiguous. The caller's
arrays are never changed; those that are clean already are passed on without a copy.
"""

import functools
import math
from typing import Any

import numpy as np
import scipy.sparse as sp

from namlcp.compiled import kernel, part

INFINITE = 0.999e20
"""Bounds of at least this modulus mean "no bound". The QP collections write 1e20, and
some of these numbers have become slightly smaller by scaling."""

MOST_ENTRIES = 2**31 - 1
"""Most entries of any matrix, the KKT matrix included: int32 counts them."""

FLOAT = np.dtype(np.float64)
INDEX = np.dtype(np.int32)


def is_clean(array: Any, ndim: int) -> bool:
    """Tell whether `array` can go to compiled code as it is."""
    return (
        type(array) is np.ndarray
        and array.dtype == FLOAT
        and array.ndim == ndim
        and array.flags.carray
    )


def clean_copy(array: np.ndarray, kind: Any) -> np.ndarray:
    """Return `array`, copied unless it is C-contiguous, writeable and of the dtype."""
    if array.dtype == kind and array.flags.carray:
        return array
    return np.array(array, kind, order="C")


def real_array(name: str, value: Any) -> np.ndarray:
    """Return `value` as a writeable C-contiguous float64 array, copied if need be."""
    try:
        if value is None or isinstance(value, np.ma.MaskedArray):
            raise ValueError("None or masked")
        array = np.asarray(value)
    except ValueError as error:
        raise TypeError(
            f"{name} must be an array of real numbers, got {value!r:.60} ({error})"
        ) from None
    if array.dtype.kind not in "biuf":
        raise TypeError(
            f"{name} must be an array of real numbers, got dtype {array.dtype}"
        )
    return clean_copy(array, np.float64)


def vector(
    name: str, value: Any, size: int, other: str, shape: tuple[int, ...]
) -> np.ndarray:
    """Return `value` as a clean (size,) array; columns and rows are flattened.

    `other`, of `shape`, is the argument that sets the size.
    """
    if is_clean(value, 1) and value.size == size:
        return value
    if sp.issparse(value):
        if math.prod(value.shape) != size:  # before it is made dense
            raise wrong_shape(name, value, size, other, shape)
        refuse_indices(name, value)
        value = value.toarray()
    array = real_array(name, value)
    if array.ndim == 2 and 1 in array.shape:
        array = array.ravel()
    if array.shape != (size,):
        raise wrong_shape(name, value, size, other, shape)
    return array


def wrong_shape(
    name: str, value: Any, size: int, other: str, shape: tuple[int, ...]
) -> ValueError:
    """Return the error of a vector that does not match `other`."""
    return ValueError(
        f"{name} must have shape ({size},) to match {other} of shape {shape}, "
        f"got {np.shape(value)}"
    )


def finite_vector(
    name: str, value: Any, size: int, other: str, shape: tuple[int, ...]
) -> np.ndarray:
    """Return `value` as `vector` does; raise unless all of it is finite."""
    array = vector(name, value, size, other, shape)
    refuse_number(name, array, False)
    return array


@kernel
def are_indices(indptr, indices, major, minor):
    """Tell whether compressed sparse indices are in range; no kernel checks them later.

    `major` is the number of rows for CSR, of columns for CSC; `minor` is the other one.
    """
    if indptr.size != major + 1 or indptr[0] != 0 or indptr[major] > indices.size:
        return False
    for j in range(major):
        if indptr[j + 1] < indptr[j]:
            return False
    for t in range(indptr[major]):
        if indices[t] < 0 or indices[t] >= minor:
            return False
    return True


def refuse_indices(name: str, C: Any) -> None:
    """Raise a ValueError if a sparse matrix is corrupt, which SciPy does not check."""
    sound = True
    if C.format == "coo":
        sides = zip(C.coords, C.shape, strict=True)
        sound = all(0 <= k.min() <= k.max() < n for k, n in sides if k.size)
    elif C.format in ("csr", "csc", "bsr") and C.ndim == 2:
        major, minor = C.shape if C.format != "csc" else C.shape[::-1]
        size = C.data.shape[0]
        if C.format == "bsr":
            major, minor = major // C.blocksize[0], minor // C.blocksize[1]
        sound = are_indices(C.indptr, C.indices[:size], major, minor)
    if not sound:
        raise ValueError(
            f"{name} must have indices within its shape {C.shape}, got others "
            "(a corrupt sparse matrix)"
        )


def is_clean_sparse(value: Any, layout: str) -> bool:
    """Tell whether a sparse matrix can go to compiled code as it is."""
    return (
        value.format == layout
        and is_clean(value.data, 1)
        and value.indices.dtype == value.indptr.dtype == INDEX
        and value.indices.flags.carray
        and value.indptr.flags.carray
        and value.data.size == value.indptr[-1]
        and value.has_canonical_format
    )


def refuse_size(name: str, entries: int) -> None:
    """Raise a MemoryError where there are more entries than int32 can count."""
    if entries > MOST_ENTRIES:
        raise MemoryError(
            f"{name} would have {entries:.1e} entries of {8e-9 * entries:.0f} GB, "
            f"allowed are {MOST_ENTRIES:.1e}"
        )


def sparse_matrix(name: str, value: Any, layout: str) -> Any:
    """Return `value` as a canonical sparse array or matrix of float64."""
    refuse_indices(name, value)
    if value.ndim == 2 and is_clean_sparse(value, layout):
        return value  # SciPy takes 30 us to make another
    if value.dtype.kind not in "biuf":
        raise TypeError(f"{name} must hold real numbers, got dtype {value.dtype}")
    if value.ndim == 1:
        value = value.reshape(1, -1)
    if value.format == layout and value.has_canonical_format:
        nnz = value.indptr[-1]
        data, indices, indptr = value.data[:nnz], value.indices[:nnz], value.indptr
    else:
        refuse_size(name, value.nnz)
        value = sp.csr_array(value, copy=True).asformat(layout)
        value.sum_duplicates()
        data, indices, indptr = value.data, value.indices, value.indptr
    refuse_size(name, max(*value.shape, data.size))
    data = clean_copy(data, np.float64)
    indices, indptr = (clean_copy(v, np.int32) for v in (indices, indptr))
    wrap = sp.csr_array if layout == "csr" else sp.csc_array
    clean = wrap((data, indices, indptr), shape=value.shape)
    clean.has_canonical_format = True
    return clean


@functools.lru_cache(maxsize=16)
def no_rows(n: int) -> sp.csc_array:
    """Return the (0, n) matrix of absent constraints, which is shared: read only."""
    indptr = np.zeros(n + 1, dtype=np.int32)
    return sp.csc_array((np.empty(0), np.empty(0, np.int32), indptr), shape=(0, n))


def matrix(name: str, value: Any, layout: str) -> Any:
    """Return `value` as a clean 2-D array, or as a canonical sparse array.

    A vector is one row.
    """
    if is_clean(value, 2):
        return value
    if sp.issparse(value):
        return sparse_matrix(name, value, layout)
    array = real_array(name, value)
    if array.ndim == 1:
        array = array.reshape(1, -1)
    if array.ndim != 2:
        raise ValueError(f"{name} must have two dimensions, got shape {array.shape}")
    return array


def square_matrix(name: str, value: Any, layout: str) -> Any:
    """Return `value` as `matrix` does; raise unless it is square."""
    C = matrix(name, value, layout)
    if C.shape[0] != C.shape[1]:
        raise ValueError(f"{name} must be square, got shape {np.shape(value)}")
    return C


def finite_square_matrix(name: str, value: Any, layout: str) -> Any:
    """Return `value` as `square_matrix` does; raise unless all of it is finite."""
    C = square_matrix(name, value, layout)
    refuse_number(name, C.data if sp.issparse(C) else C, False)
    return C


# The order of the sums is free ("reassoc"), so that they vectorise; NaN is kept.
@kernel(fastmath={"reassoc"})
def is_bad(values, infinite_allowed):
    """Tell whether a NaN (or an infinite value unless allowed) is among the values."""
    total = 0.0
    if infinite_allowed:
        for i in range(values.size):
            total += 1.0 if values[i] != values[i] else 0.0
    else:
        for i in range(values.size):
            total += 0.0 * values[i]
    return not total == 0.0


@part
def has_bad_row(C):
    """Tell whether a NaN or an infinite value is in a dense matrix."""
    infinite_allowed = np.bool_(False)
    for i in range(C.shape[0]):
        if is_bad(C[i], infinite_allowed):
            return True
    return False


@kernel
def has_huge_bound(bounds):
    """Tell whether a bound is finite, but beyond INFINITE."""
    for i in range(bounds.size):
        if abs(bounds[i]) >= INFINITE and not np.isinf(bounds[i]):
            return True
    return False


def refuse_number(name: str, values: np.ndarray, infinite_allowed: bool) -> None:
    """Raise a ValueError that says where the first NaN or forbidden infinity is."""
    flat = values.ravel()
    if is_bad(flat, infinite_allowed):
        i = np.argmax(np.isnan(flat) if infinite_allowed else ~np.isfinite(flat))
        wanted = "must not hold NaN" if infinite_allowed else "must be finite"
        place = ", ".join(str(k) for k in np.unravel_index(i, values.shape))
        raise ValueError(f"{name} {wanted}, got {flat[i]} at ({place})")


def without_huge(bounds: np.ndarray, sign: float) -> np.ndarray:
    """Return the bounds with each huge one that excludes nothing made infinite.

    sign is +1 for upper bounds and -1 for lower ones. Huge bounds of the opposite sign
    stay: x <= -1e21 is a constraint.
    """
    if has_huge_bound(bounds):
        return np.where(sign * bounds >= INFINITE, sign * np.inf, bounds)
    return bounds


def as_sparse(C: Any) -> Any:
    """Return a clean matrix as a clean sparse one."""
    if type(C) is not np.ndarray:
        return C
    refuse_size("a dense matrix as a sparse one", C.size)
    if C.shape[0] == 0:
        return no_rows(C.shape[1])
    sparse = sp.csc_array(compressed(C), shape=C.shape)
    sparse.has_canonical_format = True
    return sparse


@kernel
def compressed(C):
    """Return the CSC arrays (data, indices, indptr) of a dense matrix."""
    rows, columns = C.shape
    indptr = np.zeros(columns + 1, dtype=np.int32)
    for i in range(rows):
        for j in range(columns):
            if C[i, j] != 0.0:
                indptr[j + 1] += 1
    for j in range(columns):
        indptr[j + 1] += indptr[j]
    place = indptr[:columns].copy()
    data = np.empty(indptr[columns])
    indices = np.empty(indptr[columns], dtype=np.int32)
    for i in range(rows):
        for j in range(columns):
            if C[i, j] != 0.0:
                data[place[j]] = C[i, j]
                indices[place[j]] = i
                place[j] += 1
    return data, indices, indptr


def constant(n: int, value: float) -> np.ndarray:
    """Return np.full(n, value), in a third of its time."""
    array = np.empty(n)
    array.fill(value)
    return array
