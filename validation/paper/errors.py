"""The computations behind paper.md, from plain matrix formulas: no kernel is used.

`report` prints every section below the first line of its docstring.
"""

import itertools
import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from validation.paper.printed import EPS, SIZES, TABLES
from validation.problems import sweep_scenes

Matrix = Any
Row = dict[str, Any]


def parts(A: Matrix) -> tuple[Matrix, Matrix, Matrix]:
    """Return D, L, U of A = D - L - U."""
    D = sp.csr_array(sp.diags_array(A.diagonal()))
    return D, sp.csr_array(-sp.tril(A, -1)), sp.csr_array(-sp.triu(A, 1))


def splitting(A: Matrix, method: str, alpha: float) -> tuple[Matrix, Matrix]:
    """Return (M~, N~) of a printed method: Bai's (M, N), or (M + I - L, N + I - L)."""
    D, L, _ = parts(A)
    M = D / alpha - L
    more = 0 * L if method.startswith("m") else sp.eye_array(A.shape[0]) - L
    return M + more, M - A + more


def sweeps(
    scene: sweep_scenes.Scene,
    M: Matrix,
    N: Matrix,
    Omega: Matrix,
    bounded: bool = True,
    columns: str = "NATURAL",
) -> Iterator[float]:
    """Yield Res of the iterates of (M + Omega) s+ = N s + (Omega - A)|s| - 2 q.

    Without bounds |s| is replaced by s: a linear system. `columns`: SuperLU's order.
    """
    A, q, s = scene.A, scene.q, np.array(scene.s0)
    left = splu(sp.csc_array(M + Omega), permc_spec=columns)
    N, B = sp.csr_array(N), sp.csr_array(Omega - A)
    while True:
        R = np.abs(s) if bounded else s
        z = 0.5 * (R + s)
        w = A @ z + q
        yield float(np.linalg.norm(np.minimum(z, w) if bounded else w))
        s = left.solve(N @ s + B @ R - 2.0 * q)


def first_below(residuals: Iterator[float], eps: float, most: int) -> int:
    """Return the index of the first residual below eps, at most `most`."""
    return next(k for k, r in enumerate(residuals) if r < eps or k == most)


def printed_runs() -> Iterator[tuple[sweep_scenes.Scene, str, float, float]]:
    """Yield scene, method, alpha and the printed count of the 48 printed runs."""
    for (example, method, relaxation), (counts, *_) in TABLES.items():
        for m, printed in zip(SIZES, counts, strict=True):
            scene = sweep_scenes.paper_example(example, m)
            yield scene, method, relaxation or 1.0, printed


def agreeing(guess: Callable[[Matrix, float], Matrix], bounded: bool = True) -> int:
    """Return how many printed counts come out with Omega = guess(D, alpha)."""
    same = 0
    for scene, method, alpha, printed in printed_runs():
        Omega = guess(parts(scene.A)[0], alpha)
        run = sweeps(scene, *splitting(scene.A, method, alpha), Omega, bounded)
        same += first_below(run, EPS, 100) == printed
    return same


def paper_omega(D: Matrix, alpha: float) -> Matrix:
    """Return D/(2 alpha^2)."""
    return D / (2.0 * alpha**2)


def spectral_radius(T: np.ndarray) -> float:
    """Return the largest modulus of an eigenvalue."""
    return float(np.max(np.abs(np.linalg.eigvals(T))))


def bound_matrix(A: Matrix, M: Matrix, N: Matrix, Omega: Matrix) -> np.ndarray:
    """Return T = |(M~ + Omega)^-1| (|N~| + |Omega - A|) of Theorem 2, dense."""
    M, N, Omega, A = (sp.csr_array(X).toarray() for X in (M, N, Omega, A))
    return np.abs(np.linalg.inv(M + Omega)) @ (np.abs(N) + np.abs(Omega - A))


def comparison(A: Matrix) -> Matrix:
    """Return <A>: |a_ii| on the diagonal, -|a_ij| beside it."""
    return sp.csr_array(2.0 * sp.diags_array(np.abs(A.diagonal())) - abs(A))


def m_radius(Z: Matrix) -> float:
    """Return rho(|off-diagonal|/diagonal) of a Z-matrix: below 1, an M-matrix.

    inf where a diagonal entry is not positive: no M-matrix.
    """
    Z = sp.csr_array(Z).toarray()
    d = np.diag(Z)
    if not (d > 0.0).all():
        return math.inf
    return spectral_radius((np.diag(d) - Z) / d[:, None])


# ---- the sections of paper.md


def missing_omega() -> Iterator[Row]:
    """Count the printed iteration numbers that each guess of Omega reproduces."""
    guesses: dict[str, Callable[[Matrix, float], Matrix]] = {
        "I": lambda D, alpha: sp.eye_array(D.shape[0]),
        "D": lambda D, alpha: D,
        "D/2": lambda D, alpha: D / 2.0,
        "D/alpha": lambda D, alpha: D / alpha,
        "D/(2 alpha)": lambda D, alpha: D / (2.0 * alpha),
        "D/(2 alpha^2)": paper_omega,
    }
    for name, guess in guesses.items():
        yield {"Omega": name, "counts of 48": agreeing(guess)}
    same = agreeing(paper_omega, bounded=False)
    yield {"counts of 48 that stay without z >= 0": same}


def hidden_relaxation() -> Iterator[Row]:
    """Count the printed NAM iteration numbers that plain SOR for A z = -q has.

    With |s| = s the left matrix is D/alpha + Omega + I - 2 L and the right side twice
    the residual: SOR with relaxation 2 d / (d/alpha + omega + 1), d = 8 here.
    """
    same, relaxations = 0, {}
    for scene, method, alpha, printed in printed_runs():
        if not method.startswith("nam"):
            continue
        factor = 2.0 / (1.0 / alpha + 1.0 / (2.0 * alpha**2) + 1.0 / 8.0)
        relaxations[f"{method} {alpha:g}"] = factor
        A, q = scene.A, scene.q
        D, L, _ = parts(A)
        left = splu(sp.csc_array(D / factor - L), permc_spec="NATURAL")
        z, k = np.array(scene.s0), 0
        while np.linalg.norm(A @ z + q) >= EPS:
            z, k = z - left.solve(A @ z + q), k + 1
        same += k == printed
    yield {"counts of 24 that SOR has too": same} | relaxations


def printed_formulas() -> Iterator[Row]:
    """Apply the printed iterations once to a solution; a correct one stays there.

    A 10 x 10 problem of Example 1, with Omega = D/(2 alpha^2), alpha = 0.9, beta = 0.5
    and the q that makes half of the z*_i zero; s* = z* - Omega^-1 w*.
    """
    A = sweep_scenes.paper_example(1, 10).A
    a, b = 0.9, 0.5
    D, L, U = parts(A)
    n = A.shape[0]
    I, Omega = sp.eye_array(n), paper_omega(D, a)
    rng = np.random.default_rng(0)
    free, size = rng.random(n) < 0.5, rng.uniform(1.0, 2.0, n)
    z, w = np.where(free, size, 0.0), np.where(free, 0.0, size)
    q, s = w - A @ z, z - w / Omega.diagonal()
    sor = D - 2 * a * L + a * Omega + a * I
    aor = D - (a + b) * L + a * Omega + a * I
    for name, left, l, last in (  # (... + l L) s + a (Omega - A) last
        ("(5) as printed: -L, s", sor, -1.0, s),
        ("(5) with |s| only", sor, -1.0, abs(s)),
        ("(5) with -alpha L and |s|", sor, -a, abs(s)),
        ("(6) as printed: 2 alpha - beta, s", aor, 2 * a - b, s),
        ("(6) with |s| only", aor, 2 * a - b, abs(s)),
        ("(6) with -beta and |s|", aor, -b, abs(s)),
    ):
        right = ((1 - a) * D + a * U + a * I + l * L) @ s + a * (Omega - A) @ last
        yield {"formula": name, "max |s+ - s*|": moved(left, right - 2 * a * q, s)}
    # L as the text defines it, the strictly lower part of A itself:
    lower, upper = -L, -U
    left = D - 2 * lower + Omega + I
    right = (upper + I - lower) @ s + (Omega - A) @ abs(s) - 2 * q
    name = "(4) with L = tril(A, -1), U = triu(A, 1)"
    yield {"formula": name, "max |s+ - s*|": moved(left, right, s)}


def moved(left: Matrix, right: np.ndarray, s: np.ndarray) -> float:
    """Return max |s+ - s| of left s+ = right."""
    return float(np.max(np.abs(splu(sp.csc_array(left)).solve(right) - s)))


def factor_r() -> Iterator[Row]:
    """Compare Omega(|s| - s) with A z + q at the fixed point (Theorem 1)."""
    scene = sweep_scenes.paper_example(1, 10)
    A, n = scene.A, scene.q.size
    q = scene.q + 3.0 * np.sin(np.arange(n)) * 4.0
    M, N = splitting(A, "namgs", 1.0)
    Omega = parts(A)[0] / 2.0
    left = splu(sp.csc_array(M + Omega))
    for r in (1.0, 2.0, 5.0):
        s = np.zeros(n)
        for _ in range(300):
            s = left.solve(N @ s + (Omega - A) @ np.abs(s) - r * q)
        w = A @ (np.abs(s) + s) / r + q
        printed = Omega @ (np.abs(s) - s)
        ratio = printed[w > 1e-6] / w[w > 1e-6]
        yield {"r": r, "Omega(|s| - s) / (A z + q)": float(np.median(ratio))}


def theorem_two() -> Iterator[Row]:
    """Return rho(T) of the paper's own runs at n = 100, 900 (Theorem 2)."""
    for example, method, relaxation in TABLES:
        alpha = relaxation or 1.0
        row: Row = {"example": example, "method": method}
        for m in (10, 30):
            A = sweep_scenes.paper_example(example, m).A
            Omega = paper_omega(parts(A)[0], alpha)
            T = bound_matrix(A, *splitting(A, method, alpha), Omega)
            row[f"rho(T), n = {m * m}"] = spectral_radius(T)
        yield row


def componentwise() -> Iterator[Row]:
    """Count the components that one step takes away from s* (Theorem 2).

    Example 1, n = 100, NAMGS, Omega = D; s differs from s* in one component.
    """
    scene = sweep_scenes.paper_example(1, 10)
    A, D = scene.A, parts(scene.A)[0]
    M, N = splitting(A, "namgs", 1.0)
    fixed = np.tile([1.0, 2.0], 50)
    s = fixed + (np.arange(100) == 44)
    new = splu(sp.csc_array(M + D)).solve(N @ s + (D - A) @ np.abs(s) - 2 * scene.q)
    worse = np.abs(new - fixed) > np.abs(s - fixed) + 1e-14
    radius = spectral_radius(bound_matrix(A, M, N, D))
    yield {"rho(T)": radius, "components further from s*": int(np.sum(worse))}


def compatible() -> Iterator[Row]:
    """Return max | <A> - (<M~> - |N~|) |, 0 where H-compatible (Theorem 3)."""
    A = sweep_scenes.paper_example(1, 10).A
    D, L, _ = parts(A)
    I, alpha, beta = sp.eye_array(A.shape[0]), 0.9, 0.5
    for name, M in (
        ("NAM", A),
        ("NAMJ", D),
        ("NAMGS", D - L),
        ("NAMSOR, alpha = 0.9", D / alpha - L),
        ("NAMAOR, alpha = 0.9, beta = 0.5", (D - beta * L) / alpha),
        ("NAMAOR, alpha = 0.9, beta = 0", D / alpha),
    ):
        gap = comparison(M + I - L) - abs(M - A + I - L) - comparison(A)
        yield {"method": name, "max gap": float(abs(gap).max())}


def theorem_three() -> Iterator[Row]:
    """Tell for NAMGS which condition of Theorem 3 is an M-matrix: below 1.

    Stated: 2 Omega - D - |B|. Used in the proof: <A> + 2 Omega - D - |B|. Repaired:
    <M~> - |N~| + min(D, 2 Omega - D) - |B|.
    """
    for example, delta, c in itertools.product((1, 2), (4.0, 0.0), (0.5, 1.0)):
        A = sweep_scenes.paper_example(example, 10, delta).A
        D, L, U = parts(A)
        M, N = splitting(A, "namgs", 1.0)
        stated = (2.0 * c - 1.0) * D - L - U
        repaired = comparison(M) - abs(N) + min(1.0, 2.0 * c - 1.0) * D - L - U
        row: Row = {"example": example, "delta": delta, "Omega": f"{c:g} D"}
        row |= {"stated": m_radius(stated), "proof": m_radius(comparison(A) + stated)}
        row["repaired"] = m_radius(repaired)
        yield row | {"rho(T)": spectral_radius(bound_matrix(A, M, N, c * D))}


def repaired_condition(trials: int = 2000) -> Iterator[Row]:
    """Check the repaired Theorem 3 on random matrices, Omega and methods."""
    rng = np.random.default_rng(0)
    holds = violated = bounded = 0
    worst = 0.0
    for _ in range(trials):
        n = int(rng.integers(2, 9))
        A = rng.standard_normal((n, n)) * (rng.random((n, n)) < 0.6)
        np.fill_diagonal(A, 0.0)
        row_sum = np.abs(A).sum(axis=1) + 0.1
        np.fill_diagonal(A, row_sum * rng.uniform(0.7, 5.0))
        D, L = np.diag(np.diag(A)), -np.tril(A, -1)
        alpha, beta = rng.uniform(0.3, 1.9), rng.uniform(0.0, 1.9)
        E = np.diag(rng.uniform(0.0, 2.0, n)) * rng.integers(0, 2)
        M = (D - beta * L) / alpha + E - L * rng.integers(0, 2)
        N = M - A
        Omega = D * rng.uniform(0.2, 2.0)
        K = 2.0 * np.diag(np.diag(np.abs(M))) - np.abs(M) - np.abs(N)
        K += np.minimum(D, 2.0 * Omega - D) - (np.abs(A) - D)
        radius = spectral_radius(bound_matrix(A, M, N, Omega))
        bounded += radius < 1.0
        if m_radius(K) < 1.0:
            holds += 1
            violated += radius >= 1.0
            worst = max(worst, radius)
    yield {
        "matrices": trials,
        "condition holds": holds,
        "of these rho(T) >= 1": violated,
        "largest rho(T) of these": worst,
        "rho(T) < 1 in all": bounded,
    }


def units() -> Iterator[Row]:
    """Return the counts of NAMGS for A, q and eps in other units, both shifts."""
    for unit in (1e3, 1.0, 1e-1, 1e-2, 1e-3):
        row: Row = {"unit": unit}
        scene = sweep_scenes.paper_example(1, 30)
        scene = scene._replace(A=unit * scene.A, q=unit * scene.q)
        D, L, _ = parts(scene.A)
        for word, shift in (("I", sp.eye_array(scene.q.size)), ("D", D)):
            M = D - 2 * L + shift
            run = sweeps(scene, M, M - scene.A, D / 2)
            row[f"sweeps, shift {word}"] = first_below(run, unit * EPS, 10_000)
        yield row


def far_from_normal() -> Iterator[Row]:
    """Return what NAM with Omega = I does in Example 2: growth and stagnation."""
    for m in (30, 50):
        A = sweep_scenes.paper_example(2, m, 0.0).A
        inverse = np.linalg.inv((A + 2.0 * sp.eye_array(m * m) - parts(A)[1]).toarray())
        largest = float(np.max(np.abs(inverse)))
        yield {"delta": 0, "n": m * m, "max |(A + 2I - L)^-1|": largest}
    scene = sweep_scenes.paper_example(2, 30)
    I = sp.eye_array(scene.q.size)
    more = I - parts(scene.A)[1]
    run = list(
        itertools.islice(sweeps(scene, scene.A + more, more, I, columns="COLAMD"), 2001)
    )
    residuals = {f"Res {k}": run[k] for k in (10, 100, 500, 1000, 2000)}
    yield {"delta": 4, "n": scene.q.size} | residuals


SECTIONS = (
    missing_omega, hidden_relaxation, printed_formulas, factor_r,
    theorem_two, componentwise, compatible, theorem_three, repaired_condition, units,
    far_from_normal,
)  # fmt: skip


def report() -> None:
    """Print every computation."""
    for section in SECTIONS:
        print("\n" + (section.__doc__ or "").splitlines()[0])
        for row in section():
            print("  " + ", ".join(f"{name} = {text(x)}" for name, x in row.items()))


def text(value: Any) -> str:
    """Return a number to four digits."""
    return f"{value:.4g}" if isinstance(value, float) else str(value)
