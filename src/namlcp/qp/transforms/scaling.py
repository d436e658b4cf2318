"""Scaling: the presolved QP in equilibrated form, and the exact way back.

Symmetric Ruiz scaling of K = [[P, C'], [C, 0]], C = [A; G]: ten rounds divide rows and
columns by the square roots of their largest entries, until those are 1 within 1e-3
(D. Ruiz, RAL-TR-2001-034). With d the factors of the columns and e those of the rows,
x = d x_scaled, y = e y_scaled, z_box = z_box_scaled / d; the cost is not scaled.
The scaling of a matrix is not unique, and what K is divided by first decides which one
is found: `normalise` looks for the side whose units are apart, `even_out` leads to the
same matrix in whatever units the rows and columns came. A path that leads nowhere is
tried again in other UNITS.

The constraints become *pieces*, one for each finite side: sign * t[place] <= c, where
t = (x, Ax, Gx) has the layout of K; t_user = unit * t and multipliers_user = v / unit.
"""

import numpy as np

from namlcp.compiled import kernel
from namlcp.qp.guess import Guess
from namlcp.qp.kkt import KKT
from namlcp.qp.problem import Point
from namlcp.qp.transforms.presolve import Presolved

UNITS = "normal", "even", "given"  # in this order; all are equilibrated then
ROUNDS = 10
EQUAL = 1e-3
PAYS = 0.8  # of the variance may be left where one side is normalised
GEOMETRIC_ROUNDS = 20
GEOMETRIC = 1e-6  # of the first squares is left
LARGEST = 20.0  # of the logarithms of the factors
TINY = 1e-300


class ScaledQP:
    """min 1/2 x'Px + q'x, Ax = b, sign * t[place] <= c.

    The pieces come in the order upper and lower ends of rows, upper and lower bounds;
    `ends` has the three positions where the next kind begins.
    """

    def __init__(self, small: Presolved, last: "ScaledQP | None" = None) -> None:
        """Scale the presolved problem; P, A and G live on in `kkt` alone.

        The matrices of the `last` problem are not scaled again.
        """
        n, p = small.q.size, small.b.size
        self.small = small
        self.kkt: KKT
        self.scale: np.ndarray
        self.unscaled: np.ndarray
        self.units: int
        self.n, self.p = n, p
        if last is not None and small.has_matrices_of(last.small):
            self.kkt, self.unscaled, self.scale = last.kkt, last.unscaled, last.scale
            self.units = last.units
        else:
            old = None if last is None else last.kkt
            self.kkt = KKT(small.P, small.A, small.G, old)
            self.scale = np.ones(self.kkt.size)
            self.unscaled = self.kkt.base.copy()
            self.units = 0
            self.scale_matrix()
        sides = (small.upper, small.lower, small.ub, small.lb)
        finite = [np.flatnonzero(np.isfinite(side)) for side in sides]
        first = n + p
        self.place = np.concatenate(
            (finite[0] + first, finite[1] + first, finite[2], finite[3])
        ).astype(np.int32)
        counts = [rows.size for rows in finite]
        self.ends = np.cumsum(counts[:3])
        self.sign = np.repeat((1.0, -1.0, 1.0, -1.0), counts)
        self.finite = finite
        self.scale_vectors()

    def scale_vectors(self) -> None:
        """Set the units, q, b and c for the scaled matrix."""
        n, p, small, scale = self.n, self.p, self.small, self.scale
        self.kkt.data[:] = self.kkt.base
        self.unit = np.concatenate((scale[:n], 1.0 / scale[n:]))
        self.q = small.q * scale[:n]
        self.b = small.b * scale[n : n + p]
        sides = (small.upper, small.lower, small.ub, small.lb)
        value = [side[at] for side, at in zip(sides, self.finite, strict=True)]
        self.c = self.sign * np.concatenate(value) / self.unit[self.place]

    def scale_matrix(self) -> None:
        """Scale K and set the factors."""
        kkt = self.kkt
        self.scale[:] = 1.0
        kkt.base[:] = self.unscaled
        matrix = kkt.indptr, kkt.indices, kkt.base
        units = UNITS[self.units]
        if units == "normal":
            normalise(*matrix, self.n, self.scale)
        elif units == "even":
            even_out(*matrix, self.scale)
        equilibrate(*matrix, self.scale)

    def change_units(self) -> np.ndarray:
        """Scale in the next of UNITS; return the ratio of new units to old."""
        old = self.unit
        self.units = (self.units + 1) % len(UNITS)
        self.scale_matrix()
        self.scale_vectors()
        return self.unit / old

    def point(self, x: np.ndarray, y: np.ndarray, Z: np.ndarray) -> Point:
        """Return the point of the QP that was presolved."""
        n, p = self.n, self.p
        z_upper, z_lower, box = self.sides(Z)
        return self.small.point(
            x * self.unit[:n], y / self.unit[n : n + p], z_upper, z_lower, box
        )

    def certificate(
        self, y: np.ndarray, Z: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the multipliers (y, z) of its rows."""
        z_upper, z_lower, _ = self.sides(Z)
        y = y / self.unit[self.n : self.n + self.p]
        return self.small.certificate(y, z_upper, z_lower)

    def ray(self, dx: np.ndarray) -> np.ndarray:
        """Return the direction of its x; fixed variables do not move."""
        return self.small.ray(dx * self.unit[: self.n])

    def guess(
        self, guess: Guess
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return the scaled (x, y, Z) of a guess and its active pieces."""
        n, small = self.n, self.small
        y, z_upper, z_lower = small.guess(guess.y, guess.z)
        box = guess.z_box[small.kept]
        sides = z_upper, z_lower, np.maximum(box, 0.0), np.maximum(-box, 0.0)
        Z = np.concatenate([v[at] for v, at in zip(sides, self.finite, strict=True)])
        first, active = small.qp.h.size, guess.active != 0
        second = first + guess.x.size
        mark_row, mark_lb, mark_ub = (
            active[:first], active[first:second], active[second:]
        )  # fmt: skip
        upper, lower, ub, lb = self.finite
        marks = (
            mark_row[small.upper_of.rows[upper]],
            mark_row[small.lower_of.rows[lower]],
            mark_ub[small.kept[ub]],
            mark_lb[small.kept[lb]],
        )
        return (
            guess.x[small.kept] / self.unit[:n],
            y * self.unit[n : n + self.p],
            Z * self.unit[self.place],
            np.concatenate(marks),
        )

    def give_way(self, t: np.ndarray) -> None:
        """Move the sides of rows that t = (x, Ax, Gx) violates to t."""
        row = self.place >= self.n + self.p
        self.b = t[self.n : self.n + self.p].copy()
        self.c = np.where(row, np.maximum(self.c, self.sign * t[self.place]), self.c)

    def sides(self, Z: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return unscaled multipliers: upper and lower ends of rows, net bounds."""
        z = Z / self.unit[self.place]
        upper, lower = np.zeros((2, self.small.upper.size))
        box = np.zeros(self.n)
        i, j, k = self.ends
        upper[self.finite[0]] = z[:i]
        lower[self.finite[1]] = z[i:j]
        box[self.finite[2]] = z[j:k]
        box[self.finite[3]] -= z[k:]
        return upper, lower, box


@kernel
def normalise(indptr, indices, data, n, scale):
    """Divide the rows of C by their largest entries, or the columns, if that pays.

    It does where the logarithms of the entries vary less afterwards: the user's units
    of one side that are far apart are nothing the other side should make up for.
    Factors are clipped as in `equilibrate`.
    """
    size = scale.size
    factor = np.zeros(size)  # of column j < n or row j of C, first its largest entry
    logarithm = np.empty(size)
    for j in range(n, size):
        for t in range(indptr[j], indptr[j + 1] - 1):
            value = abs(data[t])
            factor[j] = max(factor[j], value)
            factor[indices[t]] = max(factor[indices[t]], value)
    for j in range(size):
        largest = factor[j] if factor[j] > 0.0 else 1.0
        factor[j] = min(max(1.0 / largest, 1e-8), 1e8)
        logarithm[j] = np.log(factor[j])
    count = 0
    total, squares = np.zeros(3), np.zeros(3)  # of all logarithms: as is, rows, columns
    for j in range(n, size):
        for t in range(indptr[j], indptr[j + 1] - 1):
            if data[t] != 0.0:
                value = np.log(abs(data[t]))
                by_rows = value + logarithm[j]
                by_columns = value + logarithm[indices[t]]
                count += 1
                total[0] += value
                total[1] += by_rows
                total[2] += by_columns
                squares[0] += value * value
                squares[1] += by_rows * by_rows
                squares[2] += by_columns * by_columns
    best = 0
    least = np.inf
    for k in range(3):
        variance = squares[k] - total[k] * total[k] / max(count, 1)
        if k == 0:
            variance *= PAYS
        if variance < least:
            best, least = k, variance
    if best == 0:
        return
    for j in range(size):
        if (j < n) == (best == 1):
            factor[j] = 1.0
        scale[j] *= factor[j]
        for t in range(indptr[j], indptr[j + 1]):
            data[t] *= factor[j] * factor[indices[t]]


@kernel
def equilibrate(indptr, indices, data, scale):
    """Scale the symmetric matrix (upper triangle in CSC) in place, data and `scale`.

    Factors are clipped to [1e-8, 1e8]; an empty row keeps its own.
    """
    size = scale.size
    largest = np.empty(size)
    for _ in range(ROUNDS):
        largest[:] = 0.0
        for j in range(size):
            for t in range(indptr[j], indptr[j + 1]):
                value = abs(data[t])
                i = indices[t]
                largest[i] = max(largest[i], value)
                largest[j] = max(largest[j], value)
        off = 0.0
        for j in range(size):
            factor = 1.0
            if largest[j] > 0.0:
                off = max(off, abs(1.0 - largest[j]))
                factor = 1.0 / np.sqrt(largest[j])
            largest[j] = min(max(factor, 1e-8 / scale[j]), 1e8 / scale[j])
        if off <= EQUAL:
            return
        for j in range(size):
            scale[j] *= largest[j]
            for t in range(indptr[j], indptr[j + 1]):
                data[t] *= largest[j] * largest[indices[t]]


@kernel
def even_out(indptr, indices, data, scale):
    """Scale like `equilibrate`, but min sum log(|k_ij| s_i s_j)^2 over the entries.

    Conjugate gradients on the normal equations, preconditioned by the numbers of
    entries (A.R. Curtis and J.K. Reid, J. Inst. Maths Applics 10, 1972).
    """
    size = scale.size
    count, r, p, Mp = np.zeros(size), np.zeros(size), np.zeros(size), np.empty(size)
    for j in range(size):
        for t in range(indptr[j], indptr[j + 1]):
            if data[t] != 0.0:
                i, value = indices[t], np.log(abs(data[t]))
                count[j] += 1.0
                r[j] -= value
                if i != j:
                    count[i] += 1.0
                    r[i] -= value
    s = np.zeros(size)
    first = last = 0.0
    for k in range(GEOMETRIC_ROUNDS):
        rho = 0.0
        for j in range(size):
            rho += r[j] * r[j] / max(count[j], 1.0)
        if k == 0:
            first = last = rho
        if rho <= GEOMETRIC * first:
            break
        for j in range(size):
            p[j] = r[j] / max(count[j], 1.0) + rho / last * p[j]
            Mp[j] = count[j] * p[j]
        last = rho
        for j in range(size):
            for t in range(indptr[j], indptr[j + 1]):
                if data[t] != 0.0:
                    i = indices[t]
                    Mp[j] += p[i]
                    if i != j:
                        Mp[i] += p[j]
        step = rho / max(np.dot(p, Mp), TINY)
        for j in range(size):
            s[j] += step * p[j]
            r[j] -= step * Mp[j]
    for j in range(size):
        s[j] = np.exp(min(max(s[j], -LARGEST), LARGEST))
        scale[j] *= s[j]
        for t in range(indptr[j], indptr[j + 1]):
            data[t] *= s[j] * s[indices[t]]
