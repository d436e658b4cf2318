"""Is A an H+ matrix? Answers with a witness.

The comparison matrix of A has <A>_ii = |a_ii|, <A>_ij = -|a_ij|; A is an H+ matrix if
its diagonal is positive and <A> is a nonsingular M-matrix (in this package M-matrices
are nonsingular). With a positive diagonal D and J = D^-1 |A - D|, the Jacobi matrix of
<A>, that is rho(J) < 1. Two inequalities settle it (Berman and Plemmons, Nonnegative
Matrices in the Mathematical Sciences, chapter 6):

    v > 0 and <A> v > 0 exist         <=>  <A> is an M-matrix,
    u >= 0, u != 0 and <A> u <= 0     <=>  it is not.

The second always holds where u_i = 0. So u may be a vector x > 0 on some rows alone:
those where (J x)_i >= x_i, less those that this makes fail, and so on.

Candidates are v = u = 1, which decides strict dominance by rows, power steps, and
solutions of

    (lambda I - J) y = x,   x > 0.                                                   (1)

If lambda > rho(J), y > 0 and J y = lambda y - x < lambda y. If not, u = max(-y, 0) has
J u >= lambda u, since J u >= -J y = x - lambda y. So (1) decides with lambda = 1 -+
`BESIDE`, unless rho(J) lies between the two. With lambda = max (J x)_i / x_i >= rho(J)
(Collatz and Wielandt) it is a step of Noda's iteration (Numer. Math. 17 (1971) 382-386)
towards a Perron vector of J; multigrid, for large systems, needs such a lambda. Every
candidate is checked in exact arithmetic.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from namlcp.checks import finite_square_matrix
from namlcp.lcp.loops import row_sums
from namlcp.lcp.multigrid.hierarchy import VCycle, coarsen
from namlcp.limits import NEVER
from namlcp.linalg.csc import arrays_of
from namlcp.linalg.factors import asymmetry

# The largest errors of one operation: relative, and absolute where it underflows.
ROUNDOFF, LEAST_NUMBER = 2.0**-53, 5e-324
# Most vectors u, each with fewer rows than the one before.
RESTRICTIONS = 11
# Power steps of a round; they go on while a round reduces log(max/min) of (J x)_i / x_i
# below POWER_HELPS times.
POWERS, POWER_HELPS = 10, 0.7
# Distance from 1 of lambda in (1).
BESIDE = 1e-13
# Least entry of an x whose largest one is 1, and the factor of the right-hand side of a
# system whose solution exceeds the range of floating point.
LEAST_ENTRY, TINY = 1e-250, 2.0**-900
# Largest order at which (1) is factored: multigrid solves larger systems.
LARGEST_FACTORED = 20_000
# Most steps with multigrid cycles for one system, and the residual at which they end,
# relative to the right-hand side: for a proof its entries must be below those of x.
STEPS, RESIDUAL = 16, 1e-3


@dataclass(frozen=True, eq=False)
class Verdict:
    """An answer with its reason. `bool(verdict)` is True only where it is proven.

    Attributes
    ----------
    answer : bool or None
        None: not decided.
    theorem : str
        The statement that decides, with its source.
    checked : str
        What was computed, and what came out.
    witness : array or None
        What proves the answer; `theorem` says how.
    bound : float
        Bound of the spectral radius that the theorem is about: an upper bound (below 1)
        for True, a lower bound (at least 1) for False; NaN where there is none.

    Examples
    --------
    >>> import numpy as np
    >>> import namlcp
    >>> verdict = namlcp.is_h_plus(np.array([[2.0, -1.0], [-1.0, 2.0]]))
    >>> bool(verdict), verdict.answer, verdict.witness.shape
    (True, True, (2,))
    """

    answer: bool | None
    theorem: str
    checked: str
    witness: np.ndarray | None = None
    bound: float = math.nan

    def __bool__(self) -> bool:
        return self.answer is True


def is_h_plus(A: Any) -> Verdict:
    """Tell whether A is an H+ matrix, with a vector that proves it.

    A_ii > 0 and <A> v > 0 for some v > 0,  <A>_ii = |a_ii|, <A>_ij = -|a_ij|

    Then LCP(q, A), with any bounds, has exactly one solution for every q, and projected
    SOR and, with Omega >= D, modulus SOR converge to it if alpha <= 1.

    Parameters
    ----------
    A : (n, n) array or sparse array

    Returns
    -------
    Verdict
        True: witness v > 0 with <A> v > 0. False: witness u >= 0, u != 0, with D u <=
        |A - D| u (<A> u <= 0 where the diagonal is positive); the unit vector e_i if
        a_ii <= 0. Both inequalities hold exactly for the stored numbers. None: rho(J),
        J = D^-1 |A - D|, is too close to 1 (|rho(J) - 1| <= 1e-10), a witness leaves
        the range of floating point, or for n > 20 000 multigrid failed. `bound` is the
        largest (J v)_i / v_i for True, and the least (J u)_i / u_i for False.

    Raises
    ------
    TypeError, ValueError
        A is not a square matrix of finite real numbers.

    Examples
    --------
    >>> import numpy as np
    >>> from namlcp import is_h_plus
    >>> A = np.array([[2.0, 3.0], [-1.0, 2.0]])
    >>> is_h_plus(A).answer, is_h_plus(A - np.eye(2)).answer
    (True, False)
    """
    A = finite_square_matrix("A", A, "csr")
    return settle(sparse.csr_array(A), "A is an H+ matrix")


def settle(A: Any, claim: str) -> Verdict:
    """Return the verdict on `claim`: diag(A) - |A - diag(A)| is an M-matrix.

    A is a csr_array, the witness as for `is_h_plus`.
    """
    D = A.diagonal()
    wrong = np.flatnonzero(~(D > 0.0))
    if wrong.size:
        i = wrong[0]
        theorem = f"{claim}: no, an M-matrix has a positive diagonal"
        unit = np.where(np.arange(D.size) == i, 1.0, 0.0)
        return Verdict(False, theorem, f"entry ({i}, {i}) is {D[i]:g}", unit)
    checked = ""
    with np.errstate(all="ignore"):
        for source, y in candidates(A, D):
            for _ in range(RESTRICTIONS):
                above, below, quotient = signs(A, y)
                rest = np.where(quotient >= 1.0, y, 0.0)
                if above or below or not rest.any() or np.array_equal(rest, y):
                    break
                y = rest
            least = float(quotient[y > 0.0].min(initial=math.inf))
            largest = float(quotient[y > 0.0].max(initial=0.0))
            if above:
                theorem, bound = "v > 0, <A> v > 0", min(largest, 1.0 - ROUNDOFF)
                checked = f"{source}: rho(J) <= {bound:.17g}, the largest (Jv)_i / v_i"
            elif below:
                theorem, bound = "u >= 0, u != 0, <A> u <= 0", max(least, 1.0)
                checked = f"{source}: rho(J) >= {bound:.17g}, the least (Ju)_i / u_i"
            else:
                checked = f"(Jx)_i / x_i lies in [{least:.15g}, {largest:.15g}]"
                continue
            theorem = f"{claim}: {theorem} (Berman and Plemmons, ch. 6)"
            return Verdict(above, theorem, checked, y, bound)
    return Verdict(None, f"{claim}: not decided", checked)


def candidates(A: Any, D: np.ndarray) -> Iterator[tuple[str, np.ndarray]]:
    yield "v = 1", np.ones(D.size)
    rows = np.repeat(np.arange(D.size), np.diff(A.indptr))
    root = np.sqrt(D)  # a similar matrix, symmetric where A is
    J = abs(A)
    J.data /= root[rows] * root[A.indices]
    J.data[rows == A.indices] = 0.0
    x, gap = np.ones(D.size), math.inf
    while True:
        scale = ((J @ x) / x).max()
        for _ in range(POWERS if scale > 0.0 else 0):
            x = (J @ x) / scale + 0.5 * x
        x = np.maximum(x / x.max(), LEAST_ENTRY)
        yield "power steps", x / root
        quotient = (J @ x) / x
        low, high = quotient.min(), quotient.max()
        before, gap = gap, math.log(high / low) if low > 0.0 else math.inf
        if not gap < POWER_HELPS * before:
            break
    shifts = [1.0 - BESIDE, 1.0 + BESIDE]
    for shift in shifts if D.size <= LARGEST_FACTORED else [math.inf, *shifts]:
        scaled = sparse.diags_array(1.0 / x) @ J @ sparse.diags_array(x)
        largest = float((scaled @ np.ones(x.size)).max()) * (1.0 + 1e-15)
        try:
            y = solution(scaled, min(shift, largest))
        except (RuntimeError, np.linalg.LinAlgError):
            continue
        if np.all(np.isfinite(y)) and y.any():
            part = np.maximum(-y, 0.0) if np.any(y < 0.0) else y
            yield "a solution of (1)", x * part / root
            x = x * np.abs(y)
            x = np.maximum(x / x.max(), LEAST_ENTRY)


def signs(A: Any, x: np.ndarray) -> tuple[bool, bool, np.ndarray]:
    """Return whether K x > 0, whether K x <= 0 where x > 0, and (J x)_i / x_i.

    K = D - |A - D|, x >= 0. The signs are those of the exact numbers: where bounds of
    rounding errors do not settle one, the row is summed in rational arithmetic.
    """
    own, others, margin = sums(A, x)
    value, inside = own - others, x > 0.0
    if not np.all(np.isfinite(value)) or (x.size and not inside.any()):
        return False, False, np.full(x.size, math.nan)
    positive, negative = value > margin, value <= -margin
    doubtful = np.flatnonzero(inside & ~positive & ~negative)
    above = bool(inside.all() and not negative.any())
    below = bool(x.size and not positive[inside].any())
    above = above and all(exact_row(A, i, x) > 0 for i in doubtful)
    below = below and all(exact_row(A, i, x) <= 0 for i in doubtful)
    return above, below, others / own


def sums(A: Any, x: np.ndarray) -> np.ndarray:
    found = np.empty((3, x.size))
    row_sums(*arrays_of(A), x, ROUNDOFF, LEAST_NUMBER, *found)
    return found


def exact_row(A: Any, i: Any, x: np.ndarray) -> Fraction:
    row = slice(A.indptr[i], A.indptr[i + 1])
    total = Fraction(0)
    for j, a in zip(A.indices[row].tolist(), A.data[row].tolist(), strict=True):
        term = abs(Fraction(a)) * Fraction(x[j])
        total += term if j == i else -term
    return total


def is_weakly_dominant(A: Any) -> bool:
    """Tell whether |a_ii| >= sum_{j != i} |a_ij| holds exactly in every row."""
    ones = np.ones(A.shape[0])
    own, others, margin = sums(A, ones)
    doubtful = np.flatnonzero(own - others < margin)
    return all(exact_row(A, i, ones) >= 0 for i in doubtful)


def solution(J: Any, shift: float) -> np.ndarray:
    """Return an approximation of (shift I - J)^-1 1, up to a positive factor."""
    n = J.shape[0]
    b = np.ones(n)
    K = sparse.csr_array(sparse.diags_array(np.full(n, shift)) - J)
    if n > LARGEST_FACTORED:
        symmetric = asymmetry(K)[0] == 0.0
        levels = coarsen(K, symmetric, False, NEVER)
        if levels is None:  # K is not an M-matrix
            return np.zeros(n)
        goal = RESIDUAL * math.sqrt(n)
        return VCycle(levels, symmetric).krylov(0, b, goal, STEPS)
    factor = splu(
        sparse.csc_array(K),
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,  # pivots from the diagonal: these need no scaling
        options={"SymmetricMode": True},
    )
    y = factor.solve(b)
    return y if np.all(np.isfinite(y)) else factor.solve(TINY * b)
