"""LCPs of known classes that are neither P nor semidefinite, by name, size and seed.

Every problem has a solution. `copositive` matrices have x'A x >= 0 for x >= 0; here a
nonnegative matrix plus a semidefinite one, with a positive diagonal: strictly so, and
Lemke's method finds a solution for every q. `singular copositive` has a zero diagonal
in places, and q > 0 there, which Lemke's theory covers as well (Cottle, Pang and Stone
1992, 4.4.12). `copositive-plus`: a block of the first kind and a semidefinite one that
is not symmetric, around a planted solution. `P0`: principal minors >= 0, those of odd
order 0, around a planted solution. Games: two players with payoffs R and C (p x r)
choose rows and columns at random, with probabilities x and y. In costs r_ij = max R -
R_ij + 1 > 0 and likewise c,

    w = [0 r; c' 0] (x, y) - 1 >= 0,   (x, y) >= 0,   (x, y)'w = 0

has the equilibria as its solutions, with x and y divided by their sums.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import scipy.linalg

from namlcp.scenes.friction import Scene, friction_lcp
from validation.problems import contact_scenes as piles

MU = (0.2, 0.5, 0.9)  # in turn, by the seed

Problem = tuple[Any, np.ndarray]


def planted(rng: np.random.Generator, A: np.ndarray) -> Problem:
    """Return the LCP of complementary z and w, half of z positive, a tenth both 0."""
    n = len(A)
    kind = rng.random(n)
    z = rng.exponential(size=n) * (kind < 0.5)
    w = rng.exponential(size=n) * (kind > 0.6)
    return A, w - A @ z


def nonnegative(rng: np.random.Generator, n: int) -> np.ndarray:
    return rng.exponential(size=(n, n)) * (rng.random((n, n)) < 0.3)


def semidefinite(rng: np.random.Generator, n: int) -> np.ndarray:
    F = rng.standard_normal((n, max(1, n // 4)))
    return F @ F.T / n


def copositive(n: int, seed: int) -> Problem:
    rng = np.random.default_rng([n, seed])
    A = nonnegative(rng, n) + semidefinite(rng, n) + 0.01 * np.eye(n)
    return A, rng.standard_normal(n)


def singular_copositive(n: int, seed: int) -> Problem:
    rng = np.random.default_rng([n, seed])
    A, q = nonnegative(rng, n), rng.standard_normal(n)
    zero = rng.random(n) < 0.5
    A[zero, zero] = 0.0
    positive = A.diagonal() == 0.0
    q[positive] = np.abs(q[positive])
    return A, q


def copositive_plus(n: int, seed: int) -> Problem:
    rng = np.random.default_rng([n, seed])
    k = n // 2
    K = rng.standard_normal((k, k))
    skew = semidefinite(rng, k) + (K - K.T) / np.sqrt(max(k, 1))
    rest = nonnegative(rng, n - k) + np.eye(n - k)
    return planted(rng, scipy.linalg.block_diag(skew, rest))


def p0(n: int, seed: int) -> Problem:
    rng = np.random.default_rng([n, seed])
    K = rng.standard_normal((n, n))
    return planted(rng, rng.exponential(size=(n, 1)) * (K - K.T))


def game_lcp(R: np.ndarray, C: np.ndarray) -> Problem:
    R, C = (M.max() - M + 1.0 for M in np.array((R, C), dtype=float))
    p, r = R.shape
    A = np.block([[np.zeros((p, p)), R], [C.T, np.zeros((r, r))]])
    return A, np.full(p + r, -1.0)


def random_game(rows: int, columns: int, seed: int, whole: bool) -> Problem:
    """Return the LCP of uniform payoffs, or whole ones from 0 to 4, with many ties."""
    rng = np.random.default_rng(seed)
    shape = 2, rows, columns
    return game_lcp(*(rng.integers(0, 5, shape) if whole else rng.random(shape)))


def game(n: int, seed: int) -> Problem:
    rows = max(1, (3 * n) // 7)
    return random_game(rows, n - rows, seed, whole=bool(seed % 2))


def friction(build: Callable[..., Scene]) -> Callable[..., Problem]:

    def family(n: int, seed: int, ratio: float = 2.0) -> Problem:
        size, mu = 2, MU[seed % len(MU)]
        while True:
            scene = build(size, mu, ratio=ratio, seed=seed)
            if scene.contacts.mu.size * (scene.directions + 2) >= n:
                return friction_lcp(scene)
            size = max(size + 1, int(1.1 * size))

    return family


FAMILIES: dict[str, Callable[..., Problem]] = {
    "pile": friction(piles.pile_of_discs),
    "wall": friction(piles.wall_of_bricks),
    "chain": friction(piles.pressed_chain),
    "balls": friction(piles.pile_of_balls),
    "cubes": friction(partial(piles.column_of_cubes, directions=8)),
    "copositive": copositive,
    "singular copositive": singular_copositive,
    "copositive-plus": copositive_plus,
    "P0": p0,
    "games": game,
}
"""Families by name: A and q from (n, seed); those with friction from a mass ratio too.
They have n unknowns, or more where n is no size of a scene."""

FRICTION = ("pile", "wall", "chain", "balls", "cubes")
