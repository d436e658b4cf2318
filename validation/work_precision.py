"""Speed against attained accuracy: one panel for each family of problems.

Usage::

    python validation/work_precision.py run [--data DIR] [--quick] [--results DIR]
        [--families NAME ...] [--solvers nam piqp ...] [--eps 1e-2 1e-4 ...]
        [--limit 5] [--minutes 60]
    python validation/work_precision.py plot [--results DIR] [--figures DIR]

run
    work-precision-problems.csv: a row for each problem, solver and requested tolerance.
    `error` is computed here from the returned point: the distance to the solution,
    || x - x* ||_inf / || x* ||_inf, in families whose solutions are unique (known by
    construction, or from `references`), else the worst residual. `residual` is the
    worst of primal residual, dual residual, duality gap and wrong-signed multipliers,
    for a sweep Res(z): the quantity whose tolerance was asked for. A request is missed
    if the residual is more than ten times the tolerance, or the time limit is; what
    the solver says of itself counts for nothing. The solvers take turns, problem by
    problem; what is late at a tolerance is not tried at a tighter one. A run that was
    stopped goes on where its file ends.
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
import resource
import sys
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np
import qpsolvers
import scipy.sparse as sp
from qpsolvers import Solution

import problems
from benchmark import (
    RESIDUALS,
    Row,
    csv_writer,
    header_lines,
    installed,
    machine_lines,
    read_csv,
    run_problem,
    use_one_thread,
)
from families import Task, families, missing
from measure import MEMORY, Bench, bench, failure, judge, median_time, silence
from namlcp.residuals import natural_residual
from references import distance, reference
from settings import solve, solver_settings

HERE = Path(__file__).parent
SOLVERS = "nam piqp proxqp daqp quadprog clarabel osqp scs highs".split()
DENSE, DENSE_MOST = ("daqp", "quadprog"), 3000  # solvers that fill P; n at most
OURS = ("nam", "sweep auto")
TOLERANCES = [10.0**-k for k in range(2, 13, 2)]
QUICK_TOLERANCES = [1e-3, 1e-6, 1e-9]
LIMIT, QUICK_LIMIT = 5.0, 2.0  # [s]
MISS = 10.0  # a residual of so many tolerances
KEY = ["family", "problem", "solver", "eps"]
COLUMNS = [*KEY, "n", "runtime", "residual", "error", "missed", "status"]
SUMMARY = (
    "family title measure n_least n_most problems solver eps solved error time q1 q3"
).split()


def sweep_call(task: Task, name: str, eps: float, limit: float) -> Callable[[], Any]:
    """Return the call of a named sweep on the LCP, its parameters chosen by itself."""
    from namlcp import solve_lcp
    from namlcp.lcp.modulus.methods import KNOWN

    P, q = task.problem.P, task.problem.q
    A = sp.csr_array(P) if sp.issparse(P) else P
    free = {"omega"} if name == "modified-nam" else {"alpha", "omega"}
    given = dict.fromkeys(set(KNOWN[name].takes) & free, "auto")
    if task.s0 is not None and name != "auto":
        given["s0"] = task.s0
    given |= {"eps_abs": eps, "time_limit": limit}
    lower, upper = task.problem.lb, task.problem.ub
    return lambda: solve_lcp(A, q, lower, upper, method=name, **given)


def solver_call(task: Task, solver: str, eps: float, limit: float) -> Callable[[], Any]:
    """Return the call that is timed: a sweep, or a solver through qpsolvers."""
    kind, _, name = solver.rpartition(" ")
    if kind == "sweep":
        return sweep_call(task, name, eps, limit)
    settings = solver_settings(solver, eps, limit)
    problem = problems.filled(task.problem) if solver in DENSE else task.problem
    return lambda: solve(problem, solver, **settings)


def judged(task: Task, answer: Any, eps: float) -> tuple[np.ndarray | None, Row]:
    """Return the point and its residual, whatever the solver says of it."""
    if isinstance(answer, Solution):
        found = Solution(task.problem, found=True, x=answer.x)
        if answer.x is None or not np.all(np.isfinite(answer.x)):
            return None, judge(task.problem, answer, eps)
        found.y, found.z, found.z_box = answer.y, answer.z, answer.z_box
        row = judge(task.problem, found, eps)
        worst = max(np.nan_to_num(row[name], nan=np.inf) for name in RESIDUALS)
        return answer.x, {"residual": float(worst), "status": row["status"]}
    problem = task.problem
    w = problem.P @ answer.z + problem.q
    residual = natural_residual(answer.z, w, problem.lb, problem.ub)
    return answer.z, {"residual": residual, "status": answer.status.value}


def loading_tasks(task: Task, solver: str) -> Iterator[Task]:
    """Yield tasks that load, and once compile, what this one will need.

    Tiny ones of its kind; for our own solver, whose choice of a method depends on the
    size, the task itself too.
    """
    for tiny in problems.tiny_problems(task.problem):
        yield Task(tiny)
    if solver in OURS:
        yield task


def measure(
    pipe: Connection, solver: str, task: Task, eps: float, limit: float
) -> tuple[np.ndarray | None, Row]:
    """Time a solver on a problem; return its first point and the row."""
    n = task.problem.q.size
    if solver in DENSE and n > DENSE_MOST:
        return None, {"n": n} | failure(f"too slow: dense, n > {DENSE_MOST}")
    for other in loading_tasks(task, solver):
        try:
            solver_call(other, solver, eps, limit)()
        except Exception:  # what the solver refuses cannot warm it up
            continue
    pipe.send("ready")
    try:
        answer, cold, runtime = median_time(solver_call(task, solver, eps, limit))
        point, row = judged(task, answer, eps)
    except Exception as error:
        return None, {"n": n} | failure(f"{type(error).__name__}: {error}")
    if cold > limit:
        row["status"] = "too slow"
    return point, row | {"n": n, "runtime": runtime}


def serve(pipe: Connection, data: Path | None, solver: str, limit: float) -> None:
    """Answer requests (family, problem, eps) until None comes: the child process."""
    warnings.simplefilter("ignore")
    silence()
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    import namlcp  # noqa: F401

    known = families(data)
    last, task = None, None
    for family, name, eps in iter(pipe.recv, None):
        if last != (family, name):
            last, task = (family, name), known[family].makers[name]()
        pipe.send(measure(pipe, solver, task, eps, limit))


class ChartBench(Bench):
    """A child process that answers with a point and a row."""

    work = staticmethod(serve)
    point: np.ndarray | None = None

    def ask(self, request: Any) -> Row:
        """Return the row; the point is kept."""
        answer: Any = super().ask(request)
        self.point, row = answer if isinstance(answer, tuple) else (None, answer)
        return row


def solution_of(task: Task) -> np.ndarray | None:
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


def family_rows(
    data: Path | None,
    name: str,
    solvers: list[str],
    tolerances: list[float],
    limit: float,
    done: set[tuple[str, ...]],
    quick: bool,
) -> Iterator[Row]:
    """Yield the rows of one family that are not `done`."""
    family = families(data)[name]
    chosen = solvers if family.peers else []
    chosen = [*chosen, *family.sweeps]
    if not family.peers:
        chosen = ["sweep auto", *chosen]
    with ExitStack() as stack:
        children: dict[str, ChartBench] = {}
        for problem in family.quick if quick else family.makers:
            wanted = [
                (eps, solver)
                for eps in sorted(tolerances, reverse=True)
                for solver in chosen
                if (name, problem, solver, f"{eps:.0e}") not in done
            ]
            if not wanted:
                continue
            exact = solution_of(family.makers[problem]()) if family.distance else None
            slow: dict[str, dict[str, Row]] = {solver: {} for solver in chosen}
            for eps, solver in wanted:
                if solver not in children:
                    child = bench(data, solver, limit, ChartBench)
                    children[solver] = stack.enter_context(child)
                child = children[solver]
                child.point = None
                row = run_problem(child, name, problem, eps, slow[solver])
                yield complete(dict(row), child.point, exact)


def key_of(row: Row) -> tuple[str, ...]:
    """Return what a row is about, as the file has it."""
    family, problem, solver, eps = (row[name] for name in KEY)
    return family, problem, solver, f"{float(eps):.0e}"


def run(args: argparse.Namespace) -> int:
    """Measure what the file does not have yet, then sum it up; 2: data are missing."""
    use_one_thread()
    absent = missing(args.data)
    for text in absent:
        print(f"missing in the data folder, left out: {text}")
    solvers = installed(args.solvers)
    left_out = [solver for solver in args.solvers if solver not in solvers]
    header = machine_lines(solvers)
    header += [f"not installed: {', '.join(left_out)}"] if left_out else []
    header += [f"without data: {'; '.join(absent)}"] if absent else []
    header.append(f"limit: {args.limit:g} s")
    file = args.results / f"{args.stem}-problems.csv"
    file.parent.mkdir(parents=True, exist_ok=True)
    done = {key_of(row) for row in read_csv(file)} if file.exists() else set()
    end = time.monotonic() + 60.0 * args.minutes
    with csv_writer(file, header, COLUMNS, "ignore", append=True) as write:
        for name in args.families or families(args.data):
            rows = family_rows(
                args.data, name, solvers, args.eps, args.limit, done, args.quick
            )
            for row in rows:
                write(row)
                args.report(row)
                if time.monotonic() > end:
                    print("out of minutes; the same command goes on from here")
                    return 1
    summarise(args, file)
    return 2 if absent else 0


def summarise(args: argparse.Namespace, file: Path) -> None:
    """Write the medians and quartiles over the problems of each family."""
    rows = read_csv(file)
    groups: dict[tuple[str, str, float], list[Row]] = {}
    for row in rows:
        key = row["family"], row["solver"], float(row["eps"])
        groups.setdefault(key, []).append(row)
    known = families(args.data)
    sizes: dict[str, list[int]] = {}
    for family in {row["family"] for row in rows}:
        n = [int(row["n"]) for row in rows if row["family"] == family and row["n"]]
        sizes[family] = [min(n), max(n)]
    target = args.results / f"{args.stem}.csv"
    with csv_writer(target, header_lines(file), SUMMARY) as write:
        for (family, solver, eps), own in groups.items():
            solved = [row for row in own if row["missed"] == "False"]
            lost = [np.inf] * (len(own) - len(solved))
            error, times = (
                quartiles([float(row[name]) for row in solved] + lost)
                for name in ("error", "runtime")
            )
            write(
                {
                    "family": family,
                    "title": known[family].title,
                    "measure": "distance" if known[family].distance else "residual",
                    "n_least": sizes[family][0],
                    "n_most": sizes[family][1],
                    "problems": len(own),
                    "solver": solver,
                    "eps": eps,
                    "solved": len(solved),
                    "error": error[1],
                    "time": times[1],
                    "q1": times[0],
                    "q3": times[2],
                }
            )


def quartiles(values: list[float]) -> list[float]:
    """Return quartiles that are members of the sample, some of which is infinite."""
    found = np.quantile(values, (0.25, 0.5, 0.75), method="inverted_cdf")
    return [float(value) for value in found]


def print_row(row: Row) -> None:
    """Print one measurement on one line."""
    runtime, error = (float(row.get(key, "nan")) for key in ("runtime", "error"))
    print(
        f"{row['family']:<11}{row['problem']:<24}{row['solver']:<19}{row['eps']:<8.0e}"
        f"{1e3 * runtime:>11.3f} ms{error:>9.1e} {row['status']:.30}",
        flush=True,
    )


def parse_arguments(arguments: list[str] | None) -> argparse.Namespace:
    """Return the command line, with what --quick stands for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("task", choices=["run", "plot"])
    parser.add_argument("--data", type=Path, help="the data folder")
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--families", nargs="+", choices=families(None))
    parser.add_argument("--solvers", nargs="+", default=SOLVERS)
    parser.add_argument("--eps", nargs="+", type=float)
    parser.add_argument("--limit", type=float, help="[s] a solve")
    parser.add_argument("--minutes", type=float, default=np.inf)
    parser.add_argument("--results", type=Path, default=HERE / "results")
    parser.add_argument("--figures", type=Path, default=HERE / "figures")
    args = parser.parse_args(arguments)
    args.eps = args.eps or (QUICK_TOLERANCES if args.quick else TOLERANCES)
    args.limit = args.limit or (QUICK_LIMIT if args.quick else LIMIT)
    args.stem = "work-precision-quick" if args.quick else "work-precision"
    args.report = print_row
    return args


def main(arguments: list[str] | None = None) -> int:
    """Run or plot."""
    args = parse_arguments(arguments)
    if args.task == "run":
        return run(args)
    import work_precision_figure

    results = args.results / f"{args.stem}.csv"
    work_precision_figure.plot(results, args.figures / f"{args.stem}.svg")
    return 0


if __name__ == "__main__":
    sys.exit(main())
