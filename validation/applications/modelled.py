"""What people model in CVXPY, solved with NAM beside OSQP and Clarabel.

models
    Each model (`problems.models`) at two sizes. The time is the median of repeated
    calls of CVXPY's solve_via_data, without its compilation and without a warm start.
steps
    One cp.Problem, its Parameters set 100 times, each time ``problem.solve``;
    NAM as an inline ``NAM()``. `total` is the median of the whole call, without the
    first, `solver_time` that of solve_via_data; the rest is CVXPY. Residuals are the
    worst of all steps.

Times are processor seconds on one thread. The objective is compared with Clarabel's, at
its tightest tolerances unless it fails there. Residuals are computed on the data that
CVXPY hands over, min 1/2 x'Px + q'x, Ax = b, Fx <= g, from the point and the
multipliers that the solver's interface hands back:

- primal: largest violation over max(1, |Ax|, |b|, |Fx|, |g|);
- dual: largest |Px + q + A'y + F'z| or wrong sign over max(1, |Px|, |q|, |A'y|, |F'z|);
- complementarity: largest |z_i (g - Fx)_i|, and the duality gap, over max(1, x'Px, q'x,
  b'y, g'z).
"""

import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Any

import cvxpy as cp
import numpy as np
from cvxpy.error import SolverError
from scipy.linalg import solve_discrete_are

from namlcp.cvxpy import NAM, register
from validation.harness import Job, Row, timing
from validation.harness.judging import largest
from validation.harness.suite import Args, Suite
from validation.problems import models

TIGHT = dict.fromkeys(("tol_gap_abs", "tol_gap_rel", "tol_feas"), 1e-12)
SOLVERS: dict[str, tuple[str, dict[str, Any]]] = {
    solver: (solver.upper(), {}) for solver in ("nam", "osqp", "clarabel")
}
SOLVERS["reference"] = "CLARABEL", {**TIGHT, "accept_unknown": True}
REFERENCE = "reference"
ACCURATE = 1e-7  # what residuals and objective must reach to count as a success
ERRORS = ["primal_residual", "dual_residual", "complementarity"]
STEPS = 101  # the first compiles and is not counted


def stuffed_qp(data: dict[str, Any]) -> tuple[Any, ...]:
    """Return P, q, A, b, F, g of the data for a QP or a conic solver."""
    if "F" in data:
        return tuple(data[key] for key in ("P", "q", "A", "b", "F", "G"))
    n, rows = data["c"].size, data["dims"].zero
    P = data.get("P", np.zeros((n, n)))
    A, b = data["A"], data["b"]
    return P, data["c"], A[:rows], b[:rows], A[rows:], b[rows:]


def residuals(qp: tuple[Any, ...], x: Any, y: Any, z: Any) -> dict[str, float]:
    P, q, A, b, F, g = qp
    Px, Ax, Fx, Ay, Fz = P @ x, A @ x, F @ x, A.T @ y, F.T @ z
    finite = np.isfinite(g)
    slack, zf = (g - Fx)[finite], z[finite]
    terms = (x @ Px, q @ x, b @ y, g[finite] @ zf)
    dual = largest(Px + q + Ay + Fz, np.minimum(z, 0.0), z[~finite])
    primal = largest(Ax - b, np.minimum(slack, 0.0))
    return {
        "primal_residual": primal / max(1.0, largest(Ax, b, Fx, g[finite])),
        "dual_residual": dual / max(1.0, largest(Px, q, Ay, Fz)),
        "complementarity": largest(slack * zf, sum(terms)) / max(1.0, largest(*terms)),
    }


def judge(problem: Any, chain: Any, raw: Any, data: Any, inverse: Any) -> Row:
    last, solver = inverse[-1], chain.solver
    solution = solver.invert(raw, last)
    row: Row = {"status": solution.status, "iterations": solution.attr.get("num_iters")}
    qp = stuffed_qp(data)
    row |= {"variables": qp[1].size, "equalities": qp[3].size}
    row["inequalities"] = qp[5].size
    if solution.primal_vars:
        dual = {key: np.ravel(v, "F") for key, v in solution.dual_vars.items()}
        y, z = (
            np.concatenate([np.zeros(0), *(dual[c.id] for c in last[k])])
            for k in (solver.EQ_CONSTR, solver.NEQ_CONSTR)
        )
        x = np.ravel(next(iter(solution.primal_vars.values())))
        row |= residuals(qp, x, y, z)
        problem.unpack_results(raw, chain, inverse)
        row["objective"] = float(problem.value)
    return row


def work(job: Job, size: str, name: str) -> Row:
    register()
    model = models.MODELS[name]
    keyword, options = SOLVERS[job.solver]
    if size == "large":  # load what is compiled on first use
        with suppress(Exception):
            model.make(*model.small).solve(solver=keyword, **options)
    problem = model.make(*getattr(model, size))
    data, chain, inverse = problem.get_problem_data(keyword, solver_opts=dict(options))

    def call() -> Any:
        problem._solver_cache = {}
        return chain.solve_via_data(problem, data, True, False, dict(options))

    job.ready()
    try:
        raw, cold, runtime = timing.median_time(call, time.process_time)
        row = judge(problem, chain, raw, data, inverse)
    except SolverError:
        return {"status": "refused"}
    if cold > job.limit:
        row["status"] = "too slow"
    return row | {"runtime": runtime, "cold": cold}


def worst(row: Row) -> float:
    return max(np.inf if row.get(name) is None else row[name] for name in ERRORS)


def conclude(rows: list[Row]) -> list[Row]:
    """Return the rows of one model with objective errors and successes.

    The objective is compared with the better of Clarabel's points, or, should neither
    be accurate, with the point of least residuals: `against` says whose it is.
    """
    oracles = [row for row in rows if row["solver"] in (REFERENCE, "clarabel")]
    best = min(oracles, key=worst, default=None)
    if best is None or worst(best) > ACCURATE:
        best = min(rows, key=worst)
    for row in rows:
        if worst(best) < np.inf and worst(row) < np.inf:
            error = abs(row["objective"] - best["objective"])
            row["objective_error"] = error / max(1.0, abs(best["objective"]))
            row["against"] = best["solver"]
        errors = [row.get(name) for name in (*ERRORS, "objective_error")]
        accurate = all(error is None or error <= ACCURATE for error in errors)
        row["success"] = row.get("status") == row["expected"] and accurate
    return rows


def of_models(args: Args) -> Iterator[Row]:
    for size in ("small", "large"):
        for name, model in models.MODELS.items():
            yield {"set": size, "problem": name, "expected": model.expected}


# ---- problems with Parameters

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
    problem = cp.Problem(cp.Maximize(mean @ w - gamma * risk), rows)
    return problem, values_of(gamma, np.logspace(-1.0, 3.0, STEPS))


def lasso(m: int, n: int) -> Sequence:
    """Lasso path: the penalty, in the linear cost, falls."""
    X, y = models.regression(m, n)
    w, penalty = cp.Variable(n), cp.Parameter(nonneg=True)
    most = 2.0 * np.abs(X.T @ y).max()
    cost = cp.sum_squares(X @ w - y) + penalty * cp.norm1(w)
    path = values_of(penalty, most * np.logspace(0.0, -3.0, STEPS))
    return cp.Problem(cp.Minimize(cost)), path


def values_of(parameter: cp.Parameter, values: np.ndarray) -> Iterator[None]:
    for parameter.value in values:
        yield


SEQUENCES: dict[str, tuple[Callable[..., Sequence], dict[str, tuple[int, ...]]]] = {
    "control": (control, {"small": (4, 2, 10), "medium": (12, 4, 30)}),
    "frontier": (frontier, {"small": (20, 3), "medium": (500, 20)}),
    "lasso": (lasso, {"small": (40, 20), "medium": (200, 400)}),
}


def resolve(name: str, size: str, variant: str) -> Row:
    make, sizes = SEQUENCES[name]
    keyword, options = SOLVERS[variant]
    problem, steps = make(*sizes[size])
    times, found, values, recorded = [], [], [], {}
    next(steps)
    problem.solve(solver=NAM() if keyword == "NAM" else keyword, **options)
    inside = problem._cache.solving_chain.solver
    solve_via_data = inside.solve_via_data

    def record(*arguments: Any) -> Any:
        start = time.process_time()
        recorded["raw"] = solve_via_data(*arguments)
        recorded["time"] = time.process_time() - start
        return recorded["raw"]

    inside.solve_via_data = record
    for _ in steps:
        solver = NAM() if keyword == "NAM" else keyword
        start = time.process_time()
        problem.solve(solver=solver, **options)
        times.append((time.process_time() - start, recorded["time"]))
        data, chain, inverse = problem.get_problem_data(solver, solver_opts=options)
        found.append(judge(problem, chain, recorded["raw"], data, inverse))
        values.append(problem.value)
    total, solver_time = np.median(times, axis=0)
    row = {"steps": len(found), "total": total, "solver_time": solver_time}
    row["optimal"] = sum(step["status"] == "optimal" for step in found)
    row |= {key: max(step.get(key, np.inf) for step in found) for key in ERRORS}
    return row | {"values": values}


def work_steps(job: Job, size: str, name: str) -> Row:
    resolve(name, "small", job.solver)  # load what is compiled on first use
    job.ready()
    return resolve(name, size, job.solver)


def conclude_steps(rows: list[Row]) -> list[Row]:
    reference = next((r.get("values") for r in rows if r["solver"] == REFERENCE), None)
    best = np.array(reference, dtype=float)
    for row in rows if reference is not None else ():
        if "values" in row:
            error = np.abs(np.array(row["values"], dtype=float) - best)
            row["objective_error"] = float((error / np.maximum(1.0, abs(best))).max())
    return rows


SUITES = {
    "models": Suite(
        name="cvxpy-models", requests=of_models, work=work, conclude=conclude,
        columns=(
            "set problem solver | variables equalities inequalities runtime cold "
            "status expected success objective objective_error against primal_residual "
            "dual_residual complementarity iterations"
        ),
        solvers=("nam", "osqp", "clarabel", REFERENCE), packages={REFERENCE: "cvxpy"},
        limit=60.0,
    ),
    "steps": Suite(
        name="cvxpy-resolve",
        requests=lambda args: (
            {"set": size, "problem": name}
            for size in ("small", "medium")
            for name in SEQUENCES
        ),
        work=work_steps, conclude=conclude_steps,
        columns=(
            "set problem solver | steps optimal total solver_time primal_residual "
            "dual_residual complementarity objective_error"
        ),
        solvers=("nam", "osqp", REFERENCE), packages={REFERENCE: "clarabel"},
        limit=120.0,
    ),
}  # fmt: skip
