"""The hypotheses of the paper's Theorem 3, and of its repair, checked one by one.

H-compatible splittings are those of Frommer and Szyld, Numer. Math. 63 (1992) 345-356.
"""

import math
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from scipy import sparse

from namlcp import Verdict, is_h_plus
from namlcp.theory.comparison import is_m_matrix
from namlcp.theory.splittings import SAFE, compared, comparison, lowered, splitting


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


def is_h_compatible(M: Any, N: Any) -> Verdict:
    """Tell whether A = M - N is an H-compatible splitting: <A> = <M> - |N|.

    Entries count as equal up to SAFE (|m_ij| + |n_ij|), because M - N is rounded.
    """
    M, N = sparse.csr_array(M), sparse.csr_array(N)
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
    C, W = comparison(parts)
    repaired = "repaired: K = <M + Omega> - |N| - |Omega - A| is an M-matrix"
    return TheoremThree(
        is_h_plus(A),
        is_h_compatible(parts.M, parts.N),
        case_1,
        cases[0],
        cases[1],
        replace(is_m_matrix(lowered(C, W)), theorem=repaired),
    )
