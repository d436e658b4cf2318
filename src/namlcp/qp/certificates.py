"""Certificates: multipliers that prove a QP infeasible, rays that prove it unbounded.

Primal infeasible: (y, z >= 0, z_box) with A'y + G'z + z_box = 0 and
b'y + h'z + lb'z_box^- + ub'z_box^+ = -1 (Farkas). Unbounded: a direction d, q'd = -1,
with P d = 0, A d = 0, G d <= 0, d in the recession cone of the bounds. Every form
proposes candidates; `accept_primal` and `accept_dual` alone accept them.

The test of a Farkas certificate: let r be the residual of the first equation and lam
the 1-norm of the multipliers. Every x that violates no constraint by more than t has
1 <= |r|_inf |x|_1 + t lam. The certificate thus excludes all x with |x|_1 below
(1 - t lam)/|r|_inf; if r = 0, every x violates some constraint by 1/lam or more.
"""

from typing import Any

import numpy as np
from scipy.sparse import csc_array

from namlcp.checks import as_sparse
from namlcp.compiled import kernel
from namlcp.linalg import add_transposed, by_rows, times, without_zeros
from namlcp.qp.kkt import KKT
from namlcp.qp.problem import QP, Point
from namlcp.qp.transforms import equilibrate

# The value of a certificate (the sum scaled to -1 above) must be below minus this times
# the sum of the moduli of its terms, far beyond the rounding errors of the sum.
VALUE_ROUNDING = 1e3 * np.finfo(float).eps
# A certificate with a residual, relative to its largest entry, of at most RESIDUAL must
# exclude all x with |x|_1 up to RADIUS times max(1, |x|_1 of the current point). With a
# residual of at most EXACT_RESIDUAL, mere rounding, it need not, but must satisfy
# MARGIN and ROUNDED_VALUE.
RESIDUAL, RADIUS, EXACT_RESIDUAL = 1e-8, 1e3, 1e-12
# Largest tol * lam, for a ray tol * |d|_1, of such a certificate.
MARGIN = 0.5
# Largest error of its value, as a part of it: a multiplier is as inexact as the
# relative residual says, and so is each term of the sum. (Of a ray also: as inexact as
# |M d| relative to |M| |d|.)
ROUNDED_VALUE = 1e-2
# Largest |M d|, relative to |M| |d| row by row, of such a ray.
CANCELLED = 1e-10
# The user's own units of x, y and z.
ONES = 3 * (np.ones(1),)


def accept_primal(
    qp: QP, x: np.ndarray, y: np.ndarray, z: np.ndarray, tol: float
) -> Point | None:
    """Return (NaN, y, z, z_box) with value -1 if it proves that no x is feasible.

    z_box follows from y and z; x is the current point, `tol` the absolute tolerance.
    """
    z_kept = np.where((z <= 0.0) | np.isinf(qp.h), 0.0, z)  # NaN is kept
    s, z_box = np.zeros((2, x.size))
    add_transposed(qp.G, z_kept, s)
    add_transposed(qp.A, y, s)
    sides = qp.b, qp.h, qp.lb, qp.ub
    value, moduli, worst, most, lam = farkas_numbers(sides, y, z_kept, s, z_box)
    if not value < -VALUE_ROUNDING * moduli:
        return None
    radius, margin = RADIUS * max(1.0, float(np.abs(x).sum())), tol * lam / -value
    moduli /= -value
    if not is_contradiction(worst / most, radius * worst / -value, margin, moduli):
        return None
    y, z, z_box = y / -value, z_kept / -value, z_box / -value
    d, a, g = equilibration(qp, csc_array((x.size, x.size)))
    worst = largest((s / -value + z_box) * d)
    most = max(largest(y / a), largest(z / g), largest(z_box * d))
    radius = RADIUS * max(1.0, float(np.abs(x / d).sum()))
    if not is_contradiction(worst / most, radius * worst, margin, moduli):
        return None
    return Point(np.full(x.size, np.nan), y, z, z_box)


def is_contradiction(
    relative: float, error: float, margin: float, moduli: float
) -> bool:
    """Tell whether a Farkas certificate of value -1 passes.

    relative: residual over largest entry; error: RADIUS |x|_1 times the residual;
    margin: t lam of the module docstring for t = tol; moduli: those of the terms of the
    value, added.
    """
    return suffices(relative, error + margin, margin, is_exact(relative, moduli))


def is_exact(relative: float, moduli: float) -> bool:
    """Tell whether a residual is mere rounding, and has not made the value of -1."""
    return relative <= EXACT_RESIDUAL and relative * moduli <= ROUNDED_VALUE


def suffices(relative: float, error: float, margin: float, exact: bool) -> bool:
    """Tell whether a certificate with this relative residual is accepted.

    `error` must be at most 1 for the points within RADIUS, for an exact one `margin`,
    its part by the tolerance, must be small.
    """
    within = relative <= RESIDUAL and error <= 1.0
    return within or (exact and margin <= MARGIN)


@kernel
def farkas_numbers(sides, y, z, s, z_box):
    """Set z_box to -s = -(G'z + A'y) where a bound allows; return five numbers.

    sides = (b, h, lb, ub). The numbers are the value b'y + h'z + lb'z_box^- +
    ub'z_box^+, the sum of the moduli of its terms, the largest |s + z_box| and the
    largest entry and the 1-norm of (y, z, z_box).
    """
    b, h, lb, ub = sides
    value, moduli, worst, most, lam = 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(b.size):
        value += b[i] * y[i]
        moduli += abs(b[i] * y[i])
        most = max(most, abs(y[i]))
        lam += abs(y[i])
    for i in range(h.size):
        if z[i] != 0.0:
            value += h[i] * z[i]
            moduli += abs(h[i] * z[i])
            most = max(most, z[i])
            lam += z[i]
    for j in range(s.size):
        bound = ub[j] if s[j] < 0.0 else lb[j]
        z_box[j] = -s[j] if np.isfinite(bound) and s[j] != 0.0 else 0.0
        if z_box[j] != 0.0:
            value += bound * z_box[j]
            moduli += abs(bound * z_box[j])
            most = max(most, abs(z_box[j]))
            lam += abs(z_box[j])
        worst = max(worst, abs(s[j] + z_box[j]))
        value += 0.0 * s[j]  # NaN where s is, which max() may ignore
    return value, moduli, worst, most, lam


def equilibration(qp: QP, P: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return factors of x, y and z that equilibrate P, A and G.

    Without them a column of tiny entries would have a tiny residual for any y and z,
    and a variable that counts in large units one for any step along it.
    """
    n, p = qp.q.size, qp.b.size
    A, G = (by_rows(without_zeros(as_sparse(M))) for M in (qp.A, qp.G))
    kkt = KKT(csc_array(P), A, G)
    scale = np.ones(kkt.size)
    equilibrate(kkt.indptr, kkt.indices, kkt.base, scale)
    return scale[:n], scale[n : n + p], scale[n + p :]


def accept_dual(
    qp: QP, x: np.ndarray, y: np.ndarray, z: np.ndarray, d: np.ndarray, tol: float
) -> Point | None:
    """Return (d, NaN, NaN, NaN) with q'd = -1 if it proves unboundedness.

    d is first clipped to the recession cone of the bounds; (x, y, z) is the current
    point, `tol` the absolute tolerance.
    """
    d = np.where(np.isfinite(qp.ub), np.minimum(d, 0.0), d)
    d = np.where(np.isfinite(qp.lb), np.maximum(d, 0.0), d)
    terms = qp.q * d
    value, moduli = terms.sum(), np.abs(terms).sum()
    if not value < -VALUE_ROUNDING * moduli:
        return None
    d = d / -value
    residuals = (
        times(qp.P, d),
        times(qp.A, d),
        np.where(np.isinf(qp.h), 0.0, np.maximum(times(qp.G, d), 0.0)),
    )
    matrices = qp.P, qp.A, qp.G
    left = max(map(uncancelled, matrices, 3 * (d,), residuals))
    cancelled = left <= CANCELLED and left * moduli / -value <= ROUNDED_VALUE
    margin = tol * np.abs(d).sum()

    def proves(units: tuple[np.ndarray, ...], sizes: list[float]) -> bool:
        """Tell whether d passes in units of x, y and z, for points of these sizes."""
        parts = [largest(u * v) for u, v in zip(units, residuals, strict=True)]
        relative = max(parts) / largest(d / units[0])
        error = RADIUS * float(np.dot(parts, sizes)) + margin
        exact = is_exact(relative, moduli / -value) and cancelled
        return suffices(relative, error, margin, exact)

    if not proves(ONES, [max(1.0, np.abs(v).sum()) for v in (x, y, z)]):
        return None
    units = equilibration(qp, qp.P)
    if not proves(units, 3 * [max(1.0, largest(units[0] * qp.q))]):
        return None
    return Point(d, *(np.full(v.size, np.nan) for v in (y, z, d)))


def uncancelled(M: Any, d: np.ndarray, Md: np.ndarray) -> float:
    """Return the largest |M d| over |M| |d| row by row: the same in any units."""
    terms = abs(M) @ np.abs(d)
    return largest(np.divide(Md, terms, out=np.zeros_like(Md), where=terms > 0.0))


def largest(v: np.ndarray) -> float:
    """Return max |v_i|, 0 for no entries."""
    return float(np.abs(v).max()) if v.size else 0.0
