"""QP solvers on sets of problems: what a child does."""

from collections.abc import Callable
from pathlib import Path

from qpsolvers import Problem

from validation.harness import (
    Job,
    Row,
    judging,
    processes,
    qp_solvers,
    qps,
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
