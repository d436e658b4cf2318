"""The gate of the LCP side: a box LCP as clean arrays, or an error that names it."""

from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp

from namlcp.checks import (
    is_clean,
    real_array,
    refuse_number,
    side,
    square_matrix,
    vector,
)


class LCPData(NamedTuple):
    """A checked box LCP; A is a dense array or a csr_array."""

    A: Any
    q: np.ndarray
    lower: np.ndarray
    upper: np.ndarray


def spread_number(name: str, value: Any, n: int) -> np.ndarray:
    """Return a number or an (n,) array as a clean (n,) array."""
    array = value if is_clean(value, 1) else real_array(name, value)
    if array.ndim == 0:
        return np.full(n, array)
    return vector(name, array, n, "A", (n, n))


def lcp_matrix(A: Any) -> Any:
    """Check the matrix as the user gave it and return it clean."""
    A = square_matrix("A", A, "csr")
    refuse_number("A", A.data if sp.issparse(A) else A, False)
    return A


def lcp_data(A: Any, q: Any, lower: Any, upper: Any) -> LCPData:
    """Check the vectors of a box LCP as the user gave them and return them clean.

    A is a matrix as `lcp_matrix` returns it. Raises TypeError or ValueError naming the
    argument, what was expected and what came.
    """
    n = A.shape[1]
    q = vector("q", q, n, "A", A.shape)
    lower = spread_number("lower", 0.0 if lower is None else lower, n)
    upper = spread_number("upper", np.inf if upper is None else upper, n)
    refuse_number("q", q, False)
    refuse_number("lower", lower, True)
    refuse_number("upper", upper, True)
    lower, upper = side(lower, -1.0), side(upper, 1.0)
    wrong = np.flatnonzero((lower > upper) | (lower == np.inf) | (upper == -np.inf))
    if wrong.size:
        i = wrong[0]
        raise ValueError(
            "lower must not exceed upper, lower be < inf and upper > -inf, "
            f"got lower[{i}] = {lower[i]:g}, upper[{i}] = {upper[i]:g} "
            "(from 1e20 on, no bound)"
        )
    return LCPData(A, q, lower, upper)
