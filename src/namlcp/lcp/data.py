"""The data of box LCPs, checked and made clean arrays, and their stopping criterion."""

import math
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import LinearOperator

from namlcp.arrays import stamp_of, transposed
from namlcp.checks import (
    LEAST_DIVISOR,
    as_sparse,
    constant,
    finite_square_matrix,
    number_or_vector,
    refuse_number,
    vector,
    without_huge,
)
from namlcp.lcp.loops import MOST_SMALL, affine, is_ordinary, row_sums, two_colours
from namlcp.lcp.tridiagonal import read_rows
from namlcp.limits import Limits
from namlcp.linalg.csc import arrays_of
from namlcp.linalg.factors import is_symmetric
from namlcp.measure import are_met, natural_residuals
from namlcp.residuals import natural_residual
from namlcp.status import Outcome, Status

# Sum of (A + A')_ij r_j, relative to its terms, that counts as 0 where a_ii = 0.
DIAGONAL_ROUNDING = 1e-10
# Order up to which matrices are factored as dense ones, and share of entries that are
# not 0 from which on larger ones are, too.
DENSE_ORDER, SPARSE = 250, 0.125
# Largest order of a sparse matrix that pivoting always takes as a dense one: from 80 on
# contact problems take longer so.
SMALL_ORDER = 64
# Largest |u'Av - v'Au| that counts as zero for two fixed random vectors, relative to
# |u||Av| + |v||Au|: it allows for products in single precision.
SYMMETRIC = 1e-7
# Range of max |q_i| in which q is not scaled: sums of squares neither vanish nor
# overflow there.
LEAST_SIZE, MOST_SIZE = 1e-100, 1e100
# Entry of w = A z + q, relative to |A||z| + |q|, that counts as 0.
W_ROUNDING = 1e-15


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
        else:
            raise ValueError(
                "diagonal is for a LinearOperator; other matrices have theirs"
            )

    def hold(self, A: Any) -> None:
        self.A, self.n, self.is_sparse = A, A.shape[0], sparse.issparse(A)

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
    def small(self) -> Any:
        """A, dense if it is of small order: then `solve_small` takes less time."""
        is_small = self.is_sparse and self.n <= SMALL_ORDER and self.tridiagonal is None
        return self.compact if is_small else self.A

    @cached_property
    def columns(self) -> Any:
        """Its columns for pivoting: rows of a dense array, or the arrays of CSC.

        Those of a symmetric matrix are its rows, so that no copy is made.
        """
        A, n = self.A, self.n
        if isinstance(A, np.ndarray):
            is_dense = n <= MOST_SMALL or np.count_nonzero(A) >= n * n // 8
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
    """A symmetric matrix A known by x -> A x, with a diagonal of ones unless given."""

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
            unit = float(np.abs((Au, Av)).max(initial=0.0)) or 1.0  # squares vanish
            gap = abs(float(u @ Av) - float(v @ Au)) / unit
            size = float(norm(u) * norm(Av / unit) + norm(v) * norm(Au / unit))
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


class LCPPoint(NamedTuple):
    """A point z of an LCP, w = A z + q and, of sweep methods, the modulus variable."""

    z: np.ndarray
    w: np.ndarray
    s: np.ndarray | None = None


class LCP(NamedTuple):
    """A checked box LCP, see `solve_lcp`; its vectors are (n,) arrays of float64."""

    matrix: Prepared
    q: np.ndarray
    lower: np.ndarray
    upper: np.ndarray

    @property
    def A(self) -> Any:
        return self.matrix.A

    def w(self, z: np.ndarray) -> np.ndarray:
        A = self.matrix.A
        if type(A) is np.ndarray and z.size <= MOST_SMALL:
            return affine(A, z, self.q)
        w = A @ z
        w += self.q
        return w

    def start(self, z0: np.ndarray | None = None) -> np.ndarray:
        """Return z0, or 0 if it is None, clipped to the bounds: a new array."""
        z = np.zeros(self.q.size) if z0 is None else z0.copy()
        return np.clip(z, self.lower, self.upper, out=z)

    def residual(self, z: np.ndarray, w: np.ndarray) -> float:
        return natural_residual(z, w, self.lower, self.upper)

    def active(self, z: np.ndarray) -> int:
        return int(np.count_nonzero((z == self.lower) | (z == self.upper)))

    def outcome(
        self,
        status: Status,
        z: np.ndarray,
        w: np.ndarray,
        iterations: int,
        method: str,
        message: str = "",
        ray: np.ndarray | None = None,
        s: np.ndarray | None = None,
    ) -> Outcome:
        point, residual = LCPPoint(z, w, s), self.residual(z, w)
        return Outcome(status, point, residual, iterations, method, message, ray)


class Criterion:
    """The stopping criterion of all but the sweep methods, with tolerances of `limits`.

    A point z solves a box LCP if Res(z) < eps_abs for the problem as given, or if
    Res(z) <= eps_rel Res(clip(0)) for the problem scaled to a unit diagonal.
    """

    def __init__(self, lcp: LCP, limits: Limits):
        self.lcp, self.limits = lcp, limits
        self.root = lcp.matrix.root

    def residuals(self, z: np.ndarray, w: np.ndarray) -> tuple[float, float]:
        """Return Res(z) of the problem as given and scaled to a unit diagonal."""
        return natural_residuals(z, w, self.lcp.lower, self.lcp.upper, self.root)

    @cached_property
    def size(self) -> float:
        """Res(clip(0)) of the problem scaled to a unit diagonal."""
        z = self.lcp.start()
        return self.residuals(z, self.lcp.w(z) if z.any() else self.lcp.q)[1]

    @cached_property
    def goal(self) -> float:
        """Estimate of the largest Res of the scaled problem that `accepts` accepts."""
        largest = float(self.root.max(initial=LEAST_DIVISOR))
        return max(self.limits.eps_rel * self.size, self.limits.eps_abs / largest)

    def accepts(self, z: np.ndarray, w: np.ndarray) -> bool:
        return self.met(*self.residuals(z, w))

    def met(self, plain: float, scaled: float) -> bool:
        return are_met(*self.limits.tolerances, self.size, plain, scaled)


def is_solved_by_zero(lcp: LCP) -> bool:
    """Tell whether z = clip(0) is a solution but for the rounding of w."""
    w = lcp.w(z := lcp.start())
    terms = np.abs(lcp.q) + abs(lcp.A) @ np.abs(z)
    w[np.abs(w) <= W_ROUNDING * terms] = 0.0
    return not np.maximum(np.minimum(w, z - lcp.lower), z - lcp.upper).any()


def lcp_data(matrix: Prepared, q: Any, lower: Any, upper: Any) -> tuple[LCP, float]:
    """Check the user's vectors; raise TypeError or ValueError, or return the LCP.

    The number is 1, or a power of 2 near max |q_i| where squares may leave the range,
    near that of w at clip(0) where q is tiny.
    """
    shape = matrix.A.shape
    n = shape[1]
    q = vector("q", q, n, "A", shape)
    lower = constant(n, 0.0) if lower is None else number_or_vector("lower", lower, n)
    upper = (
        constant(n, np.inf) if upper is None else number_or_vector("upper", upper, n)
    )
    if is_ordinary(q, lower, upper):
        return LCP(matrix, q, lower, upper), 1.0
    refuse_number("q", q, False)
    refuse_number("lower", lower, True)
    refuse_number("upper", upper, True)
    lower, upper = without_huge(lower, -1.0), without_huge(upper, 1.0)
    wrong = np.flatnonzero((lower > upper) | (lower == np.inf) | (upper == -np.inf))
    if wrong.size:
        i = wrong[0]
        raise ValueError(
            "lower must not exceed upper, lower be < inf and upper > -inf, "
            f"got lower[{i}] = {lower[i]:g}, upper[{i}] = {upper[i]:g} "
            "(from 1e20 on, no bound)"
        )
    lcp = LCP(matrix, q, lower, upper)
    size = float(np.abs(q).max(initial=0.0))
    if 0.0 < size <= LEAST_SIZE:
        with np.errstate(all="ignore"):
            size = float(np.abs(lcp.w(lcp.start())).max())
    is_extreme = 0.0 < size <= LEAST_SIZE or MOST_SIZE <= size < math.inf
    return lcp, 2.0 ** math.floor(math.log2(size)) if is_extreme else 1.0
