"""LCPs with known answers: textbook problems, generated classes, contact scenes.

A problem is (A, q) or (A, q, lower, upper); a generator takes a numpy Generator.
"""

import json
import os
from pathlib import Path

import numpy as np
from scipy import sparse

from validation.problems import sweep_scenes
from validation.problems.data_sets import contact_lcp

DATA = Path(
    os.environ.get("NAMLCP_DATA", Path(__file__).parents[3] / "shared" / "data")
)

INF = np.inf

# name: (A, q, the solution or None, source)
TEXTBOOK = {
    "cottle_pang_stone_semidefinite": (
        [[1, 1], [1, 1]], [-1, -1], None,
        "Cottle, Pang, Stone 1992 (siconos CPS_1); semidefinite, many solutions",
    ),
    "cottle_pang_stone_kkt": (
        [[11, 0, 10, -1], [0, 11, 10, -1], [10, 10, 21, -1], [1, 1, 1, 0]],
        [50, 50, 23, -6], [3, 3, 0, 83],
        "Cottle, Pang, Stone 1992 (siconos CPS_4bis); optimality conditions of a QP",
    ),
    "pang_isolated": (
        [[0, -1, -1], [1, 0, 0], [-1, 0, 0]], [0, -1, 1], None,
        "Pang (siconos Pang_isolated_sol); skew-symmetric",
    ),
    "fathi_2": ([[1, 2], [2, 5]], [-1, -1], [1, 0], "Fathi 1979, n = 2"),
    "deudeu": (
        [[2, 1], [1, 2]], [-5, -6], [4 / 3, 7 / 3], "Murty 1988 (siconos deudeu)",
    ),
    "ortiz_block": (
        [[3, 1, 0, -1], [-1, 2, 1, 1], [0, 1, 3, -1], [0, 0, 1, 2]], [-2, 1, -1, 1],
        [2 / 3, 0, 1 / 3, 0], "Ortiz (siconos ortiz_block); nonsymmetric P-matrix",
    ),
    "cyclic_3": (
        [[1, 2, 0], [0, 1, 2], [2, 0, 1]], [-1, -1, -1], [1 / 3, 1 / 3, 1 / 3],
        "Murty 1974; pivoting without a rule goes round; nonsymmetric P-matrix",
    ),
    "path_4": (
        [[0, 0, -1, -1], [0, 0, 1, -2], [1, -1, 2, -2], [1, 2, -2, 4]], [2, 2, -2, -6],
        [2.8, 0, 0.8, 1.2], "PATHSolver.jl, README; semidefinite, nonsymmetric",
    ),
}  # fmt: skip

# No solution; the direction v >= 0 with A v = 0 and q'v < 0.
UNSOLVABLE = {
    "zero": ([[0, 0], [0, 0]], [-1, -1]),
    "one_direction": ([[1, -1], [-1, 1]], [-1, -1]),
    "scaled_direction": ([[1e-6, -1e-1], [-1e-1, 1e4]], [-1e-9, -1e-9]),
}

TRUTH = dict.fromkeys(("fathi_2", "deudeu", "ortiz_block", "cyclic_3"), "P")
"""Classes of TEXTBOOK as `lcp_cases` names them, where they are not semidefinite."""


def with_solution(rng, A, degenerate=0.0):
    """Return q and z such that z solves LCP(q, A); some z_i = w_i = 0 if wanted."""
    n = A.shape[0]
    kind = rng.random(n)
    z = np.where(kind < 0.5, rng.exponential(size=n), 0.0)
    w = np.where(kind >= 0.5, rng.exponential(size=n), 0.0)
    none = rng.random(n) < degenerate
    z[none] = w[none] = 0.0
    return w - A @ z, z


def every_bounds(rng, n):
    """Return random bounds of every kind: infinite ones, equal ones, none."""
    lower = np.where(rng.random(n) < 0.3, -INF, rng.normal(size=n))
    upper = np.where(rng.random(n) < 0.3, INF, lower + rng.exponential(size=n))
    upper[lower == -INF] = 1.0
    lower[0], upper[0] = -INF, INF
    lower[1] = upper[1] = 0.7
    return lower, upper


def quotient_p(rng, n):
    """Return B^-1 C, B and C strictly column-dominant: P, rarely positive definite."""
    B, C = rng.standard_normal((2, n, n))
    for M in (B, C):
        np.fill_diagonal(M, 0.0)
        np.fill_diagonal(M, np.abs(M).sum(axis=0) * (1 + rng.random(n)) + 0.1)
    return np.linalg.solve(B, C)


def triangular_p(rng, n, size=1.0):
    """Return a lower triangular matrix with a positive diagonal."""
    return np.tril(size * rng.standard_normal((n, n)), -1) + np.diag(
        rng.uniform(0.5, 2, n)
    )


def skew(rng, n, diagonal):
    """Return a positive definite matrix that is skew-symmetric but for its diagonal."""
    K = rng.standard_normal((n, n))
    return K - K.T + diagonal * np.eye(n)


def unsolvable(rng, n):
    """Return a semidefinite A with A v = 0, v > 0, and q with q'v < 0."""
    v = rng.exponential(size=n)
    v /= np.linalg.norm(v)
    B = rng.standard_normal((n, n - 1))
    B -= np.outer(v, v @ B)
    A = B @ B.T
    q = rng.standard_normal(n)
    return (A + A.T) / 2, q - v * (q @ v + 0.1)


def murty(n):
    """Return Murty's exponential example (1978), z = 2^n e_n: 2^n pivots of Lemke."""
    A = np.triu(np.full((n, n), 2.0), 1) + np.eye(n)
    q = 2.0 ** np.arange(1, n + 1) - 2.0 ** (n + 1)
    return A, q, np.append(np.zeros(n - 1), 2.0**n)


def fathi(n):
    """Return Fathi's exponential example (1979): M M' of Murty's matrix, SPD."""
    M = np.tril(2 * np.ones((n, n)), -1) + np.eye(n)
    return M @ M.T, -np.ones(n)


def laplacian(m, shift=0.0):
    """Return the five-point matrix on m x m nodes plus shift I, csr_array."""
    T = sparse.diags_array(
        [-np.ones(m - 1), np.full(m, 2.0), -np.ones(m - 1)], offsets=[-1, 0, 1]
    )
    eye = sparse.eye_array(m)
    return sparse.csr_array(
        sparse.kron(eye, T) + sparse.kron(T, eye) + shift * sparse.eye_array(m * m)
    )


def contact_scenes():
    """Return {name: (W_NN, q_N)} of the contact scenes in the data folder."""
    names = (path.stem for path in sorted((DATA / "contact").glob("*.npz")))
    return {name: contact_lcp(DATA, name) for name in names}


def checkers(A):
    """Return q, bounds and z = (1, 0, 1, 0, ...) which solves the LCP."""
    z = np.arange(1, A.shape[0] + 1) % 2.0
    return 1.0 - z - A @ z, 0.0, INF, z


def paper_example(number, m, delta=4.0):
    """Return A = P + delta I and q of the paper's Example 1 or 2, n = m^2; z = 1, 2."""
    scene = sweep_scenes.paper_example(number, m, delta)
    return scene.A, scene.q


def whole_numbers(seed):
    """Return a small degenerate LCP with x'Ax >= 0, in a box of any kind.

    It is B'B + K - K' and q in whole numbers: rows repeat, tie and contradict.
    """
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 9))
    B = rng.integers(-2, 3, (int(rng.integers(0, n + 1)), n)) * (rng.random(n) < 0.6)
    K = rng.integers(-2, 3, (n, n)) * (rng.random((n, n)) < rng.choice([0.2, 0.5, 1.0]))
    lower, upper = np.zeros(n), np.full(n, INF)
    if rng.random() < 0.5:
        kind = rng.integers(0, 6, n)
        lower = rng.integers(-2, 3, n).astype(float)
        upper = lower + rng.integers(0, 3, n)
        upper[kind <= 1], lower[kind == 2] = INF, -INF
        lower[kind == 3], upper[kind == 3] = -INF, INF
    A, q = (B.T @ B + K - K.T).astype(float), rng.integers(-3, 4, n).astype(float)
    return A, q, lower, upper


def program(seed, n, m, kind, free=1.0):
    """Return the LCP of min 1/2 x'Px + q'x, Gx <= h, a share of x free, others >= 0.

    kind: "infeasible" by a combination of rows, "unbounded" along d, or "solvable".
    """
    rng = np.random.default_rng([seed, n])
    is_free = rng.random(n) < free
    B, G = rng.standard_normal((n // 2, n)), rng.standard_normal((m, n))
    x, d = rng.random(n), np.abs(rng.standard_normal(n))
    d /= np.linalg.norm(d)
    q = rng.standard_normal(n)
    if kind == "unbounded":
        B -= np.outer(B @ d, d)
        rising = G @ d > 0.0
        G[rising] -= np.outer(G[rising] @ d, d)
        q -= (q @ d + 0.05) * d
    h = G @ x + rng.random(m)
    if kind == "infeasible":
        y = rng.random(m - 1) * (rng.random(m - 1) < 0.3)
        G[-1] = -y @ G[:-1] + rng.random(n) * ~is_free
        h[-1] = -y @ h[:-1] - 0.1 * np.linalg.norm(h)
    elif kind == "solvable":
        active = rng.random(m) < 0.4 * n / m
        h, y = G @ x + ~active * rng.random(m), active * rng.random(m)
        x_is_0 = ~is_free & (rng.random(n) < 0.5)
        h -= G @ (x * x_is_0)
        x[x_is_0] = 0.0
        q = -B.T @ (B @ x) / n - G.T @ y + x_is_0 * rng.random(n)
    A = np.block([[B.T @ B / n, G.T], [-G, np.zeros((m, m))]])
    lower = np.where(np.append(is_free, np.zeros(m)) > 0.0, -INF, 0.0)
    return A, np.append(q, h), lower, np.full(n + m, INF)


def chain(n, room):
    """Return a sparse LCP: x_i+1 >= x_i + 1 and x_n <= n - 1 + room; x, y >= 0."""
    G = sparse.diags_array([1.0, -1.0], offsets=[0, 1], shape=(n, n)).tolil()
    h = np.append(-np.ones(n - 1), n - 1 + room)
    A = sparse.block_array([[None, G.T], [-G, None]], format="csr")
    return A, np.append(np.ones(n), h)


def neumann(m, n=1):
    """Return the five-point matrix with free ends: it sends constants to 0."""
    G = [sparse.diags_array([-np.ones(k - 1), np.ones(k - 1)], offsets=[0, 1],
         shape=(k - 1, k)) if k > 1 else sparse.csr_array((1, 1))
         for k in (m, n)]  # fmt: skip
    lines = [differences.T @ differences for differences in G]
    one, other = (sparse.eye_array(k) for k in (m, n))
    A = sparse.csr_array(sparse.kron(lines[0], other) + sparse.kron(one, lines[1]))
    A.sort_indices()
    return A


def textbook_file():
    """Return {name: (A, q)} of the textbook file in the data folder, {} without it."""
    path = DATA / "lcp" / "textbook_lcps.json"
    if not path.exists():
        return {}
    return {
        p["name"]: (np.array(p["M"]), np.array(p["q"]))
        for p in json.loads(path.read_text())["problems"]
    }
