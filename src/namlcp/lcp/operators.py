"""Symmetric matrices known only by their products: SciPy's LinearOperator, checked."""

from typing import Any

import numpy as np
from scipy.sparse.linalg import LinearOperator

from namlcp.checks import vector

# Largest |u'Av - v'Au| that counts as zero for two fixed random vectors, relative to
# |u||Av| + |v||Au|: it allows for products in single precision.
SYMMETRIC = 1e-7


class Operator:
    """A symmetric matrix A known by x -> A x and, where it was given, its diagonal.

    It replaces an array where only A @ x, A.shape and A.diagonal() are used.
    """

    def __init__(self, A: LinearOperator, diagonal: Any):
        """Check A and its diagonal, which may be None."""
        self.A, self.shape = A, A.shape
        n = A.shape[0]
        if A.shape[1] != n:
            raise ValueError(f"A must be square, got shape {A.shape}")
        if np.dtype(A.dtype or np.float64).kind not in "biuf":
            raise TypeError(f"A must be real, got a LinearOperator of dtype {A.dtype}")
        self.known = np.ones(n)
        if diagonal is not None:
            self.known = vector("diagonal", diagonal, n, "A", A.shape, finite=True)
            wrong = np.flatnonzero(self.known < 0.0)
            if wrong.size:
                i = wrong[0]
                raise ValueError(
                    "diagonal must not be negative (A must be positive semidefinite as "
                    f"a LinearOperator), got {self.known[i]:g} at ({i})"
                )
        u, v = np.random.default_rng(0).standard_normal((2, n))
        Au, Av, norm = self @ u, self @ v, np.linalg.norm
        with np.errstate(all="ignore"):
            gap = abs(float(u @ Av) - float(v @ Au))
            size = float(norm(u) * norm(Av) + norm(v) * norm(Au))
        if gap > SYMMETRIC * size:
            raise ValueError(
                "A must be symmetric as a LinearOperator: u'Av and v'Au differ by "
                f"{gap / size:.1e} of their size for random u and v"
            )

    def __matmul__(self, x: np.ndarray) -> np.ndarray:
        """Return A x, a new array."""
        y = np.asarray(self.A.matvec(x))
        if y.dtype.kind not in "biuf":
            raise TypeError(f"A must be real, got a product of dtype {y.dtype}")
        return np.array(y, dtype=np.float64).reshape(x.shape)

    def diagonal(self) -> np.ndarray:
        """Return diag(A), ones if it is unknown."""
        return self.known
