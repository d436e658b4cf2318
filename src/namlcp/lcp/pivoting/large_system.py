"""Free systems of large sparse symmetric problems.

`pivot` returns for every free system, and `LargeSystem` solves it. It keeps the factor
in blocks: while rho is the same, only blocks of unknowns whose state changed, and their
ancestors, are recomputed.
"""

import numpy as np

from namlcp.lcp.pivoting.state import PivotMemory
from namlcp.linalg import (
    PSD_SLACK,
    Blocks,
    blocks_of,
    factor_blocks,
    minimum_degree,
    solve_blocks,
)


class LargeSystem:
    """The factor of the current free system of a sparse symmetric problem."""

    def __init__(self, work: PivotMemory) -> None:
        """Keep the memory of `pivot`; nothing is factored yet."""
        self.work = work
        self.free = np.zeros(work.n, dtype=bool)  # unknowns in the factor
        self.rho = np.nan  # of the factor
        self.member = np.zeros(work.n, dtype=bool)  # unknowns in the blocks
        self.orders = 0  # elimination orders computed so far
        self.blocks: Blocks | None = None
        self.values = np.empty(0)

    def factor(self, free: np.ndarray, rho: float) -> float:
        """Factor A + diag(shift) on the free unknowns; return the least pivot.

        If rho is that of the last call, so must the shift be, and the factor is
        updated. With rho = NaN it is always computed anew.
        """
        again = rho == self.rho
        if self.blocks is None or np.any(free > self.member):
            self.cover(free)
            again = False
        changed = free != self.free if again else self.member
        data, shift = self.work.scaled.data, self.work.shift
        smallest, _ = factor_blocks(
            data, shift, free, changed, self.blocks, self.values
        )
        self.free, self.rho = free, rho
        return smallest

    def cover(self, free: np.ndarray) -> None:
        """Order and lay out blocks for the free unknowns and the earlier members.

        From the third time on, or if these are more than half of all unknowns, the
        blocks cover all unknowns with l < u, too.
        """
        self.orders += 1
        member = free | self.member
        if self.orders > 2 or 2 * np.count_nonzero(member) > member.size:
            member = free | (self.work.lower < self.work.upper)
        self.member = member
        scaled = self.work.scaled
        order = minimum_degree(scaled.indptr, scaled.indices, member)
        self.blocks = blocks_of(scaled.indptr, scaled.indices, order)
        self.values = np.empty(self.blocks.nodes.panels[-1])

    def solve(self) -> None:
        """Write to z the solution of the free system of `pivot`."""
        work, now = self.work, self.work.now
        free, rho = work.state == 0, now.rho
        if rho != self.rho or np.any(free != self.free):
            work.shift[:] = rho
            now.factorisations += 1
            self.factor(free, rho)
        if self.blocks is not None:
            solve_blocks(self.blocks, free, self.values, work.rhs, work.z)

    def is_convex(self) -> bool:
        """Tell whether A + `PSD_SLACK` I is positive definite."""
        if not np.all(self.work.has_unit):
            return False
        self.work.shift[:] = PSD_SLACK
        self.member[:] = True
        self.blocks = None
        return self.factor(np.ones(self.free.size, dtype=bool), np.nan) == 1.0
