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

from functools import partial
from typing import Any

import numpy as np
import scipy.sparse as sp

from namlcp.checks import finite_vector
from namlcp.derivatives.gradients import QPGradients, RankTwo, product_of
from namlcp.derivatives.qp import QPDerivative
from namlcp.qp import QP, Face, Point

ITS_OWN = (None, None, None)
"""The matrices of a stage, which no user has given."""


class Products:
    """A sum of outer products, asked for on the entries of a matrix of the user."""

    def __init__(self, *terms: RankTwo) -> None:
        self.terms = terms

    def on(self, pattern: Any) -> Any:
        """Return it as `RankTwo.on` does."""
        total, *others = (term.on(pattern) for term in self.terms)
        entries = total.data if sp.issparse(total) else total
        for other in others:
            entries += other.data if sp.issparse(other) else other
        return total


class ClosestDerivative:
    """The factors of both stages."""

    def __init__(
        self, problem: tuple[QP, Any], face: Face, easier: QP, point: Point
    ) -> None:
        """Factor; `problem`: the QP, and P, G and A as they were given.

        `easier` and `point` are stage 2 and its solution.
        """
        self.face, (self.qp, given) = face, problem
        self.patterns = {
            name: getattr(self.qp, name) if user is None else user
            for name, user in zip("PGA", given, strict=True)
        }
        stage, its_point = face.least_shifts(point.x)
        self.first = QPDerivative(stage, ITS_OWN, its_point)
        self.second = QPDerivative(easier, ITS_OWN, point)

    def backward(self, dx: Any, dshift_h: Any, dshift_b: Any) -> QPGradients:
        """Return the gradients of a scalar in the data from those in x and shifts."""
        qp, face = self.qp, self.face
        dx = vector("dx", dx, "x", qp.q)
        dshift_h = vector("dshift_h", dshift_h, "h", qp.h)
        dshift_b = vector("dshift_b", dshift_b, "b", qp.b)
        second = self.second.backward(dx, None, None, None)
        lam = face.spread(second.b, second.h)  # the gradient in d, then also that in r
        dr = (face.rows.joined(dshift_h, dshift_b) + lam)[face.shifted]
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
        of_G, _, _, of_A = self.products(
            (face.spread(y, z), u, lam, x),
            (face.spread(self.first.point.y, 0.0 * z), -first.q[: u.size], mu, x),
        )
        vectors = second.q, g_h, g_b, lb, ub
        products: dict[str, RankTwo | Products] = {"G": of_G, "A": of_A}
        products["P"] = product_of(vectors, point, "P")
        matrix = partial(self.matrix, products)
        return QPGradients(vectors, matrix, second.weak, first.singular)

    def matrix(self, products: dict[str, RankTwo | Products], name: str) -> Any:
        """Return the gradient in P, G or A in the form of the user's matrix."""
        return products[name].on(self.patterns[name])

    def products(self, *terms: tuple[np.ndarray, ...]) -> list[Products]:
        """Return the gradient -sum(v u' + lam x') in C, in parts as `Rows.parts`."""
        parts = self.face.rows.parts
        stages = [
            [
                RankTwo(-1.0, p, u, -1.0, l, x)
                for p, l in zip(parts(v), parts(lam), strict=True)
            ]
            for v, u, lam, x in terms
        ]
        return [Products(*pair) for pair in zip(*stages, strict=True)]


def vector(name: str, value: Any, other: str, own: np.ndarray) -> np.ndarray:
    """Return a gradient in a part of the solution, 0 if it is None."""
    if value is None:
        return np.zeros(own.size)
    return finite_vector(name, value, own.size, other, own.shape)
