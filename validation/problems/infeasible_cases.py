"""QPs without a solution, and some that only look so: a set with known truth.

The truth, `infeasible`, `unbounded`, `both`, `feasible` or `not convex`, follows from
the construction; where that needs a linear program, HiGHS solves it. From the
Maros-Meszaros collection come the convex problems of at most 1000 variables and rows,
each changed in one way:

- fixed: a variable is held above the largest value that the constraints allow (HiGHS);
- row: a row is added that contradicts the sum of two others by 1e-3 of its size;
- free: a free variable with a cost and nothing else is added;
- pair: two variables >= 0 are added that cancel in every row but not in the cost;
- unbound: all bounds are dropped (HiGHS says if a direction of recession descends);
- both: row and free;
- sums: three sums of two equations are added, their right-hand sides off by 1e-4;
- digits: the same, off by 1e-8, which is feasible within the tolerance.
"""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp
from qpsolvers import Problem
from scipy.optimize import linprog

from validation.harness import qps
from validation.problems import data_sets

MOST = 1000  # variables and rows of a Maros-Meszaros problem to be changed
MARGIN = 1e-3
DESCENT, LEVEL = 1e-3, 1e-9  # slopes that HiGHS can tell from each other
SIZES = ((5, 8, 2), (10, 20, 3), (30, 40, 5), (50, 100, 10), (100, 150, 20),
         (200, 300, 40), (300, 400, 50))  # fmt: skip
DENSITY = 0.05


class Case(NamedTuple):
    """A problem, and what is true of it."""

    group: str
    truth: str
    problem: Problem
    eps: float = 1e-6


Maker = Callable[[], Case | None]  # None: the change does not make such a problem


def all_cases(data: Path | None, step: int) -> dict[str, Maker]:
    """Return the makers; every step-th Maros-Meszaros problem gets each change."""
    makers = dict(SMALL)
    for k, size in enumerate(SIZES):
        for dense in (True, False):
            for kind in (random_infeasible, random_unbounded):
                text = f"{kind.__name__} {size[0]} {'dense' if dense else 'sparse'}"
                makers[text.replace("_", " ")] = partial(kind, k, *size, dense)
    if data is not None:
        for place, change in enumerate(CHANGES):
            often = 3 * step if change == "both" else step
            for name in bases(data)[place % often :: often]:
                makers[f"{name} {change}"] = partial(changed, data, name, change)
    return makers


def small_case(group: str, truth: str, eps: float = 1e-6, **data: Any) -> Case:
    """Return a dense case; a number stands for a vector of it."""
    arrays = {k: np.array(v, dtype=float) for k, v in ({"q": 0.0} | data).items()}
    n = len(arrays["P"])
    whole = {k: v if v.ndim else np.full(n, v) for k, v in arrays.items()}
    return Case(group, truth, Problem(**whole), eps)


def random_rows(rng: np.random.Generator, rows: int, n: int, dense: bool) -> np.ndarray:
    """Return normal random entries, all or 5 % of them, and one at least in a row."""
    M = rng.standard_normal((rows, n))
    if not dense:
        keep = rng.random((rows, n)) < DENSITY
        keep[np.arange(rows), rng.integers(0, n, rows)] = True
        M *= keep
    return M


def random_feasible(
    rng: np.random.Generator, n: int, m: int, p: int, rank: int, dense: bool
) -> list[np.ndarray]:
    """Return P, q, G, h, A, b, lb, ub with a complementary point; P of some rank."""
    B = random_rows(rng, rank, n, dense)
    G, A = random_rows(rng, m, n, dense), random_rows(rng, p, n, dense)
    x = rng.standard_normal(n)
    active = rng.random(m) < 0.3
    z = np.where(active, rng.random(m), 0.0)
    at_lb = rng.random(n) < 0.3
    z_box = np.where(at_lb, -rng.random(n), 0.0)
    lb = np.where(at_lb, x, x - 1.0)
    q = -(B.T @ (B @ x) + G.T @ z + A.T @ rng.standard_normal(p) + z_box)
    h = G @ x + np.where(active, 0.0, rng.random(m))
    ub = np.where(rng.random(n) < 0.5, x + 2, np.inf)
    return [B.T @ B, q, G, h, A, A @ x, lb, ub]


def shaped(arrays: list[np.ndarray], dense: bool) -> Problem:
    return Problem(*arrays) if dense else qps.sparse(Problem(*arrays))


def random_infeasible(seed: int, n: int, m: int, p: int, dense: bool) -> Case:
    """Add a row that contradicts others: of all if dense, else of four."""
    rng = np.random.default_rng(seed)
    rank = (n, n // 2, 0)[seed % 3]
    P, q, G, h, A, b, lb, ub = random_feasible(rng, n, m, p, rank, dense)
    used = np.arange(m) if dense else rng.choice(m, 4, replace=False)
    z, y = 0.1 + rng.random(used.size), 0.1 * rng.standard_normal(p)
    y[2:] *= dense
    row = -(G[used].T @ z + A.T @ y)
    side = -(h[used] @ z + b @ y) - 0.1
    problem = [P, q, np.vstack([G, row]), np.append(h, side), A, b, lb, ub]
    return Case("random infeasible", "infeasible", shaped(problem, dense))


def random_unbounded(seed: int, n: int, m: int, p: int, dense: bool) -> Case:
    """Add a direction d: P d = A d = 0, G d <= 0, q'd = -1; dense, or four entries."""
    rng = np.random.default_rng(seed)
    rank = (n // 2, 1, 0)[seed % 3]
    _, q, G, _, A, *_ = random_feasible(rng, n, m, p, rank, dense)
    d = np.zeros(n)
    used = np.arange(n) if dense else rng.choice(n, 4, replace=False)
    d[used] = rng.standard_normal(used.size)
    d /= np.linalg.norm(d)

    def across(M: np.ndarray) -> np.ndarray:
        return M - np.outer(M @ d, d)

    x = rng.standard_normal(n)
    B, A = across(random_rows(rng, rank, n, dense)), across(A)
    G = np.where((G @ d > 0.0)[:, None], across(G), G)
    q -= (q @ d + 1.0) * d
    lb, ub = x - rng.random(n), x + rng.random(n)
    h, b = G @ x + rng.random(m), A @ x
    open_lb, open_ub = np.where(d < 0.0, -np.inf, lb), np.where(d > 0.0, np.inf, ub)
    problem = [B.T @ B, q, G, h, A, b, open_lb, open_ub]
    return Case("random unbounded", "unbounded", shaped(problem, dense))


def bases(data: Path) -> list[str]:
    index = data_sets.maros_index(data, "all")
    return sorted(
        name
        for name, row in index.items()
        if int(row["n"]) <= MOST
        and int(row["mG"]) + int(row["mA"]) <= MOST
        and name != "VALUES"  # not convex
    )


def changed(data: Path, name: str, change: str) -> Case | None:
    base = data_sets.load(data, "all", name)
    problem, truth = CHANGES[change](base)
    return problem and truth and Case(f"Maros-Meszaros, {change}", truth, problem)


def linear_program(cost: np.ndarray, problem: Problem) -> Any:
    _, _, G, h, A, b, lb, ub = qps.parts(problem)
    finite = np.isfinite(h)
    G = sp.csr_matrix(G)[finite]
    bounds = np.column_stack([lb, ub])
    return linprog(cost, G, h[finite], sp.csr_matrix(A), b, bounds, method="highs")


def fix_outside(problem: Problem) -> Problem | None:
    P, q, G, h, A, b, lb, ub = qps.parts(problem)
    for j in range(min(q.size, 20)):
        cost, low, high = np.zeros(q.size), lb.copy(), ub.copy()
        cost[j], low[j], high[j] = -1.0, -np.inf, np.inf
        answer = linear_program(cost, Problem(P, q, G, h, A, b, low, high))
        if answer.status == 0:
            low[j] = high[j] = -answer.fun + 1e-2 * (1.0 + abs(answer.fun))
            return qps.joined(P, q, G, h, A, b, low, high)
    return None


def contradict(problem: Problem) -> Problem:
    """Add the row -(r1 + r2)'x <= -(s1 + s2) - margin for two of its sides r'x <= s."""
    P, q, G, h, A, b, lb, ub = qps.parts(problem)
    G, A, one = sp.csr_matrix(G), sp.csr_matrix(A), sp.eye(q.size, format="csr")
    finite, up, down = np.isfinite(h), np.isfinite(ub), np.isfinite(lb)
    rows = sp.vstack([G[finite], A, one[up], -one[down]]).tocsr()
    sides = np.concatenate([h[finite], b, ub[up], -lb[down]])
    used = [0, min(1 + sides.size // 3, sides.size - 1)]
    row, side = rows[used].sum(axis=0), sides[used].sum()
    margin = MARGIN * (1.0 + abs(side))
    G = sp.vstack([G, -sp.csr_matrix(row)]).tocsc()
    return qps.joined(P, q, G, np.append(h, -side - margin), A.tocsc(), b, lb, ub)


def add_sums(problem: Problem, off: float) -> Problem | None:
    """Add sums of two equations, every right-hand side wrong by +-off."""
    if problem.A is None:
        return None
    P, q, G, h, A, b, lb, ub = qps.parts(problem)
    A, p = sp.csr_matrix(A), b.size
    first = np.unique(np.arange(3) * p // 3)
    second = (first + 1) % p
    sums = b[first] + b[second] + off * (-1.0) ** np.arange(first.size)
    A = sp.vstack([A, A[first] + A[second]]).tocsc()
    return qps.joined(P, q, G, h, A, np.append(b, sums), lb, ub)


def add_variables(problem: Problem, count: int) -> Problem:
    """Add a free variable with a cost, or two >= 0 whose columns cancel."""
    P, q, G, h, A, b, lb, ub = qps.parts(problem)
    pair = count == 2
    P = sp.block_diag([P, sp.csc_matrix((count, count))]).tocsc()
    wider = []
    for M in (G, A):
        column = sp.csc_matrix((M.shape[0], 1))
        if pair and M.shape[0]:
            column = sp.csc_matrix(M.mean(axis=1).reshape(-1, 1))
        wider.append(sp.hstack([M, *[column, -column][:count]]).tocsc())
    q = np.append(q, [1.0, -2.0] if pair else [-1.0])
    lb = np.append(lb, [0.0, 0.0] if pair else [-np.inf])
    ub = np.append(ub, np.full(count, np.inf))
    return qps.joined(P, q, wider[0], h, wider[1], b, lb, ub)


def is_feasible(problem: Problem) -> bool | None:
    if problem.h is not None and (problem.h == -np.inf).any():
        return False
    answer = linear_program(np.zeros(problem.q.size), problem)
    return {0: True, 2: False}.get(answer.status)


def is_unbounded(problem: Problem) -> bool | None:
    """Ask HiGHS whether a ray in [-1, 1] descends; None if it cannot tell."""
    P, q, G, h, A, _, lb, ub = qps.parts(problem)
    G = sp.csr_matrix(G)[np.isfinite(h)]
    still = sp.vstack([sp.csr_matrix(P), sp.csr_matrix(A)])
    cone = Problem(
        sp.csc_matrix(P.shape), q, G, np.zeros(G.shape[0]), still,
        np.zeros(still.shape[0]), np.where(np.isfinite(lb), 0.0, -1.0),
        np.where(np.isfinite(ub), 0.0, 1.0),
    )  # fmt: skip
    answer = linear_program(q, cone)
    if answer.status != 0 or -DESCENT < answer.fun < -LEVEL:
        return None
    return bool(answer.fun <= -DESCENT)


def unbind(problem: Problem) -> tuple[Problem | None, str | None]:
    if problem.lb is None and problem.ub is None:
        return None, None
    free = Problem(*problem.unpack()[:6])
    return free, {True: "unbounded", False: "feasible"}.get(is_unbounded(free))


CHANGES: dict[str, Callable[[Problem], tuple[Problem | None, str | None]]] = {
    "fixed": lambda base: (fix_outside(base), "infeasible"),
    "row": lambda base: (contradict(base), "infeasible"),
    "free": lambda base: (add_variables(base, 1), "unbounded"),
    "pair": lambda base: (add_variables(base, 2), "unbounded"),
    "unbound": unbind,
    "both": lambda base: (add_variables(contradict(base), 1), "both"),
    "sums": lambda base: (add_sums(base, 1e-4), "infeasible"),
    "digits": lambda base: (add_sums(base, 1e-8), "feasible"),
}


# ---- small ones: what they are made of, without P = I, q = 0 and what there is not

I2, O2 = np.eye(2), np.zeros((2, 2))


def small_cases(truth: str, group: str, entries: Any) -> dict[str, Maker]:
    groups = {name: "nearly bounded" if "slope" in name else group for name in entries}
    return {k: partial(small_case, groups[k], truth, **v) for k, v in entries.items()}


SMALL = small_cases("infeasible", "small, infeasible", {
    "opposite rows": dict(P=I2, G=[[1, 1], [-2, -2]], h=[1, -4]),
    "opposite rows, cost in one corner": dict(
        P=np.diag([1, 0]), q=[0, 1], lb=0, G=[[1, 1], [-2, -2]], h=[1, -4],
    ),
    "three rows": dict(P=I2, G=[[1, 1], [-1, 0], [0, -1]], h=[1, -1, -1]),
    "cycle of differences": dict(
        P=np.eye(3), G=[[1, -1, 0], [0, 1, -1], [-1, 0, 1]], h=[-1, -1, -1],
    ),
    "row against bounds": dict(P=I2, G=[[1, 1]], h=[-1], lb=0),
    "crossed bounds": dict(P=I2, lb=[0, 1], ub=[1, 0]),
    "repeated equations": dict(P=I2, A=[[1, 1], [2, 2]], b=[1, 3]),
    "dependent equations": dict(
        P=np.eye(3), A=[[1, 1, 0], [0, 1, 1], [1, 2, 1]], b=[1, 1, 3],
    ),
    "more equations than unknowns": dict(P=I2, A=[[1, 0], [0, 1], [1, 1]], b=[1, 1, 3]),
    "empty equation": dict(P=I2, A=[[0, 0]], b=[-1]),
    "empty row": dict(P=I2, G=[[0, 0]], h=[-1]),
    "row of -inf": dict(P=I2, G=[[1, 1]], h=[-np.inf]),
    "all fixed": dict(P=I2, G=[[1, 1]], h=[2], lb=[1, 2], ub=[1, 2]),
    "equation against bounds": dict(P=I2, A=[[1, 1]], b=[5], lb=0, ub=1),
    "equation against rows": dict(
        P=I2, A=[[1, -1]], b=[0], G=[[1, 0], [0, -1]], h=[0, -1],
    ),
    "transport": dict(
        P=np.zeros((4, 4)), q=[1, 2, 2, 1], lb=0,
        A=[[1, 1, 0, 0], [0, 0, 1, 1], [1, 0, 1, 0], [0, 1, 0, 1]], b=[1, 1, 1, 2],
    ),
    "one unknown": dict(P=[[1]], G=[[1], [-1]], h=[-1, 0]),
    "rows of different size": dict(P=I2, G=[[1e6, 1e6], [-1, -1]], h=[1e6, -2]),
})  # fmt: skip

SMALL |= small_cases("unbounded", "small, unbounded", {
    "no constraint, linear": dict(P=O2, q=[1, 0]),
    "no constraint, flat direction": dict(P=np.diag([1, 0]), q=[0, -1]),
    "no constraint, flat across": dict(P=[[1, -1], [-1, 1]], q=[-1, -1]),
    "strip": dict(P=O2, q=-1, G=[[1, -1], [-1, 1]], h=[1, 1]),
    "quadrant": dict(P=O2, q=[-1, 1], lb=0),
    "half-line": dict(P=[[0]], q=-1, G=[[-1]], h=[0]),
    "equation": dict(
        P=np.diag([1, 1, 0, 0]), q=[0, 0, -1, 0], A=[[0, 0, 1, -1]], b=[0],
    ),
    "cone": dict(
        P=np.outer([1, -1, 0], [1, -1, 0]), q=[-1, -1, 1],
        G=[[1, 0, -3], [0, 1, -3], [-1, -1, 1]], h=[0, 0, 1],
    ),
    "rank one": dict(P=np.ones((5, 5)), q=[-1, 2, 0, 0, 0]),
    "only infinite rows": dict(P=O2, q=[1, -1], G=[[1, 1]], h=[np.inf]),
    "empty row and a ray": dict(P=np.diag([1, 0]), q=[0, -1], G=[[0, 0]], h=[1]),
    "slope 1e-3": dict(P=np.diag([1, 0]), q=[1, -1e-3], lb=0),
    "slope 1e-5": dict(P=np.diag([1, 0]), q=[1, -1e-5], lb=0),
    "slope 1e-4 along a row": dict(P=O2, q=[-1 - 1e-4, 1], G=[[1, -1]], h=[1]),
})  # fmt: skip

SMALL |= small_cases("both", "small, both", {
    "rows and a free variable": dict(
        P=np.diag([1, 0]), q=[0, 1], G=[[1, 0], [-1, 0]], h=[-1, 0],
    ),
    "linear rows": dict(P=O2, q=[0, -1], G=[[1, 0], [-1, 0]], h=[-1, 0]),
    "repeated equations, linear": dict(P=O2, q=[1, 0], A=[[1, 1], [2, 2]], b=[1, 3]),
})  # fmt: skip

for margin, eps in ((1e-3, 1e-6), (1e-4, 1e-6), (1e-6, 1e-9), (1e-8, 1e-10)):
    small = f"margin {margin:.0e}"
    SMALL |= small_cases("infeasible", "nearly feasible", {
        f"pair, {small}": dict(eps=eps, P=[[1]], G=[[1], [-1]], h=[0, -margin]),
        f"triangle, {small}": dict(
            eps=eps, P=I2, G=[[1, 1], [-1, 0], [0, -1]], h=[1, -0.5, -0.5 - margin],
        ),
        f"box, {small}": dict(
            eps=eps, P=np.eye(10), G=-np.ones((1, 10)), h=[-10 - margin], ub=1,
        ),
        f"mean, {small}": dict(
            eps=eps, P=O2, q=[1, 2], A=np.ones((1, 2)), b=[-margin], lb=0,
        ),
    })  # fmt: skip

# Solvable, though a solver may see a ray or a contradiction.
SMALL |= small_cases("feasible", "treacherous", {
    "solution at 1e9, flat": dict(P=[[1e-9]], q=-1),
    "solution at 1e8, half flat": dict(P=np.diag([1, 1e-8]), q=[0, -1]),
    "solution at 1e8, linear": dict(P=O2, q=[1, 2], lb=[1e8, 0]),
    "box of 1e9": dict(P=O2, q=[1e-3, -1e-3], lb=-1e9, ub=1e9),
    "far corner of a thin cone": dict(
        P=1e-6 * I2, q=[1, 0], G=[[-1e-6, 1]], h=[-1], lb=0,
    ),
    "interior of 1e-8": dict(P=[[1]], q=1, G=[[1], [-1]], h=[0, 1e-8]),
    "one point": dict(P=I2, q=[-1, 1], G=[[1, 1], [-1, 0], [0, -1]], h=[1, -0.5, -0.5]),
    "one corner by 1e-9": dict(
        P=np.eye(10), q=1, G=-np.ones((1, 10)), h=[-10 + 1e-9], ub=1,
    ),
    "nearly dependent equations": dict(
        P=I2, q=[1, 0], A=[[1, 1], [1, 1 + 1e-7]], b=[2, 2 + 1e-7],
    ),
    "sum of equations, rounded": dict(
        P=np.eye(3), q=1, A=[[1, 1, 0], [0, 1, 1], [1, 2, 1]], b=[0.1, 0.2, 0.3],
    ),
    "no cost in a cone": dict(P=O2, G=[[1, -2], [-2, 1]], h=[-1, -1]),
})  # fmt: skip

# The smallest eigenvalue with a unit diagonal is -2e-6 or less; a box holds x.
SMALL |= small_cases("not convex", "not convex", {
    name: {"P": P, "lb": -1, "ub": 1}
    for name, P in {
        "negative diagonal": np.diag([1, -1]),
        "negative minor": [[1, 2], [2, 1]],
        "negative by 2e-6": [[1, 1 + 2e-6], [1 + 2e-6, 1]],
        "negative by 1e-4 in three": [[1, -0.50005, -0.5001], [-0.50005, 1, -0.5001],
                                      [-0.5001, -0.5001, 1]],
        "negative, far from the diagonal": np.eye(20)[::-1],
    }.items()
})  # fmt: skip
