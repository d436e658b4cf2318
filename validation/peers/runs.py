"""QP solvers on sets of problems: what a child does, and tables of the rows."""

from collections.abc import Callable
from itertools import product
from pathlib import Path

import numpy as np
from qpsolvers import Problem

from validation.harness import (
    Job,
    Row,
    csv_files,
    judging,
    processes,
    qp_solvers,
    qps,
    tables,
    timing,
)
from validation.problems import data_sets

COLUMNS = (
    "problem set solver eps runtime cold found "
    + " ".join(judging.RESIDUALS)
    + " success status iterations form"
)


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


def read_rows(file: Path) -> list[Row]:
    """Return the rows of a file, with numbers for what tables need."""
    return [
        csv_files.with_numbers(row, ("eps", "runtime"))
        | {"success": row["success"] == "True"}
        for row in csv_files.read(file)
    ]


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
