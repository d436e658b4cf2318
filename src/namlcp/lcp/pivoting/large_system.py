"""Free systems of large sparse symmetric problems, which `pivot` leaves to Python.

Unknowns at their bounds are held by huge diagonal entries, so that the elimination
order of one pattern serves many free systems.
"""

from typing import Any

import numpy as np
from scipy import sparse

from namlcp.lcp.pivoting.state import PivotMemory
from namlcp.lcp.shifted import HELD, Quasidefinite
from namlcp.linalg.csc import submatrix
from namlcp.linalg.definite import PSD_SLACK, has_positive_pivots


class LargeSystem:
    """The factors of the current free system of a sparse symmetric problem."""

    def __init__(self, work: PivotMemory) -> None:
        self.work = work
        self.free = np.zeros(work.n, dtype=bool)  # unknowns in the factors
        self.rho = np.nan  # of the factors
        self.member = np.zeros(work.n, dtype=bool)  # unknowns in the pattern
        self.orders = 0  # elimination orders computed so far
        self.system: Any = None  # a Quasidefinite
        self.factors: Any = None

    def cover(self, free: np.ndarray) -> None:
        """Order the free unknowns and the earlier members.

        From the third time on, or if these are more than half of all unknowns, all
        unknowns with l < u are ordered, too.
        """
        self.orders += 1
        member = free | self.member
        if self.orders > 2 or 2 * np.count_nonzero(member) > member.size:
            member = free | (self.work.lower < self.work.upper)
        self.member = member
        rows = np.flatnonzero(member)
        part = submatrix(self.work.scaled, rows, rows)
        self.system = Quasidefinite(part, np.ones(rows.size))

    def solve(self) -> None:
        """Write to z the solution of the free system of `pivot`, NaN if singular."""
        work, now = self.work, self.work.now
        free, rho = work.state == 0, now.rho
        if rho != self.rho or np.any(free != self.free):
            now.factorisations += 1
            if self.system is None or np.any(free > self.member):
                self.cover(free)
            shift = np.where(free, rho, HELD)[self.member]
            self.factors = self.system.factors(shift)
            self.free, self.rho = free, rho
        if self.factors is None:
            work.z[free] = np.nan
        else:
            rhs = np.where(free, work.rhs, 0.0)[self.member]
            work.z[free] = self.factors.solve(rhs)[free[self.member]]

    def is_convex(self) -> bool:
        """Tell whether A + `PSD_SLACK` I is positive definite."""
        if not np.all(self.work.has_unit):
            return False
        slack = PSD_SLACK * sparse.eye_array(self.work.n)
        upper = sparse.triu(self.work.scaled)
        return has_positive_pivots(sparse.csc_array(upper + slack))
