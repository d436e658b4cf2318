"""Large sparse box LCPs by truncated multigrid: a few cycles, whatever the order.

A cycle: projected Gauss-Seidel sweeps, forward and backward, find the face F, where
l < z < u; a Krylov method, preconditioned by V-cycles that live on F, solves A_FF x =
-w_F roughly, or exactly where F has not changed; z moves towards clip(z + x), for
symmetric A to the lowest energy on that segment. For symmetric positive definite A
every part decreases the energy, and the sweeps alone would converge; only where the
search goes nowhere the step is full, as it always is for other matrices. For them
nothing is promised: the best point is kept, and cycles that do not improve it end.

The start is nested: coarse levels solve the LCP with P'q and the bounds at the coarse
unknowns, each from the solution of the next coarser one. Without it the face would grow
by one layer of unknowns a cycle.

References
----------
Kornhuber, Numer. Math. 69 (1994) 167-184; Graeser and Kornhuber, J. Comput. Math. 27
(2009) 1-44; Brandt and Cryer, SIAM J. Sci. Stat. Comput. 4 (1983) 655-684.
"""

import math
from typing import NamedTuple

import numpy as np

from namlcp.lcp.criterion import Criterion
from namlcp.lcp.data import LCP, Outcome
from namlcp.lcp.multigrid.hierarchy import Hierarchy
from namlcp.lcp.multigrid.kernels import (
    interpolate,
    mark_free,
    move,
    project_step,
    residual_vector,
)
from namlcp.lcp.multigrid.krylov import solve_on_face
from namlcp.lcp.multigrid.vcycle import VCycle
from namlcp.lcp.relaxation import relax_back, relax_csr
from namlcp.limits import Deadline, Limits
from namlcp.residuals import natural_residuals
from namlcp.status import Status

MAX_CYCLES = 40
"""Cycles at most, unless the caller says; a matrix that suits takes less than 10."""

SWEEPS = 2
"""Pairs of a forward and a backward sweep in a cycle."""

REDUCTION, NEW_FACE_STEPS = 0.1, 12
"""Fraction of the residual to be left on a new face; Krylov steps at most for that."""

SETTLED_FACE_STEPS = 60
"""Krylov steps at most on a face that has not changed."""

FACE_GOAL = 0.3
"""Residual wanted on a face, relative to the tolerance: less is wasted work."""

NESTED_GOAL, NESTED_CYCLES = 1e-3, 3
"""Residual wanted on a coarse level, relative to that of clip(0); cycles at most."""

SMALLEST = 1e-300
"""In place of a residual of 0 in a denominator."""

WARM, WARM_CYCLES = 1e-2, 5
"""A start whose residual, relative to that of clip(0), is at most WARM is tried for
WARM_CYCLES cycles."""

SLOW_CYCLES = 2
"""Cycles in turn on an unchanged face that may leave more than half of the residual."""

FRUITLESS_CYCLES = 5
"""Cycles in turn that may pass without a better point: then nonsymmetric problems are
given up, and the energy of symmetric ones must decrease."""

SHORT_STEP = 0.5
"""A line search that ends before this is not followed: the full step corrects the
face."""


class LevelLCP(NamedTuple):
    """The LCP on one level; its residual counts in units of `scale`."""

    q: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    scale: np.ndarray


class Iterate:
    """z, w = A z + q and Res(z) on one level, and what changes them.

    `residual` is Res of the problem scaled to a unit diagonal (as it is on coarse
    levels), `here` in the scaling of the hierarchy.
    """

    def __init__(self, cycle: VCycle, k: int, box: LevelLCP, z: np.ndarray):
        self.cycle, self.k, self.box = cycle, k, box
        self.A = cycle.levels[k].A
        self.z = z
        self.w, self.x, self.Ax = (np.empty_like(z) for _ in range(3))
        self.settled = False
        self.bold = True
        self.begun = False
        residual_vector(self.A, box.q, z, self.w)
        self.judge()

    def judge(self) -> None:
        """Compute the residuals."""
        self.here, self.residual = natural_residuals(self.z, self.w, *self.box[1:])

    @property
    def active(self) -> int:
        """Unknowns at a bound."""
        z, box = self.z, self.box
        return int(np.count_nonzero((z == box.lower) | (z == box.upper)))

    def smooth(self) -> None:
        """Sweep forward and backward."""
        q, lower, upper, _ = self.box
        for _ in range(SWEEPS):
            relax_csr(*self.A, q, lower, upper, 1.0, self.z)
            relax_back(*self.A, q, lower, upper, self.z)
        residual_vector(self.A, q, self.z, self.w)
        self.judge()

    def correct(self, goal: float) -> None:
        """Solve on the face and move; no better than Res = `goal` asks for."""
        _, lower, upper, _ = self.box
        z, w, x, Ax = self.z, self.w, self.x, self.Ax
        d, dinv = self.cycle.levels[self.k].d, self.cycle.faces[self.k].dinv
        changed = mark_free(d, z, lower, upper, dinv)
        if changed or not self.begun:
            self.cycle.follow_face(self.k)
        self.settled = self.begun and not changed
        self.begun = True
        floor = FACE_GOAL * goal * (self.here / max(self.residual, SMALLEST))
        reduction, steps = 0.0, SETTLED_FACE_STEPS
        if not self.settled:
            reduction, steps = REDUCTION, NEW_FACE_STEPS
        solve_on_face(self.cycle, self.k, w, reduction, floor, steps, x)
        slope, curvature = project_step(self.A, z, w, lower, upper, x, Ax)
        step = 1.0
        if self.cycle.symmetric and -slope < curvature:
            step = max(0.0, -slope / curvature)
        if self.bold and step < SHORT_STEP:
            step = 1.0
        move(step, x, Ax, lower, upper, z, w)
        self.judge()


def solve_by_multigrid(
    lcp: LCP, z0: np.ndarray | None, limits: Limits, criterion: Criterion
) -> Outcome:
    """Solve the box LCP; iterations are cycles on A itself. Raise if A does not suit.

    Otherwise than SOLVED z is the best point met: MAX_ITER, TIME_LIMIT, STALLED
    (rounding, or no progress on a nonsymmetric matrix). z0 is heeded if it is close to
    the solution.
    """
    hierarchy = lcp.matrix.hierarchy(limits.deadline)
    if hierarchy is None:
        if not limits.deadline.reached():
            raise ValueError(
                'A does not suit method "multigrid": it must have a positive diagonal, '
                "short rows, mostly negative couplings and V-cycles that contract; "
                'use method="auto"'
            )
        z = lcp.start(z0)
        return Outcome(Status.TIME_LIMIT, z, lcp.w(z), 0, "multigrid")
    solver = MultigridSolver(lcp, hierarchy, criterion)
    status = solver.run(z0, limits)
    return Outcome(status, *solver.users_point(solver.best), solver.done, "multigrid")


class MultigridSolver:
    """One solve.

    Attributes
    ----------
    best : (n,) array
        The best point met, in the scaling of the hierarchy, and `least`, its Res.
    done : int
        Cycles on the first level.
    cycle : VCycle
        Counts the V-cycles on all levels.
    """

    def __init__(self, lcp: LCP, hierarchy: Hierarchy, criterion: Criterion):
        self.lcp, self.hierarchy = lcp, hierarchy
        self.cycle = VCycle(hierarchy.levels, hierarchy.symmetric)
        _, q, lower, upper = lcp
        S = hierarchy.scale
        root = np.sqrt(hierarchy.levels[0].d)
        self.box = LevelLCP(S * q, lower / S, upper / S, root)
        self.accepts, self.goal = criterion.accepts, criterion.goal
        self.best = self.clipped(np.zeros(q.size), self.box)
        self.least = math.inf
        self.done = 0
        self.warm = False

    @staticmethod
    def clipped(z: np.ndarray, box: LevelLCP) -> np.ndarray:
        """Return the point of the box next to z."""
        return np.minimum(np.maximum(z, box.lower), box.upper)

    def users_point(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return z in the caller's scaling, and w = A z + q."""
        _, _, lower, upper = self.lcp
        z = np.minimum(np.maximum(self.hierarchy.scale * z, lower), upper)
        return z, self.lcp.w(z)

    def note(self, iterate: Iterate) -> None:
        """Keep the iterate if it is the best so far."""
        if iterate.residual < self.least:
            self.least = iterate.residual
            np.copyto(self.best, iterate.z)

    def is_solved(self, iterate: Iterate) -> bool:
        """Note the iterate; tell whether the criterion accepts it.

        It is asked only when Res(z) of the problem scaled to a unit diagonal is at most
        the goal; a refusal divides that goal by 10.
        """
        self.note(iterate)
        if not iterate.residual <= self.goal:
            return False
        if self.accepts(*self.users_point(iterate.z)):
            np.copyto(self.best, iterate.z)
            return True
        self.goal *= 0.1
        return False

    def run(self, z0: np.ndarray | None, limits: Limits) -> Status:
        """Start, then cycle until solved or an end is in sight."""
        deadline, max_cycles = limits.deadline, limits.max_iter or MAX_CYCLES
        iterate = self.start(z0, deadline)
        if self.is_solved(iterate):
            return Status.SOLVED
        fruitless = slow = 0
        while self.done < max_cycles:
            if deadline.reached():
                return Status.TIME_LIMIT
            before, least = iterate.residual, self.least
            self.done += 1
            iterate.smooth()
            solved = self.is_solved(iterate)
            if not solved:
                iterate.correct(self.goal)
                solved = self.is_solved(iterate)
            if limits.report is not None:
                residual = self.lcp.residual(*self.users_point(iterate.z))
                limits.report(self.done, residual, iterate.active)
            if solved:
                return Status.SOLVED
            if self.warm and self.done == WARM_CYCLES:
                self.cycle.release()
                iterate = self.nested_start(deadline)
                continue
            fruitless = 0 if self.least < least else fruitless + 1
            if iterate.settled and not iterate.residual <= 0.5 * before:
                slow += 1
            else:
                slow = 0
            if slow >= SLOW_CYCLES:
                return Status.STALLED
            if fruitless >= FRUITLESS_CYCLES:
                if not self.cycle.symmetric:
                    return Status.STALLED
                iterate.bold = False
        return Status.MAX_ITER

    def start(self, z0: np.ndarray | None, deadline: Deadline) -> Iterate:
        """Return z0 if it is close to the solution, else a nested start."""
        cold = Iterate(self.cycle, 0, self.box, self.best.copy())
        self.note(cold)
        if z0 is not None:
            with np.errstate(over="ignore"):
                z = self.clipped(z0 / self.hierarchy.scale, self.box)
            warm = Iterate(self.cycle, 0, self.box, z)
            self.note(warm)
            if warm.residual <= max(WARM * cold.residual, self.goal):
                self.warm = True
                return warm
        if cold.residual <= self.goal:
            return cold
        return self.nested_start(deadline)

    def nested_start(self, deadline: Deadline) -> Iterate:
        """Return the solution of the level below; no level may be truncated."""
        return Iterate(self.cycle, 0, self.box, self.nested(0, self.box, deadline))

    def nested(self, k: int, box: LevelLCP, deadline: Deadline) -> np.ndarray:
        """Return clip(P z) on level k, z from the LCP on the level below.

        On a level without one it is clip(0).
        """
        levels = self.cycle.levels
        if k + 1 == len(levels):
            return self.clipped(np.zeros(box.q.size), box)
        level = levels[k]
        q, C = np.empty(level.C.size), level.C
        residual_vector(level.R, np.zeros(q.size), box.q, q)
        below = LevelLCP(q, box.lower[C], box.upper[C], np.ones(q.size))
        cold = self.clipped(np.zeros(q.size), below)
        goal = NESTED_GOAL * Iterate(self.cycle, k + 1, below, cold).residual
        iterate = Iterate(self.cycle, k + 1, below, self.nested(k + 1, below, deadline))
        for _ in range(NESTED_CYCLES):
            if iterate.residual <= goal or deadline.reached():
                break
            iterate.smooth()
            if iterate.residual > goal:
                iterate.correct(goal)
        z = np.empty(box.q.size)
        interpolate(level.P, iterate.z, box.lower, box.upper, z)
        return z
