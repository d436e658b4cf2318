"""QP solvers on sets of problems: success, time and accuracy, namlcp beside its peers.

What counts as solved, and what is timed, stands in README.md.

sets, maros-meszaros
    Collections and parts of them (`data_sets`); all of Maros-Meszaros.
classes
    Those of the OSQP paper (`osqp_classes`), four sizes of each. A peer's time limit is
    ten times what namlcp took; what ran into it is not tried at a larger size.
families
    Random QPs around a planted primal-dual solution (`draw`); the size comes from
    the seed as well. Like the next, no constants were tuned on them.
changes
    Maros-Meszaros problems with their data changed (`draw.CHANGES`). The noise can make
    a problem infeasible: what is called so is asked of HiGHS (an LP without cost) and
    counts as solved if it agrees.
infeasible
    QPs without a solution, and some that only look so (`infeasible_cases`). Every
    solver has those of its settings that recognise most. What it says is recognised:
    "infeasible", "unbounded" (either where both are true), solved within ten times eps,
    or, of a problem that is not convex, anything but solved; misjudged: solved where
    nothing can be, infeasible or unbounded where a solution exists (of an infeasible
    problem: unbounded), or "solved" with larger residuals; else undecided. The time is
    processor time.
"""

import time
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import replace
from functools import partial
from itertools import product
from pathlib import Path

import numpy as np
from qpsolvers import Problem, Solution

from validation.harness import Job, Row, judging, qp_solvers, qps
from validation.harness.suite import Args, Late, Suite
from validation.problems import data_sets, draw, infeasible_cases, osqp_classes

COLUMNS = (
    "set problem solver eps | runtime cold found "
    + " ".join(judging.RESIDUALS)
    + " success status iterations form"
)
SETS = ("mpc", "contact", "small", "strict")
SEEDS = 40  # of each random family


def load(data: Path, problem_set: str, name: str) -> Problem:
    """Return a problem of a class, a random family or a collection, perhaps changed."""
    if problem_set in osqp_classes.CLASSES:
        return osqp_classes.generate(problem_set, name)
    if problem_set in draw.FAMILIES:
        rng = np.random.default_rng(int(name))
        return draw.random_qp(rng, draw.FAMILIES[problem_set])
    if problem_set not in draw.CHANGES:
        return data_sets.load(data, problem_set, name)
    seed = int.from_bytes(name.encode(), "big") % 2**32  # the same in every run
    problem = data_sets.maros_problem(data, name, dense=False)
    return draw.CHANGES[problem_set](problem, np.random.default_rng(seed))


def names_of(data: Path, problem_set: str) -> list[str]:
    if problem_set in osqp_classes.CLASSES:
        return [str(size) for size in osqp_classes.CLASSES[problem_set].sizes]
    if problem_set in draw.FAMILIES:
        return [str(seed) for seed in range(SEEDS)]
    changed = problem_set in draw.CHANGES
    return data_sets.set_names(data, "all" if changed else problem_set)


def measure(job: Job, problem_set: str, name: str, eps: float) -> Row:
    """Time a solver on a problem and judge its first answer.

    To call infeasible what HiGHS calls infeasible too, after noise, is a success.
    """
    problem = load(job.data, problem_set, name)
    settings = qp_solvers.settings(job.solver, eps, job.limit)
    for tiny in qps.tiny_problems(problem):
        with suppress(Exception):  # what the solver refuses cannot warm it up
            qp_solvers.solve(tiny, job.solver, **settings)
    call = lambda: qp_solvers.solve(problem, job.solver, **settings)  # noqa: E731
    row = judging.timed(job, call, partial(judging.judge, problem, eps=eps))
    if problem_set in osqp_classes.CLASSES:
        entries = osqp_classes.entries(problem)
        row |= {"variables": problem.q.size, "entries": entries}
    if problem_set == "noise" and "infeasible" in row["status"]:
        if infeasible_cases.is_feasible(problem) is False:
            row |= {"success": True, "status": "infeasible, as HiGHS says"}
    return row


def of_sets(args: Args, sets: Iterable[str]) -> Iterator[Row]:
    for problem_set in sets:
        names = names_of(args.data, problem_set)
        for eps, name in product(sorted(args.eps, reverse=True), names):
            key = {"set": problem_set, "problem": name, "eps": eps}
            yield key | {"limit": args.limit}


RIGHT = {  # of other truths what says the same
    "both": ("infeasible", "unbounded"),
    "feasible": ("solved",),
    "not convex": ("undecided", "infeasible", "unbounded"),
}
WRONG = ("solved", "inaccurate", "infeasible", "unbounded")


def said_of(job: Job, problem: Problem, eps: float) -> Row:
    settings = qp_solvers.detecting_settings(job.solver, eps, job.limit)

    def judge(found: Solution) -> Row:
        verdict, said = judging.verdict(problem, found, eps)
        return {"verdict": verdict, "status": said}

    call = lambda: qp_solvers.solve(problem, job.solver, **settings)  # noqa: E731
    row = judging.timed(job, call, judge, time.process_time)
    if "unbounded below" in row["status"]:  # an error of OSQP or PIQP
        row["verdict"] = "unbounded"
    return row


def of_infeasible(args: Args) -> Iterator[Row]:
    makers = infeasible_cases.all_cases(args.data, 3)
    found = {name: case for name, make in makers.items() if (case := make())}
    for solver in args.solvers:
        for name, case in found.items():
            key = {"problem": name, "solver": solver, "eps": case.eps}
            key |= {"group": case.group, "truth": case.truth}
            key |= {"variables": case.problem.q.size}
            yield key | {"ask": (case.problem, case.eps)}


def complete(row: Row) -> Row:
    said = row.setdefault("verdict", "undecided")
    word = "misjudged" if said in WRONG else "undecided"
    right = RIGHT.get(row["truth"], (row["truth"],))
    return row | {"outcome": "recognised" if said in right else word}


SUITE = Suite(
    name="benchmark", requests=lambda args: of_sets(args, SETS), work=measure,
    columns=COLUMNS, solvers=("nam", "piqp", "daqp", "clarabel", "osqp", "qtqp"),
    tolerances=(1e-6, 1e-9), late=Late(), needs_data=True,
)  # fmt: skip
FAMILIES = replace(
    SUITE, name="generalisation-families",
    requests=lambda args: of_sets(args, draw.FAMILIES),
    solvers=("nam", "piqp", "clarabel"), tolerances=(1e-6,), needs_data=False,
)  # fmt: skip
SUITES = {
    "sets": SUITE,
    "maros-meszaros": replace(
        SUITE, name="maros-meszaros", requests=lambda args: of_sets(args, ("all",)),
        columns=f"{COLUMNS} limit",
        solvers=("nam", "piqp", "clarabel", "proxqp", "osqp"),
        tolerances=(1e-3, 1e-6, 1e-9),
    ),
    "classes": replace(
        FAMILIES, name="classes",
        requests=lambda args: of_sets(args, osqp_classes.CLASSES),
        columns=f"{COLUMNS} variables entries",
        solvers=("nam", "piqp", "clarabel", "osqp", "proxqp", "qtqp"),
        late=Late(by="problem", same=("set",)), beside=True,
    ),
    "families": FAMILIES,
    "changes": replace(
        FAMILIES, name="generalisation",
        requests=lambda args: of_sets(args, draw.CHANGES), needs_data=True,
    ),
    "infeasible": Suite(
        name="infeasible", requests=of_infeasible, work=said_of, complete=complete,
        columns=(
            "problem solver | group truth eps variables outcome verdict runtime cold "
            "status"
        ),
        solvers=("nam", "osqp", "piqp", "clarabel"), limit=5.0,
    ),
}  # fmt: skip
