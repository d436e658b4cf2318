"""Factors for contact with friction: unknowns of a friction cone are eliminated first.

Contact with d directions of friction has d + 1 unknowns more than its normal impulse:
impulses b_j along the directions and a speed g. With x for the other unknowns and
D > 0 diagonal, the rows of (M + D) (x, b, g) = r of one contact are

    d_j b_j + v_j g + tau_j'y = r_j,    kappa x_l - sum_j v_j b_j + d_g g = r_g,

where y = N (x, t) are the rows of the first p of its directions, p = 1 in the plane and
2 in space, t = sum_j tau_j b_j is the friction along these, and M has no other entries
in the column of g. With e_j = v_j^2 / d_j, c_j = tau_j / v_j and the sums

    s = sum e_j,   m = sum e_j c_j / s,   h = s / (s + d_g),
    C = sum e_j (c_j - m) (c_j - m)' + h d_g m m',

in which nothing cancels, elimination of b and g leaves

    y + C^-1 (t - h kappa m x_l) = C^-1 (sum e_j (c_j - m) rho_j + h m sigma),

rho_j = r_j / v_j, sigma = d_g / s sum e_j rho_j - r_g. So p unknowns a contact
remain of d + 1, and the fill of the factors falls to 2/5 in the plane, to 1/20 with
eight directions. The determinant of M + D has the sign of that which remains, as C and
all d are > 0.

A speed is an unknown with a diagonal entry 0, whose column has d entries v_j > 0, and
whose row has -v_j there and one entry more.
"""

from typing import Any

import numpy as np
from scipy import sparse

from namlcp.checks import sparse_matrix
from namlcp.lcp.shifted import Shifted
from namlcp.linalg.factors import plan_lu

# Largest difference of entries of M, whose diagonal is 1 or 0, that are taken for
# equal: the directions of friction are combinations of the first ones to rounding.
SAME = 1e-11


def cones_of(M: Any) -> tuple[np.ndarray, ...] | None:
    M = sparse.csr_array(M)
    by_columns = sparse.csc_array(M)
    g = np.flatnonzero(M.diagonal() == 0.0)
    columns, rows = by_columns[:, g], M[g]
    sizes = np.diff(columns.indptr)
    if g.size == 0 or sizes[0] < 2 or (sizes != sizes[0]).any():
        return None
    d, p = int(sizes[0]), 1 if sizes[0] == 2 else 2
    b, v = columns.indices.reshape(-1, d), columns.data.reshape(-1, d)
    if (v <= 0.0).any() or np.unique(b).size < b.size:
        return None
    rest = sparse.csr_array(rows + columns.T)
    rest.data[np.abs(rest.data) <= SAME] = 0.0
    rest.eliminate_zeros()
    if (np.diff(rest.indptr) != 1).any():
        return None
    if np.isin(rest.indices, np.append(g, b)).any():
        return None
    gram = np.empty((g.size, d, p))
    for j in range(d):
        for i in range(p):
            gram[:, j, i] = M[b[:, j], b[:, i]]
    if np.abs(np.linalg.det(gram[:, :p])).min() <= SAME:
        return None
    # the rows of d directions are combinations tau of the first p
    tau = gram @ np.linalg.inv(gram[:, :p])
    eliminated = np.concatenate((g, b[:, p:].ravel()))
    remaining = np.setdiff1d(np.arange(M.shape[0]), eliminated)
    # M must be U N U' but for the rows and columns of the speeds
    n, plain = M.shape[0], np.setdiff1d(remaining, b[:, :p])
    position = np.empty(n, dtype=np.intp)
    position[remaining] = np.arange(remaining.size)
    column = position[np.repeat(b[:, None, :p], d, axis=1)].ravel()
    places = (
        np.append(plain, np.repeat(b.ravel(), p)),
        np.append(position[plain], column),
    )
    entries = np.append(np.ones(plain.size), tau.ravel())
    U = sparse.csr_array((entries, places), shape=(n, remaining.size))
    other = np.ones(n)
    other[g] = 0.0
    left = sparse.diags_array(other)
    difference = left @ M @ left - U @ M[remaining][:, remaining] @ U.T
    if not np.abs(difference.data).max(initial=0.0) <= SAME:
        return None
    return g, rest.indices, b, rest.data, v, tau / v[:, :, None], remaining


def principal(
    weights: np.ndarray, vectors: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Diagonalise sums of w_i a_i a_i', w (k, d) >= 0, a (k, d, p), p = 1 or 2.

    Return the eigenvalues (k, p), the axes (k, p, p) and the a_i along these axes. The
    first guess of an axis is the a_i of the largest w_i |a_i|^2; one rotation of Jacobi
    does the rest. So what this a_i has across the axes keeps its digits, though it may
    be w_2 / w_1 of the whole. The least eigenvalue is the determinant, sum_{i<j} w_i
    w_j (a_i x a_j)^2 (Cauchy and Binet), over the largest: nothing cancels.
    """
    k, _, p = vectors.shape
    if p == 1:
        return np.einsum("kj,kjp->kp", weights, vectors**2), np.ones((k, 1, 1)), vectors
    each = np.arange(k)
    largest = np.argmax(weights * (vectors**2).sum(axis=2), axis=1)
    x, y = vectors[each, largest].T
    size = np.hypot(x, y)
    x, y = x / size, y / size
    along = vectors[:, :, 0] * x[:, None] + vectors[:, :, 1] * y[:, None]
    across = vectors[:, :, 1] * x[:, None] - vectors[:, :, 0] * y[:, None]
    across[each, largest] = 0.0
    first, second = (weights * along**2).sum(axis=1), (weights * across**2).sum(axis=1)
    mixed = (weights * along * across).sum(axis=1)
    minors = along[:, :, None] * across[:, None] - across[:, :, None] * along[:, None]
    determinant = 0.5 * np.einsum("ki,kj,kij->k", weights, weights, minors**2)
    slope = np.copysign(2.0 * mixed, (first - second) * mixed)
    half = np.abs(first - second)
    tangent = np.divide(
        slope, half + np.hypot(half, slope), out=np.zeros(k), where=mixed != 0.0
    )
    cosine = 1.0 / np.sqrt(1.0 + tangent**2)
    sine = tangent * cosine
    values = np.column_stack((first + tangent * mixed, second - tangent * mixed))
    least = np.argmin(values, axis=1)
    values[each, least] = determinant / values[each, 1 - least]
    turn = np.array([[cosine, -sine], [sine, cosine]]).transpose(2, 0, 1)
    axes = np.array([[x, -y], [y, x]]).transpose(2, 0, 1) @ turn
    return values, axes, np.stack((along, across), axis=2) @ turn


class ConeFactors:
    """Factors of M + D for a D, by those of what remains; ValueError if a pivot is 0.

    The directions of friction are turned to the principal axes of each C: in others the
    largest entries of C^-1, which are of all sizes, would cover N.
    """

    def __init__(self, system: "Condensed", diagonal: np.ndarray):
        self.e = system.v**2 / diagonal[system.b]
        self.s = self.e.sum(axis=1)
        self.d_g = diagonal[system.g]
        self.h = self.s / (self.s + self.d_g)
        m = np.einsum("kj,kjp->kp", self.e, system.c) / self.s[:, None]
        # c_j - m would lose its digits where e_j is most of s
        off = np.einsum("ki,kjip->kjp", self.e / self.s[:, None], system.between)
        vectors = np.concatenate((off, m[:, None]), axis=1)
        weights = np.column_stack((self.e, self.h * self.d_g))
        values, axes, turned = principal(weights, vectors)
        self.off, self.m = turned[:, :-1], turned[:, -1]
        self.inverse = 1.0 / values
        slope = -(self.h * system.kappa)[:, None] * self.inverse * self.m
        self.system, self.axes = system, axes
        data = system.turn(axes)
        own = data[system.diagonal[system.turned]]
        # y is C^-1 (...) and N (x, t): the smaller factor rounds less
        self.soft = self.inverse > own
        # what remains is V'N V with all C^-1 and slopes
        change = diagonal[system.remaining]
        change[system.turned] = self.inverse
        data[system.diagonal] += change
        data[system.slopes] += slope.ravel()
        self.lu = system.fronts.another()
        self.lu.refactor(data)

    def is_positive(self) -> bool:
        return np.count_nonzero(self.lu.pivots < 0.0) % 2 == 0

    def solve(self, r: np.ndarray) -> np.ndarray:
        if r.ndim == 2:
            return np.column_stack([self.solve(column) for column in r.T])
        system = self.system
        basis, remaining, b, g = system.basis, system.remaining, system.b, system.g
        rho = r[b] / system.v
        weighted = self.e * rho
        total = weighted.sum(axis=1)
        sigma = self.d_g * total / self.s - r[g]
        side = np.einsum("kj,kjp->kp", weighted, self.off)
        side += (self.h * sigma)[:, None] * self.m
        condensed = r.copy()
        condensed[basis] = self.inverse * side
        x = np.zeros_like(r)
        x[remaining] = self.lu.solve(condensed[remaining])
        t, x_l = x[basis], x[system.normal]
        y = self.inverse * (side - t + (self.h * system.kappa * x_l)[:, None] * self.m)
        x[basis] = np.einsum("kpq,kq->kp", self.axes, t)
        speeds = (system.N @ x[remaining])[system.turned]
        y = np.where(self.soft, np.einsum("kpq,kp->kq", self.axes, speeds), y)
        middle = np.einsum("kp,kp->k", self.m, y)  # the speed is lifted by this
        lifted = r[g] - system.kappa * x_l + total + self.d_g * middle
        lifted /= self.s + self.d_g
        x[g] = lifted - middle
        free = rho - np.einsum("kjp,kp->kj", self.off, y) - lifted[:, None]
        x[b] = self.e * free / system.v
        return x


class Condensed:
    """A sparse M with friction cones, and factors of its sums with diagonals > 0.

    g, normal (k,): indices of the speeds and of the normal impulses x_l of k contacts.
    b (k, d): those of the impulses along the directions, the first p a basis. kappa
    (k,) and v (k, d): entries of M. c (k, d, p): tau_j / v_j. remaining: indices of
    what is not eliminated, all but g and b[:, p:].
    """

    def __init__(self, M: Any, cones: tuple[np.ndarray, ...]):
        self.g, self.normal, self.b, self.kappa, self.v, self.c, remaining = cones
        self.remaining, size, p = remaining, remaining.size, self.c.shape[2]
        self.basis = self.b[:, :p]
        self.between = self.c[:, :, None] - self.c[:, None]
        position = np.empty(M.shape[0], dtype=np.int64)
        position[remaining] = np.arange(size)
        self.turned = position[self.basis]
        normal = position[self.normal]
        self.partner = np.arange(size)
        self.partner[self.turned] = self.turned[:, ::-1]
        # all entries that turning and D may change are stored, zeros too, and those
        # across the diagonal from them
        N = sparse.coo_array(sparse.csr_array(M)[remaining][:, remaining])
        pairs = sparse.eye_array(size, format="csr")
        if p == 2:
            pairs = pairs + pairs[self.partner]
        pattern = sparse.coo_array(pairs @ sparse.csr_array(abs(N) + abs(N).T) @ pairs)
        row, column = self.turned.ravel(), np.repeat(normal, p)
        rows = np.concatenate((N.row, pattern.row, row, column, np.arange(size)))
        columns = np.concatenate((N.col, pattern.col, column, row, np.arange(size)))
        data = np.append(N.data, np.zeros(rows.size - N.nnz))
        N = sparse.csc_array((data, (rows, columns)), shape=N.shape)
        self.N = sparse_matrix("M", N, "csc")
        self.columns = np.repeat(np.arange(size), np.diff(self.N.indptr))
        self.stored = self.columns * size + self.N.indices
        self.diagonal = self.at(np.arange(size), np.arange(size))
        self.slopes = self.at(row, column)
        if p == 2:
            self.across = self.at(self.N.indices, self.partner[self.columns])
            self.along = self.at(self.partner[self.N.indices], self.columns)
        self.fronts = plan_lu(self.N.indptr, self.N.indices)

    def at(self, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
        return np.searchsorted(self.stored, columns * self.remaining.size + rows)

    def turn(self, axes: np.ndarray) -> np.ndarray:
        """Return the entries of V'N V, V the axes of each contact."""
        data = self.N.data
        if axes.shape[1] == 1:
            return data.copy()
        same, other = np.ones(self.partner.size), np.zeros(self.partner.size)
        same[self.turned] = axes[:, [0, 1], [0, 1]]
        other[self.turned] = axes[:, [1, 0], [0, 1]]
        rows = self.N.indices
        data = same[rows] * data + other[rows] * data[self.along]
        return same[self.columns] * data + other[self.columns] * data[self.across]

    def factors(self, diagonal: np.ndarray) -> ConeFactors | None:
        """Factor M + diag(diagonal); return None if it is singular or not finite."""
        with np.errstate(all="ignore"):
            if not np.isfinite((1.0 / diagonal).sum() + diagonal.sum()):
                return None
            try:
                return ConeFactors(self, diagonal)
            except ValueError:  # a pivot is 0, or overflow
                return None


System = Shifted | Condensed


def system_of(M: Any) -> System:
    cones = cones_of(M) if sparse.issparse(M) else None
    return Shifted(M) if cones is None else Condensed(M, cones)
