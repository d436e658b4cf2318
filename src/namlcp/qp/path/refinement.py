"""Active-set refinement: guess the active constraints, solve, correct the guess.

With the active one-sided constraints, at first those with Z > W, as equations and
without the others,

    [P  A'  G_a'] [x]   [-q ]
    [A          ] [y] = [b  ]      (variables at an active bound held there)
    [G_a        ] [v]   [c_a]

is solved by proximal iterations with the factors of its regularised matrix, which
converge for dependent active rows too. The next guess keeps the active constraints with
multipliers >= 0 and adds the violated ones: a primal-dual active-set method
(Hintermueller, Ito and Kunisch, SIAM J. Optim. 13 (2003) 865-888).
"""

import numpy as np

from namlcp.limits import Deadline
from namlcp.qp.judge import Judge
from namlcp.qp.path.advance import HOLD
from namlcp.qp.path.workspace import Workspace

# Active sets tried by one refinement at most, and the residual over its tolerance, on
# unscaled data, up to which no other set is tried.
MOST_SETS, GOOD_ENOUGH = 6, 1e-2
# Added to the diagonal of P, and subtracted for rows. The second is tried where L D L'
# breaks down with the first, or where the iterations do not reduce the residual
# tenfold: the KKT system of the active set is singular then.
REGULARISATIONS = 1e-9, 1e-7
# Proximal iterations at most.
PROXIMAL_STEPS = 25
# Violation of a slack or multiplier over the tolerance above which a point is not worth
# measuring.
FAR = 1e3
# A set that is FAR off is followed by another only where its violation fell to this
# part of the last one's. Sets that lead to the solution gain more, others cost a
# factorisation each.
FALL = 0.3


class Refinement:
    """Rounds of the active-set method on a scaled problem; overwrites the factors."""

    def __init__(self, work: Workspace, judge: Judge, deadline: Deadline) -> None:
        self.work, self.judge, self.deadline = work, judge, deadline

    def run(
        self, x: np.ndarray, y: np.ndarray, Z: np.ndarray, active: np.ndarray
    ) -> None:
        """Try active sets, the given one first; offer every point found to the judge.

        Ends with a residual over its tolerance of GOOD_ENOUGH, where that ratio is not
        halved or the violation does not FALL, or where the set does not change.
        """
        work, now = self.work, self.work.now
        work.set_active[:] = active
        now.most_solves = PROXIMAL_STEPS
        best = violation = np.inf
        regularisations: tuple[float, ...] = REGULARISATIONS
        for _ in range(MOST_SETS):
            for k, regularisation in enumerate(regularisations):
                now.regularisation = regularisation
                work.set_x[:], work.set_y[:], work.set_Z[:] = x, y, Z
                work.perform(HOLD)
                if now.converged:
                    regularisations = regularisations[k:]
                    break
            if not now.is_factored:
                return
            if now.set_violation <= FAR * now.tol or not now.set_changed:
                point = work.problem.point(work.set_x, work.set_y, work.set_Z)
                worst = self.judge.offer(point)
                if worst <= GOOD_ENOUGH or not worst <= 0.5 * best:
                    return
                best = worst
            elif not now.set_violation <= FALL * violation:
                return
            violation = now.set_violation
            if not now.set_changed:
                return
            if self.deadline.reached():
                return
            work.set_active[:] = work.next_active
            x, y, Z = (v.copy() for v in (work.set_x, work.set_y, work.set_Z))
