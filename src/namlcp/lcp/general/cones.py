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

Contacts are found from M: a speed is an unknown with a diagonal entry 0, whose column
has d entries v_j > 0, and whose row has -v_j there and one entry more.
"""

from typing import Any, NamedTuple

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import SuperLU, splu

from namlcp.lcp.shifted import Factors, Shifted, transpositions

SAME = 1e-11
"""Largest difference of entries of M, whose diagonal is 1 or 0, that are taken for
equal: the directions of friction are combinations of the first ones to rounding."""

THRESHOLD = 0.01
"""A diagonal entry is a pivot unless it is this much smaller than its column."""


class Cones(NamedTuple):
    """The friction cones of k contacts with d directions in p dimensions.

    g, normal (k,): indices of the speeds and of the normal impulses x_l. b (k, d):
    those of the impulses along the directions, the first p a basis. kappa (k,) and
    v (k, d): entries of M. c (k, d, p): tau_j / v_j. kept: indices of what is not
    eliminated, all unknowns but g and b[:, p:].
    """

    g: np.ndarray
    normal: np.ndarray
    b: np.ndarray
    kappa: np.ndarray
    v: np.ndarray
    c: np.ndarray
    kept: np.ndarray


def cones_of(M: Any) -> Cones | None:
    """Return the friction cones in a sparse M, None if there are none that fit."""
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
    kept = np.setdiff1d(np.arange(M.shape[0]), eliminated)
    cones = Cones(g, rest.indices, b, rest.data, v, tau / v[:, :, None], kept)
    return cones if spans(M, cones, tau) else None


def spans(M: Any, cones: Cones, tau: np.ndarray) -> bool:
    """Tell whether M = U N U' but for the rows and columns of the speeds."""
    n, (_, d, p) = M.shape[0], tau.shape
    plain = np.setdiff1d(cones.kept, cones.b[:, :p])
    place = np.empty(n, dtype=np.intp)
    place[cones.kept] = np.arange(cones.kept.size)
    row = np.repeat(cones.b.ravel(), p)
    column = place[np.repeat(cones.b[:, None, :p], d, axis=1)].ravel()
    U = sparse.csr_array(
        (
            np.append(np.ones(plain.size), tau.ravel()),
            (np.append(plain, row), np.append(place[plain], column)),
        ),
        shape=(n, cones.kept.size),
    )
    other = np.ones(n)
    other[cones.g] = 0.0
    left = sparse.diags_array(other)
    difference = left @ M @ left - U @ M[cones.kept][:, cones.kept] @ U.T
    return float(np.abs(difference.data).max(initial=0.0)) <= SAME


def principal(
    weights: np.ndarray, vectors: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return eigenvalues and vectors of sums of w_i a_i a_i', w (k, d), a (k, d, p).

    Of two eigenvalues the least is the determinant over the largest one, and the
    determinant is that of the minors, sum_{i<j} w_i w_j (a_i x a_j)^2 (Cauchy and
    Binet): nothing cancels, however different the weights are.
    """
    total = np.einsum("kj,kjp,kjq->kpq", weights, vectors, vectors)
    if vectors.shape[2] == 1:
        return total[:, :, 0], np.ones_like(total)
    values, axes = np.linalg.eigh(total)
    x, y = vectors[:, :, 0], vectors[:, :, 1]
    minors = x[:, :, None] * y[:, None] - y[:, :, None] * x[:, None]
    determinant = 0.5 * np.einsum("ki,kj,kij->k", weights, weights, minors**2)
    values[:, 0] = determinant / values[:, 1]
    return values, axes


class ConeFactors:
    """Factors of M + D for a D, by those of what remains.

    The directions of friction are turned to the principal axes of each C: where some
    d_j are small and others are large, the entries of C^-1 are of all sizes, and in
    other axes the largest ones would cover N.
    """

    def __init__(self, system: "Condensed", diagonal: np.ndarray):
        """Factor; raise RuntimeError if the remainder is exactly singular."""
        self.cones = cones = system.cones
        self.basis = system.basis
        self.e = cones.v**2 / diagonal[cones.b]
        self.s = self.e.sum(axis=1)
        self.d_g = diagonal[cones.g]
        self.h = self.s / (self.s + self.d_g)
        m = np.einsum("kj,kjp->kp", self.e, cones.c) / self.s[:, None]
        # c_j - m would lose its digits where e_j is most of s
        off = np.einsum("ki,kjip->kjp", self.e / self.s[:, None], system.between)
        vectors = np.concatenate((off, m[:, None]), axis=1)
        weights = np.column_stack((self.e, self.h * self.d_g))
        values, axes = principal(weights, vectors)
        self.m, self.off = np.einsum("kp,kpq->kq", m, axes), off @ axes
        self.inverse = 1.0 / values
        slope = -(self.h * cones.kappa)[:, None] * self.inverse * self.m
        self.lu, self.order = system.remainder(diagonal, axes, self.inverse, slope)

    @property
    def entries(self) -> int:
        """Number of entries that are kept."""
        return int(self.lu.nnz)

    @property
    def positive(self) -> bool:
        """Whether the determinant is positive."""
        lu = self.lu
        swaps = transpositions(lu.perm_r) + transpositions(lu.perm_c)
        return bool((swaps + np.count_nonzero(lu.U.diagonal() < 0.0)) % 2 == 0)

    def solve(self, r: np.ndarray) -> np.ndarray:
        """Return the solution for r, (n,) or (n, k)."""
        if r.ndim == 2:
            return np.column_stack([self.solve(column) for column in r.T])
        cones, basis = self.cones, self.basis
        rho = r[cones.b] / cones.v
        weighted = self.e * rho
        total = weighted.sum(axis=1)
        sigma = self.d_g * total / self.s - r[cones.g]
        side = np.einsum("kj,kjp->kp", weighted, self.off)
        side += (self.h * sigma)[:, None] * self.m
        condensed = r.copy()
        condensed[basis] = self.inverse * side
        x = np.zeros_like(r)
        x[self.order] = self.lu.solve(condensed[self.order])
        t, x_l = x[basis], x[cones.normal]
        y = self.inverse * (side - t + (self.h * cones.kappa * x_l)[:, None] * self.m)
        middle = np.einsum("kp,kp->k", self.m, y)  # the speed is lifted by this
        lifted = r[cones.g] - cones.kappa * x_l + total + self.d_g * middle
        lifted /= self.s + self.d_g
        x[cones.g] = lifted - middle
        free = rho - np.einsum("kjp,kp->kj", self.off, y) - lifted[:, None]
        x[cones.b] = self.e * free / cones.v
        return x


class Condensed:
    """A sparse M with friction cones, and factors of its sums with diagonals > 0."""

    def __init__(self, M: Any, cones: Cones):
        self.M, self.cones = sparse.csr_array(M), cones
        self.basis = cones.b[:, : cones.c.shape[2]]
        self.between = cones.c[:, :, None] - cones.c[:, None]
        self.ordered = False
        self.lay_out(cones.kept)

    def lay_out(self, order: np.ndarray) -> None:
        """Store what remains in this order, and find the entries that D changes."""
        size, p = order.size, self.basis.shape[1]
        place = np.empty(self.M.shape[0], dtype=np.int64)
        place[order] = np.arange(size)
        self.order, self.turned = order, place[self.basis]
        normal = place[self.cones.normal]
        self.partner = np.arange(size)
        self.partner[self.turned] = self.turned[:, ::-1]
        # all entries that turning and D may change are stored, zeros too
        N = sparse.coo_array(self.M[order][:, order])
        pairs = sparse.eye_array(size, format="csr")
        if p == 2:
            pairs = pairs + pairs[self.partner]
        pattern = sparse.coo_array(pairs @ sparse.csr_array(abs(N)) @ pairs)
        row, column = self.turned.ravel(), np.repeat(normal, p)
        rows = np.concatenate((N.row, pattern.row, row, np.arange(size)))
        columns = np.concatenate((N.col, pattern.col, column, np.arange(size)))
        data = np.append(N.data, np.zeros(rows.size - N.nnz))
        self.N = sparse.csc_array((data, (rows, columns)), shape=N.shape)
        self.N.sort_indices()
        self.columns = np.repeat(np.arange(size), np.diff(self.N.indptr))
        self.stored = self.columns * size + self.N.indices
        self.diagonal = self.at(np.arange(size), np.arange(size))
        self.slopes = self.at(row, column)
        if p == 2:
            self.across = self.at(self.N.indices, self.partner[self.columns])
            self.along = self.at(self.partner[self.N.indices], self.columns)

    def at(self, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
        """Return where these entries of N are stored."""
        return np.searchsorted(self.stored, columns * self.order.size + rows)

    def turn(self, axes: np.ndarray) -> np.ndarray:
        """Return the stored entries of V'N V, V the axes of each contact."""
        data = self.N.data
        if axes.shape[1] == 1:
            return data.copy()
        same, other = np.ones(self.order.size), np.zeros(self.order.size)
        same[self.turned] = axes[:, [0, 1], [0, 1]]
        other[self.turned] = axes[:, [1, 0], [0, 1]]
        rows = self.N.indices
        data = same[rows] * data + other[rows] * data[self.along]
        return same[self.columns] * data + other[self.columns] * data[self.across]

    def remainder(
        self,
        diagonal: np.ndarray,
        axes: np.ndarray,
        inverse: np.ndarray,
        slope: np.ndarray,
    ) -> tuple[SuperLU, np.ndarray]:
        """Factor what remains, with C^-1 and the slopes of all contacts; and its order.

        The first call finds an order of little fill, which later ones keep.
        """
        change = diagonal[self.order]
        change[self.turned] = inverse
        data = self.turn(axes)
        data[self.diagonal] += change
        data[self.slopes] += slope.ravel()
        K = sparse.csc_array((data, self.N.indices, self.N.indptr), shape=self.N.shape)
        lu = splu(
            K,
            permc_spec="NATURAL" if self.ordered else "MMD_AT_PLUS_A",
            diag_pivot_thresh=THRESHOLD,
            options={"SymmetricMode": True},
        )
        order = self.order
        if not self.ordered:
            self.ordered = True
            self.lay_out(order[np.argsort(lu.perm_c)])
        return lu, order

    def factors(self, diagonal: np.ndarray) -> ConeFactors | None:
        """Factor M + diag(diagonal); return None if it is singular or not finite."""
        with np.errstate(all="ignore"):
            if not np.isfinite((1.0 / diagonal).sum() + diagonal.sum()):
                return None
            try:
                return ConeFactors(self, diagonal)
            except (RuntimeError, np.linalg.LinAlgError):  # exactly singular, overflow
                return None


Systems = Condensed | Shifted
"""A matrix, and the factors of its sums with diagonals > 0."""

AnyFactors = ConeFactors | Factors
"""Factors of a sum, which know the sign of its determinant and how large they are."""


def system_of(M: Any) -> Systems:
    """Return the linear systems of M + D, D > 0 diagonal, condensed where that fits."""
    cones = cones_of(M) if sparse.issparse(M) else None
    return Shifted(M) if cones is None else Condensed(M, cones)
