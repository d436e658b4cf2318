"""What depends on the matrix of an LCP alone, found once for one q after another."""

from functools import cached_property
from typing import Any

import numpy as np
from scipy import sparse

from namlcp.lcp.data import lcp_matrix
from namlcp.lcp.multigrid import Hierarchy, build
from namlcp.lcp.relaxation import dominance
from namlcp.lcp.tridiagonal import Tridiagonal, tridiagonal_of
from namlcp.limits import NEVER, Deadline
from namlcp.linalg import Columns, columns_of, is_symmetric


class Prepared:
    """A checked matrix, which `solve_lcp` takes in place of A.

    Parameters
    ----------
    A : (n, n) array, sparse array or scipy LinearOperator
        The matrix of the LCP. It is kept as it is where it is clean float64 (CSR if
        sparse), and must not be changed afterwards.
    diagonal : (n,) array
        diag(A) of a LinearOperator, see `solve_lcp`.

    Raises
    ------
    TypeError, ValueError
        A is no finite square matrix of real numbers.

    Notes
    -----
    What a method needs of A beyond its entries is found at its first use and kept.

    Examples
    --------
    >>> import numpy as np
    >>> from namlcp import Prepared, solve_lcp
    >>> A = Prepared(np.array([[2.0, 1.0], [1.0, 2.0]]))
    >>> [solve_lcp(A, np.array([-5.0, q])).z.round(6).tolist() for q in (-6.0, 1.0)]
    [[1.333333, 2.333333], [2.5, 0.0]]
    """

    levels: Hierarchy | None = None  # see `hierarchy`
    unsuited = False  # whether A is known not to suit multigrid cycles

    def __init__(self, A: Any, diagonal: Any = None):
        self.A = lcp_matrix(A, diagonal)

    @classmethod
    def unchecked(cls, A: Any, symmetric: bool) -> "Prepared":
        """Return a clean matrix prepared, without a look at its entries.

        A may be in CSC if it is symmetric: its columns pass for rows.
        """
        matrix = cls.__new__(cls)
        matrix.A, matrix.symmetric = A, symmetric
        return matrix

    @cached_property
    def symmetric(self) -> bool:
        """A = A' up to rounding."""
        return is_symmetric(self.A)

    def hierarchy(self, deadline: Deadline = NEVER) -> Hierarchy | None:
        """Return levels for multigrid cycles, None where A does not suit.

        None, too, where they were not ready by the deadline: then nothing is kept.
        """
        levels = self.levels  # other threads may set it, and may be late
        if levels is None and not self.unsuited:
            levels = build(sparse.csr_array(self.A), self.symmetric, deadline)
            if levels is not None:
                self.levels = levels
            elif not deadline.reached():
                self.unsuited = True
        return levels

    @cached_property
    def tridiagonal(self) -> Tridiagonal | None:
        """The form of a sparse tridiagonal matrix with a positive diagonal."""
        return None if isinstance(self.A, np.ndarray) else tridiagonal_of(self.A)

    @cached_property
    def slopes(self) -> np.ndarray:
        """diag(A), 1 where that is not positive: the units, and Omega of s."""
        diagonal = self.A.diagonal()
        return np.where(diagonal > 0.0, diagonal, 1.0)

    @cached_property
    def root(self) -> np.ndarray:
        """sqrt(slopes); D^(-1/2) A D^(-1/2) has a unit diagonal, D = root^2."""
        return np.sqrt(self.slopes)

    @cached_property
    def columns(self) -> Columns:
        """The columns of A, for compiled code."""
        return columns_of(self.A, self.symmetric)

    @cached_property
    def dominance(self) -> float:
        """Bound for rho(|I - D^-1 A|), see `relaxation.dominance`."""
        return dominance(self.A)
