"""Projected SOR for large sparse LCPs, given up early if it converges too slowly.

With mu = max_i sum_{j != i} |a_ij| / a_ii < 1 (an H+ matrix), projected SOR with alpha
in (0, 2/(1 + mu)) is a contraction in the maximum norm. If A is symmetric, too, it is
positive definite and any alpha in (0, 2) converges (Cryer 1971; Mangasarian 1977).
Scaling to (S A S, S q, l/S, u/S), S > 0 diagonal, only changes the iterates z to z/S,
so mu of D^(-1/2) A D^(-1/2), which does not depend on S, serves as well. Young's

    alpha = 2 / (1 + sqrt(1 - mu^2))

is optimal where the rows have two colours so that none is coupled to another one of its
colour: without bounds an error then falls by the factor alpha - 1 a sweep. If one
colour is relaxed after the other, it does so from the first sweeps on; in the natural
order only after some sqrt(n) of them (five-point matrix + 4 I, n = 10^6: 14 sweeps to
1e-10 in place of 25). With alpha = 1 the natural order is kept: it is the faster one
where A carries errors along with it.
"""

import math

import numpy as np

from namlcp.lcp.data import LCP, Criterion
from namlcp.lcp.loops import relax, relax_coloured
from namlcp.limits import Limits
from namlcp.linalg.csc import arrays_of
from namlcp.status import ENDS, Outcome, Status

# Largest mu for which Young's alpha is at most 2/(1 + mu).
YOUNG_IS_SAFE = 1.0 / math.sqrt(2.0)
# Sweeps at most, and between two measurements of the rate. Of these so many in a row
# must be too slow if alpha > 1, as over-relaxed sweeps begin slowly; otherwise one.
MOST_SWEEPS, RATE_SWEEPS, SLOW = 200, 8, 3


def solve_by_sweeps(lcp: LCP, z0: np.ndarray | None, limits: Limits) -> Outcome:
    """Solve an LCP with a csr_array of finite `dominance` by projected SOR.

    STALLED: MOST_SWEEPS will not suffice.
    """
    z, criterion = lcp.start(z0), Criterion(lcp, limits)
    w = lcp.w(z) if z.any() else lcp.q.copy()
    if criterion.accepts(z, w):
        return lcp.outcome(Status.SOLVED, z, w, 0, "psor")
    alpha, mu = 1.0, lcp.matrix.dominance
    if mu < 1.0:
        young = 2.0 / (1.0 + math.sqrt(1.0 - mu * mu))
        promised = (young - 1.0) ** (MOST_SWEEPS // 2) * criterion.size
        # Symmetry is tested only if Young's alpha may do.
        if mu <= YOUNG_IS_SAFE or (promised <= criterion.goal and lcp.matrix.symmetric):
            alpha = young
    status, k, w = relax_until(z, alpha, criterion)
    outcome = lcp.outcome(status, z, w, k, "psor")
    if limits.report is not None and status in ENDS:
        limits.report(k, outcome.residuals, lcp.active(z))
    return outcome


def relax_until(
    z: np.ndarray, alpha: float, criterion: Criterion
) -> tuple[Status, int, np.ndarray]:
    """Sweep from z, which is overwritten; return the sweeps made, and w.

    The criterion costs a product with A. It is asked only if an estimate of the scaled
    Res from the last two sweeps is below its goal; a rejection divides that by 10.
    """
    lcp, goal, before = criterion.lcp, criterion.goal, 0.0
    _, q, lower, upper = lcp
    parts = *arrays_of(lcp.A), q, lower, upper, alpha, z
    second = lcp.matrix.second_colour if alpha > 1.0 else None
    step = 1 if second is None else 2
    checked, checked_at, slow = 0.0, step, 0
    for k in range(step, MOST_SWEEPS + 1, step):
        if second is None:
            moved = relax(*parts, 1)
        else:
            before, moved = relax_coloured(*parts, second)
        guess = moved * (moved / before) if moved < before else moved
        if guess < goal or moved == 0.0:
            w = lcp.w(z)
            if criterion.accepts(z, w):
                return Status.SOLVED, k, w
            if moved == 0.0:
                return Status.STALLED, k, w
            goal *= 0.1
        if k == step:
            checked = moved
        elif k % RATE_SWEEPS == 0:
            rate, left = (moved / checked) ** (1.0 / (k - checked_at)), 0.0
            if not rate < 1.0:
                left = math.inf
            elif goal > 0.0 < rate:
                left = (math.log(goal) - math.log(moved)) / math.log(rate)
            slow = slow + 1 if k + left > MOST_SWEEPS else 0
            if slow == (SLOW if alpha > 1.0 else 1):
                return Status.STALLED, k, lcp.w(z)
            checked, checked_at = moved, k
        if criterion.limits.deadline.reached():
            return Status.TIME_LIMIT, k, lcp.w(z)
        before = moved
    return Status.MAX_ITER, k, lcp.w(z)
