"""Sweep methods with M = A: their matrix is factored once for all iterations.

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
from namlcp.lcp.modulus.kernels import S, Z
from namlcp.lcp.modulus.methods import Parameters
from namlcp.lcp.modulus.triangular import Step
from namlcp.lcp.shifted import Quasidefinite, Shifted, System
from namlcp.linalg.symmetry import asymmetry

Solve = Callable[[np.ndarray], np.ndarray]


class FactoredStep(Step):
    """One iteration with the factors of M + Omega, see `factored_step`."""

    def __init__(self, lcp: LCP, omega: np.ndarray, solve: Solve):
        self.lcp, self.omega, self.solve = lcp, omega, solve

    def __call__(self, old: np.ndarray, new: np.ndarray) -> float:
        """Write the next iterate to `new` and return Res(z) of `old`."""
        s, z = old
        w = self.lcp.w(z)
        new[S] = s - 2.0 * self.solve(w - self.omega * (z - s))
        np.clip(new[S], self.lcp.lower, self.lcp.upper, out=new[Z])
        return self.lcp.residual(z, w)


def factored_step(lcp: LCP, given: Parameters) -> FactoredStep | None:
    """Return a step for checked parameters, None if the factorisation fails.

    given.shift is the diagonal of E; None stands for "modulus", without E and L.
    """
    A, omega, shift = lcp.A, given.omega, given.shift
    dense = isinstance(A, np.ndarray)
    system: System
    if shift is not None:
        L = np.tril(A, -1) if dense else sparse.tril(A, -1)
        system, diagonal = Shifted(A + L), omega + shift
    elif dense or asymmetry(A)[0] > 0.0:
        system, diagonal = Shifted(A), omega
    else:
        system, diagonal = (
            Quasidefinite(sparse.csc_array(A), np.ones(omega.size)),
            omega,
        )
    factors = system.factors(diagonal)
    return None if factors is None else FactoredStep(lcp, omega, factors.solve)
