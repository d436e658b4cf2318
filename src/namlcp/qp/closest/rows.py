"""All constraints of a QP that may be shifted, as rows C x <= d and C x = d."""

from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp

from namlcp.checks import from_arrays, vector
from namlcp.linalg import add_transposed, submatrix, times
from namlcp.options import SIDES, Relaxation
from namlcp.qp.problem import QP, Point

ROUNDING = 1e-14
"""Error of C x - d at a solution of stage 1, relative to the moduli of its terms: some
fifty units of rounding. A larger one would drop rows in units 10^6 times larger."""


class Rows(NamedTuple):
    """Rows C x <= d, the last p of them C x = d, within lb <= x <= ub.

    C holds the rows of G, then the soft bounds x_j <= ub_j (j in `upper`) and
    -x_j <= -lb_j (j in `lower`), then the rows of A. lb and ub are infinite where a
    bound is soft. `weights` is infinite in rows that must not be shifted, `norm`
    measures the shifts.
    """

    C: Any
    d: np.ndarray
    weights: np.ndarray
    p: int
    lb: np.ndarray
    ub: np.ndarray
    upper: np.ndarray
    lower: np.ndarray
    norm: int

    @property
    def is_equality(self) -> np.ndarray:
        return np.arange(self.d.size) >= self.d.size - self.p

    def violations(self, x: np.ndarray) -> np.ndarray:
        """Return the least shifts with which x satisfies all rows."""
        r = times(self.C, x) - self.d
        return np.where(self.is_equality, r, np.maximum(r, 0.0))

    def cost(self, x: np.ndarray) -> float:
        """Return what stage 1 minimises (norm 2: twice that), for these shifts."""
        r = self.violations(x)
        soft = np.isfinite(self.weights) & (r != 0.0)
        r, w = r[soft], self.weights[soft]
        return float(w @ (r * r if self.norm == 2 else np.abs(r)))

    def rounding(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return bounds of the errors of v = w (C x - d), and of C'v.

        0 where w is infinite: v is not computed that way.
        """
        C, w, d = abs(self.C), self.weights, self.d
        known = np.isfinite(w) & np.isfinite(d)
        terms = times(C, np.abs(x)) + np.abs(np.where(known, d, 0.0))
        errors = np.where(known, ROUNDING * np.where(known, w, 0.0) * terms, 0.0)
        sums = np.zeros(x.size)
        add_transposed(C, errors, sums)
        return errors, sums

    def parts(self, v: np.ndarray) -> list[np.ndarray]:
        """Return the parts of v (one entry a row): G, upper, lower, A."""
        lower_end = v.size - self.p
        upper_end = lower_end - self.lower.size
        m = upper_end - self.upper.size
        return [v[:m], v[m:upper_end], v[upper_end:lower_end], v[lower_end:]]

    def point(self, x: np.ndarray, v: np.ndarray, v_box: np.ndarray) -> Point:
        """Return x with multipliers of the rows and of lb, ub as a point of the QP."""
        z, of_upper, of_lower, y = self.parts(v)
        z_box = v_box.copy()
        z_box[self.upper] += of_upper
        z_box[self.lower] -= of_lower
        return Point(x, y, z, z_box)

    def shifts(self, r: np.ndarray) -> tuple[np.ndarray, ...]:
        """Return the shifts of h, b, lb and ub for those of d."""
        h, of_upper, of_lower, b = self.parts(r)
        lb, ub = np.zeros((2, self.lb.size))
        lb[self.lower] = 0.0 - of_lower
        ub[self.upper] = of_upper
        return h, b, lb, ub


def rows_of(qp: QP, relaxation: Relaxation) -> Rows:
    w = weights_of(qp, relaxation)
    upper, lower = (
        np.flatnonzero(np.isfinite(w[side]) & np.isfinite(bound))
        for side, bound in (("ub", qp.ub), ("lb", qp.lb))
    )
    lb, ub = qp.lb.copy(), qp.ub.copy()
    lb[lower], ub[upper] = -np.inf, np.inf
    soft = (
        scattered(
            np.arange(at.size),
            at,
            np.full(at.size, sign),
            (at.size, qp.q.size),
            qp.is_dense,
        )
        for at, sign in ((upper, 1.0), (lower, -1.0))
    )
    C = stacked(0, qp.G, *soft, qp.A)
    d = np.concatenate((qp.h, qp.ub[upper], -qp.lb[lower], qp.b))
    weights = np.concatenate((w["h"], w["ub"][upper], w["lb"][lower], w["b"]))
    return Rows(C, d, weights, qp.b.size, lb, ub, upper, lower, relaxation.norm)


def least_shifts(rows: Rows) -> QP:
    """Return stage 1: the QP in (x, r) or the LP in (x, r, -r_A) of the least shifts.

    A row that is not shifted has no r. In norm 1 r is split into two parts >= 0, the
    second one only for equalities.
    """
    n, dense = rows.lb.size, isinstance(rows.C, np.ndarray)
    soft = np.flatnonzero(np.isfinite(rows.weights) & (rows.d < np.inf))
    signs = np.repeat(-1.0, soft.size)
    if rows.norm == 1:
        both = soft[rows.is_equality[soft]]
        soft, signs = np.append(soft, both), np.append(signs, np.ones(both.size))
    k, w = soft.size, rows.weights[soft]
    squares, costs = (w, 0.0 * w) if rows.norm == 2 else (w[:0], w)
    at, columns = n + np.arange(squares.size), np.arange(k)
    shifts = scattered(soft, columns, signs, (rows.d.size, k), dense)
    C = stacked(1, rows.C, shifts)
    below, equal = np.split(np.arange(rows.d.size), [rows.d.size - rows.p])
    return QP(
        scattered(at, at, squares, (n + k, n + k), dense),
        np.append(np.zeros(n), costs),
        chosen(C, below),
        rows.d[below],
        chosen(C, equal),
        rows.d[equal],
        np.append(rows.lb, np.full(k, -np.inf if rows.norm == 2 else 0.0)),
        np.append(rows.ub, np.full(k, np.inf)),
    )


def weights_of(qp: QP, relaxation: Relaxation) -> dict[str, np.ndarray]:
    """Return the weight of each entry of h, b, lb and ub.

    Raises ValueError where there are too many or too few; the message names them.
    """
    found = {}
    for side in SIDES:
        value, own = getattr(relaxation, side), getattr(qp, side)
        if np.ndim(value) == 0:
            found[side] = np.full(own.size, float(value))
        else:
            name = f"Relaxation.{side}"
            found[side] = vector(name, value, own.size, side, own.shape)
    return found


def scattered(
    rows: np.ndarray,
    columns: np.ndarray,
    values: np.ndarray,
    shape: tuple[int, int],
    dense: bool,
) -> Any:
    """Return the matrix with these entries, given column by column."""
    if dense:
        M = np.zeros(shape)
        M[rows, columns] = values
        return M
    indptr = np.searchsorted(columns, np.arange(shape[1] + 1)).astype(np.int32)
    return from_arrays((indptr, rows.astype(np.int32), values), shape)


def stacked(axis: int, *blocks: Any) -> Any:
    """Return the blocks above (axis 0) or beside each other, all dense or all CSC."""
    if isinstance(blocks[0], np.ndarray):
        return np.concatenate(blocks, axis)
    return (sp.hstack if axis else sp.vstack)(blocks, "csc")


def chosen(C: Any, rows: np.ndarray, columns: np.ndarray | None = None) -> Any:
    """Return some rows, and some columns or all, given in rising order."""
    if isinstance(C, np.ndarray):
        return C[rows] if columns is None else C[np.ix_(rows, columns)]
    return submatrix(C, rows, np.arange(C.shape[1]) if columns is None else columns)
