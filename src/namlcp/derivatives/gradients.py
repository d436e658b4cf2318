"""What `backward` and `forward` return.

The gradients in the matrices are outer products: they are formed when asked for, in the
form in which the user gave the matrix, a sparse one on its stored entries alone.
"""

from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp

from namlcp.checks import from_arrays, sparse_matrix
from namlcp.compiled import kernel


class QPTangent(NamedTuple):
    """How the solution of a QP changes: derivatives along one direction of the data.

    Attributes
    ----------
    x, y, z, z_box : (n,), (p,), (m,), (n,) array
        Derivatives of the parts of a `QPResult`.
    weak : int
        How many constraints are active with a multiplier 0: the derivative depends on
        the sign of the direction there.
    singular : bool
        Whether the KKT system of the strictly active constraints is singular.
    """

    x: np.ndarray
    y: np.ndarray
    z: np.ndarray
    z_box: np.ndarray
    weak: int
    singular: bool


class RankTwo(NamedTuple):
    """a b' + c d', asked for on the entries of a matrix of the user."""

    a: np.ndarray
    b: np.ndarray
    c: np.ndarray
    d: np.ndarray

    def on(self, pattern: Any) -> Any:
        """Return it as an array, or on the stored entries of a sparse `pattern`.

        A CSR matrix has its gradient in CSR, any other sparse matrix in CSC.
        """
        a, b, c, d = self
        if not sp.issparse(pattern):
            out = np.empty((a.size, b.size))
            write_rank_two(a, b, c, d, out)
            return out
        is_csr = pattern.format == "csr"
        pattern = sparse_matrix("pattern", pattern, "csr" if is_csr else "csc")
        if is_csr:
            a, b, c, d = b, a, d, c
        indptr, indices = pattern.indptr, pattern.indices
        data = np.empty(indices.size)
        write_rank_two_at(indptr, indices, a, b, c, d, data)
        kind = sp.csr_array if is_csr else sp.csc_array
        return from_arrays((indptr.copy(), indices.copy(), data), pattern.shape, kind)


@kernel
def write_rank_two(a, b, c, d, out):
    """Set out (m, n) to a b' + c d'."""
    for i in range(a.size):
        for j in range(b.size):
            out[i, j] = a[i] * b[j] + c[i] * d[j]


@kernel
def write_rank_two_at(indptr, indices, a, b, c, d, data):
    """Set data to the entries of a b' + c d' at the places of a matrix in CSC."""
    for j in range(indptr.size - 1):
        for t in range(indptr[j], indptr[j + 1]):
            data[t] = a[indices[t]] * b[j] + c[indices[t]] * d[j]


class QPGradients:
    """Gradients of a scalar in the data of a QP, from its gradient in the solution.

    Attributes
    ----------
    q, h, b, lb, ub : array
        Shaped as the data; (0,) where h or b was not given, 0 where a bound is infinite
        or was not given. Of a pinned variable (lb_j = ub_j) only the two bounds moved
        together have a derivative: it stands at the bound that the multiplier presses
        on.
    P, G, A : array or sparse array
        Formed at the first access. Sparse where the matrix was given so, on its stored
        entries (CSR for CSR, else CSC). That of P is symmetric: the scalar changes by
        the sum of P_ij dP_ij over all i and j, for a symmetric dP.
    weak : int
        How many constraints are active with a multiplier 0. The solution has a kink
        there; the gradients are those of the QP without these constraints, one of the
        limits of gradients nearby.
    singular : bool
        Whether the KKT system of the strictly active constraints is singular.
    """

    def __init__(
        self,
        vectors: tuple[np.ndarray, ...],
        matrices: tuple[tuple[Any, Any], ...],
        weak: int,
        singular: bool,
    ) -> None:
        """Take (q, h, b, lb, ub), then product and user's matrix for P, G and A."""
        self.q, self.h, self.b, self.lb, self.ub = vectors
        self.matrices = matrices
        self.weak, self.singular = weak, singular

    @cached_property
    def P(self) -> Any:
        """The gradient in P."""
        product, pattern = self.matrices[0]
        return product.on(pattern)

    @cached_property
    def G(self) -> Any:
        """The gradient in G."""
        product, pattern = self.matrices[1]
        return product.on(pattern)

    @cached_property
    def A(self) -> Any:
        """The gradient in A."""
        product, pattern = self.matrices[2]
        return product.on(pattern)


class LCPTangent(NamedTuple):
    """How the solution of an LCP changes: derivatives along one direction of the data.

    Attributes
    ----------
    z, w : (n,) array
        Derivatives of the parts of an `LCPResult`.
    weak : int
        How many unknowns are at a bound with w = 0: the derivative depends on the sign
        of the direction there.
    singular : bool
        Whether A_FF is singular, F all unknowns with w = 0.
    """

    z: np.ndarray
    w: np.ndarray
    weak: int
    singular: bool


class LCPGradients:
    """Gradients of a scalar in the data of a box LCP, from its gradient in z and w.

    Attributes
    ----------
    q, lower, upper : (n,) array
        0 where a bound is infinite. Of an unknown with lower_i = upper_i only the two
        bounds moved together have a derivative: it stands at the bound that w_i presses
        on.
    A : array or sparse array
        Formed at the first access; sparse where A was given so, on its stored entries
        (CSR for CSR, else CSC). All entries of A count as independent.
    weak : int
        How many unknowns are at a bound with w = 0. The solution has a kink there; the
        gradients are those with these unknowns free, one of the limits of gradients
        nearby.
    singular : bool
        Whether A_FF is singular, F all unknowns with w = 0.
    """

    def __init__(
        self,
        vectors: tuple[np.ndarray, np.ndarray, np.ndarray],
        matrix: tuple[RankTwo, Any],
        weak: int,
        singular: bool,
    ) -> None:
        """Take (q, lower, upper), then product and user's matrix for A."""
        self.q, self.lower, self.upper = vectors
        self.matrix = matrix
        self.weak, self.singular = weak, singular

    @cached_property
    def A(self) -> Any:
        """The gradient in A."""
        product, pattern = self.matrix
        return product.on(pattern)
