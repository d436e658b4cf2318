"""The judge: every candidate is measured on the user's own data, the best is kept."""

from math import inf

import numpy as np

from namlcp.checks import QPData
from namlcp.options import Options
from namlcp.residuals import Residuals, qp_residuals

Point = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]


class Judge:
    """The best point so far, `best` = its worst residual over the tolerance."""

    def __init__(self, qp: QPData, options: Options) -> None:
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
        """Judge (x, ...) and (clip(x, lb, ub), ...); return the better judgement."""
        eps = self.options.eps_abs, self.options.eps_rel
        worst = inf
        inside = np.minimum(np.maximum(x, self.qp.lb), self.qp.ub)
        for point in (x, inside):
            found = qp_residuals(*self.qp, point, y, z, z_box)
            value = found.worst(*eps)
            worst = min(worst, value)
            if value < self.best:
                self.best, self.found = value, found
                self.point = point, y, z, z_box
            if np.array_equal(x, inside):
                break
        return worst
