"""The search for certificates of infeasibility in the interior-point method.

Candidates are the iterate and the last step, as they are and projected by means of one
factorisation of K. Those with small relative residuals (`advance.promises`) are tested
by `accept_primal` and `accept_dual` on unscaled data.
"""

from collections.abc import Callable
from math import inf
from typing import Any

import numpy as np

from namlcp.compiled import address_of
from namlcp.qp.certificates import largest
from namlcp.qp.judge import Judge
from namlcp.qp.path.advance import AGAIN, HOLD, PROMISING
from namlcp.qp.path.steps import THIN
from namlcp.qp.path.workspace import Workspace
from namlcp.qp.problem import Point
from namlcp.status import Status

# In a projection, the weight of the distance to the candidate, where the residual has
# weight 1, and the refinement steps at most. These end at a largest residual PROJECTED
# of multipliers, the largest of which is 1: a certificate needs 1e-12.
PROJECTION, PROJECTION_STEPS, PROJECTED = 1e-8, 15, 1e-16
# A one-sided constraint is an equation in the projection of a ray d, max |d_j| = 1, if
# sign * C d, scaled, exceeds NEARLY_ACTIVE for d, or VIOLATED for a projection so far.
NEARLY_ACTIVE, VIOLATED, RAY_PROJECTIONS = -1e-3, 1e-13, 3


class CertificateSearch:
    """The tests of every iteration; the judge keeps what it accepts."""

    def __init__(self, work: Workspace, judge: Judge) -> None:
        self.work, self.problem, self.judge = work, work.problem, judge
        work.tested[:] = PROMISING

    def find(self) -> Status | None:
        """Return the verdict of the first candidate that is a proof, or None."""
        work, now = self.work, self.work.now
        n, p = now.n, now.p
        du, ratios = work.du.copy(), work.ratios.copy()
        for k, *candidate in (
            (0, work.y, work.Z),
            (1, du[n : n + p], np.maximum(work.dZ, 0.0)),
            (2, work.x),
            (3, du[:n]),
        ):
            if ratios[k] < np.inf and self.is_proof(k, ratios[k], candidate):
                return Status.PRIMAL_INFEASIBLE if k < 2 else Status.DUAL_INFEASIBLE
        return None

    def is_proof(self, k: int, ratio: float, candidate: list[np.ndarray]) -> bool:
        """Test candidate k, then its projections where it improved since the last."""
        proves: Callable[..., bool]
        projections: Callable[..., list[Any]]
        iterate: Any
        if k < 2:
            proves, projections = self.are_proof, self.project_multipliers
            iterate = self.problem.primal(self.work.x)
        else:
            proves, projections = self.is_ray, self.project_ray
            iterate = self.problem.point(self.work.x, self.work.y, self.work.Z)
        if proves(iterate, *candidate):
            return True
        if not ratio <= AGAIN * self.work.tested[k]:
            return False
        self.work.tested[k] = ratio
        return any(proves(iterate, *better) for better in projections(*candidate))

    def are_proof(self, x: np.ndarray, y: np.ndarray, Z: np.ndarray) -> bool:
        """Tell whether scaled multipliers prove that no x is feasible."""
        return self.judge.accept_multipliers(x, *self.problem.certificate(y, Z))

    def is_ray(self, point: Point, d: np.ndarray) -> bool:
        """Tell whether the QP is unbounded along a scaled direction."""
        return self.judge.accept_ray(self.problem.ray(d), point)

    def project_multipliers(
        self, y: np.ndarray, Z: np.ndarray
    ) -> list[tuple[np.ndarray, np.ndarray]]:
        """Project on the Farkas system A'y + C'Z = 0, in a norm with w = sqrt(Z).

        min |A'(y + dy) + C'(Z + dZ)|^2/(2 eps) + |dy|^2/2 + sum dZ^2/(2 w), with eps =
        PROJECTION, is solved again as long as the residual is halved and not PROJECTED.
        """
        s, kkt, work = self.problem, self.problem.kkt, self.work
        size = max(largest(y), largest(Z))
        y, Z = y / size, Z / size
        w = np.sqrt(Z)
        weight = self.sums(w)
        kkt.data[:] = kkt.base
        kkt.data[: kkt.indptr[s.n]] = 0.0
        diagonal = np.full(kkt.size, -1.0)
        diagonal[: s.n] = PROJECTION + weight[: s.n]
        row = slice(s.n + s.p, None)
        diagonal[row] = -1.0 / np.maximum(weight[row], THIN)
        kkt.data[kkt.diagonal] = diagonal
        factored = work.factor()
        kkt.data[:] = kkt.base
        last, rhs = inf, np.zeros(kkt.size)
        for _ in range(PROJECTION_STEPS if factored else 0):
            v = self.sums(s.sign * Z)
            v[s.n : s.n + s.p] = y
            r = work.multiply(np.zeros(s.n), v)[1] + v[: s.n]
            if not largest(r) <= 0.5 * last:
                break
            best = y, Z
            last = largest(r)
            if last <= PROJECTED:
                break
            rhs[: s.n] = -r
            u = work.solve_once(rhs)
            t = work.multiply(u[: s.n], v)[2]
            y = y + u[s.n : s.n + s.p]
            Z = np.maximum(Z + w * s.sign * t[s.place], 0.0)
        return [best if last < inf else (y, Z)]

    def project_ray(self, d: np.ndarray) -> list[tuple[np.ndarray]]:
        """Project d on P d = 0, A d = 0 and, for nearly active constraints, C d = 0.

        Constraints that the result violates are added for another projection. Returns
        all results, the last one first.
        """
        work, now = self.work, self.work.now
        d = d / largest(d)
        active, found = self.change_of_constraints(d) > NEARLY_ACTIVE, []
        zero = np.zeros(max(now.size, now.m))  # goal_c has m entries
        now.cost = now.goal_b = now.goal_c = address_of(zero)
        now.regularisation, now.most_solves = PROJECTION, PROJECTION_STEPS
        for _ in range(RAY_PROJECTIONS):
            work.set_x[:], work.set_y[:], work.set_Z[:] = d, 0.0, 0.0
            work.set_active[:] = active
            work.perform(HOLD)
            if not now.is_factored:
                break
            better = work.set_x.copy()
            found.append((better,))
            more = active | (self.change_of_constraints(better) > VIOLATED)
            if np.array_equal(more, active):
                break
            active = more
        work.attach()
        return found[::-1]

    def change_of_constraints(self, d: np.ndarray) -> np.ndarray:
        """Return sign * C d, positive where d violates a one-sided constraint."""
        t = self.work.multiply(d, np.zeros(self.work.now.size))[2]
        return self.problem.sign * t[self.problem.place]

    def sums(self, values: np.ndarray) -> np.ndarray:
        """Add up the values of the one-sided constraints that share a row of K."""
        place, size = self.problem.place, self.problem.kkt.size
        return np.bincount(place, values, minlength=size).astype(float, copy=False)
