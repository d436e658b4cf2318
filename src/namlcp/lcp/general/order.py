"""LCPs whose matrix is neither P nor semidefinite: the methods in their order.

No method solves every LCP: the problem is NP-complete (Chung, J. Optim. Theory Appl.
60, 1989, 393-399). Each of `STAGES` is a function of the `Search`. It returns an
outcome if that ends the search, and None if the next one is to be tried.
"""

from collections.abc import Callable

import numpy as np

from namlcp.lcp.data import LCP, Outcome
from namlcp.lcp.general.arc import Arc
from namlcp.lcp.general.enumeration import solve_by_enumeration
from namlcp.lcp.general.farkas import farkas
from namlcp.lcp.general.games import solve_game
from namlcp.lcp.general.lemke import solve_by_lemke
from namlcp.lcp.general.mehrotra import mehrotra
from namlcp.lcp.general.search import Search
from namlcp.limits import Limits
from namlcp.status import Status

LEMKE_ORDER, LAST_LEMKE_ORDER = 150, 1200
"""Largest orders for Lemke's method on a dense tableau: up to the first it is faster
than the paths, and up to the second it is tried after them."""

STARTS = ((1.0, 1.0), (3.0, 3.0))
"""Gaps and excess of multipliers, relative to max |q_i|, at which `arc` starts."""

UNDECIDED = "no solution was found, and no proof that there is none"
"""Message of an LCP left undecided."""

ENUMERATED = "no complementary cone contains q: all were enumerated"
"""Message of a proof by enumeration."""


def solve_general(
    lcp: LCP, z0: np.ndarray | None, limits: Limits, before: int = 0
) -> Outcome:
    """Solve a box LCP with any matrix, prove that it has no solution, or give up.

    limits.max_iter counts factorisations, `before` those of earlier methods.
    """
    with np.errstate(all="ignore"):  # paths overflow where they diverge
        search = Search(lcp, limits, before)
        if z0 is not None and not search.over():
            search.complete(search.model.p(lcp.start(z0)), "start")
        for stage in STAGES:
            if search.over():
                return search.outcome()
            outcome = stage(search)
            if outcome is not None:
                return outcome
        return search.outcome(UNDECIDED)


def by_game(search: Search) -> Outcome | None:
    """Solve a bimatrix game."""
    return search.decided(solve_game(search.lcp, None, search.limits))


def by_lemke(search: Search) -> Outcome | None:
    """Use Lemke's method where it is the fastest."""
    if search.lcp.q.size > LEMKE_ORDER:
        return None
    return search.decided(solve_by_lemke(search.lcp, None, search.limits))


def by_path(search: Search) -> None:
    """Follow the interior path."""
    search.follow(mehrotra(search.model, search.system), "path")


def by_proof(search: Search) -> Outcome | None:
    """Ask for a proof that there is no solution."""
    for v in farkas(search.lcp):
        found = search.disproved(v) if v.any() else None
        search.count += 1
        if found is not None or search.over():
            return found
    return None


def by_enumeration(search: Search) -> Outcome | None:
    """Try all faces of a tiny problem."""
    outcome = search.decided(solve_by_enumeration(search.lcp, None, search.limits))
    if outcome is not None and outcome.status is Status.UNSOLVABLE:
        return outcome._replace(message=ENUMERATED)
    return outcome


def by_arc(search: Search) -> Outcome | None:
    """Follow the smooth homotopy; where it goes to infinity, ask if that is a proof."""
    for size, big in STARTS:
        arc = Arc(search.model, search.system, size, big)
        last = search.follow(arc.points(), "arc")
        found = None if search.over() else search.disproved(search.clipped(last))
        if found is not None or search.over():
            return found
    return None


def by_lemke_at_last(search: Search) -> Outcome | None:
    """Use Lemke's method where it is slow, but has a chance."""
    if not LEMKE_ORDER < search.lcp.q.size <= LAST_LEMKE_ORDER:
        return None
    return search.decided(solve_by_lemke(search.lcp, None, search.limits))


STAGES: tuple[Callable[[Search], Outcome | None], ...] = (
    by_game, by_lemke, by_path, by_proof, by_enumeration, by_arc, by_lemke_at_last,
)  # fmt: skip
