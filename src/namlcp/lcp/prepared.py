"""The facts of the matrix of an LCP, each computed once, for any number of q."""

from functools import cached_property
from typing import Any

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import LinearOperator

from namlcp.checks import (
    as_sparse,
    finite_square_matrix,
    number_or_vector,
    refuse_number,
)
from namlcp.entries import transposed
from namlcp.lcp.loops import row_sums, two_colours
from namlcp.lcp.tridiagonal import read_rows
from namlcp.linalg.arrays import stamp_of
from namlcp.linalg.csc import arrays_of
from namlcp.linalg.factors import is_symmetric

# Sum of (A + A')_ij r_j, relative to its terms, that counts as 0 where a_ii = 0.
DIAGONAL_ROUNDING = 1e-10
# Order up to which matrices are factored as dense ones, and share of entries that are
# not 0 from which on larger ones are, too.
DENSE_ORDER, SPARSE = 250, 0.125
# Largest order of a sparse matrix that pivoting always takes as a dense one.
SMALL_ORDER = 24
# Largest |u'Av - v'Au| that counts as zero for two fixed random vectors, relative to
# |u||Av| + |v||Au|: it allows for products in single precision.
SYMMETRIC = 1e-7


class Prepared:
    """A checked matrix, which `solve_lcp` takes in place of A, for one q after another.

    It keeps what depends on A alone, and the last solution that pivoting found: the
    next solve begins with its free unknowns, which is often one factorisation from the
    next solution. So earlier LCPs may change the rounding of a solution, and which one
    is found if there are several.

    Parameters
    ----------
    A : (n, n) array, sparse array or scipy LinearOperator
        The matrix of the LCP. It is not copied if it is finite float64 (CSR if sparse),
        and must not be changed afterwards.
    diagonal : (n,) array
        diag(A) of a LinearOperator, see `solve_lcp`.

    Raises
    ------
    TypeError, ValueError
        A is no finite square matrix of real numbers.

    Examples
    --------
    >>> import numpy as np
    >>> from namlcp import Prepared, solve_lcp
    >>> A = Prepared(np.array([[2.0, 1.0], [1.0, 2.0]]))
    >>> [solve_lcp(A, np.array([-5.0, q])).z.round(6).tolist() for q in (-6.0, 1.0)]
    [[1.333333, 2.333333], [2.5, 0.0]]
    """

    levels: Any = None  # its `Hierarchy`, False if there is none, see `hierarchy_of`
    last: np.ndarray | None = None  # the last solution that pivoting found

    def __init__(self, A: Any, diagonal: Any = None):
        if isinstance(A, LinearOperator):
            self.hold(Operator(A, diagonal))
        elif diagonal is None:
            self.hold(finite_square_matrix("A", A, "csr"))
            if not self.is_sparse:  # cheap, and nearly every method asks for it
                self.symmetric = is_symmetric(self.A)
        else:
            raise ValueError(
                "diagonal is for a LinearOperator; other matrices have theirs"
            )

    def hold(self, A: Any) -> None:
        self.A, self.n = A, A.shape[0]
        self.is_sparse = sparse.issparse(A)

    @classmethod
    def unchecked(cls, A: Any, symmetric: bool) -> "Prepared":
        """Return a Prepared of a matrix known to be clean; symmetric A may be CSC."""
        matrix = cls.__new__(cls)
        matrix.hold(A)
        matrix.symmetric = symmetric
        return matrix

    @cached_property
    def symmetric(self) -> bool:
        """Whether A = A' up to rounding."""
        return is_symmetric(self.A)

    @cached_property
    def tridiagonal(self) -> np.ndarray | None:
        """The rows of a sparse tridiagonal A with a positive diagonal, else None."""
        A, n = self.A, self.n
        if not self.is_sparse or n == 0 or A.nnz > 3 * n:
            return None
        rows = np.empty((5, n))
        return rows if read_rows(*arrays_of(A), rows) else None

    @cached_property
    def diagonal(self) -> np.ndarray:
        return self.A.diagonal()

    @cached_property
    def slopes(self) -> np.ndarray:
        """diag(A), 1 where that is not positive: the scaling, and Omega of s."""
        return np.where(self.diagonal > 0.0, self.diagonal, 1.0)

    @cached_property
    def stamp(self) -> int:
        """The hash of the entries of A when it was first asked for."""
        return self.stamp_now()

    def stamp_now(self) -> int:
        values = self.A.data if self.is_sparse else self.A
        return stamp_of((values,)) if type(values) is np.ndarray else 0

    @cached_property
    def is_general(self) -> bool:
        """Whether an a_ii <= 0 proves that A is neither P nor semidefinite.

        No P-matrix has one. If also (A + A')_ij is not 0 for some j, or a_ii < 0, then
        x'A x < 0 for x = t e_i + r with any r that has (A r + A'r)_i != 0 and a large
        t of the right sign.
        """
        A, diagonal = self.A, self.diagonal
        if (diagonal > 0.0).all():
            return False
        r = np.random.default_rng(0).uniform(1.0, 2.0, diagonal.size)
        slope, size = A @ r + A.T @ r, abs(A) @ r + abs(A.T) @ r
        falls = np.abs(slope) > DIAGONAL_ROUNDING * size
        return bool((falls & (diagonal == 0.0) | (diagonal < 0.0)).any())

    @cached_property
    def root(self) -> np.ndarray:
        """sqrt(slopes): diag(1/root) A diag(1/root) is A scaled to a unit diagonal."""
        return np.sqrt(self.slopes)

    @cached_property
    def compact(self) -> Any:
        """A in the layout in which its factors take less time: dense or CSR."""
        A, n = self.A, self.n
        if isinstance(A, np.ndarray):
            sparse_enough = n > DENSE_ORDER and np.count_nonzero(A) < SPARSE * n * n
            return sparse.csr_array(A) if sparse_enough else A
        return A.toarray() if n <= DENSE_ORDER or A.nnz >= SPARSE * n * n else A

    @cached_property
    def columns(self) -> Any:
        """Its columns for pivoting: rows of a dense array, or the arrays of CSC.

        Columns, as a change of one unknown adds a multiple of its own one to w. Those
        of a symmetric matrix are its rows, so that no copy is made.
        """
        A, n = self.A, self.n
        if isinstance(A, np.ndarray):
            is_dense = n <= 4 * SMALL_ORDER or np.count_nonzero(A) >= n * n // 8
            A = A if is_dense else as_sparse(A)
        else:
            is_dense = n <= SMALL_ORDER or A.nnz > n * n // 4
            A = A.toarray() if is_dense else A
        if is_dense:
            return np.ascontiguousarray(A if self.symmetric else A.T)
        if not self.symmetric and A.format == "csr":
            return transposed(*arrays_of(A), n)
        return arrays_of(A)

    @cached_property
    def dominance(self) -> float:
        """Largest row sum of |I - D^(-1/2) A D^(-1/2)|, inf unless diag(A) > 0; A CSR.

        It bounds rho(|I - D^-1 A|): below 1, A is an H+ matrix.
        """
        if not np.all(self.diagonal > 0.0):
            return np.inf
        own, others, _ = sums = np.empty((3, self.n))
        row_sums(*arrays_of(self.A), 1.0 / self.root, 0.0, 0.0, *sums)
        return float(np.max(others / own, initial=0.0))

    @cached_property
    def second_colour(self) -> np.ndarray | None:
        """Marks of rows of a sparse A so that no two coupled ones have the same."""
        second = np.zeros(self.n, np.uint8)
        return second if two_colours(self.A.indptr, self.A.indices, second) else None


class Operator:
    """A symmetric matrix A known by x -> A x, with a diagonal of ones unless given.

    It replaces an array where only A @ x, A.shape and A.diagonal() are used.
    """

    def __init__(self, A: LinearOperator, diagonal: Any):
        self.A, self.shape = A, A.shape
        n = A.shape[0]
        if A.shape[1] != n:
            raise ValueError(f"A must be square, got shape {A.shape}")
        if np.dtype(A.dtype or np.float64).kind not in "biuf":
            raise TypeError(f"A must be real, got a LinearOperator of dtype {A.dtype}")
        self.known = diagonal_of("diagonal", diagonal, n, np.ones(n))
        u, v = np.random.default_rng(0).standard_normal((2, n))
        Au, Av, norm = self @ u, self @ v, np.linalg.norm
        with np.errstate(all="ignore"):
            gap = abs(float(u @ Av) - float(v @ Au))
            size = float(norm(u) * norm(Av) + norm(v) * norm(Au))
        if gap > SYMMETRIC * size:
            raise ValueError(
                "A must be symmetric as a LinearOperator: u'Av and v'Au differ by "
                f"{gap / size:.1e} of their size for random u and v"
            )

    def __matmul__(self, x: np.ndarray) -> np.ndarray:
        y = np.asarray(self.A.matvec(x))
        if y.dtype.kind not in "biuf":
            raise TypeError(f"A must be real, got a product of dtype {y.dtype}")
        return np.array(y, dtype=np.float64).reshape(x.shape)

    def diagonal(self) -> np.ndarray:
        return self.known


def diagonal_of(
    name: str, value: Any, n: int, default: np.ndarray, positive: bool = False
) -> np.ndarray:
    """Return a checked (n,) diagonal from an array, a number or None (the default)."""
    if value is None:
        return default
    diagonal = number_or_vector(name, value, n)
    refuse_number(name, diagonal, False)
    wrong = np.flatnonzero(diagonal <= 0.0 if positive else diagonal < 0.0)
    if wrong.size:
        i = wrong[0]
        wanted = "be positive" if positive else "not be negative"
        raise ValueError(f"{name} must {wanted}, got {diagonal[i]:g} at ({i})")
    return diagonal
