"""Is A an H+ matrix? Is a Z-matrix an M-matrix? Answers with a witness.

The comparison matrix of A has <A>_ii = |a_ii|, <A>_ij = -|a_ij|; A is an H+ matrix if
its diagonal is positive and <A> is a nonsingular M-matrix (in this package M-matrices
are nonsingular). With a positive diagonal D and J = D^-1 |A - D|, the Jacobi matrix of
<A>, that is rho(J) < 1. Two inequalities settle it (Berman and Plemmons, Nonnegative
Matrices in the Mathematical Sciences, chapter 6):

    v > 0 and <A> v > 0 exist         <=>  <A> is an M-matrix,
    u >= 0, u != 0 and <A> u <= 0     <=>  it is not.

They exclude each other, because <A>^-1 >= 0 and <A> u <= 0 give u <= 0. The second
always holds where u_i = 0, for there (<A> u)_i = -sum_j |a_ij| u_j. Hence a witness of
one irreducible block of A, padded with zeros, is a witness for A, and so is the unit
vector of a nonpositive diagonal entry.

Every candidate v or u is checked with rigorous error bounds (`signs`), so that no
answer depends on the accuracy of a linear solve. Candidates come, in this order, from

1. v = u = 1, which decides strict dominance by rows, and <A> 1 = 0 (exactly singular);
2. Gauss-Seidel sweeps on <A> v = D 1, as long as they make progress;
3. for moderate n one solve of <A> v = D 1. Wherever <A> is nonsingular this decides:
   v > 0, or u = max(-v, 0) is a witness, since for u_i > 0

       (<A> u)_i = (<A> max(v, 0))_i - d_i = -sum_j |a_ij| max(v_j, 0) - d_i < 0.

4. Noda's iteration on each irreducible block, after balancing (`perron`). With its
   shift lambda = 1 the system would be that of 3; multigrid solves it for large n, only
   as accurately as the decision needs.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import sparse

from namlcp.checks import finite_square_matrix
from namlcp.compiled import kernel, part
from namlcp.limits import interruptible
from namlcp.theory.perron import (
    LARGEST_FACTORED,
    block_vectors,
    comparison_sweep,
    row_numbers,
    solutions,
    with_entries,
)

BATCHES = (2, 2, 4, 8, 16, 32)
"""Symmetric Gauss-Seidel sweeps between two tests of the signs."""

HELP = 0.5
"""Sweeps end after a batch that changed their step by less than a factor of 1/HELP."""

ROUNDOFF = 2.0**-53
"""Unit roundoff: the largest relative error of one operation."""

LEAST_NUMBER = 5e-324
"""Least positive number: the largest absolute error of an operation that underflows."""

SPLITTER = 2.0**27 + 1.0
"""Dekker's factor, which splits a number into two halves of 26 bits."""

NO_EXPONENT = np.empty(0, dtype=np.int64)
"""In place of the exponents of x 2^exponent where they are all 0."""


@dataclass(frozen=True, eq=False, kw_only=True)
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
    witness : (n,) array or None
        What proves the answer; `theorem` says how.
    exponent : (n,) integer array or None
        If not None, `witness` * 2^exponent proves the answer, but leaves the range of
        floating point.
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
    exponent: np.ndarray | None = None
    bound: float = math.nan

    def __bool__(self) -> bool:
        return self.answer is True


@interruptible
def is_h_plus(A: Any) -> Verdict:
    """Tell whether A is an H+ matrix, with a vector that proves it.

    A_ii > 0 and <A> v > 0 for some v > 0,  <A>_ii = |a_ii|, <A>_ij = -|a_ij|

    Then LCP(q, A), with any bounds, has exactly one solution for every q, and projected
    relaxation and the modulus methods with Omega >= D converge to it.

    Parameters
    ----------
    A : (n, n) array or sparse array

    Returns
    -------
    Verdict
        True: witness v > 0 with <A> v > 0. False: witness u >= 0, u != 0, with D u <=
        |A - D| u (<A> u <= 0 where the diagonal is positive); the unit vector e_i if
        a_ii <= 0. Both inequalities hold exactly for the stored numbers. None: rho(J),
        J = D^-1 |A - D|, is too close to 1 (|rho(J) - 1| <= 1e-10), or for n > 20 000
        multigrid failed. `bound` is the largest (J v)_i / v_i for True, and the least
        (J u)_i / u_i for False.

    Raises
    ------
    TypeError, ValueError
        A is not a square matrix of finite real numbers.

    Notes
    -----
    `namlcp.theory.comparison` describes the method. If A is strictly dominant one pass
    over A suffices, otherwise a few sweeps or one linear solve.

    Examples
    --------
    >>> import numpy as np
    >>> from namlcp import is_h_plus
    >>> A = np.array([[2.0, 3.0], [-1.0, 2.0]])
    >>> bool(is_h_plus(A))
    True
    >>> is_h_plus(A - np.eye(2)).answer
    False
    """
    A = finite_square_matrix("A", A, "csr")
    return settle(sparse.csr_array(A), "A is an H+ matrix")


def is_m_matrix(K: Any) -> Verdict:
    """Tell whether K is a nonsingular M-matrix: k_ij <= 0 off the diagonal, K^-1 >= 0.

    Witnesses are as for `is_h_plus`, with K in place of <A>. There is none for a
    positive entry k_ij off the diagonal, which `checked` names.
    """
    K = sparse.csr_array(finite_square_matrix("K", K, "csr"))
    rows = row_numbers(K)
    wrong = np.flatnonzero((K.data > 0.0) & (rows != K.indices))
    name = "K is a nonsingular M-matrix"
    if wrong.size:
        t = wrong[0]
        place = f"K[{rows[t]}, {K.indices[t]}] = {K.data[t]:g} > 0"
        return Verdict(answer=False, theorem=f"{name}: no Z-matrix", checked=place)
    return settle(K, name)


def settle(A: Any, claim: str) -> Verdict:
    """Return the verdict on `claim`: diag(A) - |A - diag(A)| is an M-matrix."""
    D = A.diagonal()
    wrong = np.flatnonzero(~(D > 0.0))
    if wrong.size:
        i = wrong[0]
        return Verdict(
            answer=False,
            theorem=f"{claim}: no, an M-matrix has a positive diagonal",
            checked=f"entry ({i}, {i}) is {D[i]:g}",
            witness=np.where(np.arange(D.size) == i, 1.0, 0.0),
        )
    checked = ""
    with np.errstate(all="ignore"):
        for source, x, exponent, bounds in candidates(A, D):
            verdict = verdict_by(A, x, exponent, claim, source)
            if verdict is not None:
                return verdict
            checked = f"rho(J) of an irreducible block lies in about {bounds}"
    return Verdict(answer=None, theorem=f"{claim}: not decided", checked=checked)


def candidates(
    A: Any, D: np.ndarray
) -> Iterator[tuple[str, np.ndarray, np.ndarray, str]]:
    """Yield (source, x, exponent, bounds of rho(J) as text), the cheapest first."""
    ones = np.ones(D.size)
    yield "v = 1", ones, NO_EXPONENT, ""
    for x in swept(A, ones):
        yield "Gauss-Seidel sweeps", x, NO_EXPONENT, ""
    if D.size <= LARGEST_FACTORED:  # beyond it Noda's first system does as well
        for x in solutions(scaled_comparison(A, D), ones):
            yield "one linear solve", x, NO_EXPONENT, ""
    for x, exponent, low, high in block_vectors(A, D):
        yield "Noda's iteration", x, exponent, f"[{low:.15g}, {high:.15g}]"


def verdict_by(
    A: Any, x: np.ndarray, exponent: np.ndarray, claim: str, source: str
) -> Verdict | None:
    """Return the verdict if x 2^exponent, or its negative part, is a witness."""
    if x.size < A.shape[0]:
        return None
    if np.any(x < 0.0):
        x = np.maximum(-x, 0.0)
    if not np.all(np.isfinite(x)):
        return None
    above, below, largest, least = signs(A.indptr, A.indices, A.data, x, exponent)
    if above:
        theorem, answer, bound = "v > 0, <A> v > 0", True, min(largest, 1.0 - ROUNDOFF)
        checked = f"{source}: rho(J) <= {bound:.17g}, the largest (Jv)_i / v_i"
    elif below:
        theorem, answer, bound = "u >= 0, u != 0, <A> u <= 0", False, max(least, 1.0)
        checked = f"{source}: rho(J) >= {bound:.17g}, the least (Ju)_i / u_i"
    else:
        return None
    power = None
    if exponent.size:
        scaled = np.ldexp(x, exponent - exponent[x > 0.0].max())
        if scaled[x > 0.0].min() > 1e-200:  # products with it do not underflow
            x = scaled
        else:
            power = exponent
    theorem = f"{claim}: {theorem} (Berman and Plemmons, ch. 6)"
    return Verdict(
        answer=answer,
        theorem=theorem,
        checked=checked,
        witness=x,
        exponent=power,
        bound=bound,
    )


@kernel
def signs(indptr, indices, data, x, exponent):
    """Return the signs of K y, K = D - |A - D|, y = x 2^exponent >= 0, and bounds of J.

    Returns (K y > 0, K y <= 0 where y > 0, max (J y)_i / y_i, min (J y)_i / y_i), the
    quotients over y_i > 0. NaN stands for both where neither sign holds. The signs are
    those of the exact numbers: a row's plain sum of k terms t is off by at most (k + 1)
    u sum |t| (Higham, Accuracy and Stability, section 3.1), and underflow adds less
    than 4 k times the least number. Where that does not settle the sign, the row is
    summed again with its rounding errors (`exact_row`).
    """
    above, below = True, False
    largest, least = 0.0, np.inf
    for i in range(x.size):
        if not x[i] > 0.0:
            above = False
            continue
        d, off = 0.0, 0.0
        for k in range(indptr[i], indptr[i + 1]):
            j = indices[k]
            if j == i:
                d = data[k] * x[i]
            elif x[j] > 0.0:
                t = abs(data[k])
                if exponent.size > 0:
                    t = math.ldexp(t, exponent[j] - exponent[i])
                off += t * x[j]
        if not off < np.inf:
            return False, False, np.nan, np.nan
        count = indptr[i + 1] - indptr[i] + 3
        margin = count * (2.0 * ROUNDOFF * (d + off) + 4.0 * LEAST_NUMBER)
        low = high = d - off
        if not abs(low) > margin:
            low, high = exact_row(indptr, indices, data, i, x, exponent)
        else:
            low -= margin
            high += margin
        if not low > 0.0:
            above = False
        if high <= 0.0:
            below = True
        else:
            least = -1.0
        if not above and least < 0.0:
            return False, False, np.nan, np.nan
        quotient = off / d
        largest = max(largest, quotient)
        if least >= 0.0:
            least = min(least, quotient)
    return above, below and least >= 0.0, largest, least


@part
def exact_row(indptr, indices, data, i, x, exponent):
    """Return rigorous bounds of (K y)_i, which are equal where nothing was rounded.

    Products and sums are computed with their rounding errors (Dekker, Numer. Math. 18
    (1971) 224-242). The errors are added up, and the rounding of that sum is bounded.
    """
    total, error = 0.0, 0.0
    size, lost = 0.0, 0.0  # sum of the errors' moduli; bound of errors not computed
    for k in range(indptr[i], indptr[i + 1]):
        j = indices[k]
        if not x[j] > 0.0 or data[k] == 0.0:
            continue
        a = data[k] if j == i else -abs(data[k])
        b = x[j]
        if exponent.size > 0:
            b = math.ldexp(b, exponent[j] - exponent[i])
        p = a * b
        if abs(p) > 1e-260 and abs(a) < 1e150 and b < 1e150 and b > 1e-290:
            c = SPLITTER * a
            ah = c - (c - a)
            c = SPLITTER * b
            bh = c - (c - b)
            al = a - ah
            bl = b - bh
            e = al * bl - (((p - ah * bh) - al * bh) - ah * bl)
        else:
            e = 0.0
            lost += abs(p) * 4.0 * ROUNDOFF + 4.0 * LEAST_NUMBER * (1.0 + abs(a))
        s = total + p
        t = s - total
        f = (total - (s - t)) + (p - t)
        total = s
        error += e
        error += f
        size += abs(e) + abs(f)
    count = 2.0 * (indptr[i + 1] - indptr[i]) + 4.0
    margin = 2.0 * ROUNDOFF * count * size + lost
    whole = total + error
    if margin > 0.0:
        margin += 2.0 * ROUNDOFF * abs(whole)
    elif error != 0.0:
        margin = 2.0 * ROUNDOFF * abs(whole)
    return whole - margin, whole + margin


@kernel
def exact_dominance(indptr, indices, data):
    """Tell whether a_ii >= sum_{j != i} |a_ij| holds exactly in every row."""
    n = indptr.size - 1
    ones = np.ones(n)
    for i in range(n):
        low, _ = exact_row(indptr, indices, data, i, ones, NO_EXPONENT)
        if not low >= 0.0:
            return False
    return True


def swept(A: Any, ones: np.ndarray) -> Iterator[np.ndarray]:
    """Yield v after batches of sweeps on <A> v = D 1, while they make progress."""
    v = ones.copy()
    before = math.inf
    for sweeps in BATCHES:
        step = math.inf
        for _ in range(sweeps):
            step = comparison_sweep(A.indptr, A.indices, A.data, ones, v)
        if not step < 1e100:
            return
        yield v
        if before < math.inf and HELP * before < step < before / HELP:
            return
        before = step


def scaled_comparison(A: Any, D: np.ndarray) -> Any:
    """Return I - J = D^-1 <A>."""
    rows = row_numbers(A)
    data = -np.abs(A.data) / D[rows]
    data[rows == A.indices] = 1.0
    return with_entries(A, data)
