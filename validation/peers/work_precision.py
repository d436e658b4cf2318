"""Speed against attained accuracy: one panel for each family of problems.

A row for each problem, solver and requested tolerance. `error` is computed here from
the returned point: the distance to the solution, || x - x* ||_inf / || x* ||_inf, in
families whose solutions are unique (known by construction, or from `references`), else
the worst residual. `residual` is the worst of primal residual, dual residual, duality
gap and wrong-signed multipliers, for a sweep Res(z): the quantity whose tolerance was
asked for. A request is missed if the residual is more than ten times the tolerance, or
the time limit is; what the solver says of itself counts for nothing. The solvers take
turns, problem by problem, namlcp first: the other solvers' time limit is ten times what
it took. What is late at a tolerance is not tried at a tighter one.

--quick: two small problems for each family, three tolerances. Without --data the
problems of the data folder are left out, by name.
"""

from collections.abc import Callable, Iterator
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import qpsolvers
import scipy.sparse as sp
from qpsolvers import Solution

from namlcp import natural_residual
from validation.harness import (
    Job,
    MissingDataError,
    Row,
    csv_files,
    judging,
    processes,
    qp_solvers,
    qps,
    timing,
)
from validation.harness.suite import Args, Late, Suite
from validation.peers import work_precision_figure
from validation.peers.references import distance, reference
from validation.problems import families

DENSE = ("daqp", "quadprog")  # solvers that fill P
DENSE_MOST = 3000  # variables at most for them
OURS = ("nam", "sweep auto")
MISS = 10.0  # a residual of so many tolerances


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


@cache
def known_families(data: Path | None) -> dict[str, families.Family]:
    """Return the families, made once in a process."""
    return families.families(data)


@lru_cache(maxsize=1)
def task_of(data: Path | None, family: str, name: str) -> families.Task:
    """Return a problem; the last one is kept."""
    return known_families(data)[family].makers[name]()


def measure(job: Job, family: str, name: str, eps: float) -> Row:
    import namlcp  # noqa: F401

    task = task_of(job.data, family, name)
    n = task.problem.q.size
    if job.solver in DENSE and n > DENSE_MOST:
        return {"n": n} | processes.failure(f"too slow: dense, n > {DENSE_MOST}")
    # tiny ones of its kind load what is needed; ours chooses a method by the size, too
    tiny = [families.Task(problem) for problem in qps.tiny_problems(task.problem)]
    for other in [*tiny, task] if job.solver in OURS else tiny:
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


@lru_cache(maxsize=1)
def solution_of(data: Path | None, family: str, name: str) -> np.ndarray | None:
    """Return the solution as it is known, or as `references` certifies it."""
    task = task_of(data, family, name)
    if task.exact is not None:
        return task.exact
    import namlcp  # noqa: F401

    return reference(task.problem, qpsolvers.solve_problem(task.problem, solver="nam"))


def complete(row: Row) -> Row:
    residual = csv_files.number(row.get("residual"))
    point, about = row.pop("point", None), (row["data"], row["family"], row["problem"])
    late = row["status"].startswith("too slow")
    row["missed"], row["error"] = late or not residual <= MISS * row["eps"], None
    if point is not None:
        unique = known_families(row["data"])[row["family"]].distance
        exact = solution_of(*about) if unique else None
        row["error"] = residual if exact is None else distance(point, exact)
    return row


def requests(args: Args) -> Iterator[Row]:
    for name, family in known_families(args.data).items():
        solvers = [*(args.solvers if family.peers else ["sweep auto"]), *family.sweeps]
        for problem in family.quick if args.quick else family.makers:
            for eps in sorted(args.eps, reverse=True):
                key = {"family": name, "problem": problem, "eps": eps}
                for solver in solvers:
                    yield key | {"solver": solver, "data": args.data}
    absent = families.missing(args.data)
    if absent:
        raise MissingDataError("left out: " + "; ".join(absent))


SUITE = Suite(
    name="work-precision-problems",
    doc=__doc__,
    requests=requests,
    work=measure,
    complete=complete,
    columns="family problem solver eps n runtime residual error missed status",
    keys="family problem solver eps",
    solvers=tuple(
        "nam piqp proxqp daqp quadprog clarabel osqp scs highs moreau qtqp".split()
    ),
    tolerances=tuple(10.0**-k for k in range(2, 13, 2)),
    limit=5.0,
    quick={"eps": (1e-3, 1e-6, 1e-9), "limit": 2.0},
    late=Late(same=("family", "problem")),
    beside=True,
    success=lambda row: str(row["missed"]) == "False",
    plot=work_precision_figure.plot,
)
