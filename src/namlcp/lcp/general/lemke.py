"""Finite methods: Lemke's on a dense tableau, Lemke and Howson's for games, all cones.

For w = A z + q + z_0 d with a covering vector d > 0, z = 0 and a large z_0 satisfy all
signs. Complementary pivoting follows the path from there: it ends where z_0 leaves, a
solution, or on a ray. Rounding may end it on a ray that is none.

A ray means nothing in general. If A is copositive-plus, as all semidefinite matrices
are, there is no z >= 0 with A z + q >= 0. If A is copositive and q'v >= 0 for all v >=
0 with A v >= 0, v'A v = 0, as with friction, there is no ray. The class is not tested;
a ray is believed where its direction v proves on the data that no solution exists.

*Bimatrix games.* With positive costs R (p x r) and S (r x p) of two players, the mixed
strategies of an equilibrium are the normed parts of z = (x, y) >= 0 with

    w = [0 R; S 0] z - 1 >= 0,   z'w = 0.

Here Lemke's method with d = (1, ..., 1) ends on a ray at its first pivot. A path of
Lemke and Howson, of a label k whose pair alone need not be complementary, always ends
at an equilibrium, but may take very many pivots. So all labels race.

*Tiny LCPs.* LCP(q, A) has a solution if and only if q lies in one of the 2^n
complementary cones pos C(F), where C(F) has the columns -A e_i for i in F, e_i for the
others: then z_F and w_B with C(F) (z_F, w_B) = q solve it. If C(F) is regular, each row
r of its inverse with r q < 0 is a plane that separates q from the cone, at the distance
-r q / |r|. Where that leaves it open, the distance is found by least squares.

References
----------
Lemke, Management Science 11 (1965) 681-689. Lemke and Howson, J. SIAM 12 (1964)
413-423. Cottle, Pang and Stone, The Linear Complementarity Problem (1992), sections
1.3, 4.4.
"""

import math
from typing import Any

import numpy as np
from scipy import sparse

from namlcp.lcp.data import LCP, diagonal_of
from namlcp.lcp.general.distances import Plain, dense
from namlcp.lcp.general.search import Search
from namlcp.lcp.general.tableau import (
    DONE,
    MORE,
    Tableau,
    exchange,
    pivot_until,
    tableau_of,
)
from namlcp.lcp.pivoting.driver import proof
from namlcp.limits import Limits
from namlcp.status import ENDS, Outcome, Status

# Largest order: the tableau then takes 200 MB.
LARGEST_TABLEAU = 5000
# `solve_by_lemke` makes at most TRIES n + MORE_TRIES pivots with a covering vector:
# friction takes up to 2 n, and a path on which rounding has led back never ends. By
# name the limit is PIVOTS n + MORE_PIVOTS.
TRIES, MORE_TRIES, PIVOTS, MORE_PIVOTS = 10, 100, 50, 10_000
# Multiplications between two checks of the deadline: about 10 ms.
UNSEEN = 10_000_000
# In a game, pivots at most from each label in the first round, and the factor to the
# next; no round allows more than LAST_LIMIT n.
FIRST_LIMIT, GROWTH, LAST_LIMIT = 20, 4, 1000
# Largest order of an enumeration: 4096 cones take some hundredths of a second.
LARGEST_ENUMERATION = 12
# Distance of q from a cone, relative to |q|, that rounding cannot explain.
OUTSIDE = 1e-9


@np.errstate(all="ignore")
def solve_lemke(lcp: LCP, z0: None, limits: Limits, cover: Any = None) -> Outcome:
    """Follow the path of one covering vector, the user's; limits.max_iter: pivots."""
    n = lcp.q.size
    if n > LARGEST_TABLEAU:
        raise ValueError(
            f"A must have an order of at most {LARGEST_TABLEAU} for method 'lemke', "
            f"which is dense, got {n}"
        )
    cover = diagonal_of("cover", cover, n, np.ones(n), positive=True)
    search = Search(lcp, limits)
    if search.plain is None:
        raise ValueError(
            "A must be regular in the rows and columns of the unknowns without bounds "
            "for method 'lemke'"
        )
    most = limits.max_iter or PIVOTS * n + MORE_PIVOTS
    return follow(search, search.plain, search.plain.cover(cover), (0, most))


def solve_by_lemke(search: Search) -> Outcome | None:
    """Follow the paths of three covering vectors; None if none of them decides."""
    plain, n, done = search.plain, search.lcp.q.size, 0
    if plain is None:
        return None
    most = search.limits.max_iter or math.inf
    rng = np.random.default_rng(0)
    largest = np.abs(plain.M).max(axis=1, initial=0.0)
    rows = np.where(largest > 0.0, largest, 1.0)
    for d in (rows, np.ones(rows.size), rng.uniform(0.2, 1.0, rows.size)):
        budget = int(min(TRIES * n + MORE_TRIES, most - done))
        outcome = follow(search, plain, d, (done, done + budget))
        done = outcome.iterations
        if outcome.status in ENDS or done >= most:
            return outcome
    return None


def follow(
    search: Search, plain: Plain, d: np.ndarray, counts: tuple[int, int]
) -> Outcome:
    """Follow the path of the covering vector d of the plain form.

    counts: where the count of pivots begins, and where the path is given up.
    """
    lcp, limits, m = search.lcp, search.limits, plain.r.size
    tableau = tableau_of(plain.M, plain.r, d)
    (count, most), end, names = counts, DONE, slice(m, 2 * m)
    if plain.r.min(initial=0.0) < 0.0:
        first = last_largest(-plain.r / d)
        exchange(tableau, first, m + 1)
        count, end, entering, z_0 = count + 1, MORE, m + first, 2 * m
    chunk = 1 if limits.report is not None else max(1, UNSEEN // (m * m + 1))
    status = Status.STALLED
    while end == MORE:
        if count >= most or limits.deadline.reached():
            status = Status.MAX_ITER if count >= most else Status.TIME_LIMIT
            break
        budget = min(chunk, most - count)
        end, entering, made = pivot_until(tableau, entering, (z_0, z_0), budget)
        count += made
        if limits.report is not None:
            z = lcp.start(plain.z(tableau.values()[names]))
            limits.report(count, lcp.residual(z, lcp.w(z)), lcp.active(z))
    # the basis computed anew lacks the rounding errors of the pivots
    found = tableau.values()[names], basis_solution(plain.M, plain.r, tableau)
    points = [lcp.start(plain.z(x)) for x in found if x is not None]
    points = [z for z in points if np.isfinite(z).all()] or [search.z]
    z = min(points, key=lambda z: lcp.residual(z, lcp.w(z)))
    w, ray = lcp.w(z), None
    if search.accepts(z, w):
        status = Status.SOLVED
    elif end not in (MORE, DONE):
        v = plain.direction(tableau.direction(entering)[names])
        ray = proof(lcp, v)
        status = Status.STALLED if ray is None else Status.UNSOLVABLE
    return lcp.outcome(status, z, w, count, "lemke", ray=ray)


def last_largest(x: np.ndarray) -> int:  # as the lexicographic order has it
    return int(x.size - 1 - np.argmax(x[::-1]))


def basis_solution(M: np.ndarray, r: np.ndarray, tableau: Tableau) -> np.ndarray | None:
    z = np.zeros(r.size)
    face = np.flatnonzero((tableau.position >= 0)[r.size : 2 * r.size])
    B, r = M[np.ix_(face, face)], r[face]
    try:
        x = np.linalg.solve(B, -r)
        z[face] = x - np.linalg.solve(B, B @ x + r)  # refined: B may be badly scaled
    except np.linalg.LinAlgError:
        return None
    return z


# ---- games


def game_of(lcp: LCP) -> tuple[np.ndarray, ...] | None:
    """Return the game if A is a permutation of [0 R; S 0] and q < 0, else None.

    That is A with row i divided by -q_i, and the labels of the two players.
    """
    A, q = lcp.A, lcp.q
    if not 2 <= q.size <= LARGEST_TABLEAU or not (q < 0.0).all():
        return None
    if lcp.lower.any() or not (lcp.upper == np.inf).all():
        return None
    row = dense(A[[0]])[0]
    first, second = np.flatnonzero(row == 0.0), np.flatnonzero(row)
    entries = 2 * first.size * second.size
    if not entries or (sparse.issparse(A) and A.count_nonzero() != entries):
        return None
    A = dense(A)
    own = A[np.ix_(first, first)].any() or A[np.ix_(second, second)].any()
    if own or np.count_nonzero(A > 0.0) != entries:
        return None
    return A / -q[:, None], first, second


def solve_game(search: Search) -> Outcome | None:
    lcp, limits = search.lcp, search.limits
    game, n = game_of(lcp), lcp.q.size
    if game is None:
        return None
    cost, *players = game
    q = np.full(n, -1.0)
    start = tableau_of(cost, q)
    limit = limits.max_iter or math.inf
    count, most = 0, FIRST_LIMIT
    while most <= LAST_LIMIT * n:
        for k in range(n):
            if count >= limit or limits.deadline.reached():
                return None
            tableau = start.copy()
            end, made = follow_label(tableau, players, k, int(min(most, limit - count)))
            count += made
            if end == DONE:
                z = basis_solution(cost, q, tableau)
                z = np.maximum(tableau.values()[n : 2 * n] if z is None else z, 0.0)
                w = lcp.w(z)
                if search.accepts(z, w):
                    return lcp.outcome(Status.SOLVED, z, w, count, "lemke-howson")
        most *= GROWTH
    return None


def follow_label(
    tableau: Tableau, players: list[np.ndarray], k: int, most: int
) -> tuple[int, int]:
    """Follow the path of label k; return how it ended and the pivots made, at least 2.

    Nothing is feasible at first: z_k takes the largest value that a row of the other
    player asks for, then the pair of that row does the same for the player of k.
    """
    n, rows = tableau.basic.size, tableau.rows
    own, other = players if k in players[0] else players[::-1]
    s = other[last_largest(1.0 / rows[other, 1 + k])]
    r = own[last_largest(1.0 / rows[own, 1 + s])]
    exchange(tableau, s, 1 + k)
    exchange(tableau, r, 1 + s)
    if r == k:
        return DONE, 2
    end, _, made = pivot_until(tableau, n + r, (k, n + k), max(most - 2, 0))
    return end, 2 + made


# ---- tiny LCPs


def solve_by_enumeration(search: Search) -> Outcome | None:
    """Return None if q is not clearly outside every cone, and no solution is found."""
    lcp, plain = search.lcp, search.plain
    if plain is None or not 1 <= plain.r.size <= LARGEST_ENUMERATION:
        return None
    m = plain.r.size
    from scipy.optimize import nnls  # takes long to import

    size = float(np.linalg.norm(plain.r)) or 1.0
    faces = (np.arange(2**m)[:, None] >> np.arange(m)) % 2 == 1
    cones = np.where(faces[:, None, :], -plain.M, np.eye(m))
    best, nearest = lcp.start(), np.inf
    least = np.zeros(2**m)  # distance of q, at least, 0 where the cone is singular
    regular = np.linalg.slogdet(cones)[0] != 0.0
    inverse = np.linalg.inv(cones[regular])
    apart = -(inverse @ plain.r) / np.linalg.norm(inverse, axis=2)
    least[regular] = apart.max(axis=1)
    for k in np.flatnonzero(least <= OUTSIDE * size):
        if search.limits.deadline.reached():
            return None
        try:
            x, distance = nnls(cones[k], plain.r)
        except RuntimeError:  # too many iterations: whether q is in the cone is open
            nearest = 0.0
            continue
        z = lcp.start(plain.z(np.where(faces[k], x, 0.0)))
        if distance < nearest:
            nearest, best = distance, z
        if distance <= OUTSIDE * size and search.accepts(z, lcp.w(z)):
            count = int(k) + 1
            return lcp.outcome(Status.SOLVED, z, lcp.w(z), count, "enumeration")
    if nearest <= OUTSIDE * size:
        return None
    message = "no complementary cone contains q: all were enumerated"
    point = best, lcp.w(best)
    return lcp.outcome(Status.UNSOLVABLE, *point, 2**m, "enumeration", message)
