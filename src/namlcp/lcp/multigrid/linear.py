"""The linear system of some unknowns F alone, A_FF x = b, by truncated V-cycles."""

import numpy as np

from namlcp.lcp.multigrid.hierarchy import Hierarchy
from namlcp.lcp.multigrid.krylov import bicgstab, conjugate_gradients
from namlcp.lcp.multigrid.vcycle import VCycle

LINEAR_STEPS = 100
"""Krylov steps at most between two computations of the residual."""

RESTARTS = 3
"""Computations of the residual at most; recurrences drift away from it by rounding."""


class FreeSystem:
    """A_FF x = b for one F and any number of right-hand sides; F (n,) is a mask."""

    def __init__(self, hierarchy: Hierarchy, free: np.ndarray) -> None:
        self.hierarchy, self.free = hierarchy, free
        self.cycle = VCycle(hierarchy.levels, hierarchy.symmetric)
        self.cycle.faces[0].dinv[~free] = 0.0
        self.cycle.follow_face(0)

    def solve(self, b: np.ndarray, accuracy: float) -> tuple[np.ndarray, bool]:
        """Return x (n,), 0 outside F, and whether |b - A x|_F <= accuracy |b|_F.

        b is (n,); entries outside F are not read. The norm is that of the scaled system
        of the hierarchy.
        """
        scale, A = self.hierarchy.scale, self.hierarchy.A
        solve = conjugate_gradients if self.hierarchy.symmetric else bicgstab
        x, r = np.zeros(b.size), np.where(self.free, scale * b, 0.0)
        goal = accuracy * float(np.linalg.norm(r))
        for _ in range(RESTARTS):
            size = float(np.linalg.norm(r))
            if not size > goal:
                break
            y = np.zeros(b.size)
            solve(self.cycle, 0, r, goal, LINEAR_STEPS, y)
            x += scale * y
            r = np.where(self.free, scale * (b - A @ x), 0.0)
        return x, bool(np.linalg.norm(r) <= goal)
