"""A lasso path: the penalty falls from where nothing is chosen to a thousandth of it.

    minimise  |X w - y|^2 / 2 + penalty |w|_1,   w = u - v,  u, v >= 0

as QP in (u, v), whose P = [X'X, -X'X; -X'X, X'X] is singular. There are twice as many
samples as features, of which one in five has an influence.
"""

import numpy as np
from qpsolvers import Problem

from validation.problems.sequences.sequence import LEVELS, Sequence, Steps

VALUES = dict(zip(LEVELS, (1000, 100, 20), strict=True))
"""Values of the penalty on the whole path."""
LAST = 1e-3  # the last penalty over the first
NOISE = 0.5  # of y


def penalty_path(features: int, level: str) -> Sequence:
    """Return the path with so many features."""
    rng = np.random.default_rng(features)
    X = rng.standard_normal((2 * features, features)) / np.sqrt(2 * features)
    w = rng.standard_normal(features) * (rng.random(features) < 0.2)
    y = X @ w + NOISE * rng.standard_normal(2 * features)
    C, c = X.T @ X, X.T @ y
    P = np.block([[C, -C], [-C, C]])
    linear, ones = np.append(-c, c), np.ones(2 * features)
    penalties = np.abs(c).max() * np.geomspace(1.0, LAST, VALUES[level])
    problem = Problem(P, linear + penalties[0] * ones, lb=0.0 * ones)

    def steps() -> Steps:
        for penalty in penalties:
            yield {"q": linear + penalty * ones}

    return Sequence(problem, steps())
