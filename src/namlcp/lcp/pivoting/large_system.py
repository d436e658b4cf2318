"""Free systems and the path of large symmetric problems: factors kept from Python.

`pivot` returns for every free system, and `LargeSystem` solves it. It keeps the factor
in blocks: where rho stayed, only blocks of unknowns whose state changed, and their
ancestors, are computed anew. The path is that of `interior`, with its steps called
from here.
"""

import numpy as np

from namlcp.compiled import kernel
from namlcp.lcp.pivoting.free_system import LEAST_PIVOT
from namlcp.lcp.pivoting.interior import (
    advance_path,
    aim,
    close_path,
    evaluate_path,
    open_path,
    set_shift,
    try_direction,
)
from namlcp.lcp.pivoting.work import PivotMemory, opened, path_in
from namlcp.limits import Deadline
from namlcp.linalg import (
    SLACK,
    Blocks,
    blocks_of,
    factor_blocks,
    minimum_degree,
    solve_blocks,
)

STALL = 8
"""Steps of the path in which the residual must halve; else rounding has stopped it."""

# The stages of `path_step`.
EVALUATE, AIM, TRY, ADVANCE, CLOSE = range(5)


@kernel(error_model="numpy")
def path_step(arena, stage, corrector):
    """Do one stage of a step of the path, between the caller's factor and solves.

    EVALUATE: the residual, and the diagonal to shift; AIM: the right side to rhs; TRY:
    with path.dz solved for, tell whether to go on to the next corrector; ADVANCE: take
    the step, tell whether there is one; CLOSE: go on from the end of the path.
    """
    work, path = opened(arena), path_in(arena)
    if stage == EVALUATE:
        open_path(work, path)
        evaluate_path(work, path)
        set_shift(work, path)
    elif stage == AIM:
        aim(work, path)
    elif stage == TRY:
        return try_direction(work, path, corrector)
    elif stage == ADVANCE:
        return advance_path(work.now, path)
    else:
        close_path(work, path)
    return True


class LargeSystem:
    """The factor of the current free system of a sparse symmetric problem."""

    def __init__(self, work: PivotMemory) -> None:
        """Keep the memory of `pivot`; nothing is factored yet."""
        self.work = work
        self.free = np.zeros(work.n, dtype=bool)  # in the factor
        self.rho = np.nan  # of the factor
        self.member = np.zeros(work.n, dtype=bool)  # of the blocks
        self.orders = 0
        self.blocks: Blocks | None = None
        self.values = np.empty(0)

    def factor(self, free: np.ndarray, rho: float) -> float:
        """Factor A + diag(shift) on the free unknowns; return the least pivot.

        An equal rho says that the shift is that of the last call; NaN never is.
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
        """Order and lay out blocks for the free unknowns, and for those met before.

        From the third time on, or when they are more than a half, for all unknowns.
        """
        self.orders += 1
        member = free | self.member
        if self.orders > 2 or 2 * np.count_nonzero(member) > member.size:
            member = self.work.lower < self.work.upper
        self.member = member
        scaled = self.work.scaled
        order = minimum_degree(scaled.indptr, scaled.indices, member)
        self.blocks = blocks_of(scaled.indptr, scaled.indices, order)
        self.values = np.empty(self.blocks.nodes.panels[-1])

    def solve(self) -> None:
        """Solve the free system of `pivot`, rhs to z."""
        work, now = self.work, self.work.now
        free, rho = work.state == 0, now.rho
        if rho != self.rho or np.any(free != self.free):
            work.shift[:] = rho
            now.factorisations += 1
            now.not_p |= bool(self.factor(free, rho) < LEAST_PIVOT)
        if self.blocks is not None:
            solve_blocks(self.blocks, free, self.values, work.rhs, work.z)

    def follow(self, target: float, steps: int, deadline: Deadline) -> None:
        """Follow the path to Res <= target * now.size, as `interior.follow`."""
        work, now, arena = self.work, self.work.now, self.work.arena
        free = work.lower < work.upper
        before = np.full(STALL, np.inf)
        for k in range(steps):
            path_step(arena, EVALUATE, 0)
            found = now.path_residual <= target * now.size
            stalled = now.path_residual > 0.5 * before[k % STALL]
            if found or stalled or deadline.reached():
                break
            before[k % STALL] = now.path_residual
            self.factor(free, np.nan)
            corrector, more = 0, True
            while more:
                path_step(arena, AIM, corrector)
                solve_blocks(self.blocks, free, self.values, work.rhs, work.path_dz)
                more = path_step(arena, TRY, corrector)
                corrector += 1
            if not path_step(arena, ADVANCE, 0):
                break
        path_step(arena, CLOSE, 0)

    def is_convex(self) -> bool:
        """Tell whether A + `SLACK` I is positive definite."""
        if not np.all(self.work.has_unit):
            return False
        self.work.shift[:] = SLACK
        self.member[:] = True
        self.blocks = None
        return self.factor(np.ones(self.free.size, dtype=bool), np.nan) == 1.0
