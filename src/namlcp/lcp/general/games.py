"""Bimatrix games by the method of Lemke and Howson, from every label in turn.

With positive costs R (p x r) and S (r x p) of two players, the mixed strategies of an
equilibrium are the normed parts of z = (x, y) >= 0 with

    w = [0 R; S 0] z - 1 >= 0,   z'w = 0.

Lemke's method with d = (1, ..., 1) ends on a ray at its first pivot here. A path of
Lemke and Howson begins with z_k > 0 of a label k, whose pair alone need not be
complementary. It always ends, at an equilibrium, but may take very many pivots where
that of another label takes a few. So all labels race, with limits that grow.

References
----------
Lemke and Howson, J. SIAM 12 (1964) 413-423.
Cottle, Pang and Stone, The Linear Complementarity Problem (1992), section 4.4.
"""

import math

import numpy as np
from scipy import sparse

from namlcp.lcp.data import LCP
from namlcp.lcp.general.distances import dense
from namlcp.lcp.general.lemke import LARGEST_TABLEAU, basis_solution, last_largest
from namlcp.lcp.general.search import Search
from namlcp.lcp.general.tableau import DONE, Tableau, exchange, pivot_until, tableau_of
from namlcp.outcome import Outcome
from namlcp.status import Status

# Pivots at most from each label in the first round, and the factor to the next; no
# round allows more than LAST_LIMIT n.
FIRST_LIMIT, GROWTH, LAST_LIMIT = 20, 4, 1000


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
    """Return an equilibrium, None if the LCP is no game or no path came to its end.

    limits.max_iter counts the pivots of all paths.
    """
    lcp, limits = search.lcp, search.limits
    game, n = game_of(lcp), lcp.q.size
    if game is None:
        return None
    cost, *players = game
    q = np.full(n, -1.0)
    start = tableau_of(cost, q)
    limit = math.inf if limits.max_iter is None else limits.max_iter
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
