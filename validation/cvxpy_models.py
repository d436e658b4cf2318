"""What people model in CVXPY, solved with NAM beside OSQP and Clarabel.

Usage::

    python validation/cvxpy_models.py [--models NAME ...] [--size small large]
        [--solvers nam osqp clarabel ...] [--limit 60] [--csv FILE]

Each model (`cvxpy_statistics`, `cvxpy_decisions`) at two sizes. The objective is
compared with Clarabel's, at its tightest tolerances unless it fails there. Residuals
are computed on the data that CVXPY hands over, min 1/2 x'Px + q'x, Ax = b, Fx <= g,
from the point and the multipliers that the solver's interface hands back:

- primal: largest violation over max(1, |Ax|, |b|, |Fx|, |g|);
- dual: largest |Px + q + A'y + F'z| or wrong sign over max(1, |Px|, |q|, |A'y|, |F'z|);
- complementarity: largest |z_i (g - Fx)_i|, and the duality gap, over max(1, x'Px, q'x,
  b'y, g'z);
- proof, of an infeasible problem: largest |A'y + F'z| or wrong sign over -(b'y + g'z);
  of an unbounded one: largest |Px|, |Ax| or (Fx)_i > 0 over -q'x, for the ray x.

The time is the median of repeated calls of the host's solve_via_data, without the
host's compilation and without a warm start: processor time, on one thread.
"""

import argparse
import sys
import time
import warnings
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np

from benchmark import csv_writer, geometric_mean, machine_lines, use_one_thread
from measure import Bench, failure, median_time, silence

TIGHT = {"tol_gap_abs": 1e-12, "tol_gap_rel": 1e-12, "tol_feas": 1e-12}
SOLVERS: dict[str, tuple[str, dict[str, Any]]] = {
    "nam": ("NAM", {}),
    "osqp": ("OSQP", {}),
    "osqp-1e-8": ("OSQP", {"eps_abs": 1e-8, "eps_rel": 1e-8, "max_iter": 1_000_000}),
    "clarabel": ("CLARABEL", {}),
    "reference": ("CLARABEL", {**TIGHT, "accept_unknown": True}),
}
REFERENCE = "reference"
ORACLES = (REFERENCE, "clarabel")
DEFAULT = ["nam", "osqp", "clarabel", REFERENCE]
ACCURATE = 1e-7  # what residuals and objective must reach to count as a success
COLUMNS = (
    "problem set solver variables equalities inequalities compile runtime cold status "
    "expected success objective objective_error against primal_residual dual_residual "
    "complementarity proof iterations form message"
).split()
RESIDUALS = ["primal_residual", "dual_residual", "complementarity", "objective_error"]
Row = dict[str, Any]


def all_models() -> dict[str, Any]:
    """Return all models by name; importing them imports CVXPY."""
    import cvxpy_decisions
    import cvxpy_statistics

    return cvxpy_statistics.MODELS | cvxpy_decisions.MODELS


def host_qp(data: dict[str, Any]) -> tuple[Any, ...]:
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
    return {
        "primal_residual": largest(Ax - b, np.minimum(slack, 0.0))
        / max(1.0, largest(Ax, b, Fx, g)),
        "dual_residual": dual / max(1.0, largest(Px, q, Ay, Fz)),
        "complementarity": largest(slack * zf, sum(terms)) / gap_size,
    }


def proof(qp: tuple[Any, ...], y: np.ndarray, z: np.ndarray) -> float:
    """Return how far (y, z) is from proving that no x is feasible."""
    _, _, A, b, F, g = qp
    finite = np.isfinite(g)
    gain = -(b @ y + g[finite] @ z[finite])
    error = largest(A.T @ y + F.T @ z, np.minimum(z, 0.0), z[~finite])
    return error / gain if gain > 0.0 else np.inf


def ray_error(qp: tuple[Any, ...], raw: Any, extra: Any) -> float:
    """Return how far a solver's ray is from proving that the objective has no bound."""
    P, q, A, _, F, g = qp
    ray = extra.get("ray") if isinstance(extra, dict) else None
    if ray is None:
        ray = getattr(raw, "dual_inf_cert", getattr(raw, "x", None))
    ray = np.asarray(ray, dtype=float)
    rise = np.maximum((F @ ray)[np.isfinite(g)], 0.0)
    gain = -(q @ ray)
    return largest(P @ ray, A @ ray, rise) / gain if gain > 0.0 else np.inf


def multipliers(solution: Any, constraints: list[Any]) -> np.ndarray:
    """Return the dual values of the host's stuffed constraints, one after the other."""
    values = [np.ravel(solution.dual_vars[c.id], order="F") for c in constraints]
    return np.concatenate([np.zeros(0), *values])


def judge(problem: Any, chain: Any, raw: Any, data: Any, inverse: Any) -> Row:
    """Return status, objective and residuals of what the solver handed back."""
    last = inverse[-1]
    solution = chain.solver.invert(raw, last)
    row: Row = {"status": solution.status, "iterations": solution.attr.get("num_iters")}
    extra = solution.attr.get("solver_specific_stats")
    if isinstance(extra, dict) and "form" in extra:
        row |= {"form": extra["form"], "message": extra["message"]}
    qp = host_qp(data)
    row |= {"variables": qp[1].size, "equalities": qp[3].size}
    row["inequalities"] = qp[5].size
    solver = chain.solver
    have_duals = bool(solution.dual_vars) or qp[3].size + qp[5].size == 0
    if have_duals:
        y = multipliers(solution, last[solver.EQ_CONSTR])
        z = multipliers(solution, last[solver.NEQ_CONSTR])
    if solution.primal_vars:
        x = np.ravel(next(iter(solution.primal_vars.values())))
        row |= residuals(qp, x, y, z)
        problem.unpack_results(raw, chain, inverse)
        row["objective"] = float(problem.value)
    elif solution.status == "infeasible" and have_duals:
        row["proof"] = proof(qp, y, z)
    elif solution.status == "unbounded":
        row["proof"] = ray_error(qp, raw, extra)
    return row


def solve(pipe: Connection, model: Any, size: str, solver: str, limit: float) -> Row:
    """Compile a model, time a solver on it and judge its first answer."""
    from cvxpy.error import SolverError

    name, options = SOLVERS[solver]
    if size == "large":  # load what is compiled on first use
        try:
            model.make(*model.small).solve(solver=name, **options)
        except Exception as error:
            print(error)
    problem = model.make(*getattr(model, size))
    start = time.perf_counter()
    data, chain, inverse = problem.get_problem_data(name, solver_opts=dict(options))
    row: Row = {"compile": time.perf_counter() - start}

    def call() -> Any:
        problem._solver_cache = {}
        return chain.solve_via_data(problem, data, True, False, dict(options))

    pipe.send("ready")
    try:
        raw, cold, runtime = median_time(call, time.process_time)
        row |= judge(problem, chain, raw, data, inverse)
    except SolverError as error:
        return row | {"status": "refused", "message": " ".join(str(error).split())}
    if cold > limit:
        row["status"] = "too slow"
    return row | {"runtime": runtime, "cold": cold}


def serve(pipe: Connection, _: None, solver: str, limit: float) -> None:
    """Answer requests (size, model, _) until None comes: the child process."""
    warnings.simplefilter("ignore")
    silence()
    import namlcp.cvxpy

    namlcp.cvxpy.register()
    models = all_models()
    for size, name, _ in iter(pipe.recv, None):
        try:
            pipe.send(solve(pipe, models[name], size, solver, limit))
        except Exception as error:
            pipe.send(failure(f"{type(error).__name__}: {error}"))


class ModelBench(Bench):
    """A child process that solves models with one solver."""

    work = staticmethod(serve)


def worst(row: Row) -> float:
    """Return the largest residual of a row, infinite where it has no point."""
    errors = [row.get(name) for name in RESIDUALS[:3]]
    return max(np.inf if error is None else error for error in errors)


def conclude(rows: list[Row], expected: str) -> None:
    """Add objective errors and successes to the rows of one model.

    The objective is compared with the better of Clarabel's points, or, should neither
    be accurate, with the point of least residuals: `against` says whose it is.
    """
    oracles = [row for row in rows if row["solver"] in ORACLES]
    best = min(oracles, key=worst, default=None)
    if best is None or worst(best) > ACCURATE:
        best = min(rows, key=worst)
    for row in rows:
        row["expected"] = expected
        if worst(best) < np.inf and worst(row) < np.inf:
            error = abs(row["objective"] - best["objective"])
            row["objective_error"] = error / max(1.0, abs(best["objective"]))
            row["against"] = best["solver"]
        said = row.get("status") == expected
        errors = [row[name] for name in RESIDUALS if row.get(name) is not None]
        row["success"] = said and all(error <= ACCURATE for error in errors)


def print_row(row: Row) -> None:
    """Print one solve on one line."""
    errors = [row.get(name) for name in [*RESIDUALS, "proof"]]
    text = " ".join(f"{e:8.1e}" if e is not None else "       -" for e in errors)
    runtime = 1e3 * row.get("runtime", np.nan)
    print(
        f"{row['problem']:<24}{row['set']:<6}{row['solver']:<10}"
        f"{'' if row['success'] else '*':<2}{row['status']:<19.18}{runtime:>11.3f} ms "
        f"{text} {row.get('iterations')!s:>6} {row.get('form', '')}",
        flush=True,
    )


def print_summary(rows: list[Row]) -> None:
    """Print successes and times of every solver, and what each has wrong."""
    for size in dict.fromkeys(row["set"] for row in rows):
        here = [row for row in rows if row["set"] == size]
        own = {r["problem"]: r for r in here if r["solver"] == "nam"}
        total = len({row["problem"] for row in here})
        print(f"\n{size}: {total} models")
        for solver in dict.fromkeys(row["solver"] for row in here):
            good = [r for r in here if r["solver"] == solver and r["success"]]
            timed = [r for r in good if r.get("runtime")]
            mean = 1e3 * geometric_mean([r["runtime"] for r in timed])
            both = [r for r in timed if own.get(r["problem"], {}).get("success")]
            ratios = [own[r["problem"]]["runtime"] / r["runtime"] for r in both]
            print(
                f"{solver:<10}{len(good):>4}/{total}{mean:>10.3f} ms, nam/{solver} "
                f"{geometric_mean(ratios):.2f} ({len(ratios)})"
            )
    print("\nwho is wrong, by the status that is known and the residuals:")
    for solver in dict.fromkeys(row["solver"] for row in rows):
        wrong = [r for r in rows if r["solver"] == solver and not r["success"]]
        text = "; ".join(verdict(row) for row in wrong)
        print(f"{solver}: {text or 'nothing'}")


def print_table(rows: list[Row]) -> None:
    """Print time and worst error of the solvers side by side, in Markdown."""
    solvers = list(dict.fromkeys(row["solver"] for row in rows))
    heads = ["model", "size", "n", *(f"{s} [ms], error" for s in solvers)]
    print("\n| " + " | ".join(heads) + " |\n" + "|---" * len(heads) + "|")
    for size, name in dict.fromkeys((row["set"], row["problem"]) for row in rows):
        found = [r for r in rows if (r["set"], r["problem"]) == (size, name)]
        n = next((r["variables"] for r in found if "variables" in r), "")
        print(f"| {name} | {size} | {n} | " + " | ".join(map(cell, found)) + " |")


def cell(row: Row) -> str:
    """Return time and worst error of a solve, or what it said instead."""
    if row["status"] != row["expected"]:
        return row["status"]
    errors = [row.get(name) for name in [*RESIDUALS, "proof"]]
    known = [error for error in errors if error is not None]
    error = f", {max(known):.0e}" if known else ""
    runtime = f"{1e3 * row['runtime']:.3g}" if "runtime" in row else ""
    return runtime + error or "right"


def verdict(row: Row) -> str:
    """Return in words what is wrong with an answer."""
    place = f"{row['problem']} {row['set']}"
    if row["status"] != row["expected"]:
        return f"{place} ({row['status']}, is {row['expected']})"
    errors = {name: row.get(name) or 0.0 for name in RESIDUALS}
    most = max(errors, key=lambda name: errors[name])
    return f"{place} ({most.replace('_', ' ')} {errors[most]:.0e})"


def parse_arguments(arguments: list[str] | None) -> argparse.Namespace:
    """Return the command line, checked."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--models", nargs="+", help="names; all without")
    parser.add_argument("--size", nargs="+", choices=["small", "large"])
    parser.add_argument("--solvers", nargs="+", choices=SOLVERS, default=DEFAULT)
    parser.add_argument("--limit", type=float, default=60.0, help="[s] a solve")
    parser.add_argument("--csv", type=Path, help="write all rows to this file")
    return parser.parse_args(arguments)


def main(arguments: list[str] | None = None) -> int:
    """Run the models; return the number of NAM's failures, at most 100."""
    args = parse_arguments(arguments)
    use_one_thread()
    models = all_models()
    header = machine_lines(["nam", "cvxpy", "osqp", "clarabel"])
    print("\n".join(header))
    rows: list[Row] = []
    children = {s: ModelBench(None, s, args.limit) for s in args.solvers}
    try:
        with csv_writer(args.csv, header, COLUMNS, "ignore") as write:
            for size in args.size or ["small", "large"]:
                for name in args.models or models:
                    found = [c.run(size, name, 0.0) for c in children.values()]
                    conclude(found, models[name].expected)
                    for row in found:
                        print_row(row)
                        write(row)
                    rows += found
    finally:
        for child in children.values():
            child.stop()
    print_table(rows)
    print_summary(rows)
    failures = [r for r in rows if r["solver"] == "nam" and not r["success"]]
    return min(100, len(failures))


if __name__ == "__main__":
    sys.exit(main())
