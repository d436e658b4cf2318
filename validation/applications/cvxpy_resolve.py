"""Sequences of 100 problems that differ in Parameters: NAM beside warm-started OSQP.

One cp.Problem, its Parameters set 100 times, each time ``problem.solve(solver=...)``;
NAM as an inline ``NAM()``. Processor seconds a step on one thread, without the first:

- total: median of the whole call of ``problem.solve``;
- solver: median of the solver with its interface (solve_via_data); the rest is CVXPY.

Residuals are the worst of all steps, as in `cvxpy_models`; the objective is compared
with Clarabel's at its tightest tolerances.
"""

import time
from collections.abc import Callable, Iterator
from typing import Any

import cvxpy as cp
import numpy as np
from scipy.linalg import solve_discrete_are

from validation.applications.cvxpy_models import REFERENCE, SOLVERS, judge
from validation.harness import Job, Row
from validation.harness.suite import Args, Suite
from validation.problems import models

STEPS = 101  # the first compiles and is not counted
ERRORS = ["primal_residual", "dual_residual", "complementarity"]
Sequence = tuple[cp.Problem, Iterator[None]]


def control(nx: int, nu: int, horizon: int) -> Sequence:
    """Control from measured states: only right-hand sides change."""
    A, B, state = models.plant(nx, nu)
    start = cp.Parameter(nx)
    x, u = cp.Variable((nx, horizon + 1)), cp.Variable((nu, horizon))
    rows = [x[:, 0] == start, x[:, 1:] == A @ x[:, :-1] + B @ u, cp.abs(u) <= 0.5]
    cost = cp.sum_squares(x) + 0.1 * cp.sum_squares(u)
    S = solve_discrete_are(A, B, np.eye(nx), 0.1 * np.eye(nu))
    K = np.linalg.solve(0.1 * np.eye(nu) + B.T @ S @ B, B.T @ S @ A)
    rng = np.random.default_rng(0)

    def steps() -> Iterator[None]:
        now = state
        for _ in range(STEPS):
            start.value = now
            yield
            now = A @ now - B @ np.clip(K @ now, -0.5, 0.5)
            now = now + 0.1 * rng.standard_normal(nx)

    return cp.Problem(cp.Minimize(cost), rows), steps()


def frontier(n: int, factors: int) -> Sequence:
    """Efficient frontier: the weight of the risk, in the matrix, changes."""
    mean, loadings, specific = models.market(n, factors)
    w, f, gamma = cp.Variable(n), cp.Variable(factors), cp.Parameter(nonneg=True)
    risk = cp.sum_squares(f) + cp.sum_squares(cp.multiply(np.sqrt(specific), w))
    rows = [f == loadings.T @ w, cp.sum(w) == 1, w >= 0]

    def steps() -> Iterator[None]:
        for gamma.value in np.logspace(-1.0, 3.0, STEPS):
            yield

    return cp.Problem(cp.Maximize(mean @ w - gamma * risk), rows), steps()


def lasso(m: int, n: int) -> Sequence:
    """Lasso path: the penalty, in the linear cost, falls."""
    X, y = models.regression(m, n)
    w, penalty = cp.Variable(n), cp.Parameter(nonneg=True)
    most = 2.0 * np.abs(X.T @ y).max()

    def steps() -> Iterator[None]:
        for penalty.value in most * np.logspace(0.0, -3.0, STEPS):
            yield

    cost = cp.sum_squares(X @ w - y) + penalty * cp.norm1(w)
    return cp.Problem(cp.Minimize(cost)), steps()


MODELS: dict[str, tuple[Callable[..., Sequence], dict[str, tuple[int, ...]]]] = {
    "control": (control, {"small": (4, 2, 10), "medium": (12, 4, 30)}),
    "frontier": (frontier, {"small": (20, 3), "medium": (500, 20)}),
    "lasso": (lasso, {"small": (40, 20), "medium": (200, 400)}),
}


class Recorder:
    """Stand before the compiled problem's solver; keep its last result and time."""

    def __init__(self, problem: cp.Problem) -> None:
        solver = problem._cache.solving_chain.solver
        self.solve_via_data = solver.solve_via_data
        self.raw: Any = None
        self.time = 0.0
        solver.solve_via_data = self.solve

    def solve(self, *arguments: Any) -> Any:
        start = time.process_time()
        self.raw = self.solve_via_data(*arguments)
        self.time = time.process_time() - start
        return self.raw


def resolve(name: str, size: str, variant: str) -> Row:
    from namlcp.cvxpy import NAM

    make, sizes = MODELS[name]
    keyword, options = SOLVERS[variant]
    problem, steps = make(*sizes[size])
    times, found, values = [], [], []
    first = time.perf_counter()
    next(steps)
    problem.solve(solver=NAM() if keyword == "NAM" else keyword, **options)
    first = time.perf_counter() - first
    recorder = Recorder(problem)
    for _ in steps:
        solver = NAM() if keyword == "NAM" else keyword
        start = time.process_time()
        problem.solve(solver=solver, **options)
        times.append((time.process_time() - start, recorder.time))
        data, chain, inverse = problem.get_problem_data(solver, solver_opts=options)
        found.append(judge(problem, chain, recorder.raw, data, inverse))
        values.append(problem.value)
    total, solver_time = np.array(times).T
    row = found[-1] | {
        "steps": len(found),
        "optimal": sum(step["status"] == "optimal" for step in found),
        "first": first,
        "total": np.median(total),
        "solver_time": np.median(solver_time),
        "sum": total.sum(),
        "iterations": np.mean([step["iterations"] for step in found]),
        "values": values,
    }
    return row | {key: max(step.get(key, np.inf) for step in found) for key in ERRORS}


def work(job: Job, size: str, name: str) -> Row:
    resolve(name, "small", job.solver)  # load what is compiled on first use
    job.ready()
    return resolve(name, size, job.solver)


def requests(args: Args) -> Iterator[Row]:
    for size in ("small",) if args.quick else ("small", "medium"):
        for name in MODELS:
            yield {"set": size, "problem": name}


def conclude(rows: list[Row]) -> list[Row]:
    reference = next((r.get("values") for r in rows if r["solver"] == REFERENCE), None)
    for row in rows:
        if reference is not None and "values" in row:
            best = np.array(reference, dtype=float)
            error = np.abs(np.array(row["values"], dtype=float) - best)
            row["objective_error"] = float((error / np.maximum(1.0, abs(best))).max())
    return rows


SUITE = Suite(
    name="cvxpy-resolve",
    doc=__doc__,
    requests=requests,
    work=work,
    conclude=conclude,
    columns=(
        "problem set solver variables equalities inequalities steps optimal first total"
        " solver_time sum primal_residual dual_residual complementarity objective_error"
        " iterations form status"
    ),
    keys="set problem solver",
    solvers=("nam", "osqp", REFERENCE),
    packages={REFERENCE: "clarabel"},
    limit=120.0,
)
