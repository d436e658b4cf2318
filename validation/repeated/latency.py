"""A single dense QP, n = 2 to 1000 variables and 2n rows, through qpsolvers.

`microseconds` is the median time of a call of qpsolvers.solve_problem, the least of
ROUNDS medians (the first if it is above LONG seconds), each over PROBLEMS problems of a
size (one where a call takes a second). What ran into the limit is not tried at a larger
size.
"""

import statistics
from collections.abc import Iterator

import numpy as np
import qpsolvers
from qpsolvers import Problem, Solution

from validation.harness import (
    Job,
    Row,
    judging,
    qp_solvers,
    timing,
)
from validation.harness.suite import Args, Late, Suite
from validation.problems import planted
from validation.repeated import front_figure

SIZES = (2, 5, 10, 20, 50, 100, 200, 300, 500, 1000)
QUICK_SIZES = (2, 10)
ROUNDS, PROBLEMS = 3, 3
LONG = 0.1  # [s] a call, which then has one round


def problems(n: int) -> list[Problem]:
    stack = planted.definite_stack(np.random.default_rng(n), n, 2 * n, PROBLEMS)
    return [Problem(*parts) for parts in zip(*stack, strict=True)]


def called(problem: Problem, solver: str, eps: float, limit: float) -> Solution:
    settings = qp_solvers.settings(solver, eps, limit)
    if solver == "moreau":  # which qpsolvers does not know
        return qp_solvers.solve(problem, solver, **settings)
    return qpsolvers.solve_problem(problem, solver=solver, **settings)


def measured(job: Job, n: int, eps: float) -> Row:
    some = problems(n)
    called(problems(2)[0], job.solver, eps, job.limit)
    job.ready()
    medians, judged = [], []
    for problem in some:
        best = np.inf
        for _ in range(ROUNDS):
            solution, _, median = timing.median_time(
                lambda problem=problem: called(problem, job.solver, eps, job.limit)
            )
            best = min(best, median)
            if best > LONG:
                break
        medians.append(best)
        judged.append(judging.judge(problem, solution, eps))
        if best > timing.SLOW:
            break
    residuals = (row.get(name, np.inf) for row in judged for name in judging.RESIDUALS)
    failed = [row["status"] for row in judged if not row["success"]]
    return {
        "microseconds": 1e6 * statistics.median(medians),
        "solved": len(judged) - len(failed),
        "problems": len(judged),
        "residual": max(residuals),
        "status": failed[0] if failed else "solved",
    }


def requests(args: Args) -> Iterator[Row]:
    for n in QUICK_SIZES if args.quick else SIZES:
        yield {"n": n, "m": 2 * n, "eps": args.eps[0]}


SUITE = Suite(
    name="latency",
    doc=__doc__,
    requests=requests,
    work=measured,
    columns="n m solver eps microseconds solved problems residual status",
    keys="n solver eps",
    solvers=(*qp_solvers.SOLVERS, "quadprog"),
    tolerances=(1e-6,),
    limit=20.0,
    late=Late(by="n", same=(), copied=False),
    plot=front_figure.plot,
)
