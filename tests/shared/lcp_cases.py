"""The table CASES: LCPs of every class, with what is known of their answers.

`truth` says what a method may promise:

- dominant: an H+ matrix, on which every sweep method converges too;
- P: a P-matrix (symmetric definite ones are), one solution for every q;
- semidefinite: x'A x >= 0, symmetric or not, with a solution;
- copositive: Lemke's path ends at a solution;
- general: there is a solution, and "auto" finds it;
- unsolvable: no solution, and "auto" has a proof;
- hidden: there is a solution, but rounding may forbid to find it;
- open: any answer that the definition allows.
"""

from functools import cache
from typing import Any, NamedTuple

import numpy as np
import problems_general as general
import problems_lcp as problems
from problems_lcp import INF
from scipy import sparse

from validation.problems.contact_scenes import disc_pile
from validation.problems.draw import definite as spd
from validation.problems.fuzzed import cases as campaign
from validation.problems.general.families import FAMILIES


class Case(NamedTuple):
    """A box LCP, its truth, and its solution where that is known."""

    truth: str
    A: Any
    q: Any
    lower: Any = 0.0
    upper: Any = INF
    z: Any = None

    @property
    def data(self):
        return self.A, self.q, self.lower, self.upper


def numbers(*key):
    return np.random.default_rng(key)


def textbook():
    for name, (A, q, z, _) in problems.TEXTBOOK.items():
        yield name, Case(problems.TRUTH.get(name, "semidefinite"), A, q, z=z)
    for n in (1, 2, 8, 20, 30):
        yield f"murty {n}", Case("P", *problems.murty(n)[:2], z=problems.murty(n)[2])
    for n in (2, 10, 30):
        yield f"fathi {n}", Case("P", *problems.fathi(n))
    for name, (A, q) in problems.textbook_file().items():
        yield f"file {name}", Case("general", A, q)
    for name, (A, q) in problems.contact_scenes().items():
        yield f"contact {name}", Case("semidefinite", A, q)
    for name, (A, q) in general.collection().items():
        perturbed = name == "siconos_lcp_Pang_isolated_sol_perturbed"
        yield f"general {name}", Case("unsolvable" if perturbed else "general", A, q)


def definite():
    for n in (1, 5, 40, 150):
        for condition in (1e2, 1e6, 1e12):
            rng = numbers(n, int(np.log10(condition)))
            A, name = spd(rng, n, condition), f"spd {n} {condition:.0e}"
            q, z = problems.with_solution(rng, A)
            yield name, Case("P", A, rng.standard_normal(n))
            yield f"{name} planted", Case("P", A, q, z=z if condition < 1e6 else None)
            ties = problems.with_solution(rng, A, degenerate=0.5)
            yield f"{name} ties", Case("P", A, ties[0])
    rng = numbers(0)
    A, q = spd(rng, 50, 1e4), rng.standard_normal(50)
    for size_A, size_q in ((1e-9, 1e9), (1e9, 1e9), (1e-9, 1e-9), (1e9, 1e-9)):
        yield f"spd in {size_A:.0e}, {size_q:.0e}", Case("P", size_A * A, size_q * q)
    d = 10 ** rng.uniform(-4, 4, 50)
    B = d[:, None] * A * d
    yield "spd, rescaled unknowns", Case("P", (B + B.T) / 2, d * q)
    yield "spd, all free", Case("P", A, q, -INF, INF, np.linalg.solve(A, -q))
    for a in (1e-150, 1e-12, 1.0, 1e12):
        z = np.array([3.0 / a])
        yield f"one unknown {a:.0e}", Case("P", np.array([[a]]), [-3.0], z=z)
    for size in (1e-160, 1e162):
        A = sparse.diags_array(np.array([7.0, 7.0]) * size, format="csr")
        q = np.array([-1.5, 1.1]) * 1e-6 * size
        yield f"diagonal of {size:.0e}", Case("P", A, q, z=[1.5e-6 / 7.0, 0.0])
    yield "nothing to do", Case("dominant", np.eye(3), [0.0, 1.0, 2.0], z=np.zeros(3))
    yield "all fixed", Case("dominant", np.eye(2), [1.0, -1.0], 2.0, 2.0, [2.0, 2.0])
    yield "empty", Case("P", np.zeros((0, 0)), np.zeros(0), z=np.zeros(0))
    for low in (1e-3, 1e-6, 1e-9, 1e-11):  # a P-matrix of condition 4 / low
        A, z = [[1.0, -1.0], [-1.0, 1.0 + low]], [(2 + low) / low, 2 / low]
        truth = "P" if low > 1e-10 else "hidden"
        yield f"far solution {low:.0e}", Case(truth, A, [-1.0, -1.0], z=z)


def p_matrices():
    for make in (problems.quotient_p, problems.triangular_p):
        for n in (1, 2, 3, 10, 60):
            rng = numbers(n, 1)
            A, name = make(rng, n), f"{make.__name__} {n}"
            q, z = problems.with_solution(rng, A)
            yield name, Case("P", A, q, z=z if n < 60 else None)
            rows, columns = 10 ** rng.uniform(-4, 4, (2, n))
            B = rows[:, None] * A * columns
            yield f"{name} rescaled", Case("P", B, rows * rng.standard_normal(n))
    for n in (5, 50, 150):
        for diagonal in (1e-2, 1e-4):
            rng = numbers(n, 2)
            A = problems.skew(rng, n, diagonal)
            yield f"skew {n} {diagonal:.0e}", Case("P", A, rng.standard_normal(n))
    A = problems.laplacian(30, 0.5)
    A = sparse.csr_array(A + 0.1 * sparse.triu(A, 1))
    yield "sparse, not symmetric", Case("P", A, numbers(3).standard_normal(900))
    for seed in range(3):  # symmetric but for rounding, not in its pattern
        rng = numbers(seed, 4)
        B = np.where(rng.random((70, 70)) < 0.06, rng.standard_normal((70, 70)), 0.0)
        A = B @ B.T + 0.1 * np.eye(70)
        A[(A == 0.0) & (rng.random((70, 70)) < 0.1)] = 1e-18
        q = rng.standard_normal(70)
        yield f"stored on one side {seed}", Case("P", sparse.csr_array(A), q)
    for name, A in (
        ("symmetric", spd(numbers(5), 60, 1e3)),
        ("not symmetric", problems.quotient_p(numbers(5), 60)),
        ("small", spd(numbers(5), 30, 1e2)),
    ):
        n, rng = len(A), numbers(6)
        lower, upper = -rng.random(n), rng.random(n)
        lower[:10], upper[5:15] = -INF, INF
        lower[20:25] = upper[20:25]
        yield f"box, {name}", Case("P", A, rng.standard_normal(n), lower, upper)
    for seed in range(5):
        rng = numbers(seed, 11)
        n = int(rng.integers(1, 30))
        F, K = rng.standard_normal((2, n, n))
        A, q = F @ F.T + 0.1 * np.eye(n) + K - K.T, 5.0 * rng.standard_normal(n)
        lower = np.where(rng.random(n) < 0.4, -INF, rng.standard_normal(n))
        room = rng.exponential(size=n) * (rng.random(n) < 0.9)
        upper = np.where(rng.random(n) < 0.4, INF, np.maximum(lower, -2.0) + room)
        yield f"any box {seed}", Case("P", A, q, lower, upper)


def dominant():
    rng = numbers(1)
    A = rng.normal(size=(30, 30)) * (rng.random((30, 30)) < 0.2)
    A += np.diag(3.0 * np.abs(A).sum(axis=1) + 1.0)
    lower, upper = np.full(30, -1.0), np.full(30, 1.0)
    lower[::5], upper[::7] = -INF, INF
    lower[3] = upper[3] = 0.7
    z = np.clip(2.0 * rng.normal(size=30), lower, upper)
    w = np.where(z == lower, 1.0, np.where(z == upper, -1.0, 0.0))
    yield "dominant box", Case("dominant", A, w - A @ z, lower, upper, z)
    yield (
        "dominant free",
        Case("dominant", A, -A @ z, -INF, np.where(np.arange(30) == 0, z[0], INF), z),
    )
    A = problems.laplacian(6, 4.0)
    yield "dominant grid", Case("dominant", A, *problems.checkers(A))


def semidefinite():
    for n in (2, 20, 100):
        rng = numbers(n, 7)
        B = rng.standard_normal((n // 2, n))
        A = (B.T @ B + (B.T @ B).T) / 2
        q = -B.T @ rng.standard_normal(n // 2)
        yield f"singular {n}", Case("semidefinite", A, q)
        for ties in (0.0, 0.5):
            q, _ = problems.with_solution(rng, A, ties)
            yield f"singular {n} planted {ties}", Case("semidefinite", A, q)
    yield "zero matrix", Case("semidefinite", np.zeros((2, 2)), [1.0, 0.0], z=[0, 0])
    for rows in (1, 3, 5):
        A, q = disc_pile(rows)
        yield f"pile of discs {rows}", Case("semidefinite", A, q)
    for index in (7228, 9319, 40633, 47314, 59860, 66541, 81994, 89848, 92806, 96886,
                  12839, 96776):  # fmt: skip
        case = campaign.make(1, index)
        assert case.truth == "solvable"
        yield f"campaign {index}", Case("semidefinite", *case.problem)
    for shape in ((4, 6), (15, 30)):
        for free in (1.0, 0.3, 0.0):
            for seed in range(3):
                lcp = problems.program(seed, *shape, "solvable", free)
                name = f"program {shape[0]} {free} {seed}"
                yield name, Case("semidefinite", *lcp)
    for n in (40, 400):  # dense LU up to some hundred unknowns, sparse LU beyond
        yield f"chain {n}", Case("semidefinite", *problems.chain(n, 0.5))
    for n in (5, 40):
        A, q = problems.neumann(n), np.sin(np.arange(n))
        yield f"neumann {n}", Case("semidefinite", A, q - q.mean() + 0.1)
    for seed in range(30):
        yield f"whole numbers {seed}", Case("open", *problems.whole_numbers(seed))


def unsolvable():
    for name, (A, q) in problems.UNSOLVABLE.items():
        yield name, Case("unsolvable", A, q)
    for n in (3, 30, 150):
        yield f"unsolvable {n}", Case("unsolvable", *problems.unsolvable(numbers(n), n))
    for size in (1e-120, 1e120):
        q = np.array([-1.0, 2.0]) * size
        yield f"zero in {size:.0e}", Case("unsolvable", np.zeros((2, 2)), q)
    # stalled or went round once; then symmetric and nearly singular ones
    for index in (98, 149, 302, 557, 710, 4790, 5963, 16775, 18611, 1678, 43855, 57166,
                  70069):  # fmt: skip
        case = campaign.make(1, index)
        yield f"campaign {index}", Case("unsolvable", *case.problem)
    for kind in ("infeasible", "unbounded"):
        for shape in ((4, 6), (15, 30)):
            for free in (1.0, 0.3, 0.0):
                for seed in range(3):
                    lcp = problems.program(seed, *shape, kind, free)
                    name = f"{kind} {shape[0]} {free} {seed}"
                    yield name, Case("unsolvable", *lcp)
    for n in (40, 400):
        yield f"chain {n} too short", Case("unsolvable", *problems.chain(n, -0.5))
    for n in (5, 40):
        A, q = problems.neumann(n), np.sin(np.arange(n))
        yield f"neumann {n} sinking", Case("unsolvable", A, q - q.mean() - 0.1)
    # q'v = 0, but z_1 = 2 makes w_2 = -6, and z_2 has no upper bound
    A, q, z_1 = [[0.0, 3.0], [-3.0, 0.0]], [1.0, 0.0], [2.0, INF]
    yield "proof by the bounds", Case("unsolvable", A, q, [2.0, 0.0], z_1)
    yield "closing walls", Case("unsolvable", *general.closing_walls())


def neither():
    """Matrices that are neither P nor semidefinite."""
    for bodies in (3, 10, 40):
        for ratio in (1.0, 1e4):
            for seed, mu in enumerate((0.2, 0.5, 0.9)):
                A, q = general.friction(numbers(seed), bodies, mu, ratio)
                name = f"friction {bodies} {ratio:.0e} {mu}"
                yield name, Case("copositive", A, q)
    A, q = general.friction(numbers(4), 6, 0.5, directions=4)
    yield "friction in space", Case("copositive", A, q)
    for seed in range(4):
        for parts in ((4, 2, 2), (30, 10, 10)):
            lcp = general.machine(numbers(seed), *parts)
            yield f"machine {parts[0]} {seed}", Case("general", *lcp)
    for n in (5, 40, 160):
        for seed in range(3):
            lcp = FAMILIES["copositive"](n, seed)
            yield f"copositive {n} {seed}", Case("copositive", *lcp)
            yield f"p0 {n} {seed}", Case("general", *FAMILIES["P0"](n, seed))
    for n in (5, 40, 120):  # 1 on the diagonal, >= 0 off it: strictly copositive
        rng = numbers(n)
        A = np.abs(rng.standard_normal((n, n))) * (rng.random((n, n)) < 0.3)
        A -= np.diag(A.diagonal() - 1.0)
        yield f"nonnegative {n}", Case("copositive", A, rng.standard_normal(n))
    for size_A, size_q in ((1e-6, 1.0), (1.0, 1e-150), (1e6, 1e120)):
        A, q = general.friction(numbers(3), 8)
        lcp = size_A * A, size_q * q
        yield f"friction in {size_A:.0e}, {size_q:.0e}", Case("general", *lcp)
    for A in ([[0, 1], [1, 0]], [[0, 2, 0], [3, 0, 1], [0, 5, 0]]):  # games
        A = np.array(A, dtype=float)
        yield f"game {len(A)}", Case("general", A, -np.ones(len(A)))
    for shape in ((1, 1), (2, 2), (3, 5), (8, 10), (60, 80)):
        for seed in range(3):
            R, S = numbers(seed).uniform(0.1, 1.0, (2, *shape))
            yield f"game {shape} {seed}", Case("general", *general.game(R, S))
            R, S = np.ceil(3.0 * R), np.ceil(3.0 * S)  # degenerate
            name = f"game {shape} {seed} in whole numbers"
            yield name, Case("general", *general.game(R, S))
    yield "game of one cost", Case("general", *general.game(*np.ones((2, 4, 3))))
    for seed in range(6):  # friction's structure: singular on most faces
        rng = numbers(seed, 10)
        J = rng.standard_normal((2, 6))
        A = np.block([[J.T @ J, np.eye(6)], [-np.eye(6), np.zeros((6, 6))]])
        q, _ = problems.with_solution(rng, A, 0.2)
        yield f"singular faces {seed}", Case("semidefinite", A, q)


def undecided():
    for n in (2, 5, 20):
        rng = numbers(n, 8)
        B, q = rng.standard_normal((n, n)), rng.standard_normal(n) - 1.0
        for name, A in (("any", B), ("indefinite", B + B.T), ("negative", -np.eye(n))):
            yield f"{name} {n}", Case("open", A, q)
    for seed in range(6):
        lcp = general.mixed(numbers(seed), 15)
        yield f"mixed {seed}", Case("open", *lcp)
    rng = numbers(9)
    B, K = rng.standard_normal((2, 6, 6))
    for skewness in (0.0, 1.0):  # every z is near a bound, as far as w can tell
        A = 1e18 * (B.T @ B + skewness * (K - K.T))
        q = [1.0, -2.0, 3.0, -1.0, 2.0, -3.0]
        yield f"narrow box {skewness}", Case("open", A, q, -1e-18, 1e-18)
    for index in (98, 302):  # a solution far away, no proof
        for tiny in (1e-3, 1e-6):
            A, q, *bounds = campaign.make(1, index).problem
            A = A + tiny * np.eye(q.size)
            yield f"campaign {index} + {tiny:.0e}", Case("hidden", A, q, *bounds)
    A = np.diag(np.ones(4)) - 2.0 * (np.eye(4, k=1) + np.eye(4, k=-1))
    yield "negative pivot", Case("open", sparse.csr_array(A), -np.ones(4))


@cache
def all_cases():
    """Return {name: Case}, with float arrays."""
    found = {}
    for family in (textbook, definite, p_matrices, dominant, semidefinite, unsolvable,
                   neither, undecided):  # fmt: skip
        for name, case in family():
            A = case.A if sparse.issparse(case.A) else np.array(case.A, dtype=float)
            n = A.shape[0]
            lower, upper = (np.broadcast_to(b, n).astype(float) for b in case[3:5])
            z = None if case.z is None else np.array(case.z, dtype=float)
            assert name not in found, name
            q = np.array(case.q, dtype=float)
            found[name] = Case(case.truth, A, q, lower, upper, z)
    return found
