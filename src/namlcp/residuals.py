"""The one definition of every residual: solvers, tests and validation import it.

LCP(q, A) with bounds: Res(z) = || z - clip(z - (A z + q), lower, upper) ||_2, which is
the paper's || min(z, A z + q) ||_2 where lower = 0, upper = +inf.

QP: min 1/2 x'Px + q'x, Gx <= h, Ax = b, lb <= x <= ub, multipliers y, z, z_box in
qpsolvers' signs (P x + q + G'z + A'y + z_box = 0, z >= 0, z_box <= 0 at a lower bound):

- primal residual: the largest violation of a constraint;
- dual residual: the largest entry of |P x + q + G'z + A'y + z_box|, or of a multiplier
  with a sign that its constraint does not allow;
- duality gap: |x'Px + q'x + b'y + h'z + lb'z_box^- + ub'z_box^+|.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from namlcp.linalg.csc import add_transposed, times
from namlcp.measure import largest_ratio, natural_squares, residuals_of_products


class Residuals(NamedTuple):
    """The three residuals of a QP point, each with the size of its largest term.

    `objective` is 1/2 x'Px + q'x, from the same products.

    Examples
    --------
    >>> import numpy as np
    >>> import namlcp
    >>> found = namlcp.solve_qp(np.eye(2), -np.ones(2), ub=np.zeros(2)).residuals
    >>> found.primal, found.dual, found.gap, found.solved(eps_abs=1e-9, eps_rel=0.0)
    (0.0, 0.0, 0.0, True)
    """

    primal: float
    dual: float
    gap: float
    primal_size: float
    dual_size: float
    gap_size: float
    objective: float

    def worst(self, eps_abs: float, eps_rel: float) -> float:
        """Return the largest residual over its tolerance; at most 1 means solved."""
        return largest_ratio(self, eps_abs, eps_rel)

    def solved(self, eps_abs: float, eps_rel: float) -> bool:
        """Tell whether all three are within tolerance."""
        return largest_ratio(self, eps_abs, eps_rel) <= 1.0


UNDEFINED = Residuals(*[math.nan] * 7)


def natural_residual(
    z: np.ndarray, w: np.ndarray, lower: np.ndarray, upper: np.ndarray
) -> float:
    """Return || z - clip(z - w, lower, upper) ||_2 for w = A z + q.

    All four are (n,) arrays of float64. Raises ValueError where the sizes disagree.

    Examples
    --------
    >>> import numpy as np
    >>> from namlcp import natural_residual
    >>> z, w = np.array([2.0, 0.0]), np.array([3.0, 4.0])  # w_1 = 0 should hold
    >>> natural_residual(z, w, np.zeros(2), np.full(2, np.inf))
    2.0
    """
    if not z.shape == w.shape == lower.shape == upper.shape:
        shapes = z.shape, w.shape, lower.shape, upper.shape
        raise ValueError(f"z, w, lower and upper must have one shape, got {shapes}")
    z, w, lower, upper = (np.ascontiguousarray(v, float) for v in (z, w, lower, upper))
    total = natural_squares(z, w, lower, upper)
    if 1e-200 < total < 1e200:
        return math.sqrt(total)
    r = np.maximum(np.minimum(w, z - lower), z - upper)  # its squares left the range
    size = float(np.abs(r).max()) if r.size else 0.0
    if not 0.0 < size < math.inf:
        return size
    return size * float(np.linalg.norm(r / size))


def qp_residuals(
    P: Any,
    q: np.ndarray,
    G: Any,
    h: np.ndarray,
    A: Any,
    b: np.ndarray,
    lb: np.ndarray | None,
    ub: np.ndarray | None,
    x: np.ndarray,
    y: np.ndarray,
    z: np.ndarray,
    z_box: np.ndarray,
) -> Residuals:
    """Return the residuals of (x, y, z, z_box) on the QP as it was given.

    P, G, A are dense or sparse, the vectors arrays of float64. Absent constraints have
    zero rows, absent bounds are infinite or None. Raises ValueError where the sizes
    disagree. All sums run in the order of qpsolvers: those over P, G and A in the order
    in which these are stored, the gap dot product by dot product.

    Examples
    --------
    >>> import numpy as np
    >>> from namlcp import qp_residuals
    >>> none, empty = np.zeros((0, 1)), np.zeros(0)
    >>> qp = np.eye(1), np.ones(1), none, empty, none, empty, None, None
    >>> found = qp_residuals(*qp, np.zeros(1), empty, empty, np.zeros(1))
    >>> found.primal, found.dual  # x = 0 where x = -1 is the solution
    (0.0, 1.0)
    """
    lb = np.full(x.size, -np.inf) if lb is None else lb
    ub = np.full(x.size, np.inf) if ub is None else ub
    if not x.shape == q.shape == lb.shape == ub.shape == z_box.shape:
        shapes = x.shape, q.shape, lb.shape, ub.shape, z_box.shape
        raise ValueError(f"x, q, lb, ub, z_box must have one shape, got {shapes}")
    for names, right, multiplier in (("h and z", h, z), ("b and y", b, y)):
        if right.shape != multiplier.shape:
            both = f"{right.shape} and {multiplier.shape}"
            raise ValueError(f"{names} must have one shape, got {both}")
    for name, C, right in (("P", P, q), ("G", G, h), ("A", A, b)):
        wanted = right.size, x.size
        if C.shape != wanted:
            raise ValueError(f"{name} must have shape {wanted}, got {C.shape}")
    q, h, b, lb, ub = (np.ascontiguousarray(v, float) for v in (q, h, b, lb, ub))
    point = tuple(np.ascontiguousarray(v, float) for v in (x, y, z, z_box))
    Gtz, Aty = np.zeros((2, x.size))
    add_transposed(G, z, Gtz)
    add_transposed(A, y, Aty)
    products = times(P, x), times(G, x), times(A, x), Gtz, Aty
    qp = P, q, G, h, A, b, lb, ub
    return Residuals(*residuals_of_products(qp, point, products))
