"""Bounds for the contraction of a sweep: rho(T) of Theorem 2, and quadratic norms.

`namlcp.theory.convergence` defines T, C and W.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from scipy import linalg, sparse
from scipy.sparse.linalg import splu

from namlcp.compiled import kernel
from namlcp.theory.comparison import ROUNDOFF
from namlcp.theory.perron import row_numbers
from namlcp.theory.splittings import Splitting

LARGEST_DENSE = 600
"""Largest order at which dense inverses and eigenvalues are computed."""

POWERS, NODA_STEPS = 40, 20
"""Most steps of the power method, then of Noda's iteration, to enclose one rho(T)."""

DOUBLINGS = 20
"""Most steps of the doubling algorithm, which converges quadratically."""

MARGINS = (1e-2, 1e-5)
"""Values of eps for which a quadratic Lyapunov function is sought, in this order."""

LEAST_ENTRY, STIR = 1e-100, 1e-3
"""If a power step gives an entry of at most LEAST_ENTRY, the largest being 1, STIR is
added to all entries, so that they stay positive."""


class RadiusBounds(NamedTuple):
    """lower <= rho(T) <= upper; x > 0 has T x <= upper x."""

    lower: float
    upper: float
    x: np.ndarray


def radius_bounds(T: np.ndarray, rtol: float = 1e-10) -> RadiusBounds:
    """Enclose rho(T) for a dense T >= 0, up to rounding.

    min (T x)_i / x_i <= rho(T) <= max (T x)_i / x_i for every x > 0 (Collatz and
    Wielandt). x comes from power steps, then from steps of Noda's iteration, until the
    width is at most rtol times the upper bound; for a reducible T it may stay wider.
    """
    n = T.shape[0]
    if n == 0:
        return RadiusBounds(0.0, 0.0, np.ones(0))
    x = np.ones(n)
    best = RadiusBounds(0.0, math.inf, x)
    for step in range(POWERS + NODA_STEPS):
        y = T @ x
        if not np.all(y >= 0.0):
            break
        quotient = y / x
        upper = float(quotient.max())
        if upper < best.upper:
            best = best._replace(upper=upper, x=x)
        best = best._replace(lower=max(best.lower, float(quotient.min())))
        if not best.upper - best.lower > rtol * best.upper:
            break
        if step >= POWERS:
            try:
                y = np.linalg.solve(best.upper * (1.0 + 1e-15) * np.eye(n) - T, best.x)
            except np.linalg.LinAlgError:
                break
            if not np.all(np.isfinite(y)):
                break
            y = np.abs(y)
        x = y / y.max()
        if step < POWERS and not x.min() > LEAST_ENTRY:
            x = x + STIR
        x = np.maximum(x, LEAST_ENTRY**2)
    return best


def left_solver(C: Any) -> Callable[[np.ndarray], np.ndarray]:
    """Return x = C^-1 b as a function of b, by substitution where C is triangular."""
    if np.all(C.indices <= row_numbers(C)):
        return lambda b: solve_lower_triangle(C.indptr, C.indices, C.data, b)
    try:
        return splu(sparse.csc_array(C)).solve
    except RuntimeError:
        return lambda b: np.full(b.size, np.nan)


@kernel
def solve_lower_triangle(indptr, indices, data, b):
    """Return C^-1 b for a lower triangular C in CSR with a nonzero diagonal."""
    x = np.empty_like(b)
    for i in range(b.size):
        r = b[i]
        d = np.nan
        for k in range(indptr[i], indptr[i + 1]):
            j = indices[k]
            if j < i:
                r -= data[k] * x[j]
            elif j == i:
                d = data[k]
        x[i] = r / d
    return x


def dense_parts(parts: Splitting) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return M + Omega, N and Omega - A as dense arrays."""
    Omega = np.diag(parts.omega)
    return parts.M.toarray() + Omega, parts.N.toarray(), Omega - parts.A.toarray()


class Lyapunov(NamedTuple):
    """Q with || e+ ||_Q <= factor || e ||_Q; `lyapunov_function` defines e.

    `weight` names the diagonal Lambda for which Q was found.
    """

    Q: np.ndarray
    factor: float
    weight: str


def lyapunov_function(parts: Splitting) -> Lyapunov | None:
    """Return a quadratic function that decreases with every sweep; dense, O(n^3).

    Let X = (M + Omega)^-1 N, Y = (M + Omega)^-1 (Omega - A), Z = 0; for the accelerated
    family Z = (M + Omega)^-1 L, and Z is subtracted from Y. The differences ds and p of
    s and R(s) between two runs obey, with e = ds - Z p,

        e+ = X e + B p,   |p| <= |ds|,   B = X Z + Y.

    If for a symmetric positive definite Q and a positive diagonal Lambda

        [X'QX - Q + Lambda    X'QB + Lambda Z                  ]
        [B'QX + Z'Lambda      B'QB + Z'Lambda Z - Lambda       ]  <=  -eps I,  eps > 0,

    multiplying by (e, p) gives |e+|_Q^2 - |e|_Q^2 <= p'Lambda p - ds'Lambda ds - eps
    (e'e + p'p) <= -eps e'e: a contraction. By the bounded real lemma [1]_ Q exists if
    rho(X) < 1 and the transfer function from p to ds has gain below 1 in the norm of
    Lambda (a small-gain or circle criterion). A Riccati equation gives Q, and the
    inequality is then checked for it. Lambda is Omega, or else `perron_weight` of
    |X| + |Y| + |Z|.

    References
    ----------
    .. [1] C. E. de Souza, L. Xie, Systems & Control Letters 18 (1992) 61-71.
    """
    n = parts.omega.size
    left, N, right = dense_parts(parts)
    L = -np.tril(parts.A.toarray(), -1) if parts.H else np.zeros((n, n))
    try:
        X, Y, Z = (np.linalg.solve(left, side) for side in (N, right - L, L))
        perron = perron_weight(np.abs(X) + np.abs(Y) + np.abs(Z))
        rounding = 1e3 * n * ROUNDOFF * np.linalg.cond(left)
        if not np.abs(np.linalg.eigvals(X)).max(initial=0.0) < 1.0:
            return None
        for name, weight in (("Omega", parts.omega), ("Perron", perron)):
            d = np.sqrt(weight)
            X1, Y1, Z1 = (d[:, None] * V / d for V in (X, Y, Z))
            for eps in MARGINS:
                found = for_unit_weight(X1, Y1, Z1, eps, rounding)
                if found is not None:
                    Q = d[:, None] * found[0] * d
                    return Lyapunov(Q, found[1], f"Lambda = {name}")
    except (np.linalg.LinAlgError, ValueError):  # singular, or not finite
        pass
    return None


def perron_weight(S: np.ndarray) -> np.ndarray:
    """Return the squares of the d that minimise || d S d^-1 ||_2, S >= 0.

    They are the ratios of the left and right Perron vectors, kept positive.
    """
    values, left, right = linalg.eig(S, left=True, right=True)
    k = int(np.argmax(np.abs(values)))
    return np.maximum(np.abs(left[:, k]), 1e-8) / np.maximum(np.abs(right[:, k]), 1e-8)


def for_unit_weight(
    X: np.ndarray, Y: np.ndarray, Z: np.ndarray, eps: float, rounding: float
) -> tuple[np.ndarray, float] | None:
    """Return (Q, factor) for Lambda = I; None if no Q solves the matrix inequality.

    `rounding` estimates the relative rounding errors of X, Y and Z.
    """
    I, B = np.eye(X.shape[0]), X @ Z + Y
    S = (1.0 + eps) * Z
    R = S.T @ Z - (1.0 - eps) * I
    Q = riccati(X, B, (1.0 + eps) * I, S, R)
    if Q is None:
        return None
    QX, QB = Q @ X, Q @ B
    corner = X.T @ QB + Z
    block = np.block([[X.T @ QX - Q + I, corner], [corner.T, B.T @ QB + Z.T @ Z - I]])
    size = 1.0 + sum(np.linalg.norm(V) for V in (X, B, Z))
    slack = rounding * (1.0 + np.linalg.norm(Q)) * size * size
    values = np.linalg.eigvalsh(block)
    weights = np.linalg.eigvalsh(Q)
    if not (values[-1] < -slack and weights[0] > slack):
        return None
    return Q, math.sqrt(1.0 + (values[-1] + slack) / weights[-1])


def riccati(
    A: np.ndarray, B: np.ndarray, H: np.ndarray, S: np.ndarray, R: np.ndarray
) -> np.ndarray | None:
    """Solve Q = A'QA + H - (A'QB + S)(R + B'QB)^-1 (B'QA + S') by doubling, R < 0.

    E. K.-W. Chu, H.-Y. Fan, W.-W. Lin, C.-S. Wang, Int. J. Control 77 (2004) 767-788.
    Returns None where the iterates, which grow, do not converge. (SciPy's
    solve_discrete_are takes 10 to 20 times as long.)
    """
    inverse = np.linalg.inv(R)
    A, G = A - B @ inverse @ S.T, B @ inverse @ B.T
    H = H - S @ inverse @ S.T
    I = np.eye(A.shape[0])
    for _ in range(DOUBLINGS):
        W = np.linalg.inv(I + G @ H)
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
