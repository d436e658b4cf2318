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
from functools import partial

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
from namlcp.linalg.definite import asymmetry


class Step:
    """One iteration, with `omega` the diagonal of Omega in the last one.

    run, a function of two iterates, (2, n) arrays of s and z = clip(s), writes the
    second one and returns Res(z) of the first.
    """

    def __init__(self, omega: np.ndarray, run: Callable[..., float]) -> None:
        self.omega, self.run = omega, run

    def retries_from(self, point: np.ndarray) -> bool:
        """Tell whether to restart from this iterate after a divergence."""
        return False


def fixed_step(lcp: LCP, chosen: Sweep, parameters: Parameters) -> Step | None:
    """Return a step for checked parameters, None if a factorisation fails.

    parameters.shift is the diagonal of E, None for methods without.
    """
    make = factored_step if chosen.factored else triangular_step
    return make(lcp, chosen, parameters)


def triangular_step(lcp: LCP, chosen: Sweep, parameters: Parameters) -> Step:
    A, (_, q, lower, upper) = lcp.A, lcp
    alpha, beta, omega, shift = parameters
    is_dense = isinstance(A, np.ndarray)
    boxed = is_dense or bool(lower.any()) or not np.all(upper == np.inf)
    vectors = np.empty((6 if boxed else 4, q.size))
    vectors[OMEGA], vectors[Q] = omega, q
    if boxed:
        vectors[LOWER], vectors[UPPER] = lower, upper
    P = A.diagonal() / alpha
    P += omega
    if shift is not None:
        P += shift
    np.divide(1.0, P, out=vectors[INVERSE])
    weights = beta / alpha + chosen.own, chosen.reflected
    if is_dense:
        return Step(omega, partial(sweep_dense, A, vectors, *weights))
    return Step(omega, partial(sweep_csr, *arrays_of(A), vectors, *weights))


def factored_step(lcp: LCP, chosen: Sweep, parameters: Parameters) -> Step | None:
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
    if factors is None:
        return None
    solve = factors.solve

    def run(old: np.ndarray, new: np.ndarray) -> float:
        s, z = old
        w = lcp.w(z)
        new[S] = s - 2.0 * solve(w - omega * (z - s))
        np.clip(new[S], lcp.lower, lcp.upper, out=new[Z])
        return lcp.residual(z, w)

    return Step(omega, run)
