"""Exact solutions near the end of an interior path: on its face, or by proximal steps.

The signs of p - F at an interior point tell which unknowns are at a bound; the others
solve F = 0. Their matrix is singular at nearly every solution of a friction problem, so
that `finish` solves the equations by proximal steps from the interior point: these lead
to the nearest solution of the face.

Where many pairs of p and F are nearly (0, 0), the face is hard to tell. For symmetric
semidefinite matrices `proximal_steps` goes on: a step from c seeks x = clip(s) with F =
M x + b, s = c - F / rho; this x minimises the convex function

    phi(x) = 1/2 x'M x + rho/2 (|| s ||^2 - || s - clip(s) ||^2)

an augmented Lagrangian (Li, Sun and Toh, SIAM J. Optim. 28 (2018) 433-458). Newton's
step solves the equations of the unknowns with s inside its bounds. Along it phi' = -rho
(s_1 - s_0)'(x - clip(s)) is piecewise linear, and an exact search makes the method
converge from every start (Hermans, Themelis and Patrinos, Math. Program. Comput. 14
(2022) 497-541).
"""

from collections.abc import Iterator

import numpy as np

from namlcp.lcp.general.cones import System
from namlcp.lcp.general.distances import Distances
from namlcp.lcp.shifted import HELD

# Wrong p or F, relative to the largest p and to max |c_i| = 1, that counts as 0.
ROUNDING = 1e-13
# On a face: weight of the proximal term, relative to the unit diagonal, and its steps
# at most; each must halve the residual of the equations.
PROXIMAL, REFINEMENTS = 1e-8, 6
# Faces at most; faces in a row without fewer wrong signs that end the search.
FACES, PATIENCE = 8, 3
# rho, relative to the unit diagonal: of the first step, its factor to the next, and its
# least value. Newton's steps at most; bisections of [0, 1] for the zero of phi'.
RHO, FALL, LEAST_RHO = 1e-5, 0.1, 1e-8
STEPS, BISECTIONS = 200, 40


def finish(model: Distances, system: System, p: np.ndarray) -> Iterator[np.ndarray]:
    """Yield points on one face after another, one factorisation each."""
    s = p - model.F(p)
    low, high = s <= model.lower, s >= model.upper
    fewest, patience = s.size + 1, PATIENCE
    for _ in range(FACES):
        x = np.where(low, model.lower, np.where(high, model.upper, p))
        solve_on_face(model, system, ~(low | high), x)
        F = model.F(x)
        zero = rounding(x)
        yield np.clip(x, model.lower, model.upper)
        under, over = x < model.lower - zero, x > model.upper + zero
        rises, falls = low & (F < -zero), high & (F > zero)
        wrong = int(np.count_nonzero(under | over | rises | falls))
        if wrong < fewest:
            fewest, patience = wrong, PATIENCE
        else:
            patience -= 1
        if wrong == 0 or patience == 0 or not np.isfinite(F).all():
            return
        low = (low & ~rises) | under
        high = (high & ~falls) | over


def solve_on_face(
    model: Distances, system: System, free: np.ndarray, x: np.ndarray
) -> None:
    """Move the free entries of x until F = 0 there, as far as that is possible."""
    factors = system.factors(np.where(free, PROXIMAL, HELD))
    if factors is None:
        return
    least = np.inf
    for _ in range(REFINEMENTS):
        F = np.where(free, model.F(x), 0.0)
        error = float(np.abs(F).max(initial=0.0))
        if not error < 0.5 * least:
            return
        least = error
        x -= np.where(free, factors.solve(F), 0.0)


def proximal_steps(
    model: Distances, system: System, p: np.ndarray
) -> Iterator[np.ndarray]:
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
        zero = rounding(x)
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


def rounding(x: np.ndarray) -> float:
    return ROUNDING * max(1.0, float(np.abs(x).max(initial=0.0)))
