"""Solve A_FF x = -w_F on a face F of a level, preconditioned by truncated V-cycles.

The methods are conjugate gradients for symmetric A, else right-preconditioned BiCGStab
(van der Vorst, SIAM J. Sci. Stat. Comput. 13 (1992) 631-644). SciPy's conjugate
gradients do not end at p'A p <= 0, and SciPy's methods update vectors one by one.
"""

import numpy as np

from namlcp.lcp.multigrid.kernels import face_product, step_along
from namlcp.lcp.multigrid.vcycle import VCycle


def conjugate_gradients(
    cycle: VCycle, k: int, r: np.ndarray, goal: float, steps: int, x: np.ndarray
) -> None:
    """Solve A_FF x = r, F = cycle.faces[k], from x = 0, which stays 0 outside F.

    Stop at a residual, left in r, of at most `goal`, or after `steps` steps.
    """
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
    """Do the same for nonsymmetric A, with two V-cycles a step."""
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
