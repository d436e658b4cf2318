"""Scaling: the presolved QP in equilibrated form, and the exact way back.

Symmetric Ruiz scaling of K = [[P, C'], [C, 0]], C = [A; G]: ROUNDS rounds divide rows
and columns by the square roots of their largest entries, until those are nearly 1
(D. Ruiz, RAL-TR-2001-034). With d the factors of the columns and e those of the rows,
x = d x_scaled, y = e y_scaled, z_box = z_box_scaled / d; the cost is not scaled.
The result depends on how K is scaled before: see UNITS.

Every finite bound or side of a row is one one-sided constraint: sign * t[place] <= c,
where t = (x, Ax, Gx) has the layout of K. Unscaled, t is unit * t, and the multipliers
are divided by `unit`.
"""

import numpy as np

from namlcp.compiled import kernel
from namlcp.qp.guess import Guess
from namlcp.qp.kkt import KKT
from namlcp.qp.problem import Point
from namlcp.qp.transforms.presolve import Presolved

# Scalings of K before `equilibrate`: `normalise`, `even_out` or none. Where the
# interior-point method fails, it is restarted with the next one.
UNITS = "normal", "even", "given"
# Most rounds of `equilibrate`, and the largest |1 - largest entry| that ends it.
ROUNDS, EQUAL = 10, 1e-3
# Range of the products of the factors of all rounds, against over- and underflow.
FACTORS = 1e-8, 1e8
# `normalise` must reduce the variance of log |C_ij| below this fraction of it.
PAYS = 0.8
# Most conjugate gradient steps of `even_out`, and the squared residual, relative to the
# first one, that ends them.
STEPS, REDUCTION = 20, 1e-6
# Largest |log| of a factor of `even_out`.
LARGEST = 20.0
# Least denominator of a step, against a division by zero.
TINY = 1e-300


class ScaledQP:
    """min 1/2 x'Px + q'x, Ax = b, sign * t[place] <= c.

    The one-sided constraints are of four kinds: upper and lower sides of rows, upper
    and lower bounds. `finite` has the rows or variables of each kind. `small` is the
    presolved problem; the scaled P, A and G are kept in `kkt` alone.
    """

    def __init__(self, small: Presolved, last: "ScaledQP | None" = None) -> None:
        """Scale the presolved problem; the matrices of `last` are not scaled again."""
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
        self.bounds = small.upper, small.lower, small.ub, small.lb
        self.finite = [np.flatnonzero(np.isfinite(side)) for side in self.bounds]
        self.counts = [at.size for at in self.finite]
        offset = np.repeat((n + p, n + p, 0, 0), self.counts)
        self.ends = tuple(np.cumsum(self.counts[:3]).tolist())
        self.place = (np.concatenate(self.finite) + offset).astype(np.int32)
        self.sign = np.repeat((1.0, -1.0, 1.0, -1.0), self.counts)
        self.scale_vectors()

    def scale_vectors(self) -> None:
        """Set unit, q, b, c and the values of K~ for the present scaling."""
        n, p, small, scale = self.n, self.p, self.small, self.scale
        self.kkt.data[:] = self.kkt.base
        self.unit = np.concatenate((scale[:n], 1.0 / scale[n:]))
        self.q = small.q * scale[:n]
        self.b = small.b * scale[n : n + p]
        self.c = self.sign * self.of_finite(self.bounds) / self.unit[self.place]

    def of_finite(self, values: tuple[np.ndarray, ...]) -> np.ndarray:
        """Return the values at the one-sided constraints from those of each kind."""
        parts = zip(values, self.finite, strict=True)
        return np.concatenate([value[at] for value, at in parts])

    def scale_matrix(self) -> None:
        """Scale K anew; set its values and `scale`."""
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
        """Scale by the next of UNITS; return new `unit` / old `unit`."""
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

    def primal(self, x: np.ndarray) -> np.ndarray:
        """Return the x of the QP that was presolved."""
        return self.small.with_fixed(x * self.unit[: self.n])

    def certificate(
        self, y: np.ndarray, Z: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the (y, z) of the QP that was presolved."""
        z_upper, z_lower, _ = self.sides(Z)
        y = y / self.unit[self.n : self.n + self.p]
        return self.small.certificate(y, z_upper, z_lower)

    def ray(self, dx: np.ndarray) -> np.ndarray:
        """Return the direction of the x of the QP that was presolved."""
        return self.small.ray(dx * self.unit[: self.n])

    def guess(
        self, guess: Guess
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return the scaled (x, y, Z) of a guess and which constraints are active."""
        n, small, kept = self.n, self.small, self.small.kept
        y, z_upper, z_lower = small.guess(guess.y, guess.z)
        box = guess.z_box[kept]
        Z = self.of_finite((z_upper, z_lower, np.maximum(box, 0), np.maximum(-box, 0)))
        m, size = guess.z.size, guess.x.size
        row, lb, ub = np.split(guess.active != 0, (m, m + size))
        upper, lower = (
            np.append(row, False)[owners.rows]  # False for -1, no owner
            for owners in (small.upper_of, small.lower_of)
        )
        return (
            guess.x[kept] / self.unit[:n],
            y * self.unit[n : n + self.p],
            Z * self.unit[self.place],
            self.of_finite((upper, lower, ub[kept], lb[kept])),
        )

    def relax(self, t: np.ndarray) -> None:
        """Relax b, and c of rows of G, to what the scaled t = (x, Ax, Gx) satisfies."""
        row = self.place >= self.n + self.p
        self.b = t[self.n : self.n + self.p].copy()
        self.c = np.where(row, np.maximum(self.c, self.sign * t[self.place]), self.c)

    def sides(self, Z: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the unscaled z_upper, z_lower and z_box from Z."""
        z, (i, j, k) = Z / self.unit[self.place], self.ends
        upper, lower = np.zeros((2, self.small.upper.size))
        box = np.zeros(self.n)
        upper[self.finite[0]] = z[:i]
        lower[self.finite[1]] = z[i:j]
        box[self.finite[2]] = z[j:k]
        box[self.finite[3]] -= z[k:]
        return upper, lower, box


def normalise(
    indptr: np.ndarray, indices: np.ndarray, data: np.ndarray, n: int, scale: np.ndarray
) -> None:
    """Divide the rows, or the columns, of C by their largest entries, if PAYS holds.

    Overwrites `data`, the values of K, and `scale`. Factors are clipped to FACTORS.
    """
    column = np.repeat(np.arange(scale.size), np.diff(indptr))  # of K
    in_C = column >= n
    in_C[indptr[1:] - 1] = False  # the diagonal
    i, j, value = column[in_C], indices[in_C], np.abs(data[in_C])
    factor = np.zeros(scale.size)
    np.maximum.at(factor, i, value)
    np.maximum.at(factor, j, value)
    factor[factor == 0.0] = 1.0
    factor = np.clip(1.0 / factor, *FACTORS)
    i, j, value = i[value > 0.0], j[value > 0.0], np.log(value[value > 0.0])
    if not value.size:
        return
    by_rows, by_columns = value + np.log(factor[i]), value + np.log(factor[j])
    spread = PAYS * value.var(), by_rows.var(), by_columns.var()
    if spread[0] == min(spread):
        return
    rows = np.arange(scale.size) >= n
    factor[rows != (spread[1] == min(spread))] = 1.0
    scale *= factor
    data *= factor[column] * factor[indices]


@kernel
def equilibrate(indptr, indices, data, scale):
    """Equilibrate a symmetric matrix (upper triangle in CSC); overwrite data and scale.

    `scale` is multiplied by the factors and clipped to FACTORS; an empty row has none.
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
            largest[j] = min(max(factor, FACTORS[0] / scale[j]), FACTORS[1] / scale[j])
        if off <= EQUAL:
            return
        for j in range(size):
            scale[j] *= largest[j]
            for t in range(indptr[j], indptr[j + 1]):
                data[t] *= largest[j] * largest[indices[t]]


@kernel
def even_out(indptr, indices, data, scale):
    """Scale as `equilibrate` does, but to minimise sum log(|k_ij| s_i s_j)^2.

    The minimum does not depend on how rows and columns were scaled before. The
    normal equations are solved by conjugate gradients, preconditioned by the numbers of
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
    for k in range(STEPS):
        rho = 0.0
        for j in range(size):
            rho += r[j] * r[j] / max(count[j], 1.0)
        if k == 0:
            first = last = rho
        if rho <= REDUCTION * first:
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
