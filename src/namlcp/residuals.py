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
from namlcp.linalg.csc import (
    add_column_sums,
    add_columns,
    add_transposed,
    compiled_form,
    times,
)
from namlcp.linalg.lapack import blas_dot

LARGE_TERM = 250.0
"""If all terms of the gap are smaller than this, then its rounding error is below 1e-12
in whatever order they are added."""


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
        primal = self.primal / (eps_abs + eps_rel * self.primal_size)
        dual = self.dual / (eps_abs + eps_rel * self.dual_size)
        gap = self.gap / (eps_abs + eps_rel * self.gap_size)
        # max() may ignore a NaN, the sum does not
        return max(primal, dual, gap) if primal + dual + gap >= 0.0 else math.inf

    def solved(self, eps_abs: float, eps_rel: float) -> bool:
        """Tell whether all three are within tolerance."""
        return self.worst(eps_abs, eps_rel) <= 1.0


UNDEFINED = Residuals(*[math.nan] * 7)


@part
def deviation(z, w, lower, upper):
    """Return z - clip(z - w, lower, upper), NaN if z or w is.

    z - w is not computed: a w far smaller than z would be lost by rounding, so that
    every large z would seem a solution where A is singular.
    """
    return max(min(w, z - lower), z - upper) + 0.0 * z


# The order of the sum is free ("reassoc"), so that it vectorises; NaN is kept.
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
    total = natural_squares(z, w, lower, upper, 1.0)
    if 1e-200 < total < 1e200:
        return math.sqrt(total)
    r = np.maximum(np.minimum(w, z - lower), z - upper)  # its squares left the range
    size = float(np.abs(r).max()) if r.size else 0.0
    if not 0.0 < size < math.inf:
        return size
    return size * math.sqrt(natural_squares(z, w, lower, upper, size))


@kernel(error_model="numpy")
def natural_residuals(z, w, lower, upper, d):
    """Return Res of this LCP, and of the one with z and bounds times d, w over d."""
    here, there = 0.0, 0.0
    for i in range(z.size):
        r = deviation(z[i], w[i], lower[i], upper[i])
        here += r * r
        t = d[i] * z[i]
        r = deviation(t, w[i] / d[i], lower[i] * d[i], upper[i] * d[i])
        there += r * r
    return np.sqrt(here), np.sqrt(there)


@kernel(error_model="numpy")
def modulus_variable(z, w, omega, s):
    """Overwrite s by z - w / omega: at a solution z = clip(s) and w = omega (z - s)."""
    for i in range(z.size):
        s[i] = z[i] - w[i] / omega[i]


@part
def qp_residuals_of_products(vectors, point, products):
    """Return the numbers of `Residuals` from the products with P, G and A.

    vectors = (q, h, b, lb, ub), point = (x, y, z, z_box), products = (Px, Gx, Ax, G'z,
    A'y). An infinite bound or right-hand side has no term in the gap, and the modulus
    of its multiplier is a dual residual.
    """
    q, h, b, lb, ub = vectors
    x, y, z, z_box = point
    Px, Gx, Ax, Gtz, Aty = products
    primal, primal_size = 0.0, 0.0
    dual, dual_size = 0.0, 0.0
    xPx, qx, by, hz, bounds = 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(x.size):
        primal = max(primal, lb[j] - x[j], x[j] - ub[j])
        if lb[j] > -np.inf or ub[j] < np.inf:  # else no constraint limits x_j alone
            primal_size = max(primal_size, abs(x[j]))
        rd = Px[j] + q[j] + Gtz[j] + Aty[j] + z_box[j]  # as qpsolvers adds it
        dual = max(dual, abs(rd))
        dual_size = max(
            dual_size, abs(Px[j]), abs(q[j]), abs(Gtz[j] + Aty[j]), abs(z_box[j])
        )
        if rd != rd or x[j] != x[j]:
            dual = np.nan
            break
        xPx += x[j] * Px[j]
        qx += q[j] * x[j]
        bound = lb[j] if z_box[j] < 0.0 else ub[j]
        if z_box[j] != 0.0:
            if np.isinf(bound):
                dual = max(dual, abs(z_box[j]))
            else:
                bounds += bound * z_box[j]
    for i in range(h.size):
        if Gx[i] != Gx[i] or z[i] != z[i]:
            dual = np.nan
        primal = max(primal, Gx[i] - h[i])
        if not np.isinf(h[i]):
            # not |h_i|, which may be huge where the row is not active
            primal_size = max(primal_size, abs(Gx[i]))
            hz += h[i] * z[i]
        else:
            dual = max(dual, abs(z[i]))
        dual = max(dual, -z[i])
    for i in range(b.size):
        if Ax[i] != Ax[i] or y[i] != y[i]:
            dual = np.nan
        primal = max(primal, abs(Ax[i] - b[i]))
        primal_size = max(primal_size, abs(Ax[i]), abs(b[i]))
        by += b[i] * y[i]
    gap = abs(xPx + qx + by + hz + bounds)
    gap_size = max(abs(xPx), abs(qx), abs(by), abs(hz), abs(bounds))
    objective = 0.5 * xPx + qx
    return primal, dual, gap, primal_size, dual_size, gap_size, objective


@kernel
def ordered_qp_residuals(vectors, point, products):
    """Do as `qp_residuals_of_products`, but add a gap of large terms by `signed_gap`.

    From Python plain tuples are passed: NamedTuples would take 3 us longer.
    """
    primal, dual, gap, primal_size, dual_size, gap_size, objective = (
        qp_residuals_of_products(vectors, point, products)
    )
    if not gap_size < LARGE_TERM:
        gap = abs(signed_gap(vectors, point, products[0]))
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

    P, G, A are dense or sparse, the vectors arrays of float64. Absent constraints have
    zero rows, absent bounds are infinite or None. Raises ValueError where the sizes
    disagree. The sums over P, G and A run in the order in which these are stored, as
    those of NumPy and SciPy do, and thus those of qpsolvers.

    With terms above LARGE_TERM the gap depends on the order of its sum by more than
    1e-12; it is then added in the order of qpsolvers, dot product by dot product.

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
    q, h, b, lb, ub, x, y, z, z_box = map(
        np.ascontiguousarray, (q, h, b, lb, ub, x, y, z, z_box)
    )  # as `signed_gap` wants them
    vectors, point = (q, h, b, lb, ub), (x, y, z, z_box)
    forms = compiled_form(P), compiled_form(G), compiled_form(A)
    wanted = (x.size, x.size), (z.size, x.size), (y.size, x.size)
    if None not in forms and (P.shape, G.shape, A.shape) == wanted:
        return clean_qp_residuals(forms, vectors, point)
    Gtz, Aty = np.zeros((2, x.size))
    add_transposed(G, z, Gtz)
    add_transposed(A, y, Aty)
    products = times(P, x), times(G, x), times(A, x), Gtz, Aty
    return Residuals(*ordered_qp_residuals(vectors, point, products))


def clean_qp_residuals(
    matrices: tuple[Any, ...],
    vectors: tuple[np.ndarray, ...],
    point: tuple[np.ndarray, ...],
) -> Residuals:
    """Return what `qp_residuals` does, for P, G and A each in `compiled_form`.

    vectors = (q, h, b, lb, ub), point = (x, y, z, z_box); the sizes are not checked.
    """
    return Residuals(*csc_residuals(matrices, vectors, point))


@kernel
def csc_residuals(matrices, vectors, point):
    """Return the numbers of `Residuals`; P, G and A are (indptr, indices, data)."""
    P, G, A = matrices
    x, y, z, _ = point
    n, m = x.size, z.size
    work = np.empty(3 * n + m + y.size)
    for j in range(work.size):
        work[j] = 0.0
    Px, Gtz, Aty = work[:n], work[n : 2 * n], work[2 * n : 3 * n]
    Gx, Ax = work[3 * n : 3 * n + m], work[3 * n + m :]
    add_columns(P[0], P[1], P[2], x, Px)
    add_columns(G[0], G[1], G[2], x, Gx)
    add_column_sums(G[0], G[1], G[2], z, Gtz)
    add_columns(A[0], A[1], A[2], x, Ax)
    add_column_sums(A[0], A[1], A[2], y, Aty)
    return ordered_qp_residuals(vectors, point, (Px, Gx, Ax, Gtz, Aty))


@kernel
def signed_gap(vectors, point, Px):
    """Return x'Px + q'x + b'y + h'z + lb'z_box^- + ub'z_box^+ as qpsolvers adds it.

    vectors = (q, h, b, lb, ub), point = (x, y, z, z_box), contiguous. An infinite side
    has no term. NumPy, and so qpsolvers, takes dot products from BLAS.
    """
    q, h, b, lb, ub = vectors
    x, y, z, z_box = point
    gap = blas_dot(x, Px) + blas_dot(q, x)
    gap += finite_dot(h, z, 0.0)
    gap += blas_dot(b, y)
    gap += finite_dot(lb, z_box, -1.0)
    gap += finite_dot(ub, z_box, 1.0)
    return gap


@part
def finite_dot(sides, multipliers, sign):
    """Return the product of the `finite_terms`."""
    finite, beside = finite_terms(sides, multipliers, sign)
    return blas_dot(finite, beside)


@part
def finite_terms(sides, multipliers, sign):
    """Return the finite sides and their multipliers.

    A multiplier of the sign opposite to `sign` becomes 0; none does for sign = 0.
    """
    finite, beside = np.empty(sides.size), np.empty(sides.size)
    count = 0
    for i in range(sides.size):
        if not np.isinf(sides[i]):
            finite[count] = sides[i]
            beside[count] = 0.0 if sign * multipliers[i] < 0.0 else multipliers[i]
            count += 1
    return finite[:count], beside[:count]
