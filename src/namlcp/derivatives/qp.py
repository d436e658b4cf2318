"""The derivative of the solution of a QP in all of its data.

min 1/2 x'Px + q'x with Gx <= h (z), Ax = b (y), lb <= x <= ub (z_box). Let I be the
strictly active rows of G, B the variables at strictly active bounds, F the others,
C = [A; G_I] and v = (y, z_I). The KKT conditions of the active set are equations with
the symmetric matrix

    K = [P_FF  C_F']
        [C_F   0   ],

whose factors serve both directions. Backward, from the gradients (gx, gy, gz, gz_box)
of a scalar in the solution:

    u_B = gz_box_B,   K (u_F, v) = ((gx - P u0)_F, (gy, gz_I) - C u0),   u0 = (u_B, 0),
    v = (nu, lam_I),  mu = gx - P u - G'lam - A'nu  (0 on F)
    g_q = -u,   g_h = lam,   g_b = nu,   g_lb, g_ub = mu at the bounds active there
    g_P = -(u x' + x u')/2,   g_G = -(z u' + lam x'),   g_A = -(y u' + nu x')

Forward, along a direction of the data, with r = dP x + dq + dG'z + dA'y:

    dx_B = dlb or dub,   e = (db - dA x, (dh - dG x)_I),   dx0 = (dx_B, 0)
    K (dx_F, dv) = (-(r + P dx0)_F, e - C dx0)
    dz_box_B = -(P dx + C'dv + r)_B

(Amos and Kolter, OptNet, ICML 2017; Magoon et al., dQP, 2024.) These are the
derivatives where all active constraints are strictly active and K is regular.
Elsewhere the solution has kinks, and an element of the generalised Jacobian is chosen:

1. weakly active constraints are dropped;
2. where strictly active ones depend on each other, independent ones that carry all
   multipliers are held (`dependent.py`);
3. where K is still singular, weakly active constraints are held, too;
4. where it is singular even so, because x is not unique, a solution of least norm is
   taken.

Steps 1 and 2 are derivatives nearby: with the right-hand sides of the dropped rows
raised, x is still the solution, with the multipliers taken, and all is regular.
"""

from functools import cached_property, partial
from typing import Any

import numpy as np

from namlcp.checks import finite_matrix, finite_vector, vector
from namlcp.derivatives.face import Face
from namlcp.derivatives.gradients import QPGradients, QPTangent, product_of
from namlcp.derivatives.items import DenseItem, refuse_faults
from namlcp.qp import QP, Point


class QPDerivative:
    """The derivative of one solution.

    Attributes
    ----------
    qp, solution : QP, Point
        The problem and its solution.
    face : Face
        The constraints held, and the factors of K; made when first asked for, as
        `backward` of a dense QP needs it at kinks alone.
    """

    def __init__(
        self,
        qp: QP,
        given: tuple[Any, Any, Any],
        point: Point,
        factors: Any = None,
    ) -> None:
        """Note the problem; `given`: P, G and A of the user, None for those of qp.

        `factors`: those of the solve, if they are there.
        """
        self.qp, self.given, self.solution = qp, given, point
        self.item: Any = None
        if qp.is_dense:
            self.item = DenseItem(qp.q.size, qp.h.size, qp.b.size)
            self.item.take(qp, point, factors)

    @cached_property
    def face(self) -> Face:
        """The constraints held, and the factors of K."""
        factors = self.item.factors if self.item is not None else None
        return Face(self.qp, self.solution, factors)

    def backward(self, dx: Any, dy: Any, dz: Any, dz_box: Any) -> QPGradients:
        """Return the gradients of a scalar in the data from those in the solution."""
        cotangents = (
            dx if dx is None else self.cotangent("x", dx),
            dy if dy is None else self.cotangent("y", dy),
            dz if dz is None else self.cotangent("z", dz),
            dz_box if dz_box is None else self.cotangent("z_box", dz_box),
        )
        if self.item is not None:
            found = self.item.backward(cotangents)
            if found is not None:
                vectors, matrices, weak = found
                gradients = self.gradients(vectors, self.solution, weak, False)
                if matrices:
                    gradients.P, gradients.G, gradients.A = matrices
                return gradients
            self.item = None  # the constraints held have to be chosen
        return self.backward_of_face(cotangents)

    def backward_of_face(
        self, cotangents: tuple[np.ndarray | None, ...]
    ) -> QPGradients:
        """Do `backward` with the constraints of `face`."""
        refuse_faults(cotangents)
        pairs = zip(cotangents, self.solution, strict=True)
        gx, gy, gz, gz_box = (
            np.zeros(own.size) if v is None else v for v, own in pairs
        )
        face = self.face
        u = face.fixed * gz_box
        lam, nu, mu = face.system.solve(gx, gz, gy, u)
        vectors = 0.0 - u, lam, nu, face.at_lower * mu, face.at_upper * mu
        return self.gradients(vectors, face.point, face.weak, face.singular)

    def gradients(
        self, vectors: tuple[np.ndarray, ...], point: Point, weak: int, singular: bool
    ) -> QPGradients:
        """Return the gradients; `vectors`: those in q, h, b, lb and ub."""
        return QPGradients(
            vectors, partial(self.matrix, vectors, point), weak, singular
        )

    def matrix(self, vectors: tuple[np.ndarray, ...], point: Point, name: str) -> Any:
        """Return the gradient in P, G or A in the form of the user's matrix."""
        pattern = self.given["PGA".index(name)]
        if pattern is None:
            pattern = getattr(self.qp, name)
        return product_of(vectors, point, name).on(pattern)

    def forward(self, changes: dict[str, Any]) -> QPTangent:
        """Return the derivative of the solution along a direction of the data."""
        d, face = self.direction(changes), self.face
        r, dh, db = self.right_sides(d, face.point)
        dx = face.at_lower * d["lb"] + face.at_upper * d["ub"]
        dz, dy, rest = face.system.solve(-r, dh, db, dx)
        return QPTangent(dx, dy, dz, face.fixed * rest, face.weak, face.singular)

    def right_sides(
        self, d: dict[str, Any], point: Point
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return dP x + dq + dG'z + dA'y, dh - dG x and db - dA x."""
        x, y, z, _ = point
        r, dh, db = d["q"], d["h"], d["b"]
        if d["P"] is not None:
            r = r + 0.5 * (d["P"] @ x + x @ d["P"])
        if d["G"] is not None:
            r, dh = r + z @ d["G"], dh - d["G"] @ x
        if d["A"] is not None:
            r, db = r + y @ d["A"], db - d["A"] @ x
        return r, dh, db

    def cotangent(self, part: str, value: Any) -> np.ndarray:
        """Return a gradient in a part of the solution as an array."""
        own = getattr(self.solution, part)
        return vector(f"d{part}", value, own.size, part, own.shape)

    def direction(self, changes: dict[str, Any]) -> dict[str, Any]:
        """Return the changes of the data by their names; an absent matrix is None."""
        out: dict[str, Any] = {}
        for name, own in zip(QP._fields, self.qp, strict=True):
            value = changes[name]
            if own.ndim == 1:
                out[name] = (
                    np.zeros(own.size)
                    if value is None
                    else finite_vector(f"d{name}", value, own.size, name, own.shape)
                )
            elif value is None:
                out[name] = None
            else:
                out[name] = finite_matrix(f"d{name}", value, name, own.shape)
        return out
