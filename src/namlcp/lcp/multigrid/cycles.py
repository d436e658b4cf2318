"""Large sparse box LCPs by truncated multigrid: a few cycles, whatever the order.

In a cycle, projected Gauss-Seidel sweeps, forward and backward, determine the free set
F, where l < z < u, called a face here. A Krylov method, preconditioned by V-cycles
truncated to F, solves A_FF x = -w_F roughly, or to the tolerance if F has not changed.
Then z moves towards clip(z + x): for symmetric A to the minimum of E = z'Az / 2 + q'z
on that segment, unless this is nearby (`SHORT_STEP`), else all the way. For symmetric
positive definite A the sweeps and the line search decrease E, and the sweeps alone
would converge. For other matrices convergence is not guaranteed: the best point is
kept, and cycles that do not improve it end.

The start is nested iteration: each coarse level solves the LCP with P'q and the bounds
at the coarse unknowns, from the solution of the next coarser one. Without it F would
grow by one layer of unknowns a cycle.

References
----------
Kornhuber, Numer. Math. 69 (1994) 167-184; Graeser and Kornhuber, J. Comput. Math. 27
(2009) 1-44; Brandt and Cryer, SIAM J. Sci. Stat. Comput. 4 (1983) 655-684.
"""

import math
from typing import NamedTuple

import numpy as np

from namlcp.lcp.criterion import Criterion
from namlcp.lcp.data import LCP
from namlcp.lcp.multigrid.hierarchy import Hierarchy, hierarchy_of
from namlcp.lcp.multigrid.kernels import (
    mark_free,
    move,
    project_step,
    residual_vector,
)
from namlcp.lcp.multigrid.krylov import bicgstab, conjugate_gradients
from namlcp.lcp.multigrid.vcycle import VCycle
from namlcp.lcp.relaxation import relax_back, relax_csr
from namlcp.limits import Deadline, Limits
from namlcp.linalg.columns import LEAST_DIVISOR
from namlcp.measure import natural_residuals
from namlcp.outcome import Outcome
from namlcp.status import Status

MAX_CYCLES = 40
"""Cycles at most, by default; suitable matrices need less than 10."""

SWEEPS = 2
"""Pairs of a forward and a backward sweep in a cycle."""

NEW_FACE_REDUCTION, NEW_FACE_STEPS = 0.1, 12
"""On a changed face: relative residual of A_FF x = -w_F wanted, and steps at most."""

SETTLED_FACE_STEPS = 60
"""Krylov steps at most on an unchanged face."""

FACE_GOAL = 0.3
"""Residual of A_FF x = -w_F, relative to the tolerance, at which Krylov steps end."""

NESTED_GOAL, NESTED_CYCLES = 1e-3, 3
"""For the nested start, on each coarse level: Res wanted relative to Res(clip(0)), and
cycles at most."""

WARM_RESIDUAL, WARM_CYCLES = 1e-2, 5
"""z0 is used if Res(z0) <= WARM_RESIDUAL Res(clip(0)); after WARM_CYCLES cycles without
success the solve begins anew with the nested start."""

SLOW_CYCLES = 2
"""The solve ends after so many cycles in a row on an unchanged face that leave more
than half of the residual."""

FRUITLESS_CYCLES = 5
"""After so many cycles in a row without a better point a nonsymmetric solve ends, and a
symmetric one follows every line search from then on."""

SHORT_STEP = 0.5
"""Step length of the line search below which the full step, which corrects the face, is
taken instead."""


class LevelLCP(NamedTuple):
    """The LCP on one level; z times `scale` has a unit diagonal on the finest level."""

    q: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    scale: np.ndarray

    def start(self) -> np.ndarray:
        """Return clip(0)."""
        return np.clip(np.zeros(self.q.size), self.lower, self.upper)


class Iterate:
    """z, w = A z + q and Res(z) on one level, and the parts of a cycle.

    `here` is Res in the scaling of the hierarchy, `residual` Res on the finest level of
    the problem scaled to a unit diagonal, on coarse levels the same as `here`.
    `settled`: the last correction met an unchanged face. `full_steps`: short line
    searches are replaced by full steps.
    """

    def __init__(self, cycle: VCycle, k: int, box: LevelLCP, z: np.ndarray):
        self.cycle, self.k, self.box = cycle, k, box
        self.A = cycle.levels[k].A
        self.z = z
        self.w, self.x, self.Ax = (np.empty_like(z) for _ in range(3))
        self.settled = False
        self.full_steps = True
        self.begun = False
        residual_vector(self.A, box.q, z, self.w)
        self.update_residuals()

    def update_residuals(self) -> None:
        self.here, self.residual = natural_residuals(self.z, self.w, *self.box[1:])

    def smooth(self) -> None:
        q, lower, upper, _ = self.box
        for _ in range(SWEEPS):
            relax_csr(*self.A, q, lower, upper, 1.0, self.z)
            relax_back(*self.A, q, lower, upper, self.z)
        residual_vector(self.A, q, self.z, self.w)
        self.update_residuals()

    def correct(self, goal: float) -> None:
        """Solve on the face, no more accurately than Res <= goal needs, and move."""
        _, lower, upper, _ = self.box
        z, w, x, Ax = self.z, self.w, self.x, self.Ax
        d, dinv = self.cycle.levels[self.k].d, self.cycle.faces[self.k].dinv
        changed = mark_free(d, z, lower, upper, dinv)
        if changed or not self.begun:
            self.cycle.follow_face(self.k)
        self.settled = self.begun and not changed
        self.begun = True
        floor = FACE_GOAL * goal * (self.here / max(self.residual, LEAST_DIVISOR))
        r = np.where(dinv != 0.0, -w, 0.0)
        x.fill(0.0)
        size, steps = float(np.linalg.norm(r)), SETTLED_FACE_STEPS
        if not self.settled:
            floor, steps = max(NEW_FACE_REDUCTION * size, floor), NEW_FACE_STEPS
        if size > floor:
            solve = conjugate_gradients if self.cycle.symmetric else bicgstab
            solve(self.cycle, self.k, r, floor, steps, x)
        slope, curvature = project_step(self.A, z, w, lower, upper, x, Ax)
        step = 1.0
        if self.cycle.symmetric and -slope < curvature:
            step = max(0.0, -slope / curvature)
        if self.full_steps and step < SHORT_STEP:
            step = 1.0
        move(step, x, Ax, lower, upper, z, w)
        self.update_residuals()


def solve_by_multigrid(lcp: LCP, z0: np.ndarray | None, limits: Limits) -> Outcome:
    """Solve the box LCP; iterations are cycles on A itself. Raise if A does not suit.

    z0 is used if it is close to the solution. With MAX_ITER, TIME_LIMIT and STALLED
    (rounding, or no progress for nonsymmetric A) z is the best point.
    """
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
    status = solver.run(z0, limits)
    return lcp.outcome(
        status, *solver.users_point(solver.best), solver.done, "multigrid"
    )


class MultigridSolver:
    """One solve: the best point so far in the scaling of the hierarchy and its Res.

    `least` is this Res, `done` the number of cycles on the finest level.
    """

    def __init__(self, lcp: LCP, hierarchy: Hierarchy, criterion: Criterion):
        self.lcp, self.hierarchy = lcp, hierarchy
        self.cycle = VCycle(hierarchy.levels, hierarchy.symmetric)
        S, root = hierarchy.scale, np.sqrt(hierarchy.levels[0].d)
        self.box = LevelLCP(S * lcp.q, lcp.lower / S, lcp.upper / S, root)
        self.accepts, self.goal = criterion.accepts, criterion.goal
        self.best = self.box.start()
        self.least = math.inf
        self.done = 0
        self.warm = False

    def users_point(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return z in the caller's scaling, and w = A z + q."""
        z = np.clip(self.hierarchy.scale * z, self.lcp.lower, self.lcp.upper)
        return z, self.lcp.w(z)

    def note(self, iterate: Iterate) -> None:
        """Keep the iterate if it is the best so far."""
        if iterate.residual < self.least:
            self.least = iterate.residual
            np.copyto(self.best, iterate.z)

    def is_solved(self, iterate: Iterate) -> bool:
        """Keep the iterate if it is the best; tell whether the criterion accepts it.

        The criterion is evaluated only if Res(z), with a unit diagonal, is at most
        `goal`; if it fails, `goal` is divided by 10.
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
        """Start, then cycle until solved, stalled or at a limit."""
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
                z, box = iterate.z, self.box
                active = np.count_nonzero((z == box.lower) | (z == box.upper))
                residual = self.lcp.residual(*self.users_point(z))
                limits.report(self.done, residual, active)
            if solved:
                return Status.SOLVED
            if self.warm and self.done == WARM_CYCLES:
                self.cycle.faces[0].dinv[:] = 1.0 / self.cycle.levels[0].d
                self.cycle.follow_face(0)
                iterate = self.nested(0, self.box, deadline)
                continue
            fruitless = 0 if self.least < least else fruitless + 1
            is_slow = iterate.settled and not iterate.residual <= 0.5 * before
            slow = slow + 1 if is_slow else 0
            if slow >= SLOW_CYCLES:
                return Status.STALLED
            if fruitless >= FRUITLESS_CYCLES:
                if not self.cycle.symmetric:
                    return Status.STALLED
                iterate.full_steps = False
        return Status.MAX_ITER

    def start(self, z0: np.ndarray | None, deadline: Deadline) -> Iterate:
        """Return z0 if it is close to the solution, else a nested start."""
        cold = Iterate(self.cycle, 0, self.box, self.best.copy())
        self.note(cold)
        if z0 is not None:
            with np.errstate(over="ignore"):
                z = np.clip(z0 / self.hierarchy.scale, *self.box[1:3])
            warm = Iterate(self.cycle, 0, self.box, z)
            self.note(warm)
            if warm.residual <= max(WARM_RESIDUAL * cold.residual, self.goal):
                self.warm = True
                return warm
        if cold.residual <= self.goal:
            return cold
        return self.nested(0, self.box, deadline)

    def nested(self, k: int, box: LevelLCP, deadline: Deadline) -> Iterate:
        """Return clip(P z), z from the level below; on the last level clip(0).

        On entry no level may be truncated.
        """
        z = box.start()
        if k + 1 < len(self.cycle.levels):
            level = self.cycle.levels[k]
            q, C = np.empty(level.C.size), level.C
            residual_vector(level.R, np.zeros(q.size), box.q, q)
            below = LevelLCP(q, box.lower[C], box.upper[C], np.ones(q.size))
            cold = Iterate(self.cycle, k + 1, below, below.start())
            goal = NESTED_GOAL * cold.residual
            iterate = self.nested(k + 1, below, deadline)
            for _ in range(NESTED_CYCLES):
                if iterate.residual <= goal or deadline.reached():
                    break
                iterate.smooth()
                if iterate.residual > goal:
                    iterate.correct(goal)
            residual_vector(level.P, np.zeros(z.size), iterate.z, z)
            np.clip(z, box.lower, box.upper, out=z)
        return Iterate(self.cycle, k, box, z)
