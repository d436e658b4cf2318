"""Speed against attained accuracy: one panel for each family of problems.

run
    work-precision-problems.csv: a row for each problem, solver and requested tolerance.
    `error` is computed here from the returned point: the distance to the solution,
    || x - x* ||_inf / || x* ||_inf, in families whose solutions are unique (known by
    construction, or from `references`), else the worst residual. `residual` is the
    worst of primal residual, dual residual, duality gap and wrong-signed multipliers,
    for a sweep Res(z): the quantity whose tolerance was asked for. A request is missed
    if the residual is more than ten times the tolerance, or the time limit is; what
    the solver says of itself counts for nothing. The solvers take turns, problem by
    problem, namlcp first: the other solvers' time limit is ten times what it took
    (`runs.limit_beside`). What is late at a tolerance is not tried at a tighter one. A
    run that was stopped goes on where its file ends.
    work-precision.csv, from it: for each family, solver and tolerance the median and
    the quartiles over the problems of time and error, what is missed being infinite,
    and how many are missed. The quartiles are values of the sample.
plot
    work-precision.svg from work-precision.csv.

--quick: two small problems for each family, three tolerances, into files of their own
names (work-precision-quick...). Without --data the problems of the data folder are left
out, by name.
"""

import argparse
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import qpsolvers
import scipy.sparse as sp
from qpsolvers import Solution

from namlcp import natural_residual
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
    qps,
    tables,
    timing,
)
from validation.peers.references import distance, reference
from validation.peers.runs import limit_beside, loosest_first, run_problem
from validation.problems import families

SOLVERS = "nam piqp proxqp daqp quadprog clarabel osqp scs highs moreau qtqp".split()
DENSE = ("daqp", "quadprog")  # solvers that fill P
DENSE_MOST = 3000  # variables at most for them
OURS = ("nam", "sweep auto")
TOLERANCES = [10.0**-k for k in range(2, 13, 2)]
QUICK_TOLERANCES = [1e-3, 1e-6, 1e-9]
LIMIT, QUICK_LIMIT = 5.0, 2.0  # [s]
MISS = 10.0  # a residual of so many tolerances
KEY = ["family", "problem", "solver", "eps"]
COLUMNS = [*KEY, "n", "runtime", "residual", "error", "missed", "status"]
SHOWN = "family problem:23 solver:18 eps:7 runtime error status:30"
SUMMARY = (
    "family title measure n_least n_most problems solver eps solved error time q1 q3"
).split()


def sweep_call(
    task: families.Task, name: str, eps: float, limit: float
) -> Callable[[], Any]:
    """Return the call of a named method on the LCP, its parameters chosen by itself."""
    from namlcp import solve_lcp
    from namlcp.lcp import SWEEPS

    P, q = task.problem.P, task.problem.q
    A = sp.csr_array(P) if sp.issparse(P) else P
    free = {"omega"} if name == "modified-nam" else {"alpha", "omega"}
    takes = SWEEPS[name].takes if name in SWEEPS else ()
    given = dict.fromkeys(set(takes) & free, "auto")
    if task.s0 is not None and name in SWEEPS:
        given["s0"] = task.s0
    given |= {"eps_abs": eps, "time_limit": limit}
    lower, upper = task.problem.lb, task.problem.ub
    return lambda: solve_lcp(A, q, lower, upper, method=name, **given)


def solver_call(
    task: families.Task, solver: str, eps: float, limit: float
) -> Callable[[], Any]:
    """Return the call that is timed: a sweep, or a solver through qpsolvers."""
    kind, _, name = solver.rpartition(" ")
    if kind == "sweep":
        return sweep_call(task, name, eps, limit)
    settings = qp_solvers.settings(solver, eps, limit)
    problem = qps.filled(task.problem) if solver in DENSE else task.problem
    return lambda: qp_solvers.solve(problem, solver, **settings)


def judged(
    task: families.Task, answer: Any, eps: float
) -> tuple[np.ndarray | None, Row]:
    """Return the point and its residual, whatever the solver says of it."""
    if isinstance(answer, Solution):
        found = Solution(task.problem, found=True, x=answer.x)
        if answer.x is None or not np.all(np.isfinite(answer.x)):
            return None, judging.judge(task.problem, answer, eps)
        found.y, found.z, found.z_box = answer.y, answer.z, answer.z_box
        row = judging.judge(task.problem, found, eps)
        worst = max(np.nan_to_num(row[name], nan=np.inf) for name in judging.RESIDUALS)
        return answer.x, {"residual": float(worst), "status": row["status"]}
    problem = task.problem
    w = problem.P @ answer.z + problem.q
    residual = natural_residual(answer.z, w, problem.lb, problem.ub)
    return answer.z, {"residual": residual, "status": answer.status.value}


def loading_tasks(task: families.Task, solver: str) -> Iterator[families.Task]:
    """Yield tasks that load, and once compile, what this one will need.

    Tiny ones of its kind; for our own solver, whose choice of a method depends on the
    size, the task itself too.
    """
    for tiny in qps.tiny_problems(task.problem):
        yield families.Task(tiny)
    if solver in OURS:
        yield task


@cache
def known_families(data: Path | None) -> dict[str, families.Family]:
    """Return the families, made once in a process."""
    return families.families(data)


@lru_cache(maxsize=1)
def task_of(data: Path | None, family: str, name: str) -> families.Task:
    """Return a problem; the last one is kept."""
    return known_families(data)[family].makers[name]()


def measure(job: Job, family: str, name: str, eps: float) -> Row:
    """Time a solver on a problem: the work of a child. `point` is its first answer."""
    import namlcp  # noqa: F401

    task = task_of(job.data, family, name)
    n = task.problem.q.size
    if job.solver in DENSE and n > DENSE_MOST:
        return {"n": n} | processes.failure(f"too slow: dense, n > {DENSE_MOST}")
    for other in loading_tasks(task, job.solver):
        try:
            solver_call(other, job.solver, eps, job.limit)()
        except Exception:  # what the solver refuses cannot warm it up
            continue
    job.ready()
    try:
        call = solver_call(task, job.solver, eps, job.limit)
        answer, cold, runtime = timing.median_time(call)
        point, row = judged(task, answer, eps)
    except Exception as error:
        return {"n": n} | processes.raised(error)
    if cold > job.limit:
        row["status"] = "too slow"
    return row | {"n": n, "runtime": runtime, "point": point}


def solution_of(task: families.Task) -> np.ndarray | None:
    """Return the solution as it is known, or as `references` certifies it."""
    if task.exact is not None:
        return task.exact
    import namlcp  # noqa: F401

    return reference(task.problem, qpsolvers.solve_problem(task.problem, solver="nam"))


def complete(row: Row, point: np.ndarray | None, exact: np.ndarray | None) -> Row:
    """Return a row with its error and whether the request is missed."""
    residual = float(row.get("residual", np.inf))
    late = row["status"].startswith("too slow")
    row["missed"] = late or not residual <= MISS * row["eps"]
    if point is not None:
        row["error"] = residual if exact is None else distance(point, exact)
    row["family"] = row.pop("set")
    return row


def limit_of(solver: str, rows: list[Row], most: float) -> float:
    """Return the time limit [s] of a solver; `rows` are those of this request."""
    if solver in OURS or solver.startswith("sweep "):
        return most
    own = [row for row in rows if row["solver"] in OURS]
    solved = [row for row in own if str(row["missed"]) == "False"]
    return limit_beside([float(row["runtime"]) for row in solved], most)


def family_rows(
    args: argparse.Namespace, name: str, solvers: list[str], file: csv_files.Growing
) -> Iterator[Row]:
    """Yield the rows of one family that the file does not have."""
    family = known_families(args.data)[name]
    asked = [*(solvers if family.peers else ["sweep auto"]), *family.sweeps]
    with ExitStack() as stack:
        children: dict[str, Bench] = {}
        for problem in family.quick if args.quick else family.makers:
            wanted = [
                (eps, solver)
                for eps, solver in loosest_first(args.eps, asked)
                if not file.has(name, problem, solver, eps)
            ]
            if not wanted:
                continue
            exact = solution_of(family.makers[problem]()) if family.distance else None
            slow: dict[str, dict[str, Row]] = {solver: {} for solver in asked}
            for eps, solver in wanted:
                if solver not in children:
                    child = Bench(measure, solver, args.limit, args.data)
                    children[solver] = stack.enter_context(child)
                asked_too = tables.chosen(file.rows, family=name, problem=problem)
                same = [row for row in asked_too if float(row["eps"]) == eps]
                children[solver].limit = limit_of(solver, same, args.limit)
                row = run_problem(children[solver], name, problem, eps, slow[solver])
                point = row.pop("point", None)  # of a late one it counts once
                yield complete(dict(row), point, exact)


def run(args: argparse.Namespace) -> int:
    """Measure what the file does not have yet, then sum it up."""
    absent = families.missing(args.data)
    for text in absent:
        print(f"missing in the data folder, left out: {text}")
    solvers = machine.installed(args.solvers)
    header = cli.begin(
        solvers,
        *machine.not_installed(args.solvers, solvers),
        *([f"without data: {'; '.join(absent)}"] if absent else []),
        f"limit: {args.limit:g} s",
    )
    path = args.results / f"{args.stem}-problems.csv"
    with csv_files.growing(path, header, COLUMNS, KEY) as file:
        for name in args.families or known_families(args.data):
            for row in family_rows(args, name, solvers, file):
                tables.print_row(file.add(row), SHOWN)
    summarise(args, path)
    return cli.MISSING if absent else 0


def summarise(args: argparse.Namespace, file: Path) -> None:
    """Write the medians and quartiles over the problems of each family."""
    rows = csv_files.read(file)
    known = known_families(args.data)
    target = args.results / f"{args.stem}.csv"
    with csv_files.writer(target, csv_files.header(file), SUMMARY) as write:
        for name, solver, eps in tables.distinct(rows, "family", "solver", "eps"):
            own = tables.chosen(rows, family=name, solver=solver, eps=eps)
            solved = tables.chosen(own, missed="False")
            lost = [np.inf] * (len(own) - len(solved))
            error, times = (
                quartiles([float(row[key]) for row in solved] + lost)
                for key in ("error", "runtime")
            )
            family = tables.chosen(rows, family=name)
            sizes = [int(row["n"]) for row in family if row["n"]]
            row = {"family": name, "title": known[name].title}
            row["measure"] = "distance" if known[name].distance else "residual"
            row |= {"n_least": min(sizes), "n_most": max(sizes), "problems": len(own)}
            row |= {"solver": solver, "eps": float(eps), "solved": len(solved)}
            row |= {"error": error[1], "time": times[1], "q1": times[0], "q3": times[2]}
            write(row)


def quartiles(values: list[float]) -> list[float]:
    """Return quartiles that are members of the sample, some of which is infinite."""
    found = np.quantile(values, (0.25, 0.5, 0.75), method="inverted_cdf")
    return [float(value) for value in found]


def main(arguments: list[str] | None = None) -> int:
    """Run or plot."""
    parser = cli.parser(
        __doc__, "data", "quick", "eps", "results", "figures",
        solvers=SOLVERS, limit=None,
    )  # fmt: skip
    parser.add_argument("task", choices=["run", "plot"])
    parser.add_argument("--families", nargs="+", choices=known_families(None))
    args = parser.parse_args(arguments)
    args.eps = args.eps or (QUICK_TOLERANCES if args.quick else TOLERANCES)
    args.limit = args.limit or (QUICK_LIMIT if args.quick else LIMIT)
    args.stem = "work-precision-quick" if args.quick else "work-precision"
    if args.task == "run":
        return run(args)
    from validation.peers import front_figure, work_precision_figure

    results = args.results / f"{args.stem}.csv"
    work_precision_figure.plot(results, args.figures / f"{args.stem}.svg")
    if not args.quick:
        front_figure.plot(results, args.figures / "front.svg")
    return 0


if __name__ == "__main__":
    sys.exit(main())
