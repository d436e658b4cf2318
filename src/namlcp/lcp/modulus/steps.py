"""One step of a sweep method: with a triangular M, or with M = A, factored once.

    modulus:            (A + Omega) (s+ - s) = -2 (A z + q - w)           (Bai 2010)
    nam, modified-nam:  (A + Omega + E - L) (s+ - s) = -2 (A z + q - w)   (the paper)

with A = D - L - U, z = clip(s, l, u), w = Omega (z - s). This is the paper's Method 3.1
with N = 0, written for increments. (The paper has r = 1, here r = 2: only s differs.)
"modulus" is Peaceman-Rachford splitting and converges for every symmetric positive
definite A and every Omega > 0; a sparse symmetric matrix is factored by LDL'. All
others are factored by LU.
"""

from collections.abc import Callable

import numpy as np
from scipy import sparse

from namlcp.lcp.data import LCP
from namlcp.lcp.modulus.kernels import (
    INVERSE,
    LOWER,
    OMEGA,
    UPPER,
    Q,
    S,
    Z,
    sweep_csr,
    sweep_dense,
)
from namlcp.lcp.modulus.methods import Parameters, Sweep
from namlcp.lcp.shifted import Quasidefinite, Shifted, System
from namlcp.linalg.csc import arrays_of
from namlcp.linalg.symmetry import asymmetry


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

    def __init__(self, lcp: LCP, chosen: Sweep, parameters: Parameters) -> None:
        A, (_, q, lower, upper) = lcp.A, lcp
        alpha, beta, self.omega, shift = parameters
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
        return self.kernel(*self.fixed, old, new)


class FactoredStep(Step):
    """One iteration with the factors of M + Omega, see `factored_step`."""

    def __init__(self, lcp: LCP, omega: np.ndarray, solve: Callable):
        self.lcp, self.omega, self.solve = lcp, omega, solve

    def __call__(self, old: np.ndarray, new: np.ndarray) -> float:
        s, z = old
        w = self.lcp.w(z)
        new[S] = s - 2.0 * self.solve(w - self.omega * (z - s))
        np.clip(new[S], self.lcp.lower, self.lcp.upper, out=new[Z])
        return self.lcp.residual(z, w)


def factored_step(lcp: LCP, parameters: Parameters) -> FactoredStep | None:
    """Return a step for checked parameters, None if the factorisation fails.

    parameters.shift is the diagonal of E; None stands for "modulus", without E and L.
    """
    A, omega, shift = lcp.A, parameters.omega, parameters.shift
    dense = isinstance(A, np.ndarray)
    system: System
    if shift is not None:
        L = np.tril(A, -1) if dense else sparse.tril(A, -1)
        system = Shifted(A + L)
    elif dense or asymmetry(A)[0] > 0.0:
        system = Shifted(A)
    else:
        system = Quasidefinite(sparse.csc_array(A), np.ones(omega.size))
    factors = system.factors(omega if shift is None else omega + shift)
    return None if factors is None else FactoredStep(lcp, omega, factors.solve)
