"""The derivative of the closest point of an infeasible QP, for shifts of norm 2.

`namlcp.qp.closest` finds it in two stages, which are differentiated one after the
other, the constraints held that are active in each (C, d: all rows and right sides):

1. the shifts r of the held rows: min 1/2 r'W r, C x - r = d, x_j fixed at held bounds;
2. the point x: min 1/2 x'Px + q'x, C x = d + r in held rows, <= in the others.

The gradient in r of stage 2 is that in its right side. In stage 1 x may be any point
with these shifts; the one of stage 2 is taken. If the held rows leave x some freedom,
a change of C that raises their rank makes shifts and point jump; the gradients are
those for changes that do not.
"""

from typing import Any

import numpy as np

from namlcp.derivatives.gradients import QPGradients, RankTwo, change, product_of
from namlcp.derivatives.qp import QPDerivative
from namlcp.qp.closest import Face
from namlcp.qp.problem import QP, Point


class ClosestDerivative:
    """The factors of both stages."""

    def __init__(
        self, problem: tuple[QP, Any], face: Face, easier: QP, point: Point
    ) -> None:
        """Factor; `problem`: the QP, and P, G and A as they were given.

        `easier` and `point` are stage 2 and its solution.
        """
        self.face, (self.qp, self.given) = face, problem
        stage, its_point = face.least_shifts(point.x)
        self.first = QPDerivative(stage, its_point)
        self.second = QPDerivative(easier, point)

    def backward(self, dx: Any, dshift_h: Any, dshift_b: Any) -> QPGradients:
        qp, face = self.qp, self.face
        dx = change("dx", dx, "x", qp.q)
        dshift_h = change("dshift_h", dshift_h, "h", qp.h)
        dshift_b = change("dshift_b", dshift_b, "b", qp.b)
        second = self.second.backward(dx, None, None, None)
        lam = face.spread(second.b, second.h)  # the gradient in d, then also that in r
        soft = np.zeros(lam.size - dshift_h.size - dshift_b.size)  # bounds
        dr = (np.concatenate((dshift_h, soft, dshift_b)) + lam)[face.shifted]
        before = np.concatenate((np.zeros(dx.size), dr))
        first = self.first.backward(before, None, None, None)
        mu = face.spread(first.b, np.zeros(second.h.size))

        g_h, g_upper, g_lower, g_b = face.rows.parts(lam + mu)
        fixed, up = face.v_box != 0.0, face.v_box > 0.0
        moved = second.lb + second.ub + (first.lb + first.ub)[: dx.size]
        lb = np.where(fixed, np.where(up, 0.0, moved), second.lb)
        ub = np.where(fixed, np.where(up, moved, 0.0), second.ub)
        lb[face.rows.lower] -= g_lower
        ub[face.rows.upper] += g_upper

        point = self.second.point
        x, y, z, _ = point
        u = -second.q
        stages = (
            (face.spread(y, z), u, lam),
            (face.spread(self.first.point.y, 0.0 * z), -first.q[: u.size], mu),
        )
        vectors = second.q, g_h, g_b, lb, ub

        def matrix(name: str) -> Any:
            """Return the gradient in P; in C it is -sum(v u' + lam x')."""
            product = product_of(vectors, point, "P")
            if name != "P":
                part = 0 if name == "G" else -1
                terms = (
                    (face.rows.parts(v)[part], u, face.rows.parts(lam)[part], x)
                    for v, u, lam in stages
                )
                v, u, lam, w = map(np.array, zip(*terms, strict=True))
                product = RankTwo(-1.0, v, u, -1.0, lam, w)
            return product.on(self.given["PGA".index(name)])

        return QPGradients(*vectors, second.weak, first.singular, matrix)
