"""Symmetric matrices known only by their products: SciPy's LinearOperator, checked."""

from typing import Any

import numpy as np
from scipy.sparse.linalg import LinearOperator

from namlcp.checks import finite_vector


class Operator:
    """A symmetric matrix A known by x -> A x and, where it was given, its diagonal.

    It replaces an array where only A @ x, A.shape and A.diagonal() are used.
    """

    def __init__(self, A: LinearOperator, diagonal: np.ndarray | None):
        self.A = A
        self.shape = A.shape
        self.stored = diagonal

    def __matmul__(self, x: np.ndarray) -> np.ndarray:
        """Return A x, a new array."""
        y = np.asarray(self.A.matvec(x))
        if y.dtype.kind not in "biuf":
            raise TypeError(f"A must be real, got a product of dtype {y.dtype}")
        return np.array(y, dtype=np.float64).reshape(x.shape)

    def diagonal(self) -> np.ndarray:
        """Return diag(A), ones if it is unknown."""
        return np.ones(self.shape[0]) if self.stored is None else self.stored


# Largest |u'Av - v'Au| that counts as zero for two fixed random vectors, relative to
# |u||Av| + |v||Au|: it allows for products in single precision.
SYMMETRIC = 1e-7


def operator_data(A: LinearOperator, diagonal: Any) -> Operator:
    """Return a LinearOperator and its diagonal (or None) checked, as an `Operator`."""
    n = A.shape[0]
    if A.shape[1] != n:
        raise ValueError(f"A must be square, got shape {A.shape}")
    if np.dtype(A.dtype or np.float64).kind not in "biuf":
        raise TypeError(f"A must be real, got a LinearOperator of dtype {A.dtype}")
    if diagonal is not None:
        diagonal = finite_vector("diagonal", diagonal, n, "A", A.shape)
        wrong = np.flatnonzero(diagonal < 0.0)
        if wrong.size:
            i = wrong[0]
            raise ValueError(
                "diagonal must not be negative (A must be positive semidefinite as a "
                f"LinearOperator), got {diagonal[i]:g} at ({i})"
            )
    operator = Operator(A, diagonal)
    u, v = np.random.default_rng(0).standard_normal((2, n))
    Au, Av, norm = operator @ u, operator @ v, np.linalg.norm
    with np.errstate(all="ignore"):
        gap = abs(float(u @ Av) - float(v @ Au))
        size = float(norm(u) * norm(Av) + norm(v) * norm(Au))
    if gap > SYMMETRIC * size:
        raise ValueError(
            "A must be symmetric as a LinearOperator: u'Av and v'Au differ by "
            f"{gap / size:.1e} of their size for random u and v"
        )
    return operator
