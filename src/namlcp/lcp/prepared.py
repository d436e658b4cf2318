"""What depends on the matrix of an LCP alone, found once for one q after another."""

from functools import cached_property
from typing import Any

from namlcp.checks import asymmetry
from namlcp.lcp.data import lcp_matrix

ROUNDING = 1e-14
"""Asymmetry of A below this times max|A| is rounding."""


class Prepared:
    """A checked matrix, which `solve_lcp` takes in place of A.

    Parameters
    ----------
    A : (n, n) array or sparse array
        The matrix of the LCP. It is kept as it is where it is clean float64 (CSR if
        sparse), and must not be changed afterwards.

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

    def __init__(self, A: Any):
        self.A = lcp_matrix(A)

    @cached_property
    def symmetric(self) -> bool:
        """A = A' up to rounding."""
        gap, size = asymmetry(self.A)
        return gap <= ROUNDING * size
