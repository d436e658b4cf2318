"""The table of the sweep methods, the checks of their parameters, and their steps.

See `sweeps` for the formulas and for the numbers G and H that define a method with a
triangular M. With M = A, factored once,

    modulus:            (A + Omega) (s+ - s) = -2 (A z + q - w)           (Bai 2010)
    nam, modified-nam:  (A + Omega + E - L) (s+ - s) = -2 (A z + q - w)   (the paper)

with A = D - L - U, z = clip(s, l, u), w = Omega (z - s). This is the paper's Method 3.1
with N = 0, written for increments. (The paper has r = 1, here r = 2: only s differs.)
"modulus" is Peaceman-Rachford splitting and converges for every symmetric positive
definite A and every Omega > 0; a sparse symmetric matrix is factored by LDL'. All
others are factored by LU.
"""

import math
import numbers
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from scipy import sparse

from namlcp.lcp.data import LCP, diagonal_of
from namlcp.lcp.loops import (
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
from namlcp.lcp.shifted import Shifted
from namlcp.linalg.csc import arrays_of
from namlcp.linalg.factors import asymmetry
from namlcp.options import check_kind


class Sweep(NamedTuple):
    """A sweep method.

    `takes`: its parameters among alpha, beta, omega, shift. `beta`: its beta if that is
    fixed; None: beta = alpha unless given. G = beta/alpha + `own` and H = `reflected`.
    Factored methods have M = A, the others a triangular M.
    """

    takes: tuple[str, ...]
    own: float = 0.0
    reflected: float = 0.0
    beta: float | None = None
    factored: bool = False


SWEEPS = {
    # Bai's splittings, the paper's equation (2): modulus Gauss-Seidel, SOR and AOR.
    "mgs": Sweep(("omega",)),
    "msor": Sweep(("alpha", "omega")),
    "maor": Sweep(("alpha", "beta", "omega")),
    # The accelerated form of the paper, Method 3.1 or equation (4): its variants 3
    # (Jacobi), 4 (Gauss-Seidel), 5 (SOR) and 6 (AOR).
    "namj": Sweep(("omega", "shift"), 1.0, beta=0.0),
    "namgs": Sweep(("omega", "shift"), 1.0),
    "namsor": Sweep(("alpha", "omega", "shift"), 1.0),
    "namaor": Sweep(("alpha", "beta", "omega", "shift"), 1.0),
    # Zheng and Yin's accelerated ones, and those with Omega = D/alpha, which are
    # projected Gauss-Seidel and projected SOR.
    "amgs": Sweep(("omega",), -1.0, 2.0),
    "amsor": Sweep(("alpha", "omega"), -1.0, 2.0),
    "pgs": Sweep((), -1.0, 2.0),
    "psor": Sweep(("alpha",), -1.0, 2.0),
    # Bai's with M = A, and the variants 1 and 2 of Method 3.1.
    "modulus": Sweep(("omega",), factored=True),
    "nam": Sweep(("omega", "shift"), 1.0, factored=True),
    "modified-nam": Sweep(("alpha", "omega", "shift"), 1.0, factored=True),
}


class Parameters(NamedTuple):
    """Parameters of a sweep method as `solve_lcp` takes them, None where not given.

    alpha, beta: relaxation parameters, alpha in (0, 2), 1 by default; beta in [0, 2),
    alpha by default. (Projected SOR cannot converge for other alpha.) "modified-nam"
    has Omega = alpha I for any alpha > 0.

    omega: diagonal of Omega, positive. Default: D/(2 alpha^2) for mgs, msor, maor and
    namj, namgs, namsor, namaor (as in the paper's tables), D/alpha for amgs and amsor,
    D for "modulus", I for "nam". pgs and psor always have D/alpha.

    shift: diagonal of E, not negative. Default: D for namj, namgs, namsor, namaor (the
    paper has I), so that they do not depend on the scaling; I for "nam" and
    "modified-nam", or D if alpha or omega is "auto".

    alpha, omega = "auto": chosen during the run, see `AdaptiveStep`; omega is then c D.
    """

    alpha: Any = None
    beta: Any = None
    omega: Any = None
    shift: Any = None


def positive_diagonal(A: Any, method: str) -> np.ndarray:
    D = np.array(A.diagonal())
    wrong = np.flatnonzero(~(D > 0.0))
    if wrong.size:
        i = wrong[0]
        raise ValueError(
            f"A must have a positive diagonal for method {method!r}, "
            f"got A[{i}, {i}] = {D[i]:g}"
        )
    return D


def number(name: str, value: Any, interval: str) -> float:
    """Return `value` as a float; raise unless it is in an interval like "(0, 2)"."""
    check_kind(name, value, numbers.Real, "a number")
    below = value >= 0.0 if interval[0] == "[" else value > 0.0
    if not (below and value < float(interval[1:-1].split(",")[1])):
        raise ValueError(f"{name} must lie in {interval}, got {value!r}")
    return float(value)


def checked_parameters(A: Any, method: str, parameters: Parameters) -> Parameters:
    """Return the parameters checked, with defaults, also of those that are "auto".

    The diagonals are arrays. shift = None: the method has no E.
    """
    chosen, n, ones = SWEEPS[method], A.shape[0], np.ones(A.shape[0])
    alpha, beta, omega, shift = parameters
    interval = "(0, inf)" if chosen.factored else "(0, 2)"
    for name, value, wanted in (
        ("omega", omega, "a positive number, an array"),
        ("alpha", alpha, f"a number in {interval}"),
    ):
        if isinstance(value, str) and value != "auto":
            raise TypeError(f"{name} must be {wanted} or 'auto', got {value!r}")
    is_adaptive = isinstance(alpha, str) or isinstance(omega, str)
    alpha, omega = (None if isinstance(v, str) else v for v in (alpha, omega))
    if chosen.factored:
        if alpha is not None:
            omega = np.full(n, number("alpha", alpha, interval))
        elif omega is None and method == "modulus":
            omega = positive_diagonal(A, method)
        omega = diagonal_of("omega", omega, n, ones, positive=True)
        E = positive_diagonal(A, method) if is_adaptive else ones
        shift = diagonal_of("shift", shift, n, E) if chosen.own else None
        return Parameters(1.0, math.nan, omega, shift)
    alpha = 1.0 if alpha is None else number("alpha", alpha, interval)
    if beta is not None:
        beta = number("beta", beta, "[0, 2)")
    else:
        beta = alpha if chosen.beta is None else chosen.beta
    D = positive_diagonal(A, method)
    default = D / alpha if chosen.reflected else D / (2.0 * alpha * alpha)
    omega = diagonal_of("omega", omega, n, default, positive=True)
    shift = diagonal_of("shift", shift, n, D) if "shift" in chosen.takes else None
    return Parameters(alpha, beta, omega, shift)


class Step:
    """One iteration with the diagonal `omega` of Omega.

    run, a function of two iterates, (2, n) arrays of s and z = clip(s), writes the
    second one and returns Res(z) of the first.
    """

    def __init__(self, omega: np.ndarray, run: Callable[..., float]) -> None:
        self.omega, self.run = omega, run

    def retries_from(self, point: np.ndarray) -> bool:
        """Tell whether to restart from this iterate after a divergence."""
        return False


def fixed_step(lcp: LCP, chosen: Sweep, parameters: Parameters) -> Step | None:
    """Return a step for checked parameters, None if a factorisation fails."""
    if chosen.factored:
        return factored_step(lcp, chosen, parameters)
    A, (_, q, lower, upper) = lcp.A, lcp
    alpha, beta, omega, shift = parameters
    vectors = np.empty((6, q.size))
    vectors[OMEGA], vectors[Q] = omega, q
    vectors[LOWER], vectors[UPPER] = lower, upper
    P = A.diagonal() / alpha + omega + (0.0 if shift is None else shift)
    vectors[INVERSE] = 1.0 / P
    weights = beta / alpha + chosen.own, chosen.reflected
    if isinstance(A, np.ndarray):
        return Step(omega, partial(sweep_dense, A, vectors, *weights))
    return Step(omega, partial(sweep_csr, *arrays_of(A), vectors, *weights))


def factored_step(lcp: LCP, chosen: Sweep, parameters: Parameters) -> Step | None:
    A, omega, shift = lcp.A, parameters.omega, parameters.shift
    dense, signs = isinstance(A, np.ndarray), None
    if shift is not None:
        A = A + (np.tril(A, -1) if dense else sparse.tril(A, -1))
    elif not dense and asymmetry(A)[0] == 0.0:
        A, signs = sparse.csc_array(A), np.ones(omega.size)
    factors = Shifted(A, signs).factors(omega if shift is None else omega + shift)
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
