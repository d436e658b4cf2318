"""The LCPs of the campaign: each class a function of a `Draw`.

It returns A, q, lower, upper and what is true of them:

- solvable: A is a P-matrix, or semidefinite with a planted solution; nam must solve it;
- possible: there is a solution, but A is outside of that class, or rounding may forbid
  to find it: a refusal is no failure;
- unsolvable: a semidefinite A, symmetric or not, and nam must prove it;
- far: as near, beyond the range of squares;
- near: nothing is known, any answer that can be proved is right.
"""

import numpy as np
import scipy.linalg

from namlcp.scenes.friction import friction_lcp
from validation.problems import contact_scenes as piles
from validation.problems.fuzzed.draw import MOST_VARIABLES, Draw, symmetric
from validation.problems.general.families import random_game
from validation.problems.known_scenes import BoxLCP, nonnegative

INF = np.inf
SEEDS = 2**31


Truth = tuple[BoxLCP, str]


def box(draw: Draw, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Return bounds: z >= 0 mostly, else of all kinds."""
    if draw.chance(0.5):
        return np.zeros(n), np.full(n, INF)
    lower, width = draw.numbers(n), draw.positive(n)
    kind = draw.rng.integers(0, 6, n) if draw.chance(0.7) else np.zeros(n, dtype=int)
    upper = lower + width
    upper[kind == 1] = INF
    lower[kind == 2] = -INF
    lower[kind == 3], upper[kind == 3] = -INF, INF
    upper[kind == 4] = lower[kind == 4]
    return lower, upper


def planted(draw: Draw, A: np.ndarray, weak: float = 0.1) -> BoxLCP:
    """Return an LCP around a random pair (z, w); a share `weak` at bounds has w = 0."""
    n = A.shape[0]
    lower, upper = box(draw, n)
    place = draw.rng.integers(0, 3, n)  # at lower, at upper, between
    low, high = np.isfinite(lower), np.isfinite(upper)
    at_low = low & ((place == 0) | (~high & (place == 1)) | (lower == upper))
    at_high = high & ~at_low & ((place == 1) | (~low & (place == 0)))
    room = np.where(low & high, (upper - lower) / 2.0, draw.positive(n))
    between = np.where(low, lower + room, np.where(high, upper - room, draw.numbers(n)))
    z = np.where(at_low, lower, np.where(at_high, upper, between))
    w = draw.positive(n) * ~draw.some(n, weak) * (1.0 * at_low - 1.0 * at_high)
    return BoxLCP(A, w - A @ z, lower, upper)


def random_side(draw: Draw, A: np.ndarray) -> BoxLCP:
    """Return an LCP with a random q: for P-matrices there is always a solution."""
    return BoxLCP(A, draw.numbers(A.shape[0]), *box(draw, A.shape[0]))


def order(draw: Draw) -> int:
    return draw.size(1, MOST_VARIABLES)


def positive_definite(draw: Draw) -> Truth:
    n = order(draw)
    A = draw.definite(n)
    if draw.chance(0.5):
        A = draw.ill_conditioned(n, draw.rng.uniform(0.0, 8.0))
    return random_side(draw, A), "solvable"


def positive_semidefinite(draw: Draw) -> Truth:
    """Symmetric, of any rank, with a planted solution."""
    return planted(draw, draw.semidefinite(order(draw))), "solvable"


def degenerate_pairs(draw: Draw) -> Truth:
    """Symmetric semidefinite or definite; most of those at a bound have w = 0."""
    n = order(draw)
    A = draw.definite(n) if draw.chance(0.5) else draw.semidefinite(n)
    return planted(draw, A, weak=0.8), "solvable"


def dominant(draw: Draw, n: int, excess: float) -> np.ndarray:
    """Return a strictly diagonally dominant matrix with a positive diagonal."""
    A = draw.matrix(n, n)
    np.fill_diagonal(A, 0.0)
    np.fill_diagonal(A, np.abs(A).sum(axis=1) * (1.0 + excess) + excess)
    return A


def h_plus(draw: Draw) -> Truth:
    """Take an H+ matrix, not symmetric: dominant, its columns scaled."""
    n = order(draw)
    A = dominant(draw, n, draw.one_of(0.01, 0.1, 1.0)) * draw.power(-1, 1, n)
    return random_side(draw, A), "solvable"


def m_matrix(draw: Draw) -> Truth:
    """Take a Z-matrix that is dominant, symmetric or not."""
    A = dominant(draw, order(draw), draw.one_of(1e-6, 0.1, 1.0))
    A = np.where(np.eye(A.shape[0]) > 0.0, A, -np.abs(A))
    if draw.chance(0.5):
        A = symmetric(A) + np.diag(np.abs(A - A.T).sum(axis=1))
    return random_side(draw, A), "solvable"


def singular_z(draw: Draw) -> Truth:
    """Take the Laplacian of a random graph, with a planted solution."""
    n = order(draw)
    B = np.abs(np.triu(draw.matrix(n, n), 1))
    B = B + B.T
    return planted(draw, np.diag(B.sum(axis=1)) - B), "solvable"


def other_z(draw: Draw) -> Truth:
    n = order(draw)
    A = -np.abs(draw.matrix(n, n))
    np.fill_diagonal(A, draw.positive(n))
    return planted(draw, A), "possible"


def quotient(draw: Draw) -> Truth:
    """B^-1 C of column-dominant B and C: a P-matrix, rarely definite."""
    draw.whole = False
    n = min(order(draw), 40)
    B, C = (dominant(draw, n, 0.5).T for _ in range(2))
    return random_side(draw, np.linalg.solve(B, C)), "solvable"


def triangular(draw: Draw) -> Truth:
    n = min(order(draw), 20)
    A = np.tril(draw.matrix(n, n), -1) + np.diag(draw.positive(n) + 0.5)
    return random_side(draw, A if draw.chance(0.5) else A.T.copy()), "solvable"


def skew_and_definite(draw: Draw) -> Truth:
    n = order(draw)
    K = draw.matrix(n, n)
    A = K - K.T + draw.one_of(1.0, 0.1, 0.01) * draw.definite(n)
    return random_side(draw, A), "solvable"


def optimality(draw: Draw) -> Truth:
    n = max(order(draw) // 2, 1)
    P, G = draw.semidefinite(n), draw.matrix(draw.size(1, n), n)
    A = scipy.linalg.block_diag(P, np.zeros((G.shape[0],) * 2))
    A[:n, n:], A[n:, :n] = -G.T, G
    return planted(draw, A), "solvable"


def zero_or_diagonal(draw: Draw) -> Truth:
    n = order(draw)
    A = draw.diagonal(n) * draw.one_of(0.0, 1.0)
    return planted(draw, A), "solvable"


def tridiagonal(draw: Draw) -> Truth:
    n = order(draw)
    side = np.abs(draw.numbers(n))
    other = side if draw.chance(0.6) else np.abs(draw.numbers(n))
    A = np.zeros((n, n))
    i = np.arange(n - 1)
    A[i, i + 1], A[i + 1, i] = -side[:-1], -other[:-1]
    shift = draw.one_of(0.0, 1e-6, 1.0)
    if other is not side:
        shift += 0.01
    np.fill_diagonal(A, np.abs(A).sum(axis=1) + shift)
    return planted(draw, A), "solvable"


def general(draw: Draw) -> Truth:
    n = order(draw)
    return planted(draw, draw.matrix(n, n)), "possible"


def general_box(draw: Draw) -> Truth:
    n = order(draw)
    lower = draw.numbers(n)
    upper = lower + draw.positive(n)
    return BoxLCP(draw.matrix(n, n), draw.numbers(n), lower, upper), "possible"


def anything(draw: Draw) -> Truth:
    return random_side(draw, draw.matrix(*(order(draw),) * 2)), "near"


def scaled_lcp(draw: Draw, decades: float) -> BoxLCP:
    """Return D A D of a definite or planted semidefinite A, and q, bounds to match."""
    n = order(draw)
    if draw.chance(0.5):
        lcp = random_side(draw, draw.definite(n))
    else:
        lcp = planted(draw, draw.semidefinite(n))
    d, c = draw.power(-decades, decades, n), draw.power(-decades, decades)
    if draw.chance(0.3):
        d = np.full(n, d[0])
    A, q, lower, upper = lcp
    return BoxLCP(c * symmetric(A * d[:, None] * d), c * q * d, lower / d, upper / d)


def scaled(draw: Draw) -> Truth:
    return scaled_lcp(draw, draw.one_of(2.0, 4.0)), "solvable"


def extreme_scales(draw: Draw) -> Truth:
    """Units changed by 1e-8 to 1e8, and all numbers by up to 1e150."""
    lcp = scaled_lcp(draw, 8.0)
    c = draw.one_of(1.0, 1e150, 1e-150)
    return lcp._replace(A=c * lcp.A, q=c * lcp.q), "possible"


def far_scales(draw: Draw) -> Truth:
    lcp = scaled_lcp(draw, draw.one_of(15.0, 35.0))
    c = draw.power(-75, 75)
    lower = np.where(np.abs(lcp.lower) < 1e19, lcp.lower, -INF)
    upper = np.where(np.abs(lcp.upper) < 1e19, lcp.upper, INF)
    return BoxLCP(c * lcp.A, c * lcp.q, lower, upper), "far"


def without_solution(draw: Draw, skew: bool) -> BoxLCP:
    """Return semidefinite A, A v = 0, v >= 0, q'v < 0, in whole numbers: exactly so."""
    draw.whole = True
    n = order(draw)
    v = draw.positive(n) * draw.some(n, 0.7)
    v[int(draw.rng.integers(n))] = 1.0
    across = v @ v * np.eye(n) - np.outer(v, v)
    S = draw.semidefinite(n)
    if skew:
        K = draw.matrix(n, n)
        S = S + K - K.T
    A = across @ S @ across / 4.0 ** np.round(np.log2(v @ v))
    v /= np.linalg.norm(v)
    q = draw.numbers(n)
    q -= (q @ v + draw.one_of(0.01, 1.0)) * v
    lower, upper = np.zeros(n), np.full(n, INF)
    free = (v == 0.0) & draw.some(n, 0.3)
    lower[free] = -1.0
    upper[free] = 1.0
    return BoxLCP(A, q, lower, upper)


def unsolvable(draw: Draw) -> Truth:
    return without_solution(draw, False), "unsolvable"


def unsolvable_skew(draw: Draw) -> Truth:
    return without_solution(draw, True), "unsolvable"


def empty(draw: Draw) -> Truth:
    n = int(draw.rng.integers(0, 2))
    return random_side(draw, np.full((n, n), float(draw.positive(1)[0]))), "solvable"


# ---- neither P nor semidefinite: friction and strictly copositive matrices have a
# solution that Lemke's method finds (Cottle, Pang and Stone 1992, section 4.4), games
# always have an equilibrium, and A'v < 0, q'v < 0 with v >= 0 leaves no solution


def friction(draw: Draw) -> Truth:
    """Bodies with friction, in the plane and in space, light ones and heavy ones."""
    seed, size = int(draw.rng.integers(SEEDS)), int(draw.rng.integers(1, 4))
    mu, ratio = draw.one_of(0.1, 0.2, 0.5, 0.9, 1.5), draw.one_of(1.0, 2.0, 1e4)
    builds = (piles.pile_of_discs, piles.wall_of_bricks, piles.pressed_chain,
              piles.pile_of_balls, piles.column_of_cubes)  # fmt: skip
    build = builds[int(draw.rng.integers(len(builds)))]
    A, q = friction_lcp(build(size, mu, ratio=ratio, seed=seed))
    return nonnegative(A.toarray(), q), "solvable"


def game(draw: Draw) -> Truth:
    """Two players, whose payoffs have ties if they are whole numbers."""
    rows, columns = draw.size(1, 30), draw.size(1, 30)
    seed = int(draw.rng.integers(SEEDS))
    A, q = random_game(rows, columns, seed, draw.whole)
    mixed = draw.rng.permutation(q.size)
    return nonnegative(A[np.ix_(mixed, mixed)], q), "solvable"


def strictly_copositive(draw: Draw) -> Truth:
    n = order(draw)
    A = np.abs(draw.matrix(n, n)) + 0.1 * draw.definite(n)
    return nonnegative(A, draw.numbers(n)), "solvable"


def copositive(draw: Draw) -> Truth:
    """Take a nonnegative and a semidefinite matrix, and a planted solution."""
    n = order(draw)
    A = np.abs(draw.matrix(n, n)) + draw.semidefinite(n)
    z = draw.positive(n) * draw.some(n, 0.5)
    w = draw.positive(n) * (z == 0.0) * draw.some(n, 0.9)
    return nonnegative(A, w - A @ z), "possible"


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
    return nonnegative(A, q), "unsolvable"
