"""An infeasible interior-point path, Mehrotra's, for matrices of any kind.

It needs one factorisation a step and solves most friction problems in 10 to 20. Where
M is not monotone it promises nothing: it may jam where `arc` would have to turn.

References
----------
Mehrotra, SIAM J. Optim. 2 (1992) 575-601.
"""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from namlcp.lcp.distances import Distances, Pairs
from namlcp.lcp.shifted import System

SHIFT = 1e-11
"""Added to the unit diagonal, so that a singular matrix can be factored."""

STEPS = 100
"""Steps at most."""

STEP_PART = 0.99
"""Fraction of the longest step with positive gaps and multipliers that is taken."""

LEAST_CENTRING, MOST_CENTRING = 1e-4, 0.9
"""Range of the mean product aimed at, relative to the present one."""

JAM, JAMS = 0.05, 3
"""So many steps in a row shorter than JAM end the path."""

STALL, FIRST_STALL = 8, 15
"""From step FIRST_STALL on, the path ends unless the least residual halves in every
STALL steps."""


class Point(NamedTuple):
    """A point of the path, or a direction from it: p, gaps and multipliers m."""

    p: np.ndarray
    gaps: np.ndarray
    m: np.ndarray


def mehrotra(model: Distances, system: System) -> Iterator[np.ndarray]:
    """Yield the points p of the path, one factorisation from one to the next."""
    pairs = Pairs(model)
    p, gaps = pairs.start(model.r)
    at = Point(p, gaps, np.ones(gaps.size))  # max |c_i| of the model is 1
    least, jams = [math.inf], 0
    for _ in range(STEPS):
        yield at.p
        excess = model.F(at.p) - pairs.total(at.m)
        error = float(np.abs(excess).max(initial=0.0))
        error = max(error, float((at.gaps * at.m).max(initial=0.0)))
        least.append(min(error, least[-1]))
        if len(least) > FIRST_STALL and least[-1] > 0.5 * least[-1 - STALL]:
            return
        factors = system.factors(pairs.gathered(at.m / at.gaps) + SHIFT)
        if factors is None:
            return
        change = -at.gaps * at.m  # of the products: first to 0, then as predicted
        for is_predictor in (True, False):
            wish = change / at.gaps
            dp = factors.solve(pairs.total(wish) - excess)
            dgaps = pairs.of(dp)
            d = Point(dp, dgaps, wish - at.m / at.gaps * dgaps)
            if is_predictor:
                change = corrected(at, d)
        step = STEP_PART * longest(at, d)
        jams = jams + 1 if step < JAM else 0
        if jams == JAMS or not math.isfinite(step):
            return
        at = Point(*(x + step * dx for x, dx in zip(at, d, strict=True)))
    yield at.p


def corrected(at: Point, d: Point) -> np.ndarray:
    """Return the changes of the products to aim at, d being Mehrotra's predictor."""
    products = at.gaps * at.m
    mu = float(products.mean()) if products.size else 0.0
    step = longest(at, d)
    left = float((at.gaps + step * d.gaps) @ (at.m + step * d.m)) / max(at.m.size, 1)
    sigma = (left / mu) ** 3 if mu > 0.0 else 0.0
    aim = min(max(sigma, LEAST_CENTRING), MOST_CENTRING) * mu
    return aim - np.clip(d.gaps * d.m, -mu, mu) - products


def longest(at: Point, d: Point) -> float:
    """Return the largest step up to 1 that keeps gaps and multipliers >= 0."""
    fall = max((-dx / x).max(initial=0.0) for x, dx in zip(at[1:], d[1:], strict=True))
    return 1.0 if fall <= 1.0 else 1.0 / float(fall)
