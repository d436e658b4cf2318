"""A long-only portfolio whose expected returns are estimated anew every day.

    minimise  w'(RISK C)w / 2 - r'w   subject to  sum(w) = 1,  0 <= w <= most

with the covariance C of a factor model as a dense matrix.
"""

import itertools

import numpy as np
from qpsolvers import Problem

from validation.problems.sequences.sequence import LEVELS, Sequence, Steps

NEWS = dict(zip(LEVELS, (1e-3, 1e-2, 1e-1), strict=True))
"""Change of the expected returns, over their own spread, from one day to the next."""
RISK = 5.0  # aversion
MOST, FEWEST = 0.1, 4.0  # largest share; at least this many can fill the budget
POOR = 0.9  # part of the expected returns that is not forgotten


def rebalancing(assets: int, level: str) -> Sequence:
    """Return the sequence with so many assets and a tenth as many factors."""
    rng = np.random.default_rng(assets)
    loadings = 0.3 * rng.standard_normal((assets, assets // 10))
    specific = 0.05 + 0.1 * rng.random(assets)
    P = RISK * (loadings @ loadings.T + np.diag(specific))
    first = rng.standard_normal(assets)
    bounds = np.zeros(assets), np.full(assets, max(MOST, FEWEST / assets))
    problem = Problem(P, -first, None, None, np.ones((1, assets)), np.ones(1), *bounds)
    return Sequence(problem, days(first, NEWS[level], rng))


def days(returns: np.ndarray, news: float, rng: np.random.Generator) -> Steps:
    """Yield q = -r; r wanders about where it began, so that its spread stays."""
    wander = np.zeros(returns.size)
    for _ in itertools.count():
        yield {"q": -(returns + wander)}
        wander = POOR * wander + news * rng.standard_normal(returns.size)
