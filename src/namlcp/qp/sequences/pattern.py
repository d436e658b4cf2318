"""Matrices with new values in the storage and the pattern of old ones."""

from typing import Any

import numpy as np
from scipy.sparse import issparse

from namlcp.checks import as_sparse, from_arrays, matrix, real_array, refuse_view
from namlcp.linalg import as_dense


class OtherShape(ValueError):
    """A matrix has another shape or other places of entries than before.

    Examples
    --------
    >>> import numpy as np
    >>> import namlcp
    >>> solver = namlcp.Solver(np.eye(2), np.zeros(2))
    >>> try:
    ...     solver.update(P=np.eye(3))
    ... except namlcp.OtherShape:
    ...     print("make another Solver")
    make another Solver
    """


def copied(name: str, M: Any) -> Any:
    """Return a user's matrix, in its own order, as one that nobody else has."""
    if M is None or issparse(M):
        return M if M is None else M.copy()
    refuse_view(name, M)
    return np.array(M if type(M) is np.ndarray else real_array(name, M))


def is_unchanged(new: Any, old: Any) -> bool:
    """Tell whether two matrices are stored alike and equal in every entry."""
    if isinstance(new, np.ndarray):
        return type(new) is type(old) and are_equal(new, old)
    if not issparse(new) or new.format not in ("csc", "csr"):
        return False
    return has_pattern_of(new, old) and are_equal(new.data, old.data)


def has_pattern_of(new: Any, old: Any) -> bool:
    """Tell whether two sparse matrices are stored alike, entry after entry."""
    return (
        type(new) is type(old)
        and new.shape == old.shape
        and are_equal(new.indptr, old.indptr)
        and are_equal(new.indices, old.indices)
    )


def are_equal(v: np.ndarray, w: np.ndarray) -> bool:
    """Return np.array_equal(v, w), of short vectors in a fifth of its time."""
    return v is w or (v.shape == w.shape and np.count_nonzero(v == w) == v.size)


def in_place_of(name: str, value: Any, kept: Any) -> Any:
    """Return a user's matrix checked, as `kept` is stored: dense, or in its pattern.

    Entries that the pattern has and the user's matrix has not are zeros. Raises
    OtherShape where the shapes differ, or an entry lies outside the pattern.
    """
    new = matrix(name, value, "csc")
    if new.shape != kept.shape:
        raise OtherShape(
            f"{name} must have shape {kept.shape} as before, got {new.shape}: "
            "make a new Solver for a problem of another size"
        )
    if type(kept) is np.ndarray:
        return new if type(new) is np.ndarray else as_dense(new)
    found = within_pattern(as_sparse(new), kept)
    if found is None:
        raise OtherShape(
            f"{name} must have no entries outside the pattern of the first {name}: "
            "make a new Solver, or store zeros there from the start"
        )
    return found


def within_pattern(new: Any, kept: Any) -> Any:
    """Return a matrix with the pattern of `kept` and the entries of `new`, both CSC.

    It is `new` itself where the patterns are equal, and None where `new` has an entry
    outside the pattern.
    """
    if has_pattern_of(new, kept):
        return new
    wanted, present = places(kept), places(new)
    position = np.searchsorted(wanted, present)
    inside = position < wanted.size
    inside[inside] = wanted[position[inside]] == present[inside]
    if new.data[~inside].any():
        return None
    data = np.zeros(kept.data.size)
    data[position[inside]] = new.data[inside]
    return from_arrays((kept.indptr, kept.indices, data), kept.shape)


def places(C: Any) -> np.ndarray:
    """Return row + rows * column for each entry of a CSC matrix, which ascends."""
    rows, columns = C.shape
    column = np.repeat(np.arange(columns), np.diff(C.indptr))
    return C.indices + rows * column
