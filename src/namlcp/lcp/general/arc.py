"""Lemke's homotopy followed as a smooth curve, for matrices that are not monotone.

The curve of all (p, m, t) with positive gaps g, multipliers m and

    M p + c + t d = sum of sign_k m_k,    g_k m_k = t a_k                      (1)

starts at a point of our choice with t = 1, which defines d and a > 0. For a copositive
M with d > 0, and c'v >= 0 wherever v >= 0 has v'M v = 0, p stays bounded while t does,
so that the curve leads to t = 0, a solution, as Lemke's path of pivots does (Cottle,
Pang, Stone: The Linear Complementarity Problem, 1992, section 4.4). Its t turns where
the determinant of M + diag(m / g) changes its sign, the orientation of the curve.

A step uses relative changes of gaps and multipliers: U along the curve per unit of
log t, V back to it, both from one factorisation. A point off the curve is given up for
an earlier one and a shorter step, from a stack.
"""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from namlcp.lcp.general.cones import Condensed, System
from namlcp.lcp.general.distances import Distances
from namlcp.lcp.general.interior import PathPoint

# Added to the unit diagonal, so that a singular matrix can be factored.
SHIFT = 1e-12
# Steps at most: of any matrix; of one with friction cones, where the curve leads to a
# solution, but may wind: with 4000 unknowns it has been seen to turn 100 times, with
# 2000 to take 2100 steps.
STEPS, PROMISED_STEPS = 400, 5000
# Largest relative change of a gap or multiplier in a step along the curve: in the first
# step; where an earlier point of the stack is taken instead; in any step.
FIRST_STEP, LEAST_STEP, MOST_STEP = 0.9, 0.02, 0.98
# Relative changes back to the curve: below NEAR steps grow, above FAR they shrink;
# above OFF the point is given up, above OFF_AGAIN if the last one was.
NEAR, FAR, OFF, OFF_AGAIN = 0.05, 0.2, 1.0, 0.7
# After a point was given up: factor of the step from the one before, and largest
# relative change back to the curve in it.
SHORTER, LIMITED = 0.3, 0.5
# Points on the stack at most, and entries of their factors: these take 8 bytes each, 24
# with indices and copies of SuperLU.
KEPT, KEPT_ENTRIES = 30, 10_000_000
# Entry of p, relative to max |c_i| = 1, and t, at which the path ends.
FAR_AWAY, LARGE_T = 1e10, 1e4


class Directions:
    """The directions at a point of the path, with its t and the next step h from it.

    h is the largest relative change of a gap or multiplier along the curve.
    U, V: relative changes of the gaps, then of the multipliers, per unit of log t along
    the curve, and back to it; du, dv: the changes of p that belong to them; tv: the
    relative change of t with V. forward: whether t falls along the curve. error: the
    largest entry of V and tv.
    """

    h: float

    def __init__(
        self,
        curve: tuple[Distances, np.ndarray, np.ndarray],
        at: PathPoint,
        t: float,
        factors: Any,
    ):
        """Take the model, d and the products a, and M + diag(m / g) factored."""
        (model, d, products), self.at, self.t, self.factors = curve, at, t, factors
        self.model = model
        wish = t * products / at.gaps
        excess = model.F(at.p) + t * d - model.total(at.m)
        sides = np.empty((model.c.size, 2), order="F")
        sides[:, 0] = model.total(wish) - t * d
        sides[:, 1] = model.total(wish - at.m) - excess
        self.du, self.dv = factors.solve(sides).T
        ratio = t * products / (at.gaps * at.m)
        self.U = self.changes(self.du, ratio)
        self.V = self.changes(self.dv, ratio - 1.0)
        # V goes across the curve, not to the point of it with the same t, so that it
        # stays bounded where t turns.
        along = float(self.U @ self.V) / float(self.U @ self.U + 1.0)
        self.V -= along * self.U
        self.dv = self.dv - along * self.du
        self.tv = -along
        self.error = max(float(np.abs(self.V).max(initial=0.0)), abs(along))
        self.forward = factors.is_positive()

    def changes(self, dp: np.ndarray, products: np.ndarray) -> np.ndarray:
        """Return the relative changes for dp and those of the products g_k m_k."""
        a = self.model.of(dp) / self.at.gaps
        return np.concatenate((a, products - a))

    def move(self, theta: float) -> tuple[PathPoint, float]:
        """Return the point a step h along the curve and theta of V away, and its t."""
        at, model, number = self.at, self.model, self.at.m.size
        tau = self.h / max(float(np.abs(self.U).max(initial=0.0)), 1.0)
        tau = -tau if self.forward else tau
        rates, dp = tau * self.U + theta * self.V, tau * self.du + theta * self.dv
        # products are to stay what the first order makes them
        bend = -(tau**2) * self.U[:number] * self.U[number:]
        dx = self.factors.solve(model.total(at.m * bend))
        X = self.changes(dx, bend)
        if np.abs(X).max(initial=0.0) <= 0.5 * self.h:
            rates += X
            dp += dx
        rate = tau + theta * self.tv
        fall = max(float(-rates.min(initial=0.0)), -rate)
        cut = min(1.0, MOST_STEP / fall) if fall > 0.0 else 1.0
        gaps = at.gaps * (1.0 + cut * rates[:number])
        m = at.m * (1.0 + cut * rates[number:])
        return PathPoint(at.p + cut * dp, gaps, m), self.t * (1.0 + cut * rate)


def arc(model: Distances, system: System) -> Iterator[np.ndarray]:
    """Yield the points p of the path, one factorisation from one to the next.

    It starts at gaps of 1, as max |c_i| = 1, with multipliers that make d >= 1.
    """
    p, gaps = model.start()
    F = model.F(p)
    m = np.maximum(model.of(F), 0.0) + 1.0
    curve = model, model.total(m) - F, gaps * m
    at, t, h, off = PathPoint(p, gaps, m), 1.0, FIRST_STEP, False
    stack: list[Directions] = []
    for _ in range(PROMISED_STEPS if isinstance(system, Condensed) else STEPS):
        yield at.p
        if t > LARGE_T or np.abs(at.p).max(initial=0.0) > FAR_AWAY:
            return
        factors = system.factors(model.total(at.m / at.gaps, 1.0) + SHIFT)
        here = None if factors is None else Directions(curve, at, t, factors)
        off = here is None or not here.error <= (OFF_AGAIN if off else OFF)
        if here is not None and math.isfinite(here.error) and not (off and stack):
            here.h = 0.7 * h if here.error > FAR else h
            if here.error < NEAR:
                here.h = min(MOST_STEP, max(2.0 * h, 1.0 - (1.0 - h) ** 1.5))
            stack.append(here)
            room = KEPT_ENTRIES // here.factors.entries
            del stack[: -max(1, min(KEPT, room))]
        elif stack:  # an earlier point is better where the last step was short
            stack[-1].h *= SHORTER
            while stack[-1].h < LEAST_STEP and len(stack) > 1:
                stack.pop()
                stack[-1].h *= SHORTER
        else:
            return
        top = stack[-1]
        h = top.h
        at, t = top.move(min(1.0, LIMITED / top.error) if off and top.error else 1.0)
    yield at.p
