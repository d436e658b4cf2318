"""The judge: every candidate is measured on the user's own data, the best is kept."""

from math import inf

import numpy as np
from numba import njit

from namlcp.checks import QPData
from namlcp.options import Options
from namlcp.residuals import Residuals, qp_residuals_of_products

Point = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]


class Judge:
    """The best point so far, `best` = its worst residual over the tolerance."""

    def __init__(self, qp: QPData, options: Options) -> None:
        """Start with zeros, not judged."""
        self.qp, self.options = qp, options
        n, m, p = qp.q.size, qp.h.size, qp.b.size
        self.best = inf
        self.point: Point = np.zeros(n), np.zeros(p), np.zeros(m), np.zeros(n)
        self.work = np.empty(n), np.empty(m), np.empty(p), np.empty(n)

    def residuals(
        self, x: np.ndarray, y: np.ndarray, z: np.ndarray, z_box: np.ndarray
    ) -> Residuals:
        """Return the residuals of a point in the user's letters and units."""
        P, q, G, h, A, b, lb, ub = self.qp
        user_products(
            P.indptr, P.indices, P.data, G.indptr, G.indices, G.data,
            A.indptr, A.indices, A.data, x, y, z, *self.work,
        )  # fmt: skip
        return Residuals(
            *qp_residuals_of_products(q, h, b, lb, ub, x, y, z, z_box, *self.work)
        )

    def offer(
        self, x: np.ndarray, y: np.ndarray, z: np.ndarray, z_box: np.ndarray
    ) -> float:
        """Judge (x, ...) and (clip(x, lb, ub), ...); return the better judgement."""
        eps_abs, eps_rel = self.options.eps_abs, self.options.eps_rel
        worst = inf
        inside = np.minimum(np.maximum(x, self.qp.lb), self.qp.ub)
        for point in (x, inside):
            value = self.residuals(point, y, z, z_box).worst(eps_abs, eps_rel)
            worst = min(worst, value)
            if value < self.best:
                self.best = value
                self.point = point, y, z, z_box
            if np.array_equal(x, inside):
                break
        return worst


@njit(cache=True, nogil=True)
def user_products(
    Pp, Pi, Px, Gp, Gi, Gx, Ap, Ai, Ax, x, y, z, P_x, G_x, A_x, dual
):  # pragma: no cover
    """Set P_x = P x, G_x = G x, A_x = A x and dual = A'y + G'z; matrices in CSC."""
    P_x[:] = 0.0
    G_x[:] = 0.0
    A_x[:] = 0.0
    for j in range(x.size):
        for t in range(Pp[j], Pp[j + 1]):
            P_x[Pi[t]] += Px[t] * x[j]
        total = 0.0
        for t in range(Ap[j], Ap[j + 1]):
            A_x[Ai[t]] += Ax[t] * x[j]
            total += Ax[t] * y[Ai[t]]
        for t in range(Gp[j], Gp[j + 1]):
            G_x[Gi[t]] += Gx[t] * x[j]
            total += Gx[t] * z[Gi[t]]
        dual[j] = total
