"""LCPs with known answers: textbook problems, generated classes, contact scenes.

A problem is (A, q) or (A, q, lower, upper); a generator takes a numpy Generator.
"""

import json
import os
from pathlib import Path

import numpy as np
from scipy import sparse

from namlcp import Prepared
from namlcp.lcp.data import LCP

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


def box_lcp(A, q, lower, upper, symmetric=True):
    """Return an LCP without any check."""
    return LCP(Prepared.unchecked(A, symmetric), q, lower, upper)


def textbook(name):
    """Return A, q and the solution (None if there are several)."""
    A, q, z, _ = TEXTBOOK[name]
    z = None if z is None else np.array(z, dtype=float)
    return np.array(A, dtype=float), np.array(q, dtype=float), z


def with_solution(rng, A, degenerate=0.0):
    """Return q and z such that z solves LCP(q, A); some z_i = w_i = 0 if wanted."""
    n = A.shape[0]
    kind = rng.random(n)
    z = np.where(kind < 0.5, rng.exponential(size=n), 0.0)
    w = np.where(kind >= 0.5, rng.exponential(size=n), 0.0)
    none = rng.random(n) < degenerate
    z[none] = w[none] = 0.0
    return w - A @ z, z


def spd(rng, n, condition):
    """Return a symmetric positive definite matrix with that condition number."""
    V, _ = np.linalg.qr(rng.standard_normal((n, n)))
    A = V * np.logspace(0, -np.log10(condition), n) @ V.T
    return (A + A.T) / 2


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


def disc_pile(rng, rows, gravity=9.81):
    """Return W, q of frictionless contact in a pile of discs between two walls.

    Discs of radius about 1/2 lie in a hexagonal packing; contacts i have normals N_i,
    W = N M^-1 N', q = N (v + h g) + gap / h: sparse, symmetric, often singular.
    """
    height = np.sqrt(3) / 2
    centres = np.array(
        [
            (k + 0.5 * (j % 2), 0.5 + height * j)
            for j in range(rows)
            for k in range(rows)
        ]
    )
    radius = 0.5 * (1 - 1e-3 * rng.random(len(centres)))
    mass = np.pi * radius**2
    h = 0.01
    left, right = centres[:, 0].min() - 0.5, centres[:, 0].max() + 0.5
    entries, gaps = [], []
    for a, (x, y) in enumerate(centres):
        walls = (((0, 1), y), ((1, 0), x - left), ((-1, 0), right - x))
        for normal, distance in walls:
            if distance - radius[a] < 0.1:
                entries.append([(a, np.array(normal, dtype=float))])
                gaps.append(distance - radius[a])
        for b in range(a):
            apart = centres[a] - centres[b]
            distance = np.linalg.norm(apart)
            if distance - radius[a] - radius[b] < 0.1:
                entries.append([(a, apart / distance), (b, -apart / distance)])
                gaps.append(distance - radius[a] - radius[b])
    N = sparse.lil_array((len(entries), 2 * len(centres)))
    for i, contact in enumerate(entries):
        for a, normal in contact:
            N[i, 2 * a], N[i, 2 * a + 1] = normal
    N = sparse.csr_array(N)
    W = sparse.csr_array(N @ sparse.diags_array(np.repeat(1 / mass, 2)) @ N.T)
    W = sparse.csr_array((W + W.T) / 2)
    W.sort_indices()
    velocity = np.tile([0.0, -h * gravity], len(centres))
    velocity += 0.05 * rng.standard_normal(velocity.size)
    return W, N @ velocity + np.array(gaps) / h * 0.1


def contact_names():
    """Return the names of the contact scenes in the data folder, [] without it."""
    return sorted(path.stem for path in (DATA / "contact").glob("*.npz"))


def contact(name):
    """Return W_NN (symmetrised csr_array) and q_N of a contact scene."""
    with np.load(DATA / "contact" / f"{name}.npz") as f:
        W = sparse.csr_array((f["data"], f["indices"], f["indptr"]), tuple(f["shape"]))
        dim = int(f["dim"]) if "dim" in f else 1
        A = sparse.csr_array(W[::dim, ::dim])
        A = sparse.csr_array((A + A.T) / 2)
        A.sort_indices()
        return A, np.ascontiguousarray(f["q"][::dim], dtype=float)


def textbook_file():
    """Return {name: (A, q)} of the textbook file in the data folder, {} without it."""
    path = DATA / "lcp" / "textbook_lcps.json"
    if not path.exists():
        return {}
    return {
        p["name"]: (np.array(p["M"]), np.array(p["q"]))
        for p in json.loads(path.read_text())["problems"]
    }
