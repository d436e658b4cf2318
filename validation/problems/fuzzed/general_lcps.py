"""LCPs of the campaign whose matrices are neither P nor semidefinite, by `lcps`' rules.

Their truth is known by construction: friction and strictly copositive matrices have a
solution that Lemke's method finds (Cottle, Pang and Stone 1992, section 4.4), games
always have an equilibrium, and A'v < 0, q'v < 0 with v >= 0 leaves no solution.
"""

import numpy as np

from namlcp.scenes.friction import friction_lcp
from validation.problems.fuzzed.draw import Draw, definite, semidefinite
from validation.problems.fuzzed.lcps import INF, LCP, Truth, order
from validation.problems.general import games, piles

SEEDS = 2**31


def plain(A: np.ndarray, q: np.ndarray) -> LCP:
    return LCP(A, q, np.zeros(q.size), np.full(q.size, INF))


def friction(draw: Draw) -> Truth:
    """Bodies with friction, in the plane and in space, light ones and heavy ones."""
    seed, size = int(draw.rng.integers(SEEDS)), int(draw.rng.integers(1, 4))
    mu, ratio = draw.one_of(0.1, 0.2, 0.5, 0.9, 1.5), draw.one_of(1.0, 2.0, 1e4)
    builds = (piles.pile_of_discs, piles.wall_of_bricks, piles.pressed_chain,
              piles.pile_of_balls, piles.column_of_cubes)  # fmt: skip
    build = builds[int(draw.rng.integers(len(builds)))]
    A, q = friction_lcp(build(size, mu, ratio=ratio, seed=seed))
    return plain(A.toarray(), q), "solvable"


def game(draw: Draw) -> Truth:
    """Two players, whose payoffs have ties if they are whole numbers."""
    rows, columns = draw.size(1, 30), draw.size(1, 30)
    rows, columns = max(rows, 1), max(columns, 1)
    seed = int(draw.rng.integers(SEEDS))
    A, q = games.lcp(*games.payoffs(rows, columns, seed, draw.whole))
    mixed = draw.rng.permutation(q.size)
    return plain(A[np.ix_(mixed, mixed)], q), "solvable"


def strictly_copositive(draw: Draw) -> Truth:
    n = order(draw)
    A = np.abs(draw.matrix(n, n)) + 0.1 * definite(draw, n)
    return plain(A, draw.numbers(n)), "solvable"


def copositive(draw: Draw) -> Truth:
    """Take a nonnegative matrix plus a semidefinite one, and a planted solution.

    There may be others, and rays on the way: a refusal is no failure.
    """
    n = order(draw)
    A = np.abs(draw.matrix(n, n)) + semidefinite(draw, n)
    z = draw.positive(n) * draw.some(n, 0.5)
    w = draw.positive(n) * (z == 0.0) * draw.some(n, 0.9)
    return plain(A, w - A @ z), "possible"


def unsolvable_general(draw: Draw) -> Truth:
    """Any matrix, changed so that A'v < 0 for some v >= 0, and q'v < 0."""
    n = order(draw)
    A = draw.matrix(n, n)
    v = draw.positive(n) * draw.some(n, 0.5)
    v[int(draw.rng.integers(n))] = 1.0
    most = np.maximum(A.T @ v, 0.0) + draw.positive(n)
    A = A - np.outer(v, most) / (v @ v)
    q = draw.numbers(n)
    q -= (max(q @ v, 0.0) + draw.one_of(0.01, 1.0)) / (v @ v) * v
    return plain(A, q), "unsolvable"
