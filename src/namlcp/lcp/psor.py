"""Large sparse LCPs by projected SOR alone, as far as its rate promises enough.

With mu = max_i sum_{j != i} |a_ij| / a_ii < 1 (an H+ matrix), alpha in (0, 2/(1 + mu))
makes projected SOR a contraction in the maximum norm; symmetric A is then positive
definite and any alpha in (0, 2) converges (Cryer 1971; Mangasarian 1977). A diagonal
S > 0 in (S A S, S q, l/S, u/S) changes its iterates z by S^-1 alone, so mu may as well
be that of D^(-1/2) A D^(-1/2), which does not depend on units. Young's

    alpha = 2 / (1 + sqrt(1 - mu^2)),   rate (1 - sqrt(1 - mu^2)) / mu a sweep,

is the best one for the five-point matrix in its natural order: 0.27 at mu = 1/2.
"""

import math

import numpy as np

from namlcp.lcp.criterion import Criterion
from namlcp.lcp.data import LCP, Outcome
from namlcp.lcp.relaxation import relax_csr
from namlcp.limits import Limits
from namlcp.status import Status

MAX_SWEEPS = 200
"""Sweeps at most, unless the caller says: they take about as long as one sparse
factorisation of the same order."""

YOUNG_IS_SAFE = 1.0 / math.sqrt(2.0)
"""Up to this mu Young's alpha is below 2/(1 + mu)."""

RATE_SWEEPS = 8
"""Number of sweeps over which the rate is measured."""

SLOW = 3
"""So many measured rates in a row must be too slow where alpha > 1: over-relaxed sweeps
begin slowly. One is enough for the others."""


def relaxation(mu: float, symmetric: bool) -> float:
    """Return an alpha that makes projected SOR converge, Young's where it does."""
    if mu < 1.0 and (symmetric or mu <= YOUNG_IS_SAFE):
        return 2.0 / (1.0 + math.sqrt(1.0 - mu * mu))
    return 1.0


def solve_by_sweeps(
    lcp: LCP, z0: np.ndarray | None, limits: Limits, criterion: Criterion
) -> Outcome:
    """Sweep over a csr_array as long as max_iter sweeps promise to be enough.

    STALLED: they do not, or a diagonal entry is not positive.
    """
    z = lcp.start(z0)
    mu = lcp.matrix.dominance
    if not mu < math.inf:
        return Outcome(Status.STALLED, z, lcp.w(z), 0, "psor")
    w = lcp.w(z) if z.any() else lcp.q.copy()
    if criterion.accepts(z, w):
        return Outcome(Status.SOLVED, z, w, 0, "psor")
    alpha = relaxation(mu, False)
    if alpha == 1.0 and mu < 1.0:
        young = relaxation(mu, True)
        sweeps = (limits.max_iter or MAX_SWEEPS) // 2
        promised = (young - 1.0) ** sweeps * criterion.size
        if promised <= criterion.goal and lcp.matrix.symmetric:
            alpha = young
    outcome = relax(lcp, z, alpha, limits, criterion)
    if limits.report is not None and outcome.status in (
        Status.SOLVED,
        Status.TIME_LIMIT,
    ):
        residual = lcp.residual(outcome.z, outcome.w)
        limits.report(outcome.iterations, residual, lcp.active(outcome.z))
    return outcome


def relax(
    lcp: LCP, z: np.ndarray, alpha: float, limits: Limits, criterion: Criterion
) -> Outcome:
    """Sweep from z, which is overwritten, until the criterion accepts it.

    The criterion costs a product with A. So it is asked only when Res(z) of the problem
    scaled to a unit diagonal, guessed from the last two sweeps, is below its goal; a
    refusal divides that goal by 10. STALLED: the measured rate does not promise the
    goal in max_iter sweeps.
    """
    _, q, lower, upper = lcp
    A, goal = lcp.A, criterion.goal
    max_iter = limits.max_iter or MAX_SWEEPS

    def outcome(status: Status) -> Outcome:
        return Outcome(status, z, lcp.w(z), k, "psor")

    before = math.inf
    checked, checked_at, slow = 0.0, 1, 0
    for k in range(1, max_iter + 1):
        moved = relax_csr(A.data, A.indices, A.indptr, q, lower, upper, alpha, z)
        guess = moved * min(1.0, moved / before) if k > 1 else moved
        if guess < goal or moved == 0.0:
            found = outcome(Status.SOLVED)
            if criterion.accepts(z, found.w):
                return found
            if moved == 0.0:
                return found._replace(status=Status.STALLED)
            goal *= 0.1
        if k == 1:
            checked = moved
        elif k % RATE_SWEEPS == 0:
            rate = (moved / checked) ** (1.0 / (k - checked_at))
            slow = slow + 1 if k + sweeps_left(moved, rate, goal) > max_iter else 0
            if slow == (SLOW if alpha > 1.0 else 1):
                return outcome(Status.STALLED)
            checked, checked_at = moved, k
        if limits.deadline.reached():
            return outcome(Status.TIME_LIMIT)
        before = moved
    return outcome(Status.MAX_ITER)


def sweeps_left(moved: float, rate: float, goal: float) -> float:
    """Return how many sweeps take `moved` below the goal at that rate."""
    if not rate < 1.0:
        return math.inf
    return math.log(goal / moved) / math.log(rate) if goal > 0.0 < rate else 0.0
