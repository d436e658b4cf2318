"""Which solver stays right under stress, and which is wrong without saying so.

Usage::

    python validation/stress.py run [--quick] [--solvers nam piqp ...] [--csv FILE]
    python validation/stress.py table [--csv FILE]
    python validation/stress.py plot [--csv FILE] [--figure FILE]

The rows are those of `stress_problems`, 20 seeded problems each, dense, of 0 to about
100 variables, all feasible and bounded, with a solution known by construction. Every
solver is asked for EPS = 1e-8, absolute and relative, through qpsolvers (`settings`;
the absolute part times the smallest unit of a scaled problem, so that asking for 1e-8
in natural units is not asking for less), in a child process that is ended when it
hangs. Its point is taken back to natural units, in which all data are of order one, and
primal residual, dual residual (signs of multipliers in it) and duality gap are
recomputed there (`namlcp.residuals`). With t the largest of the three over
TOLERANCE (1 + size of its terms), TOLERANCE = 1e-6, a hundred times what was asked:

- right: the solver says found, and t <= 1;
- inaccurate: it says found, and 1 < t <= 10;
- wrong: it says found, and t > 10 or something is not a number; or it says infeasible
  or unbounded, for all problems have a solution;
- gave up: it says that it has not found one, for whatever reason, or raises an error.
  Of daqp, quadprog and highs the host does not tell the reason, and it cannot change
  proxqp's tolerance for calling a problem infeasible;
- crash or hang: the child died twice, or was ended 2 s after the time limit, which
  some solvers do not know: piqp may take 100 000 iterations, with which it solves most.
"""

import argparse
import sys
import time
import warnings
from collections import Counter
from collections.abc import Callable, Iterable
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np
from qpsolvers import Solution

from benchmark import csv_writer, installed, machine_lines, read_csv, use_one_thread
from measure import Bench, bench, failure, silence
from namlcp.residuals import Residuals, qp_residuals
from settings import SOLVERS as MAIN_SOLVERS
from settings import solve, solver_settings
from stress_problems import ROWS, Case, Point, natural, posed

SOLVERS = (*MAIN_SOLVERS, "quadprog", "scs", "highs")
EPS, TOLERANCE, BEYOND = 1e-8, 1e-6, 10.0
OUTCOMES = ("right", "inaccurate", "wrong", "gave up", "crash or hang")
PROBLEMS, QUICK_PROBLEMS = 20, 2
LIMIT, QUICK_LIMIT = 2.0, 0.3  # [s] a problem
COLUMNS = (
    "row seed solver outcome excess primal_residual dual_residual duality_gap "
    "objective_error seconds said"
).split()
HERE = Path(__file__).parent
CSV, FIGURE = HERE / "results" / "stress.csv", HERE / "figures" / "stress.svg"
RELATIVE = {
    "nam": ("eps_rel",),
    "piqp": ("eps_rel", "eps_duality_gap_rel"),
    "proxqp": ("eps_rel", "eps_duality_gap_rel"),
    "clarabel": ("tol_gap_rel",),
    "osqp": ("eps_rel",),
    "scs": ("eps_rel",),
}
"""The relative tolerances of each solver; tol_feas of clarabel is both."""

ABSOLUTE = {
    "nam": ("eps_abs",),
    "piqp": ("eps_abs", "eps_duality_gap_abs"),
    "proxqp": ("eps_abs", "eps_duality_gap_abs"),
    "clarabel": ("tol_gap_abs",),
    "osqp": ("eps_abs",),
    "scs": ("eps_abs",),
    "daqp": ("primal_tol", "dual_tol"),
    "highs": ("primal_feasibility_tolerance", "dual_feasibility_tolerance"),
}
"""Those that take a unit; daqp and highs know no relative ones."""

LEAST = {"highs": 1e-10}  # what a solver refuses to go below

Row = dict[str, Any]


def settings(solver: str, unit: float, limit: float) -> Row:
    """Return what a solver is asked on a problem with that smallest unit."""
    known = solver_settings(solver, EPS, limit)
    known |= dict.fromkeys(RELATIVE.get(solver, ()), EPS)
    absolute = max(EPS * unit, LEAST.get(solver, 0.0))
    known |= dict.fromkeys(ABSOLUTE.get(solver, ()), absolute)
    return known


def claim(solution: Solution) -> str:
    """Return what the solver says in its own words; "" where the host does not tell."""
    extras = solution.extras or {}
    return str(extras.get("status", getattr(extras.get("info"), "status", "")))


def denies(said: str) -> bool:
    """Tell whether these words claim, without reserve, that there is no solution."""
    plain = said.lower().replace("_", " ")
    doubt = any(word in plain for word in ("almost", "inaccurate", " or "))
    return not doubt and ("infeasible" in plain or "unbounded" in plain)


def multipliers(solution: Solution, case: Case) -> Point:
    """Return the point of a solver; what it leaves out is zero."""
    sizes = case.qp.q.size, case.qp.b.size, case.qp.h.size, case.qp.q.size
    parts = (solution.x, solution.y, solution.z, solution.z_box)
    return Point(
        *(
            np.zeros(size) if part is None or np.size(part) == 0 else np.asarray(part)
            for part, size in zip(parts, sizes, strict=True)
        )
    )


def residuals(case: Case, point: Point) -> Residuals:
    """Return the residuals in natural units of a point of the posed problem."""
    return qp_residuals(*case.qp, *map(np.ascontiguousarray, natural(case, point)))


def verdict(found: bool, said: str, excess: float) -> str:
    """Return the outcome; `excess` is the largest residual over its tolerance."""
    if not found:
        return "wrong" if denies(said) else "gave up"
    if not excess <= BEYOND:
        return "wrong"
    return "right" if excess <= 1.0 else "inaccurate"


def judge(case: Case, solution: Solution) -> Row:
    """Return outcome and residuals of an answer."""
    said = claim(solution)
    if not solution.found or solution.x is None:
        return {"outcome": verdict(False, said, np.inf), "said": said}
    point = multipliers(solution, case)
    found = residuals(case, point)
    excess = found.worst(TOLERANCE, TOLERANCE)
    row: Row = {
        "outcome": verdict(True, said, excess),
        "said": said,
        "excess": excess,
        "primal_residual": found.primal,
        "dual_residual": found.dual,
        "duality_gap": found.gap,
    }
    if case.point is not None:
        P, q, x = case.qp.P, case.qp.q, case.point.x
        value = 0.5 * x @ P @ x + q @ x
        row["objective_error"] = abs(found.objective - value) / (1.0 + abs(value))
    return row


def serve(pipe: Connection, _: None, solver: str, limit: float) -> None:
    """Answer requests (row, seed, _) until None comes: the child process."""
    warnings.simplefilter("ignore")
    silence()
    if solver == "nam":
        import namlcp  # noqa: F401
    for name, seed, _ in iter(pipe.recv, None):
        case = ROWS[name](int(seed))
        problem = posed(case)
        options = settings(solver, case.units.smallest(), limit)

        def call(problem: Any = problem, options: Row = options) -> Solution:
            return solve(problem, solver, **options)

        if solver == "nam":
            call()  # compiled
        pipe.send("ready")
        start = time.perf_counter()
        try:
            row = judge(case, call())
        except Exception as error:
            words = failure(f"{type(error).__name__}: {error}")["status"]
            row = {"outcome": "gave up", "said": words}
        pipe.send(row | {"seconds": time.perf_counter() - start})


class StressBench(Bench):
    """A child process that makes the stress problems and solves them."""

    work = staticmethod(serve)


def ask(child: Bench, name: str, seed: int) -> Row:
    """Return the row of one problem; what crashed or hung is asked once more."""
    for _ in range(2):
        row = child.ask((name, seed, EPS))
        if "outcome" in row:
            break
    else:
        row = {"outcome": "crash or hang", "said": row["status"]}
    short = {k: float(f"{v:.3g}") if type(v) is float else v for k, v in row.items()}
    return {"row": name, "seed": seed, "solver": child.solver} | short


def run(
    solvers: Iterable[str],
    problems: int,
    limit: float,
    write: Callable[[Row], None],
) -> list[Row]:
    """Return the rows of all solvers on all problems, and write each at once."""
    rows = []
    for solver in solvers:
        with bench(Path(), solver, limit, StressBench) as child:
            for name in ROWS:
                for seed in range(problems):
                    rows.append(ask(child, name, seed))
                    write(rows[-1])
        right = sum(r["solver"] == solver and r["outcome"] == "right" for r in rows)
        print(f"{solver}: {right} of {problems * len(ROWS)} right", flush=True)
    return rows


def run_to(csv: Path, solvers: Iterable[str], problems: int, limit: float) -> list[Row]:
    """Run all, write a CSV file with the machine above the rows, return them."""
    use_one_thread()
    found = installed(solvers)
    header = [*machine_lines(found), f"problems a row: {problems}, limit {limit} s"]
    missing = [solver for solver in solvers if solver not in found]
    if missing:
        header.append(f"not installed: {', '.join(missing)}")
    csv.parent.mkdir(parents=True, exist_ok=True)
    print("\n".join(header))
    with csv_writer(csv, header, COLUMNS) as write:
        return run(found, problems, limit, write)


def run_quick(csv: Path, data: Path | None = None) -> list[Row]:
    """Run a few problems of every row: about a minute. No data are needed."""
    return run_to(csv, SOLVERS, QUICK_PROBLEMS, QUICK_LIMIT)


def counts(rows: Iterable[Row]) -> dict[tuple[str, str], Counter[str]]:
    """Return how often each outcome came, by row and solver."""
    table: dict[tuple[str, str], Counter[str]] = {}
    for row in rows:
        place = row["row"], row["solver"]
        table.setdefault(place, Counter())[row["outcome"]] += 1
    return table


def markdown(rows: list[Row]) -> str:
    """Return the table: right, or right / inaccurate / wrong / gave up [/ crash]."""
    table = counts(rows)
    solvers = list(dict.fromkeys(row["solver"] for row in rows))
    names = list(dict.fromkeys(row["row"] for row in rows))
    lines = [
        f"right / inaccurate / wrong without saying so / gave up / crash or hang, of "
        f"{sum(table[names[0], solvers[0]].values())} problems; one number: all right",
        "",
        "| | " + " | ".join(solvers) + " |",
        "|---" * (len(solvers) + 1) + "|",
    ]
    for name in names:
        cells = [cell(table[name, solver]) for solver in solvers]
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    totals = [sum((table[n, s] for n in names), Counter()) for s in solvers]
    lines.append("| all | " + " | ".join(map(cell, totals)) + " |")
    return "\n".join(lines)


def cell(count: Counter[str]) -> str:
    """Return one cell of the table."""
    if count["right"] == sum(count.values()):
        return str(count["right"])
    words = OUTCOMES if count[OUTCOMES[-1]] else OUTCOMES[:-1]
    return "/".join(str(count[word]) for word in words)


def shortfalls(rows: list[Row], own: str = "nam") -> list[str]:
    """Return where `own` is wrong, or right less often than the best peer."""
    table = counts(rows)
    lines = []
    for name in dict.fromkeys(row["row"] for row in rows):
        right = {s: c["right"] for (n, s), c in table.items() if n == name}
        best = max(right, key=lambda s: right[s])
        if right.get(own, 0) < right[best]:
            lines.append(f"{name}: {own} {right.get(own, 0)}, {best} {right[best]}")
        if table[name, own]["wrong"]:
            lines.append(f"{name}: {own} wrong {table[name, own]['wrong']} times")
    return lines


def main(arguments: list[str] | None = None) -> int:
    """Run, tabulate or draw; a run returns 1 where nam falls short."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("command", choices=["run", "table", "plot"])
    parser.add_argument("--quick", action="store_true", help="about a minute")
    parser.add_argument("--solvers", nargs="+", choices=SOLVERS, default=SOLVERS)
    parser.add_argument("--csv", type=Path, help="default: results/stress.csv")
    parser.add_argument("--figure", type=Path, default=FIGURE)
    args = parser.parse_args(arguments)
    if args.command == "plot":
        from stress_figure import plot

        plot(args.csv or CSV, args.figure)
        return 0
    if args.command == "table":
        print(markdown(read_csv(args.csv or CSV)))
        return 0
    csv = args.csv or (Path("stress-quick.csv") if args.quick else CSV)
    size = (QUICK_PROBLEMS, QUICK_LIMIT) if args.quick else (PROBLEMS, LIMIT)
    rows = run_to(csv, args.solvers, *size)
    print(markdown(rows))
    if "nam" not in args.solvers:
        return 0
    short = shortfalls(rows)
    print("\n".join(short) or "nam: never wrong, right as often as the best peer")
    return int(bool(short))


if __name__ == "__main__":
    sys.exit(main())
