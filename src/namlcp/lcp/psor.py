"""Large, strictly diagonally dominant LCPs: projected SOR alone, nothing is factored.

With mu = max_i sum_{j != i} |a_ij| / a_ii < 1 (an H+ matrix), alpha in (0, 2/(1 + mu))
makes projected SOR a contraction in the maximum norm; symmetric A is then positive
definite and any alpha in (0, 2) converges (Cryer 1971; Mangasarian 1977). A diagonal
S > 0 in (S A S, S q, l/S, u/S) changes its iterates z by S^-1 alone, so mu may as well
be that of D^(-1/2) A D^(-1/2), which does not depend on units. Young's

    alpha = 2 / (1 + sqrt(1 - mu^2)),   rate (1 - sqrt(1 - mu^2)) / mu a sweep,

is the best one for the five-point matrix in its natural order: 0.27 at mu = 1/2.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from namlcp.lcp.modulus import dominance_csr, relax_csr
from namlcp.limits import NEVER, Deadline
from namlcp.status import Status

YOUNG_IS_SAFE = 1.0 / math.sqrt(2.0)
"""Up to this mu Young's alpha is below 2/(1 + mu)."""

CHECK = 8
"""So many sweeps the rate is measured over."""

SLOW = 3
"""So often in a row it must promise too little: over-relaxed sweeps begin slowly. Those
with alpha <= 1 begin fast; once will do."""


def dominance(A: Any) -> float:
    """Return mu of a csr_array, the smaller of the two.

    It is inf where a diagonal entry is not positive.
    """
    D = A.diagonal()
    if not np.all(D > 0.0):
        return math.inf
    return min(dominance_csr(A.data, A.indices, A.indptr, np.sqrt(D)))


def relaxation(mu: float, symmetric: bool) -> float:
    """Return an alpha that makes projected SOR converge, Young's where it does."""
    if mu < 1.0 and (symmetric or mu <= YOUNG_IS_SAFE):
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
    deadline: Deadline = NEVER,
) -> tuple[Status, np.ndarray, int]:
    """Sweep until accept(z, w) with w = A z + q; return status, w and the sweeps made.

    STALLED is said as soon as the observed rate does not promise the goal in max_iter
    sweeps.

    Parameters
    ----------
    A : (n, n) csr_array
        Any matrix with a positive diagonal.
    q, lower, upper : (n,) array
        The rest of the box LCP.
    z : (n,) array
        Start in [lower, upper], overwritten by the last iterate.
    alpha : float
        As `relaxation` returns it.
    accept : callable
        The exact test, which costs a product with A; asked only when Res(z) of the
        problem scaled to a unit diagonal, guessed from the last two sweeps, is below
        `goal` (which a refusal divides by 10).
    goal : float
        The size of that Res(z) that `accept` wants.
    max_iter : int
        Sweeps at most.
    deadline : Deadline
        When to stop.
    """
    before = math.inf
    checked, since, slow = 0.0, 1, 0
    for k in range(1, max_iter + 1):
        moved = relax_csr(A.data, A.indices, A.indptr, q, lower, upper, alpha, z)
        guess = moved * min(1.0, moved / before) if k > 1 else moved
        if guess < goal or moved == 0.0:
            w = A @ z + q
            if accept(z, w):
                return Status.SOLVED, w, k
            if moved == 0.0:
                return Status.STALLED, w, k
            goal *= 0.1
        if k == 1:
            checked = moved
        elif k % CHECK == 0:
            rate = (moved / checked) ** (1.0 / (k - since))
            slow = slow + 1 if k + sweeps_left(moved, rate, goal) > max_iter else 0
            if slow == (SLOW if alpha > 1.0 else 1):
                return Status.STALLED, A @ z + q, k
            checked, since = moved, k
        if deadline.reached():
            return Status.TIME_LIMIT, A @ z + q, k
        before = moved
    return Status.MAX_ITER, A @ z + q, max_iter


def sweeps_left(moved: float, rate: float, goal: float) -> float:
    """Return how many sweeps take `moved` below the goal at that rate."""
    if not rate < 1.0:
        return math.inf
    return math.log(goal / moved) / math.log(rate) if goal > 0.0 < rate else 0.0
