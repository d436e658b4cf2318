"""Exact arithmetic on QPs: the KKT system of a face solved to any accuracy.

Every double is an integer times a power of two. The data of a QP are held as integers
times 2^-T, exactly; unknowns as integers times 2^-BITS. Residuals of the KKT system are
then computed without any rounding, by Python's integers in NumPy's object arrays, and
iterative refinement with factors in double precision reduces the error until the last
of the BITS.
"""

from typing import Any, NamedTuple

import numpy as np
import qdldl
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from namlcp.qp.problem import QP, Point

BITS = 400
"""Unknowns are multiples of 2^-BITS, 4e-121."""

STEPS = 200  # of iterative refinement at most
GOAL = 1e-60  # a residual that ends the refinement
WINDOW = 10  # steps in which the residual has to be halved
EQUILIBRATIONS = 12  # rounds of scaling the KKT matrix to largest entries of 1
FACTORS = (("ldl", 1e-11), ("lu", 1e-11), ("ldl", 1e-9), ("lu", 1e-8))
"""Factorisations in the order in which they are tried, and their regularisation."""


def fraction_bits(values: np.ndarray) -> int:
    """Return the least T >= 0 for which all values are integers times 2^-T."""
    used = values[values != 0.0]
    if not used.size:
        return 0
    mantissa, exponent = np.frexp(used)
    whole = (mantissa * 2.0**53).astype(np.int64)
    trailing = np.frexp((whole & -whole).astype(float))[1] - 1
    return int(max(0, (53 - exponent - trailing).max()))


def integers(values: np.ndarray, bits: int) -> np.ndarray:
    """Return floor(values 2^bits) as Python's integers."""
    mantissa, exponent = np.frexp(values)
    whole = (mantissa * 2.0**53).astype(np.int64).tolist()
    found = np.empty(values.size, dtype=object)
    for i, (number, e) in enumerate(zip(whole, exponent.tolist(), strict=True)):
        shift = e - 53 + bits
        found[i] = number << shift if shift >= 0 else number >> -shift
    return found


def doubles(numbers: np.ndarray, bits: int) -> np.ndarray:
    """Return numbers 2^-bits, each rounded to the nearest double."""
    unit = 1 << bits
    return np.array([number / unit for number in numbers], dtype=float)


class ExactMatrix:
    """A matrix of integers times 2^-bits by rows; `@` is exact."""

    def __init__(self, M: Any, bits: int) -> None:
        rows = sp.csr_array(M)
        self.data, self.indices = integers(rows.data, bits), rows.indices
        self.full = np.flatnonzero(np.diff(rows.indptr))
        self.starts = rows.indptr[self.full]
        self.size = rows.shape[0]

    def __matmul__(self, x: np.ndarray) -> np.ndarray:
        """Return the product with a vector of integers."""
        product = np.full(self.size, 0, dtype=object)
        if self.full.size:
            terms = self.data * x[self.indices]
            product[self.full] = np.add.reduceat(terms, self.starts)
        return product


class Active(NamedTuple):
    """Constraints that hold with equality: rows of G, lower bounds, upper bounds."""

    rows: np.ndarray
    lower: np.ndarray
    upper: np.ndarray

    @property
    def free(self) -> np.ndarray:
        """The variables at no bound."""
        return ~(self.lower | self.upper)


class Face(NamedTuple):
    """A solution of the KKT system of an active set, rounded to double.

    slack = h - Gx, above = x - lb, below = ub - x (infinite where there is no side) and
    pull = -(Px + q + A'y + G'z), which z_box has to be, are rounded after they were
    computed exactly. `residual` is the largest of the system, `steps` of refinement.
    """

    x: np.ndarray
    y: np.ndarray
    z: np.ndarray
    slack: np.ndarray
    above: np.ndarray
    below: np.ndarray
    pull: np.ndarray
    residual: float
    steps: int


class ExactQP:
    """The data of a sparse QP as integers times 2^-bits."""

    def __init__(self, qp: QP) -> None:
        self.qp = qp
        P, q, G, h, A, b, lb, ub = qp
        parts = (P.data, q, G.data, h, A.data, b, lb, ub)
        self.bits = T = max(fraction_bits(v[np.isfinite(v)]) for v in parts)
        if T >= BITS:
            raise ValueError(
                f"the data have {T} bits after the point, more than {BITS}"
            )
        self.P, self.G, self.A = (ExactMatrix(M, T) for M in (P, G, A))
        self.Gt, self.At = ExactMatrix(G.T, T), ExactMatrix(A.T, T)
        sides = (np.where(np.isfinite(v), v, 0.0) for v in (q, h, b))
        self.q, self.h, self.b = (integers(v, T + BITS) for v in sides)
        bounds = (np.where(np.isfinite(v), v, 0.0) for v in (lb, ub))
        self.lb, self.ub = (integers(v, BITS) for v in bounds)

    def face(self, point: Point, active: Active) -> Face:
        """Return the solution for an active set, refined from `point`.

        Where the system is singular, one of its solutions. The factors are those of
        FACTORS that leave the least residual.
        """
        faces = []
        for kind, shift in FACTORS:
            try:
                solve, d = factored(self.qp, active, kind, shift)
            except RuntimeError:  # a pivot is zero
                continue
            faces.append(self.refined(point, active, solve, d))
            if faces[-1].residual <= GOAL:
                break
        return min(faces, key=lambda face: face.residual)

    def refined(self, point: Point, active: Active, solve: Any, d: np.ndarray) -> Face:
        """Return the solution of the system with these factors of d K d."""
        free, rows = np.flatnonzero(active.free), np.flatnonzero(active.rows)
        x, y = integers(point.x, BITS), integers(point.y, BITS)
        z = integers(np.where(active.rows, point.z, 0.0), BITS)
        x = np.where(active.lower, self.lb, np.where(active.upper, self.ub, x))
        n, p = free.size, y.size
        history: list[float] = []
        for _ in range(STEPS):
            gradient = self.P @ x + self.q + self.At @ y + self.Gt @ z
            slack = self.h - self.G @ x
            right = np.concatenate((-gradient[free], self.b - self.A @ x, slack[rows]))
            r = doubles(right, self.bits + BITS)
            history.append(float(np.abs(r).max(initial=0.0)))
            slow = history[-1] > 0.5 * min(history[:-WINDOW], default=np.inf)
            if history[-1] <= GOAL or slow or not np.isfinite(history[-1]):
                break
            step = integers(d * solve(d * r), BITS)
            x[free] += step[:n]
            y = y + step[n : n + p]
            z[rows] += step[n + p :]
        return self.face_of(x, y, z, -gradient, slack, history)

    def face_of(self, x: np.ndarray, y: np.ndarray, z: np.ndarray, *rest: Any) -> Face:
        """Return the rounded face of integers x, y, z, the pull and the slack."""
        pull, slack, history = rest
        qp, deep = self.qp, self.bits + BITS
        return Face(
            *(doubles(v, BITS) for v in (x, y, z)),
            np.where(np.isfinite(qp.h), doubles(slack, deep), np.inf),
            np.where(np.isfinite(qp.lb), doubles(x - self.lb, BITS), np.inf),
            np.where(np.isfinite(qp.ub), doubles(self.ub - x, BITS), np.inf),
            doubles(pull, deep),
            history[-1],
            len(history),
        )


def factored(qp: QP, active: Active, kind: str, shift: float) -> tuple[Any, np.ndarray]:
    """Return a solver with d K d, its diagonal shifted by +-shift, and d.

    K = [P B'; B 0] in the free variables, B the rows of A and the active ones of G.
    """
    free, rows = np.flatnonzero(active.free), np.flatnonzero(active.rows)
    P = sp.csc_array(qp.P)[free][:, free]
    B = sp.vstack((sp.csc_array(qp.A)[:, free], sp.csr_array(qp.G)[rows][:, free]))
    n, m = P.shape[0], B.shape[0]
    K = sp.csc_array(sp.block_array([[P, B.T], [B, sp.csc_array((m, m))]]))
    d = np.ones(n + m)
    for _ in range(EQUILIBRATIONS):
        D = sp.diags_array(d)
        largest = abs(D @ K @ D).max(axis=0).toarray().ravel()
        d /= np.sqrt(np.where(largest > 0.0, largest, 1.0))
    D = sp.diags_array(d)
    shifts = sp.diags_array(np.append(np.full(n, shift), np.full(m, -shift)))
    M = sp.csc_matrix(D @ K @ D + shifts)
    if kind == "ldl":
        return qdldl.Solver(sp.csc_matrix(sp.triu(M)), upper=True).solve, d
    return splu(M, "MMD_AT_PLUS_A", diag_pivot_thresh=0.1).solve, d
