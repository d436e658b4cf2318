"""The sweep methods as splittings A = M - N, and what kind of splittings they are.

(M + Omega) s+ = N s + (Omega - A) R(s) - 2 q,  R(s) = 2 clip(s, l, u) - s           (1)

For nam* this is the paper's Method 3.1, with M and N here for its M + E - L and N + E -
L; the accelerated family has L R(s+) in place of L R(s). M-, H- and H-compatible
splittings are those of Frommer and Szyld, Numer. Math. 63 (1992) 345-356.
"""

import math
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from scipy import sparse

from namlcp.checks import finite_square_matrix, square_matrix
from namlcp.lcp import (
    METHODS,
    Parameters,
    checked_parameters,
    find_method,
)
from namlcp.theory.comparison import Verdict, is_h_plus, is_m_matrix
from namlcp.theory.perron import row_numbers

SAFE = 1e-13
"""Bound for the rounding errors of the entries of K, relative to their terms."""


class Splitting(NamedTuple):
    """A method on a matrix: the quantities of (1), and those of its sweep.

    A, M and N are those of (1), E and L included; csr_array. omega is the diagonal of
    Omega. alpha, G and H are those of `namlcp.lcp.modulus.sweeps` where M is
    triangular; G is NaN where M = A or A + E - L. H = 0 except in the accelerated
    family.
    """

    A: Any
    M: Any
    N: Any
    omega: np.ndarray
    alpha: float
    G: float
    H: float


class Comparison(NamedTuple):
    """C and W with T <= C^-1 W; `exact` is True only if these are equal."""

    C: Any
    W: Any
    exact: bool


class TheoremThree(NamedTuple):
    """The hypotheses of the paper's Theorem 3, and of its repair; see `theorem_3`."""

    h_plus: Verdict
    h_compatible: Verdict
    case_1: Verdict
    case_2_stated: Verdict
    case_2_proved: Verdict
    repaired: Verdict

    @property
    def applies(self) -> bool:
        """Tell whether the theorem, as stated, proves convergence."""
        case = self.case_1 or self.case_2_stated
        return bool(self.h_plus and self.h_compatible and case)

    @property
    def applies_as_proved(self) -> bool:
        """Tell whether it proves convergence with the matrix that its proof uses."""
        case = self.case_1 or self.case_2_proved
        return bool(self.h_plus and self.h_compatible and case)


def splitting(
    A: Any,
    method: str,
    *,
    alpha: float | None = None,
    beta: float | None = None,
    omega: Any = None,
    shift: Any = None,
) -> Splitting:
    """Return the splitting of a method, checked; arguments as in `converges`."""
    chosen = find_method(method, alpha=alpha, beta=beta, omega=omega, shift=shift)
    for name, value in (("alpha", alpha), ("omega", omega)):
        if isinstance(value, str):
            raise ValueError(
                f"{name} must be given in numbers, got {value!r}: no theorem is about "
                "parameters that change from sweep to sweep"
            )
    if method not in METHODS:
        raise ValueError(f"method must be a sweep method, got {method!r}")
    A = finite_square_matrix("A", A, "csr")
    n = A.shape[0]
    given = checked_parameters(A, method, Parameters(alpha, beta, omega, shift))
    alpha, beta, omega, shift, _ = given
    E = np.zeros(n) if shift is None else shift
    A = sparse.csr_array(A)
    if chosen.factored:
        addition = sparse.diags_array(E) + chosen.own * sparse.tril(A, -1)
        M, N = sparse.csr_array(A + addition), sparse.csr_array(addition)
        return Splitting(A, M, N, omega, 1.0, math.nan, 0.0)
    own = max(chosen.own, 0.0)  # the accelerated family splits A as Zheng and Yin do
    weight = beta / alpha + own
    D = A.diagonal()
    lower, upper = sparse.tril(A, -1), sparse.triu(A, 1)
    M = sparse.diags_array(D / alpha + E) + weight * lower
    N = sparse.diags_array((1.0 / alpha - 1.0) * D + E) - upper
    N = N + (weight - 1.0) * lower
    M, N = sparse.csr_array(M), sparse.csr_array(N)
    return Splitting(A, M, N, omega, alpha, beta / alpha + chosen.own, chosen.reflected)


def comparison(parts: Splitting) -> Comparison:
    """Return C and W as in `namlcp.theory.convergence`."""
    A, M, N, omega, alpha, G, H = parts
    D = A.diagonal()
    if H:
        lower, upper = abs(sparse.tril(A, -1)), abs(sparse.triu(A, 1))
        C = sparse.diags_array(D / alpha + omega) - (G + H) * lower
        weight = abs(1.0 / alpha - 1.0) * D + np.abs(omega - D)
        W = sparse.diags_array(weight) + abs(G) * lower + 2.0 * upper
        return Comparison(sparse.csr_array(C), sparse.csr_array(W), False)
    left = sparse.csr_array(M + sparse.diags_array(omega))
    C = compared(left)
    W = abs(N) + abs(sparse.diags_array(omega) - A)
    return Comparison(C, sparse.csr_array(W), not (C != left).nnz)


def lowered(C: Any, W: Any) -> Any:
    """Return C - W - SAFE (|C| + W): if it is an M-matrix, so is the exact C - W."""
    return sparse.csr_array(C - SAFE * abs(C) - (1.0 + SAFE) * W)


def is_m_splitting(M: Any, N: Any) -> Verdict:
    """Tell whether A = M - N is an M-splitting: M is an M-matrix and N >= 0."""
    M, N = same_shape(M, N)
    negative = np.flatnonzero(N.data < 0.0)
    if negative.size:
        t = negative[0]
        place = f"N[{row_numbers(N)[t]}, {N.indices[t]}] = {N.data[t]:g} < 0"
        return Verdict(answer=False, theorem="no M-splitting: N >= 0", checked=place)
    verdict = is_m_matrix(M)
    text = "M-splitting: N >= 0 and " + verdict.theorem.replace("K", "M")
    return replace(verdict, theorem=text)


def is_h_splitting(M: Any, N: Any) -> Verdict:
    """Tell whether A = M - N is an H-splitting: <M> - |N| is an M-matrix."""
    M, N = same_shape(M, N)
    verdict = is_m_matrix(compared(M) - abs(N))
    return replace(verdict, theorem=f"H-splitting, K = <M> - |N|: {verdict.theorem}")


def is_h_compatible(M: Any, N: Any) -> Verdict:
    """Tell whether A = M - N is an H-compatible splitting: <A> = <M> - |N|.

    Entries count as equal up to SAFE (|m_ij| + |n_ij|), because M - N is rounded.
    """
    M, N = same_shape(M, N)
    difference = compared(sparse.csr_array(M - N)) - compared(M) + abs(N)
    excess = sparse.coo_array(abs(difference) - SAFE * (abs(M) + abs(N)))
    theorem = "H-compatible splitting: <A> = <M> - |N|"
    worst = int(np.argmax(excess.data)) if excess.nnz else -1
    if worst >= 0 and excess.data[worst] > 0.0:
        i, j = excess.row[worst], excess.col[worst]
        gap = difference[i, j]
        checked = f"<A> - <M> + |N| is {gap:g} at ({i}, {j})"
        return Verdict(answer=False, theorem=f"no {theorem}", checked=checked)
    return Verdict(answer=True, theorem=theorem, checked="all entries")


def same_shape(M: Any, N: Any) -> tuple[Any, Any]:
    """Return M and N as clean csr_arrays."""
    M, N = square_matrix("M", M, "csr"), square_matrix("N", N, "csr")
    if M.shape != N.shape:
        raise ValueError(f"N must have shape {M.shape} to match M, got {N.shape}")
    return sparse.csr_array(M), sparse.csr_array(N)


def compared(A: Any) -> Any:
    """Return <A>: |a_ii| on the diagonal, -|a_ij| off it."""
    return sparse.csr_array(2.0 * sparse.diags_array(np.abs(A.diagonal())) - abs(A))


def theorem_3(A: Any, method: str, **parameters: Any) -> TheoremThree:
    """Check the hypotheses of the paper's Theorem 3 one by one.

    They are: A is H+, <A> = <M + E - L> - |N + E - L|, and (1) Omega >= D, or (2) Omega
    < D and 2 Omega - D - |B| is an M-matrix, B = L + U. The proof of (2) uses <A> + 2
    Omega - D - |B| instead, weaker since Omega < D. `repaired` is K of
    `namlcp.theory.convergence`: it needs neither H-compatibility nor H+. For NAMGS and
    NAMSOR with L != 0 the splitting is never H-compatible: below the diagonal <M + E -
    L> - |N + E - L| is -3 |L|.

    Arguments as in `converges`; not for the accelerated family.
    """
    parts = splitting(A, method, **parameters)
    if parts.H:
        raise ValueError(f"theorem_3 is about nam* and m* methods, got {method!r}")
    A, omega = parts.A, parts.omega
    D = A.diagonal()
    B = abs(A) - sparse.diags_array(np.abs(D))
    gap = float(np.min(omega - D, initial=math.inf))
    checked = f"min (Omega - D)_ii = {gap:g}"
    case_1 = Verdict(answer=gap >= 0.0, theorem="(1) Omega >= D", checked=checked)
    below = float(np.max(omega - D, initial=-math.inf))
    checked = f"max (Omega - D)_ii = {below:g}"
    cases = []
    for name, Z in (
        ("2 Omega - D - |B|", sparse.diags_array(2.0 * omega - D) - B),
        ("<A> + 2 Omega - D - |B|", sparse.diags_array(2.0 * omega) - 2.0 * B),
    ):
        theorem = f"(2) Omega < D, {name} is an M-matrix"
        if below >= 0.0:
            cases.append(Verdict(answer=False, theorem=theorem, checked=checked))
        else:
            cases.append(replace(is_m_matrix(Z), theorem=theorem))
    C, W, _ = comparison(parts)
    repaired = "repaired: K = <M + Omega> - |N| - |Omega - A| is an M-matrix"
    return TheoremThree(
        is_h_plus(A),
        is_h_compatible(parts.M, parts.N),
        case_1,
        cases[0],
        cases[1],
        replace(is_m_matrix(lowered(C, W)), theorem=repaired),
    )
