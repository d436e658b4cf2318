"""The exact solution next to an interior point, on the face that the point tells.

The signs of p - F tell which unknowns are at a bound; the others solve F = 0. Their
matrix is singular at nearly every solution of a friction problem, so that the equations
are solved by proximal steps from the interior point: these lead to the nearest solution
of the face.
"""

from collections.abc import Iterator

import numpy as np

from namlcp.lcp.distances import Distances
from namlcp.lcp.shifted import HELD, Quasidefinite, Shifted, System

PROXIMAL = 1e-8
"""Weight of the proximal term, relative to the unit diagonal."""

REFINEMENTS = 6
"""Proximal steps at most on a face; each must halve the residual of its equations."""

FACES, PATIENCE = 8, 3
"""Faces at most; faces in a row without fewer wrong signs that end the search."""

ROUNDING = 1e-13
"""Wrong p or F, relative to the largest p and to max |c_i| = 1, that counts as 0."""


def finish(model: Distances, system: System, p: np.ndarray) -> Iterator[np.ndarray]:
    """Yield points on one face after another, one factorisation each, from p inside."""
    s = p - model.F(p)
    low, high = s <= model.lower, s >= model.upper
    fewest, patience = s.size + 1, PATIENCE
    for _ in range(FACES):
        x = np.where(low, model.lower, np.where(high, model.upper, p))
        solve_on_face(model, system, ~(low | high), x)
        F = model.F(x)
        zero = ROUNDING * max(1.0, float(np.abs(x).max(initial=0.0)))
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
    rows = np.flatnonzero(free)
    if rows.size == 0:
        return
    if isinstance(system, Quasidefinite):  # no order of elimination is made anew
        rows, weight = np.arange(x.size), np.where(free, PROXIMAL, HELD)
    else:
        weight = np.full(rows.size, PROXIMAL)
        system = Shifted(model.M if rows.size == x.size else model.M[:, rows][rows])
    factors = system.factors(weight)
    if factors is None:
        return
    least = np.inf
    for _ in range(REFINEMENTS):
        F = np.where(free, model.F(x), 0.0)
        error = float(np.abs(F).max(initial=0.0))
        if not error < 0.5 * least:
            return
        least = error
        x[rows] -= factors.solve(F[rows])
