"""Faces and the path of large symmetric problems: factors in blocks, kept from Python.

`pivot` comes back for every face system, and `LargeFaces` solves it. It keeps the
factor: where rho stayed, only blocks of unknowns whose state changed are made anew,
and of their ancestors. The path is that of `interior`, with its steps called from here.
"""

import numpy as np

from namlcp.compiled import kernel
from namlcp.lcp.pivoting.faces import LEAST_PIVOT
from namlcp.lcp.pivoting.interior import (
    AIM,
    DIRECTIONS,
    DZ,
    RESIDUAL,
    adopt,
    advance,
    digest,
    measure,
    open_path,
    path_in,
    right_side,
    weights,
)
from namlcp.lcp.pivoting.work import (
    FACTORED,
    LOWER,
    OUTSIDE,
    RHO,
    RHS,
    SHIFT,
    SIZE,
    STATE,
    UNIT,
    UPPER,
    W,
    Work,
    Z,
    problem_in,
)
from namlcp.limits import Deadline
from namlcp.linalg import (
    SLACK,
    Blocks,
    blocks_of,
    factor_blocks,
    minimum_degree,
    solve_blocks,
)

# What `newton` is to do.
MEASURE, AIM_AT, DIGEST, MOVE, LEAVE = range(5)


@kernel(error_model="numpy")
def newton(work, stage, corrector, d, number):
    """Do one part of a step of the path, between the caller's factor and solves.

    Parameters
    ----------
    stage : int
        MEASURE: number[RESIDUAL], and the diagonal to vectors[SHIFT]; AIM_AT: the right
        side to vectors[RHS]; DIGEST: with d[DZ] solved for, tell whether to go on to
        the next corrector; MOVE: take the step, tell whether there is one; LEAVE: adopt
        the end of the path.
    corrector : int
        As `interior.digest` counts.
    d : (DIRECTIONS, n) array
    number : (5,) array
    """
    problem = problem_in(work, True)
    path, w = path_in(work), work.vectors[W]
    if stage == MEASURE:
        open_path(problem, work)
        measure(problem, path, w, d, number)
        weights(path, work.vectors[SHIFT])
        number[AIM] = 0.0
    elif stage == AIM_AT:
        right_side(path, number[AIM], w, d, work.vectors[RHS])
    elif stage == DIGEST:
        return digest(path, corrector, d, number)
    elif stage == MOVE:
        return advance(path, d, number)
    else:
        adopt(problem, work, path.z)
    return True


STALL = 8
"""Steps of the path that do not halve the residual: rounding, let pivoting go on."""


class LargeFaces:
    """The factor of the current face of a symmetric problem in compressed columns."""

    def __init__(self, work: Work) -> None:
        """Keep the workspace of `pivot`; nothing is factored yet."""
        self.work = work
        n = work.vectors.shape[1]
        self.free = np.zeros(n, dtype=bool)  # in the factor
        self.rho = np.nan  # of the factor
        self.member = np.zeros(n, dtype=bool)  # of the blocks
        self.orders = 0
        self.blocks: Blocks | None = None
        self.values = np.empty(0)

    def factor(self, free: np.ndarray, rho: float) -> float:
        """Factor A + diag(vectors[SHIFT]) on that face; return the least pivot.

        rho says whether the shift is that of the last call; NaN if it never is.
        """
        work = self.work
        again = rho == self.rho
        if self.blocks is None or np.any(free > self.member):
            self.cover(free)
            again = False
        changed = free != self.free if again else self.member
        smallest, _ = factor_blocks(
            work.scaled.data,
            work.vectors[SHIFT],
            free,
            changed,
            self.blocks,
            self.values,
        )
        self.free, self.rho = free, rho
        return smallest

    def cover(self, free: np.ndarray) -> None:
        """Order and lay out blocks for the free unknowns, and for those met before.

        From the third time on, or when they are more than a half, for all unknowns.
        """
        vectors = self.work.vectors
        self.orders += 1
        member = free | self.member
        if self.orders > 2 or 2 * np.count_nonzero(member) > member.size:
            member = vectors[LOWER] < vectors[UPPER]
        self.member = member
        scaled = self.work.scaled
        order = minimum_degree(scaled.indptr, scaled.indices, member)
        self.blocks = blocks_of(scaled.indptr, scaled.indices, order)
        self.values = np.empty(self.blocks.nodes.panels[-1])

    def solve(self) -> None:
        """Solve the face system of `pivot`, vectors[RHS] to vectors[Z]."""
        work = self.work
        vectors, counter, rho = work.vectors, work.counter, work.scalar[RHO]
        free = work.marks[STATE] == 0
        if rho != self.rho or np.any(free != self.free):
            vectors[SHIFT] = rho
            counter[FACTORED] += 1
            counter[OUTSIDE] |= self.factor(free, float(rho)) < LEAST_PIVOT
        if self.blocks is not None:
            solve_blocks(self.blocks, free, self.values, vectors[RHS], vectors[Z])

    def follow(self, target: float, steps: int, deadline: Deadline) -> None:
        """Follow the path to Res <= target * scalar[SIZE], as in `interior.follow`."""
        work, vectors = self.work, self.work.vectors
        free = vectors[LOWER] < vectors[UPPER]
        d, number = np.zeros((DIRECTIONS, free.size)), np.zeros(AIM + 1)
        before = np.full(STALL, np.inf)
        for k in range(steps):
            newton(work, MEASURE, 0, d, number)
            found = number[RESIDUAL] <= target * work.scalar[SIZE]
            stalled = number[RESIDUAL] > 0.5 * before[k % STALL]
            if found or stalled or deadline.reached():
                break
            before[k % STALL] = number[RESIDUAL]
            self.factor(free, np.nan)
            corrector, more = 0, True
            while more:
                newton(work, AIM_AT, corrector, d, number)
                solve_blocks(self.blocks, free, self.values, vectors[RHS], d[DZ])
                more = newton(work, DIGEST, corrector, d, number)
                corrector += 1
            if not newton(work, MOVE, corrector, d, number):
                break
        newton(work, LEAVE, 0, d, number)

    def is_convex(self) -> bool:
        """Tell whether A + `SLACK` I is positive definite."""
        work = self.work
        if not np.all(work.marks[UNIT]):
            return False
        work.vectors[SHIFT] = SLACK
        self.member[:] = True
        self.blocks = None
        return self.factor(np.ones(self.free.size, dtype=bool), np.nan) == 1.0
