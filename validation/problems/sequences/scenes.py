"""Scenes without control: a shaken heap, a portfolio, a lasso path.

Contact: time steps of discs in a box that is shaken (Moreau's scheme, no friction),

    minimise  v'M v / 2 - v'M(v_old + dt g + kicks)   subject to  N'v >= -gap / dt

for the velocities v; then positions += dt v. The normals N stay those of the heap at
rest, for small motions, so that only q and h change. The gaps are open at first; then
the discs rattle, and contacts close and open. Units: dt = g = 1.

Portfolio: long-only, its expected returns estimated anew every day,

    minimise  w'(RISK C)w / 2 - r'w   subject to  sum(w) = 1,  0 <= w <= most

with the covariance C of a factor model as a dense matrix.

Lasso path: the penalty falls from where nothing is chosen to a thousandth of it,

    minimise  |X w - y|^2 / 2 + penalty |w|_1,   w = u - v,  u, v >= 0

as QP in (u, v), whose P = [X'X, -X'X; -X'X, X'X] is singular. There are twice as many
samples as features, of which one in five has an influence.
"""

import itertools

import numpy as np
import scipy.sparse as sp
from qpsolvers import Problem

from validation.problems.contact_scenes import heap_of_discs
from validation.problems.sequences.control import LEVELS, Sequence, Steps

KICK = dict(zip(LEVELS, (0.01, 0.1, 1.0), strict=True))
"""Standard deviation of random changes of the velocities, over dt g."""
GAP = 1.0  # the gaps of the heap at rest: what a disc falls in the first step
MASSES = 10.0  # the largest mass over the least


def shaken_heap(contacts: int, level: str) -> Sequence:
    """Return the sequence with about so many contacts, sparse."""
    heap = heap_of_discs(contacts, True, MASSES, seed=contacts)
    G = sp.csc_matrix(-heap.N.T)
    n, m = heap.mass.size, G.shape[0]
    mass = heap.mass
    problem = Problem(
        sp.csc_matrix(sp.diags_array(mass)), np.zeros(n), G, np.full(m, GAP)
    )

    def steps() -> Steps:
        rng = np.random.default_rng(contacts)
        v, moved = np.zeros(n), np.zeros(n)
        for _ in itertools.count():
            free = v + KICK[level] * rng.standard_normal(n)
            free[1::2] -= 1.0
            h = GAP - G @ moved
            found = yield {"q": -mass * free, "h": h}
            v = np.zeros(n) if found is None else found
            moved = moved + v

    return Sequence(problem, steps())


NEWS = dict(zip(LEVELS, (1e-3, 1e-2, 1e-1), strict=True))
"""Change of the expected returns, over their own spread, from one day to the next."""
RISK = 5.0  # aversion
SHARE, FEWEST = 0.1, 4.0  # largest share; at least this many can fill the budget
POOR = 0.9  # part of the expected returns that is not forgotten


def rebalancing(assets: int, level: str) -> Sequence:
    """Return the sequence with so many assets and a tenth as many factors."""
    rng = np.random.default_rng(assets)
    loadings = 0.3 * rng.standard_normal((assets, assets // 10))
    specific = 0.05 + 0.1 * rng.random(assets)
    P = RISK * (loadings @ loadings.T + np.diag(specific))
    first = rng.standard_normal(assets)
    bounds = np.zeros(assets), np.full(assets, max(SHARE, FEWEST / assets))
    problem = Problem(P, -first, None, None, np.ones((1, assets)), np.ones(1), *bounds)
    return Sequence(problem, days(first, NEWS[level], rng))


def days(returns: np.ndarray, news: float, rng: np.random.Generator) -> Steps:
    """Yield q = -r; r wanders about where it began, so that its spread stays."""
    wander = np.zeros(returns.size)
    for _ in itertools.count():
        yield {"q": -(returns + wander)}
        wander = POOR * wander + news * rng.standard_normal(returns.size)


VALUES = dict(zip(LEVELS, (1000, 100, 20), strict=True))
"""Values of the penalty on the whole path."""
LAST = 1e-3  # the last penalty over the first
ERROR = 0.5  # of y


def penalty_path(features: int, level: str) -> Sequence:
    rng = np.random.default_rng(features)
    X = rng.standard_normal((2 * features, features)) / np.sqrt(2 * features)
    w = rng.standard_normal(features) * (rng.random(features) < 0.2)
    y = X @ w + ERROR * rng.standard_normal(2 * features)
    C, c = X.T @ X, X.T @ y
    P = np.block([[C, -C], [-C, C]])
    linear, ones = np.append(-c, c), np.ones(2 * features)
    penalties = np.abs(c).max() * np.geomspace(1.0, LAST, VALUES[level])
    problem = Problem(P, linear + penalties[0] * ones, lb=0.0 * ones)

    def steps() -> Steps:
        for penalty in penalties:
            yield {"q": linear + penalty * ones}

    return Sequence(problem, steps())
