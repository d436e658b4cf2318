"""The gate of the LCP side: a box LCP as clean arrays, or an error that names it."""

import math
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import LinearOperator

from namlcp.checks import (
    INFINITE,
    constant,
    finite_square_matrix,
    is_clean,
    real_array,
    refuse_number,
    side,
    vector,
)
from namlcp.compiled import kernel
from namlcp.lcp.operators import operator_data


class LCP(NamedTuple):
    """A checked box LCP; A is a dense array, a csr_array or an `Operator`.

    unit: 1, or a power of 2 near max |q| where squares would leave the range.
    """

    A: Any
    q: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    unit: float


def spread_number(name: str, value: Any, n: int) -> np.ndarray:
    """Return a number or an (n,) array as a clean (n,) array."""
    if is_clean(value, 1) and value.size == n:
        return value
    if not sp.issparse(value):
        value = real_array(name, value)
        if value.ndim == 0:
            return constant(n, float(value))
    return vector(name, value, n, "A", (n, n))


def lcp_matrix(A: Any, diagonal: Any = None) -> Any:
    """Check the matrix as the user gave it and return it clean.

    `diagonal` belongs to a LinearOperator, which comes back as an `Operator`.
    """
    if isinstance(A, LinearOperator):
        return operator_data(A, diagonal)
    if diagonal is not None:
        raise ValueError("diagonal is for a LinearOperator; other matrices have theirs")
    return finite_square_matrix("A", A, "csr")


def lcp_data(A: Any, q: Any, lower: Any, upper: Any) -> LCP:
    """Check the vectors of a box LCP as the user gave them and return them clean.

    A is a matrix as `lcp_matrix` returns it. Raises TypeError or ValueError naming the
    argument, what was expected and what came.
    """
    n = A.shape[1]
    q = vector("q", q, n, "A", A.shape)
    lower = constant(n, 0.0) if lower is None else spread_number("lower", lower, n)
    upper = constant(n, np.inf) if upper is None else spread_number("upper", upper, n)
    if is_ordinary(q, lower, upper):
        return LCP(A, q, lower, upper, 1.0)
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
    return LCP(A, q, lower, upper, unit_of(q))


# Sums may be taken in any order, so that they vectorise; NaN keeps its meaning.
@kernel(fastmath={"reassoc"})
def is_ordinary(q, lower, upper):
    """Tell whether no check has a fault to find, and the unit is 1.

    No NaN, no q out of range, lower <= upper, no bound that is huge but finite.
    """
    size, faults = 0.0, 0.0
    for i in range(q.size):
        size += abs(q[i])
        l, u = lower[i], upper[i]
        below = (l < INFINITE) & ((l > -INFINITE) | (l == -np.inf))
        above = (u > -INFINITE) & ((u < INFINITE) | (u == np.inf))
        faults += 0.0 if below & above & (l <= u) else 1.0
    return (size == 0.0 or 1e-90 < size < 1e90) and faults == 0.0


def unit_of(q: np.ndarray) -> float:
    """Return 1, or a power of 2 near max |q| where squares would leave the range."""
    size = float(np.abs(q).max(initial=0.0))
    if size == 0.0 or 1e-100 < size < 1e100:
        return 1.0
    return 2.0 ** math.floor(math.log2(size))
