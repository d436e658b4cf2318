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

from namlcp.compiled import kernel, part
from namlcp.linalg import add_transposed, times

# Terms of the gap below this round off by less than 1e-12: any order will do.
LARGE = 250.0


class Residuals(NamedTuple):
    """The three residuals of a QP point, each with the size of its largest term.

    `objective` is 1/2 x'Px + q'x, from the same products.
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
        primal = self.primal / (eps_abs + eps_rel * self.primal_size)
        dual = self.dual / (eps_abs + eps_rel * self.dual_size)
        gap = self.gap / (eps_abs + eps_rel * self.gap_size)
        # a sum tells NaN, which max() may lose
        return max(primal, dual, gap) if primal + dual + gap >= 0.0 else math.inf

    def solved(self, eps_abs: float, eps_rel: float) -> bool:
        """Tell whether all three are within tolerance."""
        return self.worst(eps_abs, eps_rel) <= 1.0


UNDEFINED = Residuals(*[math.nan] * 7)


@part
def deviation(z, w, lower, upper):
    """Return z - clip(z - w, lower, upper), NaN if z or w is.

    The difference z - w would lose a w below the rounding of z, and far out on a
    singular A everything would be solved.
    """
    return max(min(w, z - lower), z - upper) + 0.0 * z


# The sum may be taken in any order, so that it vectorises; NaN keeps its meaning.
@kernel(error_model="numpy", fastmath={"reassoc"})
def natural_squares(z, w, lower, upper, unit):
    """Return the sum of squares of (z - clip(z - w, lower, upper)) / unit."""
    total = 0.0
    for i in range(z.size):
        r = deviation(z[i], w[i], lower[i], upper[i]) / unit
        total += r * r
    return total


def natural_residual(
    z: np.ndarray, w: np.ndarray, lower: np.ndarray, upper: np.ndarray
) -> float:
    """Return || z - clip(z - w, lower, upper) ||_2 for w = A z + q.

    All four are (n,) arrays of float64. Raises ValueError where the sizes disagree.
    """
    if not z.shape == w.shape == lower.shape == upper.shape:
        shapes = z.shape, w.shape, lower.shape, upper.shape
        raise ValueError(f"z, w, lower and upper must have one shape, got {shapes}")
    total = natural_squares(z, w, lower, upper, 1.0)
    if 1e-200 < total < 1e200:
        return math.sqrt(total)
    r = np.maximum(np.minimum(w, z - lower), z - upper)
    size = float(np.abs(r).max()) if r.size else 0.0
    if not 0.0 < size < math.inf:
        return size  # squares may over- or underflow
    return size * math.sqrt(natural_squares(z, w, lower, upper, size))


@kernel(error_model="numpy")
def natural_residuals(z, w, lower, upper, d):
    """Return Res of this problem and of the one with z, bounds times d and w over d."""
    here = 0.0
    there = 0.0
    for i in range(z.size):
        r = deviation(z[i], w[i], lower[i], upper[i])
        here += r * r
        t = d[i] * z[i]
        r = deviation(t, w[i] / d[i], lower[i] * d[i], upper[i] * d[i])
        there += r * r
    return np.sqrt(here), np.sqrt(there)


@kernel(error_model="numpy")
def modulus_variable(z, w, omega, s):
    """Set s to z - w / omega, for which z = clip(s) and w = omega (z - s)."""
    for i in range(z.size):
        s[i] = z[i] - w[i] / omega[i]


@kernel
def qp_residuals_of_products(q, h, b, lb, ub, x, y, z, z_box, Px, Gx, Ax, Gtz, Aty):
    """Return the numbers of `Residuals` from the products with P, G and A.

    Gtz is G'z, Aty is A'y, added as the hosts do. An infinite side of a constraint has
    no term in the gap, and a multiplier on it counts with its full modulus as a dual
    residual.
    """
    primal = 0.0
    primal_size = 0.0
    dual = 0.0
    dual_size = 0.0
    xPx = 0.0
    qx = 0.0
    support = 0.0
    gap_size = 0.0
    for j in range(x.size):
        primal = max(primal, lb[j] - x[j], x[j] - ub[j])
        if lb[j] > -np.inf or ub[j] < np.inf:  # else it stands in no bound
            primal_size = max(primal_size, abs(x[j]))
        rd = Px[j] + q[j] + Gtz[j] + Aty[j] + z_box[j]
        dual = max(dual, abs(rd))
        dual_size = max(
            dual_size, abs(Px[j]), abs(q[j]), abs(Gtz[j] + Aty[j]), abs(z_box[j])
        )
        if rd != rd or x[j] != x[j]:
            dual = np.nan
            break
        xPx += x[j] * Px[j]
        qx += q[j] * x[j]
        side = lb[j] if z_box[j] < 0.0 else ub[j]
        if z_box[j] != 0.0:
            if np.isinf(side):
                dual = max(dual, abs(z_box[j]))
            else:
                support += side * z_box[j]
    hz = 0.0
    for i in range(h.size):
        if Gx[i] != Gx[i] or z[i] != z[i]:
            dual = np.nan
        primal = max(primal, Gx[i] - h[i])
        if not np.isinf(h[i]):
            # not |h_i|: where the row binds it is no larger, elsewhere it may be huge
            primal_size = max(primal_size, abs(Gx[i]))
            hz += h[i] * z[i]
        else:
            dual = max(dual, abs(z[i]))
        dual = max(dual, -z[i])
    by = 0.0
    for i in range(b.size):
        if Ax[i] != Ax[i] or y[i] != y[i]:
            dual = np.nan
        primal = max(primal, abs(Ax[i] - b[i]))
        primal_size = max(primal_size, abs(Ax[i]), abs(b[i]))
        by += b[i] * y[i]
    gap = abs(xPx + qx + by + hz + support)
    gap_size = max(abs(xPx), abs(qx), abs(by), abs(hz), abs(support))
    objective = 0.5 * xPx + qx
    return primal, dual, gap, primal_size, dual_size, gap_size, objective


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

    P, G, A are dense or sparse, the vectors arrays of float64; absent parts have zero
    rows, absent bounds infinite entries or are None. Raises ValueError where the sizes
    disagree.

    Where the terms of the gap are 1e16 times the tolerance, the order of the sums
    decides: large ones are summed as the hosts do, dot product by dot product.
    """
    lb = np.full(x.size, -np.inf) if lb is None else lb
    ub = np.full(x.size, np.inf) if ub is None else ub
    if not x.shape == q.shape == lb.shape == ub.shape == z_box.shape:
        shapes = x.shape, q.shape, lb.shape, ub.shape, z_box.shape
        raise ValueError(f"x, q, lb, ub, z_box must have one shape, got {shapes}")
    for names, side, multiplier in (("h and z", h, z), ("b and y", b, y)):
        if side.shape != multiplier.shape:
            sides = f"{side.shape} and {multiplier.shape}"
            raise ValueError(f"{names} must have one shape, got {sides}")
    Gtz, Aty = np.zeros((2, x.size))
    add_transposed(G, z, Gtz)
    add_transposed(A, y, Aty)
    Px = times(P, x)
    products = Px, times(G, x), times(A, x), Gtz, Aty
    found = Residuals(
        *qp_residuals_of_products(q, h, b, lb, ub, x, y, z, z_box, *products)
    )
    if found.gap_size < LARGE:
        return found
    return found._replace(gap=abs(signed_gap(q, h, b, lb, ub, x, y, z, z_box, Px)))


def signed_gap(
    q: np.ndarray,
    h: np.ndarray,
    b: np.ndarray,
    lb: np.ndarray,
    ub: np.ndarray,
    x: np.ndarray,
    y: np.ndarray,
    z: np.ndarray,
    z_box: np.ndarray,
    Px: np.ndarray,
) -> float:
    """Return x'Px + q'x + b'y + h'z + lb'z_box^- + ub'z_box^+ as the hosts add it."""
    with np.errstate(all="ignore"):  # far out it is infinite or nothing
        gap = x.dot(Px) + q.dot(x) + support(h, z) + b.dot(y)
        gap += support(lb, np.minimum(z_box, 0.0))
        gap += support(ub, np.maximum(z_box, 0.0))
    return float(gap)


def support(side: np.ndarray, multiplier: np.ndarray) -> float:
    """Return side'multiplier over the finite sides."""
    finite = np.isfinite(side)
    if finite.all():
        return float(side.dot(multiplier))
    return float(side[finite].dot(multiplier[finite]))
