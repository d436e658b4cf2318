"""Large, strictly diagonally dominant LCPs: projected SOR alone, nothing is factored.

With mu = max_i sum_{j != i} |a_ij| / a_ii < 1 (an H+ matrix), alpha in (0, 2/(1 + mu))
makes projected SOR a contraction in the maximum norm; symmetric A is then positive
definite and any alpha in (0, 2) converges (Cryer 1971; Mangasarian 1977). Young's

    alpha = 2 / (1 + sqrt(1 - mu^2)),   rate (1 - sqrt(1 - mu^2)) / mu a sweep,

is the best one for the five-point matrix in its natural order: 0.27 at mu = 1/2.
"""

import math
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from namlcp.lcp.kernels import dominance_csr, relax_csr
from namlcp.status import Status

YOUNG_IS_SAFE = 1.0 / math.sqrt(2.0)
"""Up to this mu Young's alpha is below 2/(1 + mu)."""

PATIENCE = 32
"""Sweeps without progress after which only rounding is left to blame."""


def dominance(A: Any) -> float:
    """Return mu = max_i sum_{j != i} |a_ij| / a_ii of a csr_array.

    It is inf where a diagonal entry is not positive.
    """
    return dominance_csr(A.data, A.indices, A.indptr)


def relaxation(mu: float, symmetric: bool) -> float:
    """Return an alpha that makes projected SOR converge, Young's where it does."""
    if symmetric or mu <= YOUNG_IS_SAFE:
        return 2.0 / (1.0 + math.sqrt(1.0 - mu * mu))
    return 1.0


def solve_dominant(
    A: Any,
    q: np.ndarray,
    z: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    alpha: float,
    accept: Callable[[np.ndarray, np.ndarray], bool],
    goal: float,
    max_iter: int,
    deadline: float = math.inf,
) -> tuple[Status, np.ndarray, int]:
    """Sweep until accept(z, w) with w = A z + q; return status, w and the sweeps made.

    Parameters
    ----------
    A : (n, n) csr_array
        Strictly dominant matrix.
    q, lower, upper : (n,) array
        The rest of the box LCP.
    z : (n,) array
        Start in [lower, upper], overwritten by the last iterate.
    alpha : float
        As `relaxation` returns it.
    accept : callable
        The exact test, which costs a product with A; asked only when Res(z), guessed
        from the last two sweeps, is below `goal` (which a refusal divides by 10).
    goal : float
        The size of Res(z) that `accept` wants.
    max_iter : int
        Sweeps at most.
    deadline : float
        Value of time.perf_counter() at which to stop.
    """
    before = reference = math.inf
    for k in range(1, max_iter + 1):
        moved = relax_csr(A.data, A.indices, A.indptr, q, lower, upper, alpha, z)
        guess = moved * min(1.0, moved / before) if k > 1 else moved
        if guess < goal or moved == 0.0:
            w = A @ z + q
            if accept(z, w):
                return Status.SOLVED, w, k
            goal *= 0.1
        if k % PATIENCE == 0:
            if not moved < reference:
                return Status.STALLED, A @ z + q, k
            reference = moved
        if time.perf_counter() >= deadline:
            return Status.TIME_LIMIT, A @ z + q, k
        before = moved
    return Status.MAX_ITER, A @ z + q, max_iter
