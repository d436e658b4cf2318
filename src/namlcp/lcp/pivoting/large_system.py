"""Free systems of large sparse symmetric problems, which `pivot` leaves to Python.

Unknowns at their bounds are held by huge diagonal entries, so that the elimination
order of one pattern serves many free systems.
"""

from typing import Any

import numpy as np
from scipy import sparse

from namlcp.lcp.pivoting.state import Pivoting
from namlcp.lcp.shifted import HELD, Quasidefinite
from namlcp.linalg.csc import submatrix
from namlcp.linalg.definite import PSD_SLACK, has_positive_pivots


class LargeSystem:
    """The factors of the current free system of a sparse symmetric problem."""

    def __init__(self, n: int) -> None:
        self.free = np.zeros(n, dtype=bool)  # unknowns in the factors
        self.rho = np.nan  # of the factors
        self.member = np.zeros(n, dtype=bool)  # unknowns in the pattern
        self.orders = 0  # elimination orders computed so far
        self.system: Any = None  # a Quasidefinite
        self.factors: Any = None

    def cover(self, work: Pivoting, free: np.ndarray) -> None:
        """Order the free unknowns and the earlier members.

        From the third time on, or if these are more than half of all unknowns, all
        unknowns with l < u are ordered, too.
        """
        self.orders += 1
        member = free | self.member
        if self.orders > 2 or 2 * np.count_nonzero(member) > member.size:
            member = free | work.is_open
        self.member = member
        rows = np.flatnonzero(member)
        part = submatrix(work.scaled_matrix, rows, rows)
        self.system = Quasidefinite(part, np.ones(rows.size))

    def solve(self, work: Pivoting) -> None:
        """Write to z the solution of the free system of `pivot`, NaN if singular."""
        free, rho = work.state == 0, work.rho
        if rho != self.rho or np.any(free != self.free):
            work.factorisations += 1
            if self.system is None or np.any(free > self.member):
                self.cover(work, free)
            shift = np.where(free, rho, HELD)[self.member]
            self.factors = self.system.factors(shift)
            self.free, self.rho = free, rho
        if self.factors is None:
            work.z[free] = np.nan
        else:
            rhs = np.where(free, work.rhs, 0.0)[self.member]
            work.z[free] = self.factors.solve(rhs)[free[self.member]]

    def is_convex(self, work: Pivoting) -> bool:
        """Tell whether A + `PSD_SLACK` I is positive definite."""
        if not np.all(work.has_unit):
            return False
        slack = PSD_SLACK * sparse.eye_array(work.n)
        upper = sparse.triu(work.scaled_matrix)
        return has_positive_pivots(sparse.csc_array(upper + slack))
