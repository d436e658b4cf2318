"""The sweep methods written out with dense matrices, as their papers have them.

A = D - L - U = M - N, R(s) = 2 clip(s, l, u) - s. Bai (2010), and the paper's Method
3.1 with M + E - L for M, E = diag(shift):

    (M + Omega) s+ = N s + (Omega - A) R(s) - 2 q;

Zheng and Yin (2013):

    (M + Omega) s+ = N s + (Omega - D + U) R(s) + L R(s+) - 2 q.
"""

import numpy as np

TAKES = {
    "mgs": "omega", "msor": "alpha omega", "maor": "alpha beta omega",
    "namj": "omega shift", "namgs": "omega shift", "namsor": "alpha omega shift",
    "namaor": "alpha beta omega shift", "amgs": "omega", "amsor": "alpha omega",
    "pgs": "", "psor": "alpha", "modulus": "omega", "nam": "omega shift",
    "modified-nam": "alpha omega shift",
}  # fmt: skip
"""Of each method the parameters that it takes."""

FACTORED = "modulus", "nam", "modified-nam"
TRIANGULAR = tuple(method for method in TAKES if method not in FACTORED)
ACCELERATED = "amgs", "amsor", "pgs", "psor"


def auto(method):
    """Return the parameters that may be chosen; modified-nam takes one of two."""
    names = {"alpha", "omega"}.intersection(TAKES[method].split())
    if method == "modified-nam":
        names.remove("omega")
    return dict.fromkeys(sorted(names), "auto")


def split(A, method, alpha=None, beta=None, omega=None, shift=None):
    """Return M, with E and L where the method has them, and diag(Omega)."""
    D, L = np.diag(A), -np.tril(A, -1)
    one = np.ones(len(A))
    if method in FACTORED:
        default = D if method == "modulus" else one
        omega = default if omega is None else omega
        omega = alpha * one if alpha is not None else omega * one
        E = one if shift is None else shift * one
        return A if method == "modulus" else A + np.diag(E) - L, omega
    alpha = 1.0 if alpha is None else alpha
    beta = (0.0 if method == "namj" else alpha) if beta is None else beta
    if omega is None:
        omega = D / alpha if method in ACCELERATED else D / (2.0 * alpha**2)
    M = (np.diag(D) - beta * L) / alpha
    if method.startswith("nam"):
        M = M + np.diag(D if shift is None else shift * one) - L
    return M, omega * one


def step(A, q, lower, upper, method, **given):
    """Return the function s -> s+."""
    M, omega = split(A, method, **given)
    left, Omega = M + np.diag(omega), np.diag(omega)
    D, L, U = np.diag(np.diag(A)), -np.tril(A, -1), -np.triu(A, 1)

    def reflection(s):
        return 2.0 * np.clip(s, lower, upper) - s

    def bai(s):
        right = (M - A) @ s + (Omega - A) @ reflection(s) - 2.0 * q
        return np.linalg.solve(left, right)

    def zheng_yin(s):
        known = (M - A) @ s + (Omega - D + U) @ reflection(s) - 2.0 * q
        new, R = np.zeros((2, s.size))
        for i in range(s.size):
            new[i] = (known[i] + L[i] @ R - left[i, :i] @ new[:i]) / left[i, i]
            R[i] = 2.0 * min(max(new[i], lower[i]), upper[i]) - new[i]
        return new

    return zheng_yin if method in ACCELERATED else bai


def residual(A, q, lower, upper, s):
    """Return Res(clip(s))."""
    z = np.clip(s, lower, upper)
    return np.linalg.norm(z - np.clip(z - (A @ z + q), lower, upper))


def iterates(A, q, lower, upper, method, s, count, **given):
    """Return s_0 ... s_count, and Res of each."""
    sweep, rows = step(A, q, lower, upper, method, **given), [s]
    for _ in range(count):
        rows.append(sweep(rows[-1]))
    return np.array(rows), np.array([residual(A, q, lower, upper, s) for s in rows])
