"""Large sparse box LCPs by truncated multigrid: a few cycles, whatever the order.

In a cycle, projected Gauss-Seidel sweeps, forward and backward, determine the free set
F, where l < z < u, called a face here. A Krylov method, preconditioned by V-cycles
truncated to F, solves A_FF x = -w_F roughly, or to the tolerance if F has not changed.
Then z moves towards clip(z + x): for symmetric A to the minimum of E = z'Az / 2 + q'z
on that segment, else all the way. For symmetric positive definite A the sweeps and the
line search decrease E, and the sweeps alone would converge. For other matrices
convergence is not guaranteed: the best point is kept.

The start is nested iteration: each coarse level solves the LCP with P'q and the bounds
at the coarse unknowns, from the solution of the next coarser one. Without it F would
grow by one layer of unknowns a cycle.

References
----------
Kornhuber, Numer. Math. 69 (1994) 167-184; Graeser and Kornhuber, J. Comput. Math. 27
(2009) 1-44; Brandt and Cryer, SIAM J. Sci. Stat. Comput. 4 (1983) 655-684.
"""

import math

import numpy as np

from namlcp.checks import LEAST_DIVISOR
from namlcp.lcp.data import LCP, Criterion
from namlcp.lcp.loops import relax
from namlcp.lcp.multigrid.hierarchy import Hierarchy, VCycle, hierarchy_of
from namlcp.lcp.multigrid.kernels import free_product
from namlcp.limits import Deadline, Limits
from namlcp.linalg.csc import arrays_of
from namlcp.residuals import natural_residual
from namlcp.status import Outcome, Status

# Cycles at most, by default; suitable matrices need less than 10. Pairs of a forward
# and a backward sweep in a cycle.
MAX_CYCLES, SWEEPS = 40, 2
# On a changed face: relative residual of A_FF x = -w_F wanted, and steps at most; steps
# at most on an unchanged face; residual, relative to the tolerance, at which they end.
NEW_FACE_REDUCTION, NEW_FACE_STEPS, SETTLED_FACE_STEPS, FACE_GOAL = 0.1, 12, 60, 0.3
# For the nested start, on each coarse level: Res wanted relative to Res(clip(0)), and
# cycles at most.
NESTED_GOAL, NESTED_CYCLES = 1e-3, 3
# z0 is used if Res(z0) <= WARM_RESIDUAL Res(clip(0)).
WARM_RESIDUAL = 1e-2
# The solve ends after so many cycles in a row on an unchanged face that leave more than
# half of the residual.
SLOW_CYCLES = 2


class LevelLCP:
    """The LCP of one level, its iterate z with w = A z + q, and the parts of a cycle.

    All is in the scaling of the hierarchy; box: lower and upper. `residual`: Res.
    `free`: mask of the last face since `go_to`. `settled`: the last correction met an
    unchanged one.
    """

    def __init__(self, cycle: VCycle, k: int, q: np.ndarray, *box: np.ndarray):
        self.cycle, self.k, self.q, self.box = cycle, k, q, box
        self.A, self.d = cycle.levels[k].A, cycle.levels[k].d
        self.w, self.r = np.empty((2, q.size))
        self.go_to(np.zeros(q.size))

    def go_to(self, z: np.ndarray) -> None:
        """Begin anew from clip(z), z being overwritten."""
        self.z = np.clip(z, *self.box, out=z)
        self.free: np.ndarray | None = None
        self.settled = False
        self.evaluate()

    def evaluate(self) -> None:
        free_product(self.A, self.d, self.z, self.w)
        self.w += self.q
        self.residual = natural_residual(self.z, self.w, *self.box)

    def smooth(self) -> None:
        problem = *arrays_of(self.A), self.q, *self.box
        for _ in range(SWEEPS):
            relax(*problem, 1.0, self.z, 1)
            relax(*problem, 1.0, self.z, -1)
        self.evaluate()

    def correct(self, goal: float) -> None:
        """Solve on the face, no more accurately than Res <= goal needs, and move."""
        lower, upper = self.box
        z, w = self.z, self.w
        free = (lower < z) & (z < upper)
        self.settled = self.free is not None and np.array_equal(free, self.free)
        if not self.settled:
            self.free = free
            np.divide(free, self.d, out=self.cycle.faces[self.k].dinv)
            self.cycle.follow_face(self.k)
        floor = FACE_GOAL * goal
        r, steps = np.multiply(w, -1.0, out=self.r), SETTLED_FACE_STEPS
        r[~free] = 0.0
        if not self.settled:
            floor = max(NEW_FACE_REDUCTION * float(np.linalg.norm(r)), floor)
            steps = NEW_FACE_STEPS
        x = self.cycle.krylov(self.k, r, floor, steps)
        x += z
        np.clip(x, lower, upper, out=x)
        x -= z
        free_product(self.A, self.d, x, r)
        slope, curvature = float(w @ x), float(x @ r)
        if self.cycle.symmetric and -slope < curvature:
            step = -slope / curvature if slope < 0.0 else 0.0
            x *= step
            r *= step
        z += x
        np.clip(z, lower, upper, out=z)
        w += r
        self.residual = natural_residual(z, w, lower, upper)

    def nest(self, deadline: Deadline) -> None:
        """Begin anew from clip(P z), z from the level below; on the last from clip(0).

        On entry no level may be truncated.
        """
        z = np.zeros(self.q.size)
        if self.k + 1 < len(self.cycle.levels):
            level = self.cycle.levels[self.k]
            box = (bound[level.C] for bound in self.box)
            below = LevelLCP(self.cycle, self.k + 1, level.R @ self.q, *box)
            goal = NESTED_GOAL * below.residual
            below.nest(deadline)
            for _ in range(NESTED_CYCLES):
                if below.residual <= goal or deadline.reached():
                    break
                below.smooth()
                if below.residual > goal:
                    below.correct(goal)
            z = level.P @ below.z
        self.go_to(z)


def solve_by_multigrid(lcp: LCP, z0: np.ndarray | None, limits: Limits) -> Outcome:
    """Solve the box LCP; iterations are cycles on A. Raise if A does not suit."""
    hierarchy = hierarchy_of(lcp.matrix, limits.deadline)
    if hierarchy is None:
        if not limits.deadline.reached():
            raise ValueError(
                'A does not suit method "multigrid": it must have a positive diagonal, '
                "short rows, mostly negative couplings and V-cycles that contract; "
                'use method="auto"'
            )
        z = lcp.start(z0)
        return lcp.outcome(Status.TIME_LIMIT, z, lcp.w(z), 0, "multigrid")
    solver = MultigridSolver(lcp, hierarchy, Criterion(lcp, limits))
    status, z = solver.run(z0, limits), solver.best
    return lcp.outcome(status, z, lcp.w(z), solver.done, "multigrid")


class MultigridSolver:
    """One solve: z, its Res of the problem as given, and scaled to a unit diagonal.

    `least`: the least scaled Res so far, that of the point `best`; `done`: cycles.
    """

    def __init__(self, lcp: LCP, hierarchy: Hierarchy, criterion: Criterion):
        self.lcp, self.criterion, S = lcp, criterion, hierarchy.scale
        self.cycle, self.scale = VCycle(hierarchy.levels, hierarchy.symmetric), S
        q, *box = lcp[1:]
        if isinstance(S, np.ndarray):  # else these are large vectors copied for nothing
            q, box = S * q, [bound / S for bound in box]
        self.top = LevelLCP(self.cycle, 0, q, *box)
        self.z, self.w = np.empty((2, q.size))
        self.best, self.least, self.done = lcp.start(), math.inf, 0

    def is_solved(self) -> bool:
        """Keep the best iterate; tell whether the criterion accepts this one.

        A product with A makes sure of it where the w of the cycle meets it.
        """
        lcp, top, criterion = self.lcp, self.top, self.criterion
        if isinstance(self.scale, np.ndarray):
            np.multiply(self.scale, top.z, out=self.z)
            np.clip(self.z, lcp.lower, lcp.upper, out=self.z)
            np.divide(top.w, self.scale, out=self.w)
        else:
            self.z, self.w = top.z, top.w
        self.plain, self.residual = criterion.residuals(self.z, self.w)
        near = criterion.met(self.plain, self.residual)
        solved = near and criterion.accepts(self.z, lcp.w(self.z))
        if solved or self.residual < self.least:
            self.best[:], self.least = self.z, self.residual
        return solved

    def run(self, z0: np.ndarray | None, limits: Limits) -> Status:
        deadline, max_cycles = limits.deadline, limits.max_iter or MAX_CYCLES
        top, goal = self.top, self.criterion.goal
        solved, cold, warm = self.is_solved(), self.residual, False
        if z0 is not None and not solved:
            with np.errstate(over="ignore"):
                top.go_to(z0 / self.scale)
            solved = self.is_solved()
            warm = self.residual <= max(WARM_RESIDUAL * cold, goal)
        if not (solved or warm):
            top.nest(deadline)
            solved = self.is_solved()
        if solved:
            return Status.SOLVED
        slow = 0
        while self.done < max_cycles:
            if deadline.reached():
                return Status.TIME_LIMIT
            before = self.residual
            self.done += 1
            top.smooth()
            solved = self.is_solved()
            if not solved:
                unit = top.residual / max(self.residual, LEAST_DIVISOR)
                top.correct(unit * goal)
                solved = self.is_solved()
            if limits.report is not None:
                limits.report(self.done, self.plain, self.lcp.active(self.z))
            if solved:
                return Status.SOLVED
            is_slow = top.settled and not self.residual <= 0.5 * before
            slow = slow + 1 if is_slow else 0
            if slow >= SLOW_CYCLES:
                return Status.STALLED
        return Status.MAX_ITER
