"""Solve A_FF x = -w_F on a face F of a level, preconditioned by truncated V-cycles.

The methods are conjugate gradients for symmetric A, else right-preconditioned BiCGStab
(van der Vorst, SIAM J. Sci. Stat. Comput. 13 (1992) 631-644). SciPy's conjugate
gradients do not end at p'A p <= 0, and SciPy's methods update vectors one by one.
"""

import numpy as np

from namlcp.lcp.multigrid.hierarchy import Hierarchy
from namlcp.lcp.multigrid.kernels import face_product, step_along
from namlcp.lcp.multigrid.vcycle import VCycle

# Krylov steps at most between two computations of the residual, and computations of it
# at most: recurrences drift away from it by rounding.
LINEAR_STEPS, RESTARTS = 100, 3


def krylov(
    cycle: VCycle, k: int, r: np.ndarray, goal: float, steps: int, x: np.ndarray
) -> None:
    """Solve A_FF x = r, F = cycle.faces[k], from x = 0, which stays 0 outside F.

    Stop at a residual, left in r, of at most `goal`, or after `steps` steps.
    """
    solve = conjugate_gradients if cycle.symmetric else bicgstab
    solve(cycle, k, r, goal, steps, x)


def conjugate_gradients(
    cycle: VCycle, k: int, r: np.ndarray, goal: float, steps: int, x: np.ndarray
) -> None:
    A, dinv = cycle.levels[k].A, cycle.faces[k].dinv
    y, Ap = np.empty_like(r), np.empty_like(r)
    rho = cycle.solve(k, r, y)
    p = y.copy()
    for step in range(1, steps + 1):
        curvature = face_product(A, dinv, p, Ap)
        if not (curvature > 0.0 and rho > 0.0):
            return
        if step_along(rho / curvature, p, Ap, x, r) <= goal or step == steps:
            return
        before, rho = rho, cycle.solve(k, r, y)
        p *= rho / before
        p += y


def bicgstab(
    cycle: VCycle, k: int, r: np.ndarray, goal: float, steps: int, x: np.ndarray
) -> None:
    A, dinv = cycle.levels[k].A, cycle.faces[k].dinv
    shadow, p = r.copy(), r.copy()
    y, Ay, t = np.empty_like(r), np.empty_like(r), np.empty_like(r)
    rho = float(shadow @ r)
    for _ in range(steps):
        cycle.solve(k, p, y)
        face_product(A, dinv, y, Ay)
        below = float(shadow @ Ay)
        if rho == 0.0 or below == 0.0:
            return
        alpha = rho / below
        if step_along(alpha, y, Ay, x, r) <= goal:
            return
        cycle.solve(k, r, y)
        face_product(A, dinv, y, t)
        product = float(t @ t)
        if product == 0.0:
            return
        omega = float(t @ r) / product
        if step_along(omega, y, t, x, r) <= goal or omega == 0.0:
            return
        before, rho = rho, float(shadow @ r)
        p -= omega * Ay
        p *= rho / before * alpha / omega
        p += r


class FreeSystem:
    """A_FF x = b for one F and any number of right-hand sides; F (n,) is a mask."""

    def __init__(self, hierarchy: Hierarchy, free: np.ndarray) -> None:
        self.hierarchy, self.free = hierarchy, free
        self.cycle = VCycle(hierarchy.levels, hierarchy.symmetric)
        self.cycle.faces[0].dinv[~free] = 0.0
        self.cycle.follow_face(0)

    def solve(self, b: np.ndarray, accuracy: float) -> tuple[np.ndarray, bool]:
        """Return x (n,), 0 outside F, and whether |b - A x|_F <= accuracy |b|_F.

        b is (n,); entries outside F are not read. The norm is that of the scaled system
        of the hierarchy.
        """
        scale, A = self.hierarchy.scale, self.hierarchy.A
        x, r = np.zeros(b.size), np.where(self.free, scale * b, 0.0)
        goal = accuracy * float(np.linalg.norm(r))
        for _ in range(RESTARTS):
            size = float(np.linalg.norm(r))
            if not size > goal:
                break
            y = np.zeros(b.size)
            krylov(self.cycle, 0, r, goal, LINEAR_STEPS, y)
            x += scale * y
            r = np.where(self.free, scale * (b - A @ x), 0.0)
        return x, bool(np.linalg.norm(r) <= goal)
