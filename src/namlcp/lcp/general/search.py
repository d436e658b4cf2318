"""The search for a solution of a general LCP, with the best point so far."""

import math
from collections.abc import Iterator
from functools import cached_property

import numpy as np
from scipy import sparse

from namlcp.lcp.data import LCP, Criterion, is_solved_by_zero
from namlcp.lcp.general.cones import System, system_of
from namlcp.lcp.general.distances import Distances, Plain
from namlcp.lcp.general.exact import finish, proximal_steps
from namlcp.lcp.general.paths import arc, farkas, mehrotra
from namlcp.lcp.pivoting.driver import MAX_FACTORISATIONS, proof
from namlcp.lcp.shifted import Shifted
from namlcp.limits import Limits
from namlcp.status import Outcome, Status

# Res of the scaled problem, relative to max |q_i|, at which a path ends; the largest
# one from which the exact solution is sought, and again on the way where it has fallen
# to the part AGAIN of that there; that of a point which is exact, whatever the
# tolerances say.
TARGET, CLOSE, AGAIN, EXACT = 1e-9, 1e-4, 0.01, 1e-12


class Search(Criterion):
    """`before` counts the factorisations of earlier methods."""

    def __init__(self, lcp: LCP, limits: Limits, before: int = 0):
        super().__init__(lcp, limits)
        self.count, self.most = before, limits.max_iter or before + MAX_FACTORISATIONS
        self.z = lcp.start()
        self.w, self.method = lcp.w(self.z), "start"
        self.solved = is_solved_by_zero(lcp)
        self.least = self.size  # scaled Res of the best point
        self.ended = self.solved  # no better point is to be expected

    @cached_property
    def model(self) -> Distances:
        matrix, q, lower, upper = self.lcp
        return Distances(matrix.compact, q, lower, upper, matrix.root)

    @cached_property
    def plain(self) -> Plain | None:
        """None if what is free is singular."""
        try:
            return Plain(self.model)
        except np.linalg.LinAlgError:
            return None

    @cached_property
    def system(self) -> System:
        M = self.model.M
        if self.lcp.matrix.symmetric and sparse.issparse(M):
            return Shifted(M, np.ones(M.shape[0]))
        return system_of(M)

    def over(self) -> bool:
        return self.ended or self.count >= self.most or self.limits.deadline.reached()

    def offer(self, z: np.ndarray, method: str) -> None:
        w = self.lcp.w(z)
        plain, scaled = self.residuals(z, w)
        if scaled < self.least:
            self.least, self.z, self.w, self.method = scaled, z, w, method
            self.solved = self.met(plain, scaled)

    def counts(self) -> None:
        self.count += 1
        if self.limits.report is not None:
            residual = self.lcp.residual(self.z, self.w)
            self.limits.report(self.count, residual, self.lcp.active(self.z))

    def by_path(self) -> None:
        self.follow(mehrotra(self.model, self.system), "path")

    def by_arc(self) -> None:
        self.follow(arc(self.model, system_of(self.model.M)), "arc")

    def by_proof(self) -> Outcome | None:
        for v in farkas(self.lcp):
            ray = proof(self.lcp, v) if v.any() else None
            if ray is not None:
                return self.outcome()._replace(status=Status.UNSOLVABLE, ray=ray)
            self.count += 1
            if self.over():
                break
        return None

    def follow(self, points: Iterator[np.ndarray], method: str) -> None:
        """Follow a path to its end, and offer its best point.

        The exact solution is sought on the way as well: the end of a path may wind, or
        be lost in rounding, where the face has long been found.
        """
        model, least, aim = self.model, math.inf, CLOSE
        best = np.zeros(model.c.size)
        for p in points:
            found = model.residual(p, model.F(p))
            if found < least:
                least, best = found, p
            if least <= TARGET or self.solved or self.over():
                break
            if found <= aim:
                aim = AGAIN * found
                self.seek(finish(model, self.system, p), method)
                if self.over():
                    break
            self.counts()
        self.offer(self.clipped(best), method)
        if least <= CLOSE and not self.over():
            self.complete(best, method)
        if self.lcp.matrix.symmetric and not self.over():
            self.seek(proximal_steps(model, self.system, best), method, True)

    def complete(self, p: np.ndarray, method: str) -> None:
        """Seek the exact solution near p; a solution then ends the search."""
        self.seek(finish(self.model, self.system, p), method)
        self.ended |= self.solved

    def seek(
        self, points: Iterator[np.ndarray], method: str, any_solution: bool = False
    ) -> None:
        """Seek an exact solution among points, or any; only that ends the search."""
        for x in points:
            self.offer(self.clipped(x), method)
            self.counts()
            exact = self.model.residual(x, self.model.F(x)) <= EXACT
            self.ended = exact or (any_solution and self.solved)
            if self.over():
                break

    def decided(self, outcome: Outcome | None) -> Outcome | None:
        """Return the outcome of another method if it ends the search, else keep z.

        A solution that is not exact is the start of a search for one.
        """
        if outcome is None or outcome.status is Status.UNSOLVABLE:
            return outcome
        self.offer(outcome.point.z, outcome.method)
        if outcome.status is not Status.SOLVED:
            return None
        if self.least > EXACT * self.size:
            self.complete(self.model.p(outcome.point.z), outcome.method)
        return self.lcp.outcome(
            outcome.status, self.z, self.w, outcome.iterations, self.method
        )

    def clipped(self, p: np.ndarray) -> np.ndarray:
        z = self.model.z(p)
        return np.clip(z, self.lcp.lower, self.lcp.upper, out=z)

    def outcome(self, message: str = "") -> Outcome:
        status = Status.MAX_ITER if self.count >= self.most else Status.STALLED
        if self.solved:
            status = Status.SOLVED
        elif self.limits.deadline.reached():
            status = Status.TIME_LIMIT
        point = self.z, self.w
        return self.lcp.outcome(status, *point, self.count, self.method, message)
