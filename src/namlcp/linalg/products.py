"""Products of matrices and vectors, compiled for CSC in float64, `@` for others.

The overhead of SciPy's sparse products, 30 to 60 us, exceeds the time of the product
for a few thousand entries. The order of summation here is SciPy's.
"""

from typing import Any

import numpy as np

from namlcp.compiled import kernel

# Types of the arrays of `compiled_form`.
KINDS = np.dtype(np.int32), np.dtype(np.int32), np.dtype(np.float64)


def times(M: Any, x: np.ndarray) -> np.ndarray:
    """Return M x. Raises ValueError where the sizes disagree."""
    if x.shape != (M.shape[1],):
        raise ValueError(f"x must have shape ({M.shape[1]},), got {x.shape}")
    if not is_csc(M):
        return M @ x
    out = np.zeros(M.shape[0])
    add_columns(M.indptr, M.indices, M.data, x, out)
    return out


def add_transposed(M: Any, z: np.ndarray, out: np.ndarray) -> None:
    """Add M'z to `out`. Raises ValueError where the sizes disagree."""
    if z.shape != (M.shape[0],) or out.shape != (M.shape[1],):
        raise ValueError(f"z must have shape ({M.shape[0]},), got {z.shape}")
    if not is_csc(M):
        out += z @ M
    elif z.size:
        add_column_sums(M.indptr, M.indices, M.data, z, out)


def is_csc(M: Any) -> bool:
    """Tell whether M is a CSC matrix of float64."""
    return getattr(M, "format", "") == "csc" and M.dtype == np.float64


def compiled_form(M: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """Return (indptr, indices, data) of a CSC matrix in float64 and int32, or None."""
    if getattr(M, "format", "") != "csc":
        return None
    form = M.indptr, M.indices, M.data
    for array, kind in zip(form, KINDS, strict=True):
        if array.dtype != kind or not array.flags.carray:
            return None
    return form


@kernel
def add_columns(indptr, indices, data, x, out):
    """Add M x to `out`."""
    for j in range(x.size):
        xj = x[j]
        for t in range(indptr[j], indptr[j + 1]):
            out[indices[t]] += data[t] * xj


@kernel
def add_column_sums(indptr, indices, data, z, out):
    """Add M'z to `out`."""
    for j in range(out.size):
        total = 0.0
        for t in range(indptr[j], indptr[j + 1]):
            total += data[t] * z[indices[t]]
        out[j] += total
