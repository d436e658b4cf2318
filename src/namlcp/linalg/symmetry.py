"""How far a matrix is from its transpose, in one pass."""

from typing import Any

import numpy as np

from namlcp.compiled import kernel


@kernel
def dense_asymmetry(P):
    """Return (max |P - P'|, max |P|)."""
    gap, size = 0.0, 0.0
    for i in range(P.shape[0]):
        size = max(size, abs(P[i, i]))
        for j in range(i):
            gap = max(gap, abs(P[i, j] - P[j, i]))
            size = max(size, abs(P[i, j]), abs(P[j, i]))
    return gap, size


@kernel
def sparse_asymmetry(indptr, indices, data):
    """Return (max |P - P'|, max |P|) of a canonical square CSR or CSC matrix.

    Entries (i, j) come in ascending order of i, so follow[j] moves once along row j.
    """
    n = indptr.size - 1
    gap, size = 0.0, 0.0
    follow = indptr[:-1].copy()
    for i in range(n):
        for t in range(indptr[i], indptr[i + 1]):
            j, value = indices[t], data[t]
            size = max(size, abs(value))
            if j <= i:
                continue
            s = follow[j]
            while s < indptr[j + 1] and indices[s] < i:
                gap = max(gap, abs(data[s]))  # no partner above the diagonal
                s += 1
            if s < indptr[j + 1] and indices[s] == i:
                gap = max(gap, abs(value - data[s]))
                s += 1
            else:
                gap = max(gap, abs(value))
            follow[j] = s
    for j in range(n):
        for s in range(follow[j], indptr[j + 1]):
            if indices[s] < j:
                gap = max(gap, abs(data[s]))
    return gap, size


def asymmetry(C: Any) -> tuple[float, float]:
    """Return (max |C - C'|, max |C|) of a square matrix, dense or canonical CSC/CSR."""
    if type(C) is np.ndarray:
        return dense_asymmetry(C)
    return sparse_asymmetry(C.indptr, C.indices, C.data)
