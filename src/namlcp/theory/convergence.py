"""The convergence theory of the sweep methods as code: answers with their reason.

With the splitting A = M - N (for nam* M + E - L and N + E - L take the places of M and
N), z = clip(s, l, u) and R(s) = 2 z - s, a sweep is

    (M + Omega) s+ = N s + (Omega - A) R(s) - 2 q.                                  (1)

For nam* this is Method 3.1 of the paper, with r = 2, any diagonal E in place of I, and
bounds: R(s) = |s| where l = 0 and u = inf. No component of R(s) changes by more than
that of s, so two runs s, t obey

    |s+ - t+| <= T |s - t|,   T = |(M + Omega)^-1| (|N| + |Omega - A|).             (2)

*The paper's Theorem 4.1.* If rho(T) < 1 there is v > 0 with T v <= theta v, theta < 1:
(1) is a contraction in the norm max |s_i| / v_i, for every q and all bounds.

*The comparison.* With C = <M + Omega> and W = |N| + |Omega - A|, if K = C - W is an
M-matrix then rho(T) < 1: K v > 0 gives C v > W v >= 0, hence C is an M-matrix,
|(M + Omega)^-1| <= C^-1 (Ostrowski), and where W v <= theta C v, T v <= C^-1 W v <=
theta v. This is the paper's Theorem 4.2, repaired: where diag(M) >= 0,

    K = <M> - |N| + min(D, 2 Omega - D) - |B|,   B = L + U.

For an H-compatible splitting <M> - |N| = <A>, so that Omega >= D makes it 2 <A>: Bai's
theorem for H+ matrices.

*The accelerated family* replaces L R(s) by L R(s+). The largest slopes of its sweep in
the increments ds and dz (`namlcp.lcp.modulus.sweeps`) give (2) with T = C^-1 W,

    C = D/alpha + Omega - (beta/alpha + 1) |L|,
    W = |1/alpha - 1| D + |Omega - D| + |beta/alpha - 1| |L| + 2 |U|.

For beta = alpha and Omega >= D, alpha <= 1, K = 2 <A> (Zheng and Yin); for projected
SOR it is the condition 0 < alpha < 2 / (1 + rho(J)) for H+ matrices (Ahn; Pang).

*Quadratic norms.* Let X = (M + Omega)^-1 N, Y = (M + Omega)^-1 (Omega - A), Z = 0; for
the accelerated family Z = (M + Omega)^-1 L, and Z is subtracted from Y. The differences
ds and p of s and R(s) obey, with e = ds - Z p,

    e+ = X e + B p,   |p| <= |ds|,   B = X Z + Y.

If for a symmetric positive definite Q and a positive diagonal Lambda

    [X'QX - Q + Lambda    X'QB + Lambda Z                  ]
    [B'QX + Z'Lambda      B'QB + Z'Lambda Z - Lambda       ]  <=  -eps I,  eps > 0,

multiplying by (e, p) gives |e+|_Q^2 - |e|_Q^2 <= p'Lambda p - ds'Lambda ds - eps (e'e +
p'p) <= -eps e'e: a contraction. A Riccati equation gives Q (the bounded real lemma, de
Souza and Xie), and the inequality is then checked for it.

*Definite matrices.* Projected SOR lowers z'Az/2 + q'z for every symmetric A (Cryer;
Mangasarian; Luo and Tseng). "modulus" is, in t = Omega^(1/2) s, reflections and the
Cayley transform (I + S)^-1 (I - S), S = Omega^(-1/2) A Omega^(-1/2), of norm < 1 if A +
A' is positive definite: ||(I - S) x||^2 = ||(I + S) x||^2 - 2 x'(S + S')x.

References
----------
Bai, Numer. Linear Algebra Appl. 17 (2010) 917-933; Zheng and Yin, Numer. Algorithms 64
(2013) 245-262; Ahn, J. Optim. Theory Appl. 33 (1981) 175-185; Pang, J. Optim. Theory
Appl. 42 (1984) 1-17; Cryer, SIAM J. Control 9 (1971) 385-392; Mangasarian, J. Optim.
Theory Appl. 22 (1977) 465-485; Luo and Tseng, SIAM J. Control Optim. 29 (1991)
1037-1060; de Souza and Xie, Systems & Control Letters 18 (1992) 61-71; Chu, Fan, Lin
and Wang, Int. J. Control 77 (2004) 767-788.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from scipy import linalg, sparse

from namlcp.checks import finite_square_matrix, sparse_matrix
from namlcp.lcp.methods import find_method
from namlcp.lcp.modulus.methods import SWEEPS, Parameters, checked_parameters
from namlcp.linalg.factors import asymmetry, has_positive_pivots
from namlcp.theory.comparison import (
    LARGEST_FACTORED,
    ROUNDOFF,
    Verdict,
    is_h_plus,
    is_weakly_dominant,
    settle,
)

# Largest order at which dense inverses and eigenvalues are computed.
LARGEST_DENSE = 600
# Bound for the rounding errors of the entries of K, relative to their terms.
SAFE = 1e-13
# Value of eps for which Q is sought.
MARGIN = 1e-3
QUADRATIC = "contraction in the norm of Q = witness (bounded real lemma)"
# Most steps of the doubling algorithm (Chu, Fan, Lin and Wang).
DOUBLINGS = 20


class Splitting(NamedTuple):
    """A method on a matrix: A, M and N of (1), E and L included; csr_array.

    alpha, G and H are those of `namlcp.lcp.modulus.sweeps` where M is triangular; G is
    NaN where M = A or A + E - L. H = 0 but for the accelerated family.
    """

    A: Any
    M: Any
    N: Any
    omega: np.ndarray
    alpha: float
    G: float
    H: float


def converges(
    A: Any,
    method: str,
    *,
    alpha: float | None = None,
    beta: float | None = None,
    omega: Any = None,
    shift: Any = None,
    semidefinite: bool = False,
) -> Verdict:
    """Tell whether a sweep method provably converges on A, for every q, bounds, start.

    Parameters
    ----------
    A : (n, n) array or sparse array
    method : str
        A name of `namlcp.lcp.modulus.methods`.
    alpha, beta, omega, shift
        As in `solve_lcp`, with the same defaults.
    semidefinite : bool
        Take it as known that A is positive semidefinite, by its construction for
        instance: rounding hides whether a nearly singular matrix is indefinite.

    Returns
    -------
    Verdict
        True: `theorem` names what proves it, with its witness: v > 0 with K v > 0 for
        the comparison (`bound` is then a contraction factor of max |s_i| / v_i), a
        matrix for a quadratic norm, none for the theorems on definite matrices. Nothing
        is claimed for a semidefinite A with a q that has no solution. False: for q =
        witness and l = 0, u = inf the iterates leave the solution e = (1, ..., 1) from
        almost every start near it; `bound` > 1 is the spectral radius. None: no theorem
        here applies; `checked` says which were tried.

    Raises
    ------
    TypeError, ValueError
        An argument is malformed, or the method does not have such a parameter.

    Notes
    -----
    `namlcp.theory.convergence` states the theorems. In the order in which they are
    tried: 1. the comparison, sparse, any size; 2. projected SOR, symmetric positive
    (semi)definite A, 0 < alpha < 2; 3. "modulus", A + A' positive definite; and for n
    <= 600: 4. Theorem 4.1 with |(M + Omega)^-1 N| + |(M + Omega)^-1 (Omega - A)|, which
    is at most its T, and for which its proof holds; 5. while no bound is active a sweep
    is a linear map, so that a spectral radius above 1 refutes it (q = -A e has the
    solution e); 6. a quadratic norm, which covers the paper's runs of NAMGS (Omega =
    D/2, E = I), where rho(T) > 1.

    Examples
    --------
    >>> import numpy as np
    >>> from namlcp import converges
    >>> A = np.array([[1.0, 0.9, 0.9], [0.9, 1.0, 0.9], [0.9, 0.9, 1.0]])
    >>> converges(A, "psor", alpha=1.5).answer
    True
    >>> converges(np.array([[1.0, 2.0], [-2.0, 1.0]]), "pgs").answer
    False
    """
    parts = splitting(A, method, Parameters(alpha, beta, omega, shift))
    theorems: list[Callable[[Splitting], Verdict]]
    theorems = [by_comparison, partial(by_descent, semidefinite), by_cayley]
    if 0 < parts.omega.size <= LARGEST_DENSE:
        theorems += [by_inverse, by_repulsion, by_quadratic_norm]
    tried: list[str] = []
    for theorem in theorems:
        try:
            with np.errstate(all="ignore"):
                verdict = theorem(parts)
        except (np.linalg.LinAlgError, ValueError):  # singular, or not finite
            continue
        if verdict.answer is not None:
            return verdict
        if verdict.checked:
            tried.append(verdict.checked)
    return undecided("; ".join(tried))


def splitting(A: Any, method: str, parameters: Parameters) -> Splitting:
    values = parameters._asdict()
    find_method(method, [name for name in values if values[name] is not None])
    for name in ("alpha", "omega"):
        if isinstance(values[name], str):
            raise ValueError(
                f"{name} must be given in numbers, got {values[name]!r}: no theorem is "
                "about parameters that change from sweep to sweep"
            )
    if method not in SWEEPS:
        raise ValueError(f"method must be a sweep method, got {method!r}")
    chosen, A = SWEEPS[method], sparse.csr_array(finite_square_matrix("A", A, "csr"))
    alpha, beta, omega, shift = checked_parameters(A, method, parameters)
    E = np.zeros(omega.size) if shift is None else shift
    D, lower = A.diagonal(), sparse.tril(A, -1)
    if chosen.factored:
        M, sweep = A + sparse.diags_array(E) + chosen.own * lower, (1.0, math.nan, 0.0)
    else:  # the accelerated family splits A as Zheng and Yin do
        weight = beta / alpha + max(chosen.own, 0.0)
        M = sparse.diags_array(D / alpha + E) + weight * lower
        sweep = alpha, beta / alpha + chosen.own, chosen.reflected
    M = sparse.csr_array(M)
    return Splitting(A, M, sparse.csr_array(M - A), omega, *sweep)


def undecided(checked: str = "") -> Verdict:
    return Verdict(None, "no theorem applies", checked)


def by_comparison(parts: Splitting) -> Verdict:
    C, W = comparison(parts)
    # if this is an M-matrix, so is the exact C - W
    K = sparse.csr_array(C - SAFE * abs(C) - (1.0 + SAFE) * W)
    verdict = settle(K, "K is an M-matrix")
    if not verdict:
        return undecided(f"K = C - W is not an M-matrix ({verdict.checked})")
    name = "Zheng and Yin 2013; Ahn 1981" if parts.H else "Theorem 4.2, repaired"
    theorem = f"contraction, rho(T) < 1, because K v > 0 ({name})"
    checked = verdict.checked.replace("rho(J)", "rho of K's Jacobi matrix")
    theta = float(np.max((W @ verdict.witness) / (C @ verdict.witness), initial=0.0))
    return replace(verdict, theorem=theorem, checked=checked, bound=theta)


def comparison(parts: Splitting) -> tuple[Any, Any]:
    A, M, N, omega, alpha, G, H = parts
    D = A.diagonal()
    if H:
        lower, upper = abs(sparse.tril(A, -1)), abs(sparse.triu(A, 1))
        C = sparse.diags_array(D / alpha + omega) - (G + H) * lower
        weight = abs(1.0 / alpha - 1.0) * D + np.abs(omega - D)
        return C, sparse.diags_array(weight) + abs(G) * lower + 2.0 * upper
    X = sparse.csr_array(M + sparse.diags_array(omega))
    C = 2.0 * sparse.diags_array(np.abs(X.diagonal())) - abs(X)  # <X>
    return C, abs(N) + abs(sparse.diags_array(omega) - A)


def by_descent(semidefinite: bool, parts: Splitting) -> Verdict:
    A = parts.A
    if parts.H == 0.0 or parts.G != 0.0:
        return undecided()
    if not np.array_equal(parts.omega, A.diagonal() / parts.alpha):
        return undecided("not projected SOR: Omega is not D/alpha")
    gap = asymmetry(A)[0]
    if gap > 0.0:
        return undecided(
            f"A is not symmetric: max |A - A'| = {gap:.1e} (pass (A + A') / 2 if that "
            "is rounding)"
        )
    source, found = "Cryer 1971", positive_definite(A)
    if not found:
        source = "for every q with a solution; Mangasarian 1977, Luo and Tseng 1991"
        if semidefinite:
            found = "A = A' is positive semidefinite: so the caller says"
        elif is_weakly_dominant(A):
            found = "A = A' is positive semidefinite: weakly dominant rows"
        else:
            return undecided("A = A' is not seen to be positive definite")
    return Verdict(True, f"projected SOR, A = A', 0 < alpha < 2 ({source})", found)


def by_cayley(parts: Splitting) -> Verdict:
    if not math.isnan(parts.G) or parts.N.count_nonzero():
        return undecided()
    A = parts.A
    symmetric = A if asymmetry(A)[0] == 0.0 else sparse.csr_array((A + A.T) * 0.5)
    found = positive_definite(symmetric)
    if not found:
        return undecided("A + A' is not seen to be positive definite")
    name = "modulus method, A + A' positive definite, any Omega > 0"
    return Verdict(True, f"{name} (Peaceman-Rachford; Bai 2010 for A = A')", found)


def positive_definite(A: Any) -> str:
    """Return how a symmetric csr_array was seen to be positive definite, or "".

    If it is no H+ matrix, an LDL' factorisation of S - c I must succeed, S = D^(-1/2) A
    D^(-1/2), where c is more than four times the norm (n + 1) u n of its rounding
    errors (Demmel; Rump, BIT 46 (2006) 433-452).
    """
    n, D = A.shape[0], A.diagonal()
    verdict = is_h_plus(A)
    if verdict:
        return f"A = A' is an H+ matrix ({verdict.checked})"
    if n > LARGEST_FACTORED or not np.all(D > 0.0):
        return ""
    root, c = sparse.diags_array(1.0 / np.sqrt(D)), 4.0 * (n + 8) * n * ROUNDOFF
    upper = sparse.triu(root @ A @ root) - c * sparse.eye_array(n)
    if not has_positive_pivots(sparse_matrix("A", upper, "csc")):
        return ""
    return f"LDL' factorisation of D^(-1/2) A D^(-1/2) - {c:.1e} I"


def dense_parts(parts: Splitting) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    Omega = np.diag(parts.omega)
    return parts.M.toarray() + Omega, parts.N.toarray(), Omega - parts.A.toarray()


def by_inverse(parts: Splitting) -> Verdict:
    if parts.H:
        return undecided()
    left, N, right = dense_parts(parts)
    inverse, I = np.linalg.inv(left), np.eye(len(N))
    T = np.abs(inverse @ N) + np.abs(inverse @ right)
    v = np.linalg.solve(I - T, np.ones(len(N)))
    theta = float(np.max((T @ v) / v)) if np.all(v > 0.0) else math.inf
    condition = np.linalg.norm(left, 1) * np.linalg.norm(inverse, 1)
    if not theta < 1.0 - 1e-12 * len(N) * condition:
        return undecided("rho(T) < 1 is not seen")
    name = "T = |(M + Omega)^-1 N| + |(M + Omega)^-1 (Omega - A)|"
    theorem = f"contraction, rho(T) < 1 for {name} (Theorem 4.1)"
    checked = f"rho(T) <= {theta:.17g}, the largest (T v)_i / v_i"
    return Verdict(True, theorem, checked, v, theta)


def by_repulsion(parts: Splitting) -> Verdict:
    # While no bound is active ds+ = (I - 2 X^-1 A) ds. The modulus of an eigenvalue
    # must exceed 1 by more than a first-order estimate of its error.
    n = parts.omega.size
    A, X = parts.A.toarray(), dense_parts(parts)[0]
    if parts.H:
        X += np.tril(A, -1)
    step = np.eye(n) - 2.0 * np.linalg.solve(X, A)
    values, left, right = linalg.eig(step, left=True, right=True)
    k = int(np.argmax(np.abs(values)))
    radius = float(np.abs(values[k]))
    condition = np.linalg.cond(X) / abs(np.vdot(left[:, k], right[:, k]))
    error = 1e3 * n * ROUNDOFF * condition * (1.0 + np.linalg.norm(step))
    if not radius - error > 1.0:
        return undecided(f"spectral radius with no active bound: {radius:.6g}")
    theorem = "for q = witness sweeps leave the solution z = e, inside all bounds"
    checked = f"spectral radius of I - 2 X^-1 A: {radius:.6g}"
    return Verdict(False, theorem, checked, -(A @ np.ones(n)), radius)


def by_quadratic_norm(parts: Splitting) -> Verdict:
    n = parts.omega.size
    left, N, right = dense_parts(parts)
    L = -np.tril(parts.A.toarray(), -1) if parts.H else np.zeros((n, n))
    none = undecided("no quadratic Lyapunov function found")
    X, Y, Z = (np.linalg.solve(left, side) for side in (N, right - L, L))
    if not np.abs(np.linalg.eigvals(X)).max() < 1.0:
        return none
    S = np.abs(X) + np.abs(Y) + np.abs(Z)  # ratios of Perron vectors minimise its norm
    values, *sides = linalg.eig(S, left=True, right=True)
    k = int(np.argmax(np.abs(values)))
    y, x = (np.maximum(np.abs(V[:, k]), 1e-8) for V in sides)
    rounding = 1e3 * n * ROUNDOFF * np.linalg.cond(left)
    for name, weight in (("Omega", parts.omega), ("Perron", y / x)):
        d = np.sqrt(weight)
        X1, Y1, Z1 = (d[:, None] * V / d for V in (X, Y, Z))
        found = for_unit_weight(X1, Y1, Z1, rounding)
        if found is not None:
            checked = f"the matrix inequality, with Lambda = {name}"
            Q = d[:, None] * found[0] * d
            return Verdict(True, QUADRATIC, checked, Q, found[1])
    return none


def for_unit_weight(
    X: np.ndarray, Y: np.ndarray, Z: np.ndarray, rounding: float
) -> tuple[np.ndarray, float] | None:
    """Return (Q, factor) for Lambda = I; None if no Q solves the matrix inequality."""
    I, B = np.eye(X.shape[0]), X @ Z + Y
    S = (1.0 + MARGIN) * Z
    Q = riccati(X, B, (1.0 + MARGIN) * I, S, S.T @ Z - (1.0 - MARGIN) * I)
    if Q is None:
        return None
    QX, QB = Q @ X, Q @ B
    corner = X.T @ QB + Z
    block = np.block([[X.T @ QX - Q + I, corner], [corner.T, B.T @ QB + Z.T @ Z - I]])
    size = 1.0 + sum(np.linalg.norm(V) for V in (X, B, Z))
    slack = rounding * (1.0 + np.linalg.norm(Q)) * size * size
    values, weights = np.linalg.eigvalsh(block), np.linalg.eigvalsh(Q)
    if not (values[-1] < -slack and weights[0] > slack):
        return None
    return Q, math.sqrt(1.0 + (values[-1] + slack) / weights[-1])


def riccati(
    A: np.ndarray, B: np.ndarray, H: np.ndarray, S: np.ndarray, R: np.ndarray
) -> np.ndarray | None:
    """Solve Q = A'QA + H - (A'QB + S)(R + B'QB)^-1 (B'QA + S') by doubling, R < 0.

    None where the iterates, which grow, do not converge. (SciPy's solve_discrete_are
    takes 10 to 20 times as long.)
    """
    inverse = np.linalg.inv(R)
    A, G = A - B @ inverse @ S.T, B @ inverse @ B.T
    H = H - S @ inverse @ S.T
    for _ in range(DOUBLINGS):
        W = np.linalg.inv(np.eye(A.shape[0]) + G @ H)
        change = A.T @ H @ W @ A
        G = G + A @ W @ G @ A.T
        A = A @ W @ A
        H = H + 0.5 * (change + change.T)
        G = 0.5 * (G + G.T)
        grown = float(np.linalg.norm(change))
        if not (np.trace(change) >= 0.0 and grown < math.inf):
            return None
        if grown <= 1e-14 * np.linalg.norm(H):
            return H
    return None
