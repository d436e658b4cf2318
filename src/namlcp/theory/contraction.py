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
from namlcp.theory.comparison import UNIT, is_m_matrix
from namlcp.theory.perron import row_numbers
from namlcp.theory.splittings import Splitting, comparison, splitting

LARGEST_DENSE = 600
"""Largest order at which dense inverses and eigenvalues are computed."""

POWERS, NODA_STEPS = 40, 20
"""Most steps of the power method, then of Noda's iteration, to enclose one rho(T)."""

RADIUS_HALVINGS = 40
"""Most M-matrix tests to halve an interval around rho(T)."""

DOUBLINGS = 20
"""Most steps of the doubling algorithm, which converges quadratically."""

MARGINS = (1e-2, 1e-5)
"""Values of eps for which a quadratic Lyapunov function is sought, in this order."""

LEAST_ENTRY, STIR = 1e-100, 1e-3
"""If a power step gives an entry of at most LEAST_ENTRY, the largest being 1, STIR is
added to all entries, so that they stay positive."""


class RadiusBounds(NamedTuple):
    """lower <= rho(T) <= upper; x > 0 has T x <= upper x unless halving gave `upper`.

    If `exact` is False, they are bounds of rho(C^-1 W), where C^-1 W >= T: `upper` then
    holds for rho(T), `lower` does not.
    """

    lower: float
    upper: float
    exact: bool
    x: np.ndarray | None


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


def contraction_bounds(
    A: Any, method: str, *, rtol: float = 1e-4, **parameters: Any
) -> RadiusBounds:
    """Enclose rho(T) of the paper's Theorem 2 for a method and an Omega.

    T = |(M + Omega)^-1| (|N| + |Omega - A|)

    Parameters
    ----------
    A, method, **parameters
        As in `converges`.
    rtol : float
        Width to reach, relative to the upper bound. If it cannot be reached, for a
        reducible T for instance, a wider interval is returned.

    Returns
    -------
    RadiusBounds
        For every x > 0, min (T x)_i / x_i <= rho(T) <= max (T x)_i / x_i (Collatz and
        Wielandt), up to rounding. For n > 600, and for the accelerated family, T is
        replaced by C^-1 W >= T; `exact` tells whether the two are equal. The interval
        is then halved: rho(C^-1 W) < t where t C - W is an M-matrix, else it is >= t.
        The bounds are (0, inf) where C is not an M-matrix.
    """
    parts = splitting(A, method, **parameters)
    C, W, exact = comparison(parts)
    n = parts.omega.size
    with np.errstate(all="ignore"):
        if n <= LARGEST_DENSE and not parts.H:
            left, N, right = dense_parts(parts)
            try:
                T = np.abs(np.linalg.inv(left)) @ (np.abs(N) + np.abs(right))
            except np.linalg.LinAlgError:
                return RadiusBounds(0.0, math.inf, True, None)
            return dense_bounds(T, rtol)
        start = is_m_matrix(C)
        if not start or start.witness is None or start.exponent is not None:
            return RadiusBounds(0.0, math.inf, exact, None)
        solve = left_solver(C)
        lower, upper, _, x = collatz(lambda x: solve(W @ x), start.witness, None, rtol)
        for _ in range(RADIUS_HALVINGS):
            if not upper - lower > rtol * upper:
                break
            middle = math.sqrt(lower * upper) if lower > 0.0 else 0.5 * upper
            below = is_m_matrix(middle * C - W)
            if below.answer is None:
                break
            lower, upper = (lower, middle) if below else (middle, upper)
        return RadiusBounds(lower, upper, exact, x)


def dense_bounds(T: np.ndarray, rtol: float = 1e-10) -> RadiusBounds:
    """Enclose rho(T) for a dense T >= 0."""
    I = np.eye(T.shape[0])

    def inverse(shift: float, x: np.ndarray) -> np.ndarray | None:
        try:
            return np.linalg.solve(shift * I - T, x)
        except np.linalg.LinAlgError:
            return None

    return collatz(lambda x: T @ x, np.ones(T.shape[0]), inverse, rtol)


def collatz(apply: Any, x: np.ndarray, inverse: Any, rtol: float) -> RadiusBounds:
    """Enclose rho(T), T >= 0, from x > 0: power steps, then steps of Noda's iteration.

    apply(x) is T x; inverse(shift, x) is (shift I - T)^-1 x, or None where that does
    not exist. If `inverse` is None, there are only power steps.
    """
    best = RadiusBounds(0.0, math.inf, True, None)
    if x.size == 0:
        return RadiusBounds(0.0, 0.0, True, x)
    for step in range(POWERS + (NODA_STEPS if inverse else 0)):
        y = apply(x)
        if not np.all(y >= 0.0):
            return best
        quotient = y / x
        upper = float(quotient.max())
        if upper < best.upper:
            best = best._replace(upper=upper, x=x)
        best = best._replace(lower=max(best.lower, float(quotient.min())))
        if not best.upper - best.lower > rtol * best.upper:
            return best
        if step >= POWERS:
            new = inverse(best.upper * (1.0 + 1e-15), best.x)
            if new is None or not np.all(np.isfinite(new)):
                return best
            y = np.abs(new)
        x = y / y.max()
        if step < POWERS and not x.min() > LEAST_ENTRY:
            x = x + STIR
        x = np.maximum(x, LEAST_ENTRY**2)
    return best


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
        rounding = 1e3 * n * UNIT * np.linalg.cond(left)
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
