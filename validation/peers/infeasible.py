"""What solver="nam" says of QPs without a solution, beside its peers, and how fast.

The problems and what is true of them: `infeasible_cases`. Every solver is called
through qpsolvers in a child process, at the case's eps as absolute tolerance, each
with those of its settings that recognise most. What it says is

- recognised: "infeasible", "unbounded" (either where both are true), solved within
  ten times eps, or, of a problem that is not convex, anything but solved;
- misjudged: solved where nothing can be, infeasible or unbounded where a solution
  exists (of an infeasible problem: unbounded), or "solved" with larger residuals;
- undecided otherwise.

The time is the median of repeated calls: processor time, on one thread. For nam also:
the time on the solvable twin, the iterations, and the residual of the certificate,
scaled so that it proves -1: the largest |A'y + G'z + z_box|, or |Pd|, |Ad| and (Gd)+,
or entry of a wrong sign. Exits with 1 if nam misjudges a case or leaves a proof open.
"""

import time
from collections.abc import Iterator

import numpy as np
from qpsolvers import Problem, Solution

from validation.harness import (
    Job,
    Row,
    judging,
    processes,
    qp_solvers,
    qps,
    tables,
    timing,
)
from validation.harness.suite import Args, Suite
from validation.problems import infeasible_cases as cases

STEP, QUICK_STEP = 3, 40  # one change of so many of each Maros-Meszaros problem
COLUMNS = (
    "problem group truth solver eps variables equalities inequalities outcome verdict "
    "runtime cold twin iterations form certificate status"
)
RIGHT = {
    "infeasible": ("infeasible",),
    "unbounded": ("unbounded",),
    "both": ("infeasible", "unbounded"),
    "feasible": ("solved",),
    "not convex": ("undecided", "infeasible", "unbounded"),
}
WRONG = ("solved", "inaccurate", "infeasible", "unbounded")


def certificate_residual(problem: Problem, solution: Solution) -> float | None:
    """Return the residual of nam's proof; None where one bound or row is the proof.

    That is the case for crossed bounds and sides of -inf.
    """
    proof = solution.extras.get("certificate")
    _, _, _, h, _, _, lb, ub = qps.parts(problem)
    if proof is None or (lb > ub).any() or (h == -np.inf).any():
        return None
    if "x" in proof:
        return judging.ray_residual(problem, proof["x"])
    return judging.farkas_residual(problem, **proof)


def outcome(truth: str, said: str) -> str:
    """Return recognised, misjudged or undecided."""
    if said in RIGHT[truth]:
        return "recognised"
    return "misjudged" if said in WRONG else "undecided"


def solve(job: Job, problem: Problem, eps: float, twin: Problem | None) -> Row:
    settings = qp_solvers.detecting_settings(job.solver, eps, job.limit)

    def timed(problem: Problem) -> tuple[Solution, float, float]:
        return timing.median_time(
            lambda: qp_solvers.solve(problem, job.solver, **settings),
            time.process_time,
        )

    row: Row = {"verdict": "undecided"}
    if twin is not None:
        row["twin"] = timed(twin)[2]
    job.ready()
    try:
        solution, row["cold"], row["runtime"] = timed(problem)
        row["verdict"], row["status"] = judging.verdict(problem, solution, eps)
    except Exception as error:
        unbounded = "unbounded below" in str(error)
        row["verdict"] = "unbounded" if unbounded else "undecided"
        return row | processes.raised(error)
    if job.solver == "nam":
        row["certificate"] = certificate_residual(problem, solution)
        row |= {key: solution.extras[key] for key in ("iterations", "form")}
    return row


def requests(args: Args) -> Iterator[Row]:
    makers = cases.all_cases(args.data, QUICK_STEP if args.quick else STEP)
    found = {name: case for name, make in makers.items() if (case := make())}
    for solver in args.solvers:
        for name, case in found.items():
            _, q, _, h, _, b, _, _ = qps.parts(case.problem)
            twin = case.twin if solver == "nam" else None
            key = {"problem": name, "solver": solver, "eps": case.eps}
            key |= {"group": case.group, "truth": case.truth, "variables": q.size}
            yield key | {
                "equalities": b.size,
                "inequalities": h.size,
                "ask": lambda case=case, twin=twin: (case.problem, case.eps, twin),
            }


def complete(row: Row) -> Row:
    row.setdefault("verdict", "undecided")
    return row | {"outcome": outcome(row["truth"], row["verdict"])}


def is_failure(row: Row) -> bool:
    """Tell whether a verdict is wrong, or missing where there is no solution."""
    optional = row["truth"] == "feasible" and row["outcome"] == "undecided"
    return row["outcome"] != "recognised" and not optional


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
    shown="problem:30 solver outcome runtime status:30",
    failed=lambda rows: any(map(is_failure, tables.chosen(rows, solver="nam"))),
)
