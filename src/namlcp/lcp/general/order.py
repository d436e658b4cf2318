"""LCPs whose matrix is neither P nor semidefinite: the methods in their order.

No method solves every LCP: the problem is NP-complete (Chung, J. Optim. Theory Appl.
60, 1989, 393-399). `STAGES` are tried in their order, by measured times: what is
likely to end the search soon comes first.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy import sparse

from namlcp.lcp.data import LCP
from namlcp.lcp.general.arc import Arc
from namlcp.lcp.general.cones.condensed import system_of
from namlcp.lcp.general.enumeration import LARGEST_ENUMERATION, solve_by_enumeration
from namlcp.lcp.general.farkas import farkas
from namlcp.lcp.general.games import solve_game
from namlcp.lcp.general.lemke import solve_by_lemke
from namlcp.lcp.general.mehrotra import mehrotra
from namlcp.lcp.general.search import Search
from namlcp.limits import Limits
from namlcp.outcome import Outcome
from namlcp.status import Status

LEMKE_ORDER, LAST_LEMKE_ORDER = 400, 1200
"""Largest orders for Lemke's method on a dense tableau: up to the first it is faster
than the paths where A is dense, up to the second it is tried after them. (An A of up to
`prepared.DENSE_ORDER` unknowns is dense here even if given as sparse.)"""

PROOF_ORDER = 250
"""Order up to which a proof is cheap beside a path."""

POOR = 1e-11
"""Res of a solution of Lemke's method, relative to that of clip(0), that a path may
better: where A is nearly singular, pivots lose digits."""

UNDECIDED = "no solution was found, and no proof that there is none"
"""Message of an LCP left undecided."""

ENUMERATED = "no complementary cone contains q: all were enumerated"
"""Message of a proof by enumeration."""


class Stage(NamedTuple):
    """A method, and the orders least < n <= most for which it is tried.

    `run` returns an outcome if that ends the search, None if the next stage is to be
    tried.
    """

    run: Callable[[Search], Outcome | None]
    least: float = 0
    most: float = math.inf


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
            if stage.least < lcp.q.size <= stage.most:
                outcome = stage.run(search)
                if outcome is not None:
                    return outcome
        return search.outcome(UNDECIDED)


def by_game(search: Search) -> Outcome | None:
    """Solve a bimatrix game."""
    return search.decided(solve_game(search.lcp, None, search.limits))


def by_lemke(search: Search) -> Outcome | None:
    """Use Lemke's method; where its point is poor, ask the interior path as well."""
    outcome = search.decided(solve_by_lemke(search.lcp, None, search.limits))
    if not (search.solved and search.least > POOR * search.criterion.size):
        return outcome
    search.ended = False
    by_path(search)
    return search.outcome()


def by_lemke_first(search: Search) -> Outcome | None:
    """Use Lemke's method where it is faster than the paths."""
    return by_lemke(search) if lemke_is_faster(search) else None


def by_lemke_last(search: Search) -> Outcome | None:
    """Use Lemke's method where it has not been used before."""
    return None if lemke_is_faster(search) else by_lemke(search)


def lemke_is_faster(search: Search) -> bool:
    """Tell whether Lemke's method is likely to take less time than the paths."""
    is_dense = not sparse.issparse(search.lcp.matrix.compact)
    return is_dense and search.lcp.q.size <= LEMKE_ORDER


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
    """Try all complementary cones."""
    outcome = search.decided(solve_by_enumeration(search.lcp, None, search.limits))
    if outcome is not None and outcome.status is Status.UNSOLVABLE:
        return outcome._replace(message=ENUMERATED)
    return outcome


def by_arc(search: Search) -> Outcome | None:
    """Follow the smooth homotopy; where it goes to infinity, ask if that is a proof."""
    arc = Arc(search.model, system_of(search.model.M))
    last = search.follow(arc.points(), "arc")
    return None if search.over() else search.disproved(search.clipped(last))


STAGES = (
    Stage(by_game),
    Stage(by_lemke_first),
    Stage(by_path),
    Stage(by_proof, most=PROOF_ORDER),
    Stage(by_enumeration, most=LARGEST_ENUMERATION),
    Stage(by_arc),
    Stage(by_proof, least=PROOF_ORDER),
    Stage(by_lemke_last, most=LAST_LEMKE_ORDER),
)
