"""Which solver stays right under stress, and which is wrong without saying so.

The rows are those of `stress_cases`, 20 seeded problems each, dense, of 0 to about
100 variables, all feasible and bounded, with a solution known by construction. Every
solver is asked for EPS = 1e-8, absolute and relative, through qpsolvers (`qp_solvers`;
the absolute part times the smallest unit of a scaled problem, so that asking for 1e-8
in natural units is not asking for less), in a child process that is ended when it
hangs. Its point is taken back to natural units, in which all data are of order one, and
primal residual, dual residual (signs of multipliers in it) and duality gap are
recomputed there (`namlcp.qp_residuals`). With t the largest of the three over
TOLERANCE (1 + size of its terms), TOLERANCE = 1e-6, a hundred times what was asked:

- right: the solver says found, and t <= 1;
- inaccurate: it says found, and 1 < t <= 10;
- wrong: it says found, and t > 10 or something is not a number; or it says infeasible
  or unbounded, for all problems have a solution;
- gave up: it says that it has not found one, for whatever reason, or raises an error.
  Of daqp, quadprog and highs qpsolvers does not tell the reason, and it cannot change
  proxqp's tolerance for calling a problem infeasible;
- crash or hang: the child died twice, or was ended 2 s after the time limit, which
  some solvers do not know: piqp may take 100 000 iterations, with which it solves most.
"""

import sys
import time
from collections import Counter
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np
from qpsolvers import Solution

from namlcp import Residuals, qp_residuals
from validation.harness import (
    Bench,
    Job,
    Row,
    cli,
    csv_files,
    judging,
    machine,
    processes,
    qp_solvers,
    tables,
)
from validation.problems import stress_cases

SOLVERS = (*qp_solvers.SOLVERS, "quadprog", "scs", "highs")
EPS = 1e-8  # what the solvers are asked for
TOLERANCE = 1e-6  # of a right answer: a hundred times that
BEYOND = 10.0  # tolerances; an answer that misses more of them is wrong
OUTCOMES = ("right", "inaccurate", "wrong", "gave up", "crash or hang")
PROBLEMS, QUICK_PROBLEMS = 20, 2
LIMIT, QUICK_LIMIT = 2.0, 0.3  # [s] a problem
COLUMNS = (
    "row seed solver outcome excess primal_residual dual_residual duality_gap "
    "objective_error seconds said"
).split()
CSV, FIGURE = cli.RESULTS / "stress.csv", cli.FIGURES / "stress.svg"
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


def settings(solver: str, unit: float, limit: float) -> Row:
    """Return what a solver is asked on a problem with that smallest unit."""
    known = qp_solvers.settings(solver, EPS, limit)
    known |= dict.fromkeys(RELATIVE.get(solver, ()), EPS)
    absolute = max(EPS * unit, LEAST.get(solver, 0.0))
    known |= dict.fromkeys(ABSOLUTE.get(solver, ()), absolute)
    return known


def denies(said: str) -> bool:
    """Tell whether these words claim, without reserve, that there is no solution."""
    plain = said.lower().replace("_", " ")
    doubt = any(word in plain for word in ("almost", "inaccurate", " or "))
    return not doubt and ("infeasible" in plain or "unbounded" in plain)


def multipliers(solution: Solution, case: stress_cases.Case) -> stress_cases.Point:
    """Return the point of a solver; what it leaves out is zero."""
    sizes = case.qp.q.size, case.qp.b.size, case.qp.h.size, case.qp.q.size
    parts = solution.x, solution.y, solution.z, solution.z_box
    return stress_cases.Point(*map(judging.filled, parts, sizes))


def residuals(case: stress_cases.Case, point: stress_cases.Point) -> Residuals:
    """Return the residuals in natural units of a point of the posed problem."""
    return qp_residuals(
        *case.qp, *map(np.ascontiguousarray, stress_cases.natural(case, point))
    )


def verdict(found: bool, said: str, excess: float) -> str:
    """Return the outcome; `excess` is the largest residual over its tolerance."""
    if not found:
        return "wrong" if denies(said) else "gave up"
    if not excess <= BEYOND:
        return "wrong"
    return "right" if excess <= 1.0 else "inaccurate"


def judge(case: stress_cases.Case, solution: Solution) -> Row:
    """Return outcome and residuals of an answer."""
    said = judging.said_by(solution)
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


def work(job: Job, name: str, seed: int) -> Row:
    """Solve a stress case and judge the answer: the work of a child."""
    case = stress_cases.ROWS[name](seed)
    problem = stress_cases.posed(case)
    options = settings(job.solver, case.units.smallest(), job.limit)
    if job.solver == "nam":
        qp_solvers.solve(problem, job.solver, **options)  # compiled
    job.ready()
    start = time.perf_counter()
    try:
        row = judge(case, qp_solvers.solve(problem, job.solver, **options))
    except Exception as error:
        row = {"outcome": "gave up", "said": processes.raised(error)["status"]}
    return row | {"seconds": time.perf_counter() - start}


def ask(child: Bench, name: str, seed: int) -> Row:
    """Return the row of one problem; what crashed or hung is asked once more."""
    for _ in range(2):
        row = child.ask(name, seed)
        if "outcome" in row:
            break
    else:
        row = {"outcome": "crash or hang", "said": row["status"]}
    short = {k: float(f"{v:.3g}") if type(v) is float else v for k, v in row.items()}
    return {"row": name, "seed": seed, "solver": child.solver} | short


def run(
    solvers: Iterable[str], problems: int, limit: float, write: Callable[[Row], None]
) -> list[Row]:
    """Return the rows of all solvers on all problems, and write each at once."""
    rows = []
    for solver in solvers:
        with Bench(work, solver, limit) as child:
            for name in stress_cases.ROWS:
                for seed in range(problems):
                    rows.append(ask(child, name, seed))
                    write(rows[-1])
        right = len(tables.chosen(rows, solver=solver, outcome="right"))
        total = problems * len(stress_cases.ROWS)
        print(f"{solver}: {right} of {total} right", flush=True)
    return rows


def run_to(csv: Path, solvers: Iterable[str], problems: int, limit: float) -> list[Row]:
    """Run all, write a CSV file with the machine above the rows, return them."""
    found = machine.installed(solvers)
    size = f"problems a row: {problems}, limit {limit} s"
    header = cli.begin(found, size, *machine.not_installed(solvers, found))
    with csv_files.writer(csv, header, COLUMNS) as write:
        return run(found, problems, limit, write)


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
    solvers, names = tables.distinct(rows, "solver"), tables.distinct(rows, "row")
    lines = [[name, *(cell(table[name, s]) for s in solvers)] for name in names]
    totals = [sum((table[n, s] for n in names), Counter()) for s in solvers]
    lines.append(["all", *map(cell, totals)])
    problems = sum(table[names[0], solvers[0]].values())
    return (
        f"right / inaccurate / wrong without saying so / gave up / crash or hang, of "
        f"{problems} problems; one number: all right\n\n"
    ) + tables.markdown(["", *solvers], lines)


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
    for name in tables.distinct(rows, "row"):
        right = {s: c["right"] for (n, s), c in table.items() if n == name}
        best = max(right, key=lambda s: right[s])
        if right.get(own, 0) < right[best]:
            lines.append(f"{name}: {own} {right.get(own, 0)}, {best} {right[best]}")
        if table[name, own]["wrong"]:
            lines.append(f"{name}: {own} wrong {table[name, own]['wrong']} times")
    return lines


def main(arguments: list[str] | None = None) -> int:
    """Run, tabulate or draw; a run returns 1 where nam falls short."""
    parser = cli.parser(__doc__, "quick", "csv", solvers=SOLVERS)
    parser.add_argument("command", choices=["run", "table", "plot"])
    parser.add_argument("--figure", type=Path, default=FIGURE)
    args = parser.parse_args(arguments)
    if args.command == "plot":
        from validation.stress.comparison_figure import plot

        plot(args.csv or CSV, args.figure)
        return 0
    if args.command == "table":
        print(markdown(csv_files.read(args.csv or CSV)))
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
