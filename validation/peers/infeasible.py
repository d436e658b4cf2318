"""What solver="nam" says of QPs without a solution, beside its peers, and how fast.

The problems and what is true of them: `infeasible_cases`. Every solver is called
through qpsolvers in a child process, at the case's eps as absolute tolerance, each
with those of its settings that recognise most. What it says is

- recognised: "infeasible", "unbounded" (either where both are true), solved within
  ten times eps, or, of a problem that is not convex, anything but solved;
- misjudged: solved where nothing can be, infeasible or unbounded where a solution
  exists (of an infeasible problem: unbounded), or "solved" with larger residuals;
- undecided otherwise.

The time is the median of repeated calls: processor time, on one thread. The campaign
judges certificates.
"""

import time
from collections.abc import Iterator

from qpsolvers import Problem

from validation.harness import (
    Job,
    Row,
    judging,
    processes,
    qp_solvers,
    timing,
)
from validation.harness.suite import Args, Suite
from validation.problems import infeasible_cases as cases

STEP, QUICK_STEP = 3, 40  # one change of so many of each Maros-Meszaros problem
COLUMNS = (
    "problem group truth solver eps variables outcome verdict runtime cold iterations "
    "form status"
)
RIGHT = {
    "infeasible": ("infeasible",),
    "unbounded": ("unbounded",),
    "both": ("infeasible", "unbounded"),
    "feasible": ("solved",),
    "not convex": ("undecided", "infeasible", "unbounded"),
}
WRONG = ("solved", "inaccurate", "infeasible", "unbounded")


def solve(job: Job, problem: Problem, eps: float) -> Row:
    settings = qp_solvers.detecting_settings(job.solver, eps, job.limit)
    row: Row = {"verdict": "undecided"}
    job.ready()
    try:
        solution, row["cold"], row["runtime"] = timing.median_time(
            lambda: qp_solvers.solve(problem, job.solver, **settings),
            time.process_time,
        )
        row["verdict"], row["status"] = judging.verdict(problem, solution, eps)
    except Exception as error:
        unbounded = "unbounded below" in str(error)
        row["verdict"] = "unbounded" if unbounded else "undecided"
        return row | processes.raised(error)
    if job.solver == "nam":
        row |= {key: solution.extras[key] for key in ("iterations", "form")}
    return row


def requests(args: Args) -> Iterator[Row]:
    makers = cases.all_cases(args.data, QUICK_STEP if args.quick else STEP)
    found = {name: case for name, make in makers.items() if (case := make())}
    for solver in args.solvers:
        for name, case in found.items():
            key = {"problem": name, "solver": solver, "eps": case.eps}
            key |= {"group": case.group, "truth": case.truth}
            key |= {"variables": case.problem.q.size}
            yield key | {"ask": lambda case=case: (case.problem, case.eps)}


def complete(row: Row) -> Row:
    said = row.setdefault("verdict", "undecided")
    word = "misjudged" if said in WRONG else "undecided"
    return row | {"outcome": "recognised" if said in RIGHT[row["truth"]] else word}


SUITE = Suite(
    name="infeasible",
    doc=__doc__,
    requests=requests,
    work=solve,
    complete=complete,
    columns=COLUMNS,
    keys="problem solver",
    solvers=("nam", "osqp", "piqp", "clarabel"),
    limit=5.0,
)
