"""Runs of QP solvers over sets of problems: rows, one a solve, and tables of them."""

import argparse
from collections.abc import Callable, Iterable, Iterator
from itertools import product
from pathlib import Path

import numpy as np
from qpsolvers import Problem

from validation.harness import (
    LATE,
    Bench,
    Job,
    Row,
    Work,
    cli,
    csv_files,
    judging,
    processes,
    qp_solvers,
    qps,
    tables,
    timing,
)
from validation.problems import data_sets

COLUMNS = [
    *"problem set solver eps runtime cold found".split(),
    *judging.RESIDUALS,
    *"success status iterations form".split(),
]
KEY = ("set", "problem", "solver", "eps")
PEER_TIMES, PEER_LEAST = 10.0, 1.0  # times of namlcp's, [s]: see limit_beside


def measure(
    job: Job,
    problem_set: str,
    name: str,
    eps: float,
    load: Callable[[Path, str, str], Problem] = data_sets.load,
) -> Row:
    """Time a solver on a problem and judge its first answer: the work of a child.

    load(data, set, name) returns the problem.
    """
    problem = load(job.data, problem_set, name)
    settings = qp_solvers.settings(job.solver, eps, job.limit)
    for tiny in qps.tiny_problems(problem):
        try:
            qp_solvers.solve(tiny, job.solver, **settings)
        except Exception:  # what the solver refuses cannot warm it up
            continue
    job.ready()
    try:
        solution, cold, runtime = timing.median_time(
            lambda: qp_solvers.solve(problem, job.solver, **settings)
        )
        row = judging.judge(problem, solution, eps)
    except Exception as error:
        return processes.raised(error)
    if cold > job.limit:
        row |= processes.failure("too slow")
    return row | {"runtime": runtime, "cold": cold}


def run_problem(
    child: Bench, problem_set: str, name: str, eps: float, slow: dict[str, Row]
) -> Row:
    """Return the row of one problem; `slow` holds those that ran into the limit.

    They are not tried at tighter tolerances; what runs into it now is added.
    """
    if name in slow and float(slow[name]["eps"]) >= eps:
        return slow[name] | {"eps": eps}
    row = child.run(problem_set, name, eps)
    if row["status"] in LATE:
        slow[name] = row
    return row


def limit_beside(ours: list[float], most: float) -> float:
    """Return the time limit [s] of a peer where namlcp has taken `ours`, if it solved.

    It is given PEER_TIMES as long, at least PEER_LEAST, and at most `most`: for figures
    that need no more than that a peer is late.
    """
    return min(most, max(PEER_LEAST, PEER_TIMES * min(ours, default=most)))


def loosest_first(
    tolerances: Iterable[float], names: Iterable[str]
) -> Iterator[tuple[float, str]]:
    """Return (eps, name) for all names at the loosest tolerance, then at the next.

    What runs into the time limit is then known before it is asked more exactly.
    """
    return product(sorted(tolerances, reverse=True), names)


def run_all(
    names: dict[str, list[str]],
    solvers: Iterable[str],
    args: argparse.Namespace,
    work: Work = measure,
    amend: Callable[[Row], Row] = lambda row: row,
) -> list[Row]:
    """Run solvers over the sets of `names`; write each row to args.csv, return all.

    Loose tolerances first: what ran into the time limit is not tried at a tighter one.
    """
    header = cli.begin(solvers)
    with csv_files.growing(args.csv, header, COLUMNS, KEY, args.go_on) as file:
        for problem_set, own in names.items():
            for solver in solvers:
                wanted = [
                    (eps, name)
                    for eps, name in loosest_first(args.eps, own)
                    if not file.has(problem_set, name, solver, eps)
                ]
                if not wanted:
                    continue
                slow = late_ones(file.rows, problem_set, solver)
                with Bench(work, solver, args.limit, args.data) as child:
                    for eps, name in wanted:
                        row = run_problem(child, problem_set, name, eps, slow)
                        file.add(amend(row))
    return typed(file.rows)


def late_ones(rows: list[Row], problem_set: str, solver: str) -> dict[str, Row]:
    """Return, by problem, the loosest row of a solver that ran into the time limit."""
    own = tables.chosen(rows, set=problem_set, solver=solver)
    late = [row for row in own if row["status"] in LATE]
    return {r["problem"]: r for r in sorted(late, key=lambda row: float(row["eps"]))}


def typed(rows: list[Row]) -> list[Row]:
    """Return rows, of a file or just measured, with numbers for what tables need."""
    return [
        csv_files.with_numbers(row, ("eps", "runtime"))
        | {"success": str(row["success"]) == "True"}
        for row in rows
    ]


def read_rows(file: Path) -> list[Row]:
    """Return the rows that an earlier run has written."""
    return typed(csv_files.read(file))


def print_tables(rows: list[Row], reference: str = "nam") -> None:
    """Print success and times of all solvers, and what each of them fails."""
    print("\n" + markdown(rows, reference) + "\n")
    for each in tables.distinct(rows, "set", "eps", "solver"):
        key = dict(zip(("set", "eps", "solver"), each, strict=True))
        failed = tables.chosen(rows, **key, success=False)
        if failed:
            texts = "; ".join(failure_text(row) for row in failed)
            print("{set}, {eps:.0e}: {solver} fails: ".format(**key) + texts)


def markdown(rows: list[Row], reference: str = "nam") -> str:
    """Return the table of sets, tolerances and solvers."""
    columns = "set", "eps", *tables.compared_columns(reference)
    lines = []
    known = sorted(rows, key=lambda row: row["solver"] != reference)
    sets, tolerances = (tables.distinct(rows, key) for key in ("set", "eps"))
    for problem_set, eps in product(sets, sorted(tolerances, reverse=True)):
        own = tables.chosen(known, set=problem_set, eps=eps)
        first = problem_set, tables.power_of_ten(eps)
        lines += [(*first, *cells) for cells in tables.compared(own, reference)]
    return tables.markdown(columns, lines)


def failure_text(row: Row) -> str:
    """Return the name of a problem and what went wrong with it."""
    errors = {name: float(row.get(name) or 0.0) for name in judging.RESIDUALS}
    if row["status"] != "inaccurate":
        return f"{row['problem']} ({row['status']})"
    worst = max(errors, key=lambda name: np.nan_to_num(errors[name], nan=np.inf))
    return f"{row['problem']} ({worst.replace('_', ' ')} {errors[worst]:.1e})"
