"""What people model in CVXPY, solved with NAM beside OSQP and Clarabel.

Each model (`problems.models`) at two sizes. The objective is
compared with Clarabel's, at its tightest tolerances unless it fails there. Residuals
are computed on the data that CVXPY hands over, min 1/2 x'Px + q'x, Ax = b, Fx <= g,
from the point and the multipliers that the solver's interface hands back:

- primal: largest violation over max(1, |Ax|, |b|, |Fx|, |g|);
- dual: largest |Px + q + A'y + F'z| or wrong sign over max(1, |Px|, |q|, |A'y|, |F'z|);
- complementarity: largest |z_i (g - Fx)_i|, and the duality gap, over max(1, x'Px, q'x,
  b'y, g'z).

The time is the median of repeated calls of CVXPY's solve_via_data, without its
compilation and without a warm start: processor time, on one thread.
"""

import time
from collections.abc import Iterator
from functools import cache
from typing import Any

import numpy as np

from validation.harness import Job, Row, timing
from validation.harness.suite import Args, Suite

TIGHT = {"tol_gap_abs": 1e-12, "tol_gap_rel": 1e-12, "tol_feas": 1e-12}
SOLVERS: dict[str, tuple[str, dict[str, Any]]] = {
    "nam": ("NAM", {}),
    "osqp": ("OSQP", {}),
    "clarabel": ("CLARABEL", {}),
    "reference": ("CLARABEL", {**TIGHT, "accept_unknown": True}),
}
REFERENCE = "reference"
ORACLES = (REFERENCE, "clarabel")
ACCURATE = 1e-7  # what residuals and objective must reach to count as a success
RESIDUALS = ["primal_residual", "dual_residual", "complementarity", "objective_error"]


def stuffed_qp(data: dict[str, Any]) -> tuple[Any, ...]:
    """Return P, q, A, b, F, g of the data for a QP or a conic solver."""
    if "F" in data:
        return tuple(data[key] for key in ("P", "q", "A", "b", "F", "G"))
    n, rows = data["c"].size, data["dims"].zero
    P = data.get("P", np.zeros((n, n)))
    A, b = data["A"], data["b"]
    return P, data["c"], A[:rows], b[:rows], A[rows:], b[rows:]


def largest(*arrays: Any) -> float:
    """Return the largest modulus of a finite entry, 0 of nothing."""
    entries = np.concatenate([np.abs(np.atleast_1d(a)) for a in arrays])
    entries = entries[~np.isinf(entries)]
    return float(entries.max()) if entries.size else 0.0


def residuals(
    qp: tuple[Any, ...], x: np.ndarray, y: np.ndarray, z: np.ndarray
) -> dict[str, float]:
    """Return the relative residuals of a primal-dual point: module docstring."""
    P, q, A, b, F, g = qp
    Px, Ax, Fx, Ay, Fz = P @ x, A @ x, F @ x, A.T @ y, F.T @ z
    finite = np.isfinite(g)
    slack, zf = (g - Fx)[finite], z[finite]
    terms = (x @ Px, q @ x, b @ y, g[finite] @ zf)
    gap_size = max(1.0, largest(*terms))
    dual = largest(Px + q + Ay + Fz, np.minimum(z, 0.0), z[~finite])
    primal = largest(Ax - b, np.minimum(slack, 0.0))
    return {
        "primal_residual": primal / max(1.0, largest(Ax, b, Fx, g)),
        "dual_residual": dual / max(1.0, largest(Px, q, Ay, Fz)),
        "complementarity": largest(slack * zf, sum(terms)) / gap_size,
    }


def multipliers(solution: Any, constraints: list[Any]) -> np.ndarray:
    """Return the dual values of the constraints as CVXPY stuffs them, in one array."""
    values = [np.ravel(solution.dual_vars[c.id], order="F") for c in constraints]
    return np.concatenate([np.zeros(0), *values])


def judge(problem: Any, chain: Any, raw: Any, data: Any, inverse: Any) -> Row:
    last = inverse[-1]
    solution = chain.solver.invert(raw, last)
    row: Row = {"status": solution.status, "iterations": solution.attr.get("num_iters")}
    extra = solution.attr.get("solver_specific_stats")
    if isinstance(extra, dict) and "form" in extra:
        row |= {"form": extra["form"], "message": extra["message"]}
    qp = stuffed_qp(data)
    row |= {"variables": qp[1].size, "equalities": qp[3].size}
    row["inequalities"] = qp[5].size
    solver = chain.solver
    if solution.primal_vars:
        y = multipliers(solution, last[solver.EQ_CONSTR])
        z = multipliers(solution, last[solver.NEQ_CONSTR])
        x = np.ravel(next(iter(solution.primal_vars.values())))
        row |= residuals(qp, x, y, z)
        problem.unpack_results(raw, chain, inverse)
        row["objective"] = float(problem.value)
    return row


@cache
def known_models() -> dict[str, Any]:
    """Return all models by name; CVXPY is imported here, and learns of NAM."""
    import namlcp.cvxpy
    from validation.problems.models import MODELS

    namlcp.cvxpy.register()
    return MODELS


def work(job: Job, size: str, name: str) -> Row:
    from cvxpy.error import SolverError

    model = known_models()[name]
    keyword, options = SOLVERS[job.solver]
    if size == "large":  # load what is compiled on first use
        try:
            model.make(*model.small).solve(solver=keyword, **options)
        except Exception as error:
            print(error)
    problem = model.make(*getattr(model, size))
    data, chain, inverse = problem.get_problem_data(keyword, solver_opts=dict(options))
    row: Row = {}

    def call() -> Any:
        problem._solver_cache = {}
        return chain.solve_via_data(problem, data, True, False, dict(options))

    job.ready()
    try:
        raw, cold, runtime = timing.median_time(call, time.process_time)
        row |= judge(problem, chain, raw, data, inverse)
    except SolverError as error:
        return row | {"status": "refused", "message": " ".join(str(error).split())}
    if cold > job.limit:
        row["status"] = "too slow"
    return row | {"runtime": runtime, "cold": cold}


def worst(row: Row) -> float:
    errors = [row.get(name) for name in RESIDUALS[:3]]
    return max(np.inf if error is None else error for error in errors)


def conclude(rows: list[Row]) -> list[Row]:
    """Return the rows of one model with objective errors and successes.

    The objective is compared with the better of Clarabel's points, or, should neither
    be accurate, with the point of least residuals: `against` says whose it is.
    """
    oracles = [row for row in rows if row["solver"] in ORACLES]
    best = min(oracles, key=worst, default=None)
    if best is None or worst(best) > ACCURATE:
        best = min(rows, key=worst)
    for row in rows:
        expected = row["expected"]
        if worst(best) < np.inf and worst(row) < np.inf:
            error = abs(row["objective"] - best["objective"])
            row["objective_error"] = error / max(1.0, abs(best["objective"]))
            row["against"] = best["solver"]
        said = row.get("status") == expected
        errors = [row[name] for name in RESIDUALS if row.get(name) is not None]
        row["success"] = said and all(error <= ACCURATE for error in errors)
    return rows


QUICK = 10  # every so many models, small


def requests(args: Args) -> Iterator[Row]:
    for size in ("small",) if args.quick else ("small", "large"):
        for name in list(known_models())[:: QUICK if args.quick else 1]:
            expected = known_models()[name].expected
            yield {"set": size, "problem": name, "expected": expected}


SUITE = Suite(
    name="cvxpy-models",
    doc=__doc__,
    requests=requests,
    work=work,
    conclude=conclude,
    columns=(
        "problem set solver variables equalities inequalities runtime cold status "
        "expected success objective objective_error against primal_residual "
        "dual_residual complementarity iterations form message"
    ),
    keys="set problem solver",
    solvers=("nam", "osqp", "clarabel", REFERENCE),
    packages={REFERENCE: "cvxpy"},
    limit=60.0,
)
