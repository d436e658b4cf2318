"""One step of a sweep method: the interface, and the step with a triangular M."""

import numpy as np

from namlcp.lcp.data import LCP
from namlcp.lcp.modulus.kernels import (
    INVERSE,
    LOWER,
    OMEGA,
    UPPER,
    Q,
    sweep_csr,
    sweep_dense,
)
from namlcp.lcp.modulus.methods import Method, Parameters
from namlcp.linalg.csc import arrays_of


class Step:
    """One iteration: a function of two iterates, (2, n) arrays of s and z = clip(s).

    `omega` is the diagonal of Omega in the last iteration.
    """

    omega: np.ndarray

    def __call__(self, old: np.ndarray, new: np.ndarray) -> float:
        """Write the next iterate to `new` and return Res(z) of `old`."""
        raise NotImplementedError

    def retries_from(self, point: np.ndarray) -> bool:
        """Tell whether to restart from this iterate after a divergence."""
        return False


class TriangularStep(Step):
    """One sweep of a triangular method with checked parameters."""

    def __init__(self, lcp: LCP, chosen: Method, given: Parameters) -> None:
        A, (_, q, lower, upper) = lcp.A, lcp
        alpha, beta, self.omega, shift = given
        is_dense = isinstance(A, np.ndarray)
        boxed = is_dense or bool(lower.any()) or not np.all(upper == np.inf)
        vectors = np.empty((6 if boxed else 4, q.size))
        vectors[OMEGA], vectors[Q] = self.omega, q
        if boxed:
            vectors[LOWER], vectors[UPPER] = lower, upper
        P = A.diagonal() / alpha
        P += self.omega
        if shift is not None:
            P += shift
        np.divide(1.0, P, out=vectors[INVERSE])
        weights = beta / alpha + chosen.own, chosen.reflected
        self.kernel = sweep_dense if is_dense else sweep_csr
        matrix = (A,) if is_dense else arrays_of(A)
        self.fixed = *matrix, vectors, *weights

    def __call__(self, old: np.ndarray, new: np.ndarray) -> float:
        """Write the next iterate to `new` and return Res(z) of `old`."""
        return self.kernel(*self.fixed, old, new)
