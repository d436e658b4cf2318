"""The judge: every candidate is measured on the user's own data, the best is kept."""

from math import inf

import numpy as np

from namlcp.options import Options
from namlcp.qp.last_digits import Point, settle
from namlcp.qp.problem import QP
from namlcp.residuals import Residuals, qp_residuals

NEAR = 1e3  # residual over its tolerance up to which last digits may be what lacks


class Judge:
    """The best point so far, `best` = its worst residual over the tolerance."""

    def __init__(self, qp: QP, options: Options) -> None:
        """Start with zeros, not judged."""
        self.qp, self.options = qp, options
        n, m, p = qp.q.size, qp.h.size, qp.b.size
        self.best = inf
        self.point: Point = np.zeros(n), np.zeros(p), np.zeros(m), np.zeros(n)
        self.found: Residuals | None = None

    @property
    def residuals(self) -> Residuals:
        """Those of the best point."""
        return self.found or qp_residuals(*self.qp, *self.point)

    def offer(
        self, x: np.ndarray, y: np.ndarray, z: np.ndarray, z_box: np.ndarray
    ) -> float:
        """Judge (x, ...), (clip(x, lb, ub), ...) and that with its last digits settled.

        Returns the best of the judgements.
        """
        inside = np.minimum(np.maximum(x, self.qp.lb), self.qp.ub)
        eps = self.options.eps_abs, self.options.eps_rel
        point: Point = x, y, z, z_box
        found = self.see(point)
        worst = found.worst(*eps)
        if not np.array_equal(x, inside):
            point = inside, y, z, z_box
            found = self.see(point)
            worst = min(worst, found.worst(*eps))
        if 1.0 < worst <= NEAR:
            moved = settle(self.qp, point, found, *eps)
            if moved is not point:
                worst = min(worst, self.see(moved).worst(*eps))
        return worst

    def see(self, point: Point) -> Residuals:
        """Return the residuals of one point; keep it if it is the best."""
        found = qp_residuals(*self.qp, *point)
        worst = found.worst(self.options.eps_abs, self.options.eps_rel)
        if worst < self.best:
            self.best, self.found, self.point = worst, found, point
        return found
