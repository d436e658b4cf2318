"""A box LCP: its data, checked and made clean arrays, and its stopping criterion."""

import math
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from namlcp.checks import (
    LEAST_DIVISOR,
    constant,
    number_or_vector,
    refuse_number,
    vector,
    without_huge,
)
from namlcp.lcp.loops import MOST_SMALL, affine, is_ordinary
from namlcp.lcp.prepared import Prepared
from namlcp.limits import Limits
from namlcp.measure import are_met, natural_residuals
from namlcp.residuals import natural_residual
from namlcp.status import Outcome, Status


class LCPPoint(NamedTuple):
    """A point z of an LCP, w = A z + q and, of sweep methods, the modulus variable."""

    z: np.ndarray
    w: np.ndarray
    s: np.ndarray | None = None


# Range of max |q_i| in which q is not scaled: sums of squares neither vanish nor
# overflow there.
LEAST_SIZE, MOST_SIZE = 1e-100, 1e100
# Entry of w = A z + q, relative to |A||z| + |q|, that counts as 0.
W_ROUNDING = 1e-15


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
        is_small = type(A) is np.ndarray and z.size <= MOST_SMALL
        return affine(A, z, self.q) if is_small else A @ z + self.q

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
    """The stopping criterion of "auto" and "multigrid" with the tolerances of `limits`.

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
    z = lcp.start()
    w = lcp.w(z)
    terms = np.abs(lcp.q) + abs(lcp.A) @ np.abs(z)
    w[np.abs(w) <= W_ROUNDING * terms] = 0.0
    return not np.maximum(np.minimum(w, z - lcp.lower), z - lcp.upper).any()


def lcp_data(matrix: Prepared, q: Any, lower: Any, upper: Any) -> tuple[LCP, float]:
    """Check the user's vectors; raise TypeError or ValueError, or return the LCP.

    The number is 1, or a power of 2 near max |q_i| where squares may leave the range.
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
    size = float(np.abs(q).max(initial=0.0))
    is_usual = size == 0.0 or LEAST_SIZE < size < MOST_SIZE
    unit = 1.0 if is_usual else 2.0 ** math.floor(math.log2(size))
    return LCP(matrix, q, lower, upper), unit
