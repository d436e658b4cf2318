"""Speed against attained accuracy: one panel for each family of problems.

A row for each problem, solver and requested tolerance. `error` is computed from the
returned point: || x - x* ||_inf / || x* ||_inf in families whose solutions are unique
(by construction, or from `reference`), else the worst residual. `residual` is the worst
of primal residual, dual residual, duality gap and wrong-signed multipliers, for a sweep
Res(z). A request is missed if the residual is more than ten times the tolerance, or the
time limit is; what the solver says of itself counts for nothing.

--quick: two small problems for each family, three tolerances. Without --data the
problems of the data folder are left out.
"""

import math
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import cache, lru_cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import qpsolvers
import scipy.sparse as sp
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.ticker import LogLocator
from qpsolvers import Problem, Solution
from scipy.sparse.linalg import splu

from namlcp import natural_residual, solve_lcp
from namlcp.lcp.modulus.methods import SWEEPS
from validation.harness import Job, Row, charts, judging, qp_solvers, qps, tables
from validation.harness.suite import Args, Late, Suite, is_ours
from validation.problems import families

DENSE = ("daqp", "quadprog")  # solvers that fill P
DENSE_MOST = 3000  # variables at most for them
OURS = ("nam", "sweep auto")
MISS = 10.0  # a residual of so many tolerances


def solver_call(
    task: families.Task, solver: str, eps: float, limit: float
) -> Callable[[], Any]:
    """Return the call of a solver; of a sweep on the LCP, with its own parameters."""
    kind, _, name = solver.rpartition(" ")
    P, q, *_, lower, upper = task.problem.unpack()
    if kind != "sweep":
        settings = qp_solvers.settings(solver, eps, limit)
        problem = qps.filled(task.problem) if solver in DENSE else task.problem
        return lambda: qp_solvers.solve(problem, solver, **settings)
    A = sp.csr_array(P) if sp.issparse(P) else P
    free = {"omega"} if name == "modified-nam" else {"alpha", "omega"}
    takes = SWEEPS[name].takes if name in SWEEPS else ()
    given = dict.fromkeys(set(takes) & free, "auto")
    if task.s0 is not None and name in SWEEPS:
        given["s0"] = task.s0
    given |= {"eps_abs": eps, "time_limit": limit}
    return lambda: solve_lcp(A, q, lower, upper, method=name, **given)


def judged(task: families.Task, answer: Any, eps: float) -> Row:
    """Return the point and its residual, whatever the solver says of it."""
    problem = task.problem
    if isinstance(answer, Solution):
        answer.problem = problem
        answer.found = answer.x is not None and bool(np.isfinite(answer.x).all())
        row = judging.judge(problem, answer, eps)
        return row | {"point": answer.x if answer.found else None}
    z = answer.z
    residual = natural_residual(z, problem.P @ z + problem.q, problem.lb, problem.ub)
    return {"residual": residual, "status": answer.status.value, "point": z}


known_families = cache(families.families)


@lru_cache(maxsize=1)
def task_of(data: Path | None, family: str, name: str) -> families.Task:
    return known_families(data)[family].makers[name]()


def measure(job: Job, family: str, name: str, eps: float) -> Row:
    task = task_of(job.data, family, name)
    n = task.problem.q.size
    if job.solver in DENSE and n > DENSE_MOST:
        return {"n": n, "status": f"too slow: dense, n > {DENSE_MOST}"}
    # tiny ones of its kind load what is needed; ours chooses a method by the size, too
    tiny = [families.Task(problem) for problem in qps.tiny_problems(task.problem)]
    for other in [*tiny, task] if job.solver in OURS else tiny:
        with suppress(Exception):  # what the solver refuses cannot warm it up
            solver_call(other, job.solver, eps, job.limit)()
    call = solver_call(task, job.solver, eps, job.limit)
    return {"n": n} | judging.timed(job, call, partial(judged, task, eps=eps))


@lru_cache(maxsize=1)
def solution_of(data: Path | None, family: str, name: str) -> np.ndarray | None:
    """Return the solution as it is known, or as `reference` certifies it."""
    task = task_of(data, family, name)
    if task.exact is not None:
        return task.exact
    return reference(task.problem, qpsolvers.solve_problem(task.problem, solver="nam"))


def complete(row: Row) -> Row:
    residual = tables.number(row.get("residual"))
    point, about = row.pop("point", None), (row["data"], row["family"], row["problem"])
    late = row["status"].startswith("too slow")
    row["missed"], row["error"] = late or not residual <= MISS * row["eps"], None
    if point is not None:
        unique = known_families(row["data"])[row["family"]].distance
        exact = solution_of(*about) if unique else None
        if exact is None:
            row["error"] = residual
        else:
            size = max(np.abs(exact).max(), 1e-300)
            row["error"] = float(np.abs(point - exact).max() / size)
    return row


def requests(args: Args) -> Iterator[Row]:
    for name, family in known_families(args.data).items():
        solvers = ["sweep auto", *family.sweeps] if family.sweeps else args.solvers
        problems = list(family.makers)[: families.QUICK if args.quick else None]
        for problem in problems:
            for eps in sorted(args.eps, reverse=True):
                key = {"family": name, "problem": problem, "eps": eps}
                for solver in solvers:
                    yield key | {"solver": solver, "data": args.data}


# ---- solutions to more digits than a solver returns: the active set of any good point
# of a strictly convex QP decides the solution, a linear system, solved with residuals
# in extended precision until they no longer fall, and accepted only if every constraint
# and multiplier that it leaves out has the right sign

WIDE = np.longdouble
STEPS = 30
ACCEPTED = 1e-11  # of the largest term: the wrong sign of a constraint or multiplier
STRICT = 1e-9  # least pivot of P, scaled to unit diagonal
REGULAR = 1e-9  # on the rows of active constraints, which may depend on each other


def strictly_convex(P: Any) -> bool:
    """Tell whether P, scaled to a unit diagonal, has no small pivots."""
    diagonal = np.asarray(P.diagonal())
    if not np.all(diagonal > 0.0):
        return False
    d = sp.diags_array(1.0 / np.sqrt(diagonal))
    if not sp.issparse(P):
        return bool(np.linalg.eigvalsh(d @ P @ d)[0] > STRICT)
    # without pivoting the pivots of a positive definite matrix are positive
    mode = {"SymmetricMode": True}
    scaled = sp.csc_matrix(d @ P @ d)
    factors = splu(scaled, "MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=mode)
    return bool(factors.U.diagonal().min() > STRICT)


def stacked(
    problem: Problem, solution: Solution
) -> tuple[sp.csr_array, np.ndarray, np.ndarray, int]:
    """Return C, d, multipliers and p: C x = d in the first p rows, C x <= d below."""
    _, q, G, h, A, b, lb, ub = qps.parts(problem)
    eye = sp.csr_array(sp.eye_array(q.size, format="csr"))
    up, low = np.isfinite(ub), np.isfinite(lb)
    C = sp.vstack([sp.csr_array(A), sp.csr_array(G), eye[up], -eye[low]])
    y, z = judging.filled(solution.y, b.size), judging.filled(solution.z, h.size)
    z_box = judging.filled(solution.z_box, q.size)
    v = [y, z, np.maximum(z_box[up], 0.0), np.maximum(-z_box[low], 0.0)]
    d = np.concatenate([b, h, ub[up], -lb[low]])
    return sp.csr_array(C), d, np.concatenate(v), b.size


def reference(problem: Problem, solution: Solution) -> np.ndarray | None:
    """Return the solution of a strictly convex QP, None if it cannot be certified.

    `solution` proposes the active set: what has a larger multiplier than slack.
    """
    if solution.x is None or not strictly_convex(problem.P):
        return None
    C, d, multipliers, p = stacked(problem, solution)
    active = multipliers > d - C @ solution.x
    active[:p] = True
    P = sp.csr_array(problem.P)
    B, side = C[active], d[active]
    m = side.size
    shift = sp.diags_array(np.full(m, -REGULAR))
    factors = splu(sp.csc_matrix(sp.block_array([[P, B.T], [B, shift]])))
    K = sp.block_array([[P, B.T], [B, None]], format="csr").astype(WIDE)
    right = np.r_[-problem.q, side].astype(WIDE)
    point = np.zeros(right.size, WIDE)
    for _ in range(STEPS):
        correction = factors.solve((right - K @ point).astype(float))
        point += correction
        if np.abs(correction).max() <= 1e-19 * np.abs(point).max():
            break
    x, y = point[: problem.q.size], point[problem.q.size :]
    slack = d - C.astype(WIDE) @ x
    terms = 1.0 + np.abs(d) + abs(C) @ np.abs(x)
    size = 1.0 + np.abs(problem.q).max() + np.abs(P.astype(WIDE) @ x).max()
    right_signs = np.all(slack[~active] >= -ACCEPTED * terms[~active])
    right_signs &= np.all(y[int(p) :] >= -ACCEPTED * size)
    solved = np.abs(right - K @ point).max() <= ACCEPTED * size
    return x.astype(float) if right_signs and solved else None


# ---- the chart

TITLES = {
    "contact": "Contact",
    "MPC": "Model predictive control",
    "SVM": "Support vector machines",
    "general QP": "Maros-Meszaros",
    "obstacle": "Obstacle LCPs",
    "paper": "The paper's LCPs",
}
NAMED = 2  # others than ours that are named, the fastest
RANKED_AT = 1e-8  # requested tolerance at which they are ranked by time
LEAST_ERROR, MOST_ERROR = 3e-17, 1.0  # ends of the horizontal axes
NAMED_SWEEPS = ("sweep pgs", "sweep namsor", "sweep modulus", "sweep lemke")


def summary(file: Path) -> list[Row]:
    """Return quartiles of time and error, by family, solver and tolerance."""
    rows = tables.read(file)
    found = []
    for family, solver, eps in tables.distinct(rows, "family", "solver", "eps"):
        own = tables.chosen(rows, family=family, solver=solver, eps=eps)
        solved = tables.chosen(own, missed="False")
        lost = [math.inf] * (len(own) - len(solved))
        row = {"family": family, "solver": solver, "eps": float(eps)}
        for name, key in (("error", "error"), ("time", "runtime")):
            values = [float(each[key]) for each in solved] + lost
            row[name] = np.quantile(values, (0.25, 0.5, 0.75), method="inverted_cdf")
        found.append(row | {"problems": len(own)})
    return found


def named(rows: list[Row], family: str) -> list[str]:
    """Return the solvers of one family that are drawn in colour."""
    if family == "paper":
        return ["sweep auto", *NAMED_SWEEPS]
    least = min(abs(math.log(row["eps"] / RANKED_AT)) for row in rows)
    near = [row for row in rows if abs(math.log(row["eps"] / RANKED_AT)) == least]
    times = ((row["time"][1], row["solver"]) for row in near)
    ranked = sorted(pair for pair in times if not is_ours(pair[1]))
    return ["nam", *(solver for _, solver in ranked[:NAMED])]


def plot(results: Path, figures: Path) -> None:
    rows = summary(results)
    figure, panels = plt.subplots(2, 3, figsize=(charts.WIDTH, 5.6), sharex=True)
    figure.subplots_adjust(
        left=0.07, right=0.99, top=0.93, bottom=0.09, hspace=0.3, wspace=0.2
    )
    for axes, (family, title) in zip(panels.flat, TITLES.items(), strict=True):
        own = tables.chosen(rows, family=family)
        if own:
            draw_family(axes, own, named(own, family))
            axes.set_title(f"{title} ({own[0]['problems']})", pad=14.0)
    for axes in panels[:, 0]:
        axes.set_ylabel("time [s]")
    figure.supxlabel("error of the returned point", fontsize=9.0)
    charts.save(figure, figures / "front.svg")


def draw_family(axes: Axes, rows: list[Row], coloured: list[str]) -> None:
    axes.set(xscale="log", yscale="log", xlim=(LEAST_ERROR, MOST_ERROR))
    axes.yaxis.set_major_locator(LogLocator(numticks=12))
    lines = {}
    for solver in tables.distinct(rows, "solver"):
        own = tables.chosen(rows, solver=solver)
        done = [row for row in own if math.isfinite(row["time"][1])]
        missed = [row["eps"] for row in own if not math.isfinite(row["time"][1])]
        across = [max(row["error"][1], LEAST_ERROR) for row in done]
        low, middle, high = ([row["time"][k] for row in done] for k in range(3))
        if solver not in coloured:
            axes.plot(across, middle, color=charts.LIGHT, linewidth=1.0)
            continue
        name = "nam" if solver in OURS else solver.removeprefix("sweep ")
        style = charts.looks(name)
        lines[style["label"]] = style["color"]
        axes.plot(across, middle, markersize=6.0 if name == "nam" else 3.5, **style)
        high = [min(h, 10.0 * y) for h, y in zip(high, middle, strict=True)]
        axes.fill_between(across, low, high, color=style["color"], alpha=0.12)
        axes.plot(
            missed, [1.0 + 0.025 * len(lines)] * len(missed), "x", clip_on=False,
            color=style["color"], markersize=3.5, transform=axes.get_xaxis_transform(),
        )  # fmt: skip
    charts.name_lines(axes, lines)


SUITE = Suite(
    name="work-precision-problems", requests=requests, work=measure, complete=complete,
    columns="family problem solver eps | n runtime residual error missed status",
    solvers=tuple("nam piqp proxqp daqp quadprog clarabel osqp qtqp".split()),
    tolerances=tuple(10.0**-k for k in range(2, 13, 2)), limit=5.0,
    quick={"eps": (1e-3, 1e-6, 1e-9), "limit": 2.0},
    late=Late(same=("family", "problem")), beside=True,
    success=lambda row: str(row["missed"]) == "False", plot=plot,
)  # fmt: skip
