"""Proximal steps from the end of an interior path, for symmetric semidefinite matrices.

They go on where many pairs of p and F are nearly (0, 0), so that pivoting does not find
the face. A step from c seeks x = clip(s) with F = M x + b, s = c - F / rho; this x
minimises the convex function

    phi(x) = 1/2 x'M x + rho/2 (|| s ||^2 - || s - clip(s) ||^2)

(an augmented Lagrangian of the problem that has x for multipliers), whose gradient is
M (x - clip(s)). Newton's step solves the equations of the unknowns with s inside its
bounds; with an exact line search it converges from every start. Along the step x and s
are linear, and phi' = -rho (s_1 - s_0)'(x - clip(s)) is piecewise linear.

References
----------
Li, Sun and Toh, SIAM J. Optim. 28 (2018) 433-458; Hermans, Themelis and Patrinos, Math.
Program. Comput. 14 (2022) 497-541 (the exact search).
"""

from collections.abc import Iterator

import numpy as np

from namlcp.lcp.general.cones import System
from namlcp.lcp.general.distances import Distances
from namlcp.lcp.shifted import HELD

# Change of p, relative to the largest p and to max |c_i| = 1, that counts as 0.
ROUNDING = 1e-13
# rho, relative to the unit diagonal: of the first step, its factor to the next, and its
# least value. Newton's steps at most; bisections of [0, 1] for the zero of phi'.
RHO, FALL, LEAST_RHO = 1e-5, 0.1, 1e-8
STEPS, BISECTIONS = 200, 40


def proximal_steps(
    model: Distances, system: System, p: np.ndarray
) -> Iterator[np.ndarray]:
    """Yield the points of Newton's steps from p, one factorisation each."""
    lower, upper = model.lower, model.upper
    centre, x, rho = p, p, RHO
    s = centre - model.F(x) / rho
    for _ in range(STEPS):
        free = (lower < s) & (s < upper)
        start = np.where(free, centre, np.clip(s, lower, upper))
        factors = system.factors(np.where(free, rho, HELD))
        if factors is None:
            return
        dx = start + factors.solve(np.where(free, -model.F(start), 0.0)) - x
        end = np.where(free, x + dx, start)
        F = model.F(end)
        ds = np.where(free, end, centre - F / rho) - s
        step = least_phi(model, x, end - x, s, ds)
        x, s = x + step * (end - x), s + step * ds
        yield np.clip(x, lower, upper)
        zero = ROUNDING * max(1.0, float(np.abs(x).max(initial=0.0)))
        slack = np.where(free, zero, -ROUNDING / rho)
        inside = (lower - slack < s) & (s < upper + slack)
        if step == 1.0 and (inside == free).all():
            centre, rho = x, max(FALL * rho, LEAST_RHO)
            s = centre - F / rho


def least_phi(
    model: Distances, x: np.ndarray, dx: np.ndarray, s: np.ndarray, ds: np.ndarray
) -> float:
    """Return the step up to 1 at which phi is least."""

    def rises(step: float) -> bool:
        at = s + step * ds
        return bool(ds @ (x + step * dx - np.clip(at, model.lower, model.upper)) < 0.0)

    below, above = 0.0, 1.0
    if not rises(1.0):
        return 1.0
    for _ in range(BISECTIONS):
        step = 0.5 * (below + above)
        below, above = (below, step) if rises(step) else (step, above)
    return above
