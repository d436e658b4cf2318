"""The convergence theory at scale: is_h_plus by definition, its time; proofs by runs.

h_plus-definition
    Random matrices on both sides of rho(J) = 1, near the border included; the truth is
    the construction (dense eigenvalues); witnesses are checked in rational arithmetic.
h_plus
    n = 10^6, is_h_plus beside one sweep, one product and one multigrid solve.
convergence-proofs
    Random matrices, methods and parameters; what `converges` proves must converge, what
    it refutes must not.
"""

import itertools
from collections import Counter
from collections.abc import Iterator
from fractions import Fraction
from functools import partial
from typing import Any

import numpy as np
import scipy.sparse as sp

from namlcp import Prepared, Status, Verdict, converges, is_h_plus, solve_lcp
from namlcp.lcp.data import LCP
from namlcp.lcp.modulus.methods import SWEEPS, Parameters
from namlcp.lcp.modulus.sweeps import step_of
from validation.applications.large import linear_solve
from validation.harness import Row, timing
from validation.harness.suite import Parts
from validation.problems import sweep_scenes

DISTANCES = (0.5, 1e-2, 1e-4, 1e-6, 1e-8, 1e-9, 2e-10, 1e-11, 1e-12, 1e-14)


def random_matrix(rng: np.random.Generator, target: float) -> np.ndarray | None:
    """Return a matrix with rho(J) = target; None where it vanishes or is unsure."""
    n = int(rng.integers(2, 40))
    A = rng.normal(size=(n, n)) * (rng.random((n, n)) < rng.choice([0.1, 0.3, 1.0]))
    if rng.random() < 0.3:
        A = A + A.T
    np.fill_diagonal(A, rng.uniform(0.5, 2.0, n))
    if rng.random() < 0.3:  # reducible
        A[: n // 2, n // 2 :] = 0.0
    off = ~np.eye(n, dtype=bool)
    for _ in range(2):
        J = np.abs(A * off) / np.diag(A)[:, None]
        rho = float(np.max(np.abs(np.linalg.eigvals(J))))
        if rho < 1e-2:
            return None
        A[off] *= target / rho
    if rng.random() < 0.4:  # neither changes rho(J)
        s = 2.0 ** np.rint(rng.uniform(-20.0, 20.0, n))
        A = A * s / s[:, None] if rng.random() < 0.5 else A * s[:, None]
    return A


def proves(verdict: Verdict, A: np.ndarray) -> bool:
    """Tell whether the witness proves the answer, in rational arithmetic."""
    n = len(A)
    x = [Fraction(v) for v in verdict.witness.tolist()]
    a = [[Fraction(v) for v in row] for row in A.tolist()]
    rows = [
        a[i][i] * x[i] - sum(abs(a[i][j]) * x[j] for j in range(n) if j != i)
        for i in range(n)
    ]
    if verdict.answer:
        return min(x) > 0 and min(rows) > 0
    return min(x) >= 0 and max(x) > 0 and max(rows) <= 0


def definition_rows(count: int) -> Iterator[Row]:
    rng = np.random.default_rng(0)
    for side, distance in itertools.product((-1.0, 1.0), DISTANCES):
        seen: Counter[str] = Counter()
        while seen["matrices"] < count:
            A = random_matrix(rng, 1.0 + side * distance)
            if A is None:
                continue
            verdict = is_h_plus(sp.csr_array(A) if rng.random() < 0.5 else A)
            seen["matrices"] += 1
            seen["undecided"] += verdict.answer is None
            if verdict.answer is not None:
                seen["proven"] += proves(verdict, A)
                seen["other"] += verdict.answer is not (side < 0.0)
        row: Row = {"case": f"rho(J) = 1 {'-+'[side > 0]} {distance:g}"}
        row |= {"matrices": count, "proven": seen["proven"]}
        # beyond 1e-10 the eigenvalues are right, so that none may be other
        row["not_the_eigenvalues"] = seen["other"]
        yield row | {"undecided": seen["undecided"]}


def time_rows(m: int) -> Iterator[Row]:
    for example, delta in ((1, 4.0), (1, 1.0), (1, 0.0), (1, -0.1), (2, 4.0), (2, 0.0)):
        scene = sweep_scenes.paper_example(example, m, delta)
        A = scene.A
        lcp = LCP(Prepared(A), scene.q, scene.lower, scene.upper)
        step = step_of(lcp, "pgs", Parameters())
        sweep = partial(step.run, *np.zeros((2, 2, m * m)))
        row: Row = {"case": f"Example {example}, delta = {delta:g}", "n": m * m}
        row["sweep"] = timing.median_time(sweep)[2]
        verdict, _, row["is_h_plus"] = timing.median_time(partial(is_h_plus, A))
        solver = "cg" if example == 1 else "bicgstab"
        ask = partial(linear_solve, A, np.full(m * m, -1.0), solver)
        row["linear_solve"] = ask() if delta >= 0.0 else ""
        yield row | {"answer": verdict.answer, "checked": verdict.checked}


KINDS = ("dominant", "Z", "spd", "gram", "positive real", "badly scaled")


def random_problem(rng: np.random.Generator, kind: str) -> tuple[Any, ...]:
    """Return A of a kind with a positive diagonal, q and bounds of every sort."""
    n = int(rng.integers(1, 14))
    A = rng.normal(size=(n, n)) * (rng.random((n, n)) < rng.choice([0.3, 1.0]))
    if kind in ("spd", "gram"):
        X = rng.normal(size=(n, n + 2 if kind == "spd" else max(1, n - 2)))
        A = X @ X.T
    elif kind == "positive real":
        A = A - A.T + np.diag(rng.uniform(0.2, 2.0, n))
    else:
        np.fill_diagonal(A, 0.0)
        A = -np.abs(A) if kind == "Z" else A
        A = A * rng.uniform(0.3, 1.3) + np.diag(np.abs(A).sum(axis=1) + 0.1)
        if kind == "badly scaled":
            s = 10.0 ** rng.uniform(-2.0, 2.0, n)
            A = A * s / s[:, None]
    lower = np.where(rng.random(n) < 0.3, -np.inf, rng.normal(size=n))
    upper = np.where(rng.random(n) < 0.3, np.inf, lower + rng.exponential(size=n))
    upper[lower == -np.inf] = 1.0
    return A, 3.0 * rng.normal(size=n), lower, upper


def random_parameters(rng: np.random.Generator, method: str, D: np.ndarray) -> Row:
    takes, given = SWEEPS[method].takes, {}
    if "alpha" in takes and rng.random() < 0.8:
        given["alpha"] = rng.uniform(0.1, 1.95)
    if "beta" in takes and rng.random() < 0.8:
        given["beta"] = rng.uniform(0.0, 1.95)
    if "omega" in takes and rng.random() < 0.8 and method != "modified-nam":
        given["omega"] = rng.choice([0.3, 0.5, 0.8, 1.0, 1.5, 3.0]) * D
    if "shift" in takes and rng.random() < 0.6:
        given["shift"] = rng.choice([0.0, 0.1, 1.0]) * D
    return given


def proof_rows(count: int) -> Iterator[Row]:
    rng = np.random.default_rng(1)
    for kind in KINDS:
        seen: Counter[str] = Counter()
        for _ in range(count):
            A, q, lower, upper = random_problem(rng, kind)
            method = str(rng.choice(list(SWEEPS)))
            given = random_parameters(rng, method, np.diag(A))
            verdict = converges(A, method, **given)
            seen[str(verdict.answer)] += 1
            if verdict.answer is True:
                result = solve_lcp(
                    A, q, lower, upper, method=method, **given, max_iter=300_000,
                    s0=10.0 * rng.normal(size=q.size),
                    eps_abs=1e-9 * max(1.0, np.abs(A).max()),
                )  # fmt: skip
                seen["kept"] += result.status is Status.SOLVED
            elif verdict.answer is False:
                e = np.ones(q.size)
                result = solve_lcp(
                    A, verdict.witness, 0.0 * e, np.inf * e, method=method, **given,
                    z0=e + 1e-3 * rng.normal(size=q.size), max_iter=20_000,
                    eps_abs=1e-9,
                )  # fmt: skip
                there = np.abs(result.z - e).max() < 1e-7
                seen["fled"] += not (result.status is Status.SOLVED and there)
        row = {"kind": kind, "problems": count, "proven": seen["True"]}
        row |= {"converged": seen["kept"], "refuted": seen["False"]}
        yield row | {"did_not": seen["fled"], "undecided": seen["None"]}


ROWS = {
    "h_plus-definition": partial(definition_rows, 60),
    "h_plus": partial(time_rows, 1000),
    "convergence-proofs": partial(proof_rows, 1500),
}
SUITE = Parts(__doc__, ROWS, ("pyamg",))
