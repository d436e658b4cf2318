"""How far a matrix is from its transpose, in one pass."""

from typing import Any

import numpy as np

from namlcp.entries import dense_asymmetry, sparse_asymmetry


def asymmetry(C: Any) -> tuple[float, float]:
    """Return (max |C - C'|, max |C|) of a square matrix, dense or canonical CSC/CSR."""
    if type(C) is np.ndarray:
        return dense_asymmetry(C)
    return sparse_asymmetry(C.indptr, C.indices, C.data)
