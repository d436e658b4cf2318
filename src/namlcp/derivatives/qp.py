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

from typing import Any

import numpy as np

from namlcp.checks import finite_matrix, finite_vector
from namlcp.derivatives.active import ActiveSet, active_sets
from namlcp.derivatives.dense_system import DenseSystem
from namlcp.derivatives.dependent import basic, dependencies
from namlcp.derivatives.gradients import QPGradients, QPTangent, RankTwo
from namlcp.derivatives.problem import problem_of
from namlcp.derivatives.sparse_system import SparseSystem
from namlcp.qp import QP, Point
from namlcp.result import QPResult


class QPDerivative:
    """The derivative of one solution: its active set, and the factors of K.

    Attributes
    ----------
    weak : int
        How many constraints are active with a multiplier 0.
    singular : bool
        Whether K is singular with the strictly active constraints alone.
    """

    def __init__(self, qp: QP, given: tuple[Any, Any, Any], point: Point) -> None:
        """Choose the active set and factor; `given`: the user's own P, G and A."""
        self.qp, self.solution = qp, point
        P, G, A = given
        self.patterns = (
            qp.P if P is None else P,
            qp.G if G is None else G,
            qp.A if A is None else A,
        )
        strict, self.whole, self.weak = active_sets(qp, point)
        self.hold(strict, point)
        self.singular = not self.system.regular
        if self.singular:
            self.hold_independent()
        if not self.system.regular and self.weak:
            self.hold(self.whole, point)
            self.hold_independent()

    def hold_independent(self) -> None:
        """Leave out active constraints that depend on others, if there are any."""
        found = dependencies(self.qp, self.active, self.system.null_space)
        if found.number:
            self.hold(*basic(self.qp, self.active, self.point, found))

    def hold(self, active: ActiveSet, point: Point) -> None:
        """Factor the KKT system of an active set; `point` has its multipliers."""
        self.active, self.point = active, point
        self.at_lower, self.at_upper = active.side < 0, active.side > 0
        self.fixed = active.side != 0
        self.system = system_of(self.qp, active)

    def null_space_of(self, active: ActiveSet) -> np.ndarray:
        """Return a basis of the null space of K for another active set."""
        return system_of(self.qp, active).null_space

    def backward(self, dx: Any, dy: Any, dz: Any, dz_box: Any) -> QPGradients:
        """Return the gradients of a scalar in the data from those in the solution."""
        x, y, z, _ = self.point
        gx, gz_box = self.vector("dx", dx, "x"), self.vector("dz_box", dz_box, "z_box")
        gy, gz = self.vector("dy", dy, "y"), self.vector("dz", dz, "z")
        u = self.fixed * gz_box
        lam, nu, mu = self.system.solve(gx, gz, gy, u)
        products = (
            RankTwo(-0.5 * u, x, x, -0.5 * u),
            RankTwo(-z, u, -lam, x),
            RankTwo(-y, u, -nu, x),
        )
        matrices = tuple(zip(products, self.patterns, strict=True))
        vectors = 0.0 - u, lam, nu, self.at_lower * mu, self.at_upper * mu
        return QPGradients(vectors, matrices, self.weak, self.singular)

    def forward(self, changes: dict[str, Any]) -> QPTangent:
        """Return the derivative of the solution along a direction of the data."""
        d = self.direction(changes)
        r, dh, db = self.right_sides(d, self.point)
        dx = self.at_lower * d["lb"] + self.at_upper * d["ub"]
        dz, dy, rest = self.system.solve(-r, dh, db, dx)
        return QPTangent(dx, dy, dz, self.fixed * rest, self.weak, self.singular)

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

    def vector(self, name: str, value: Any, part: str) -> np.ndarray:
        """Return a gradient in a part of the solution, 0 if it is None."""
        own = getattr(self.solution, part)
        if value is None:
            return np.zeros(own.size)
        return finite_vector(name, value, own.size, part, own.shape)

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


def system_of(qp: QP, active: ActiveSet) -> DenseSystem | SparseSystem:
    """Return the factored KKT system of an active set."""
    return (DenseSystem if qp.is_dense else SparseSystem)(qp, active)


def differentiate_qp(result: QPResult) -> QPDerivative:
    """Return the derivative of a solution; raise ValueError if there is none."""
    qp, given = problem_of(result)
    point = Point(result.x, result.y, result.z, result.z_box)
    return QPDerivative(qp, given, point)
