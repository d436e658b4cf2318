"""A single dense QP, n = 2 to 1000 variables and 2n rows, through qpsolvers.

`microseconds` is the median time of a call of qpsolvers.solve_problem, the least of
ROUNDS medians (the first if it is above LONG seconds), each over PROBLEMS problems of a
size (one where a call takes a second). What ran into the limit is not tried at a larger
size.
"""

import statistics
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np
import qpsolvers
from matplotlib import pyplot as plt
from qpsolvers import Problem

from validation.harness import (
    Job,
    Row,
    charts,
    csv_files,
    judging,
    qp_solvers,
    tables,
    timing,
)
from validation.harness.suite import Args, Late, Suite
from validation.problems import draw

SIZES = (2, 5, 10, 20, 50, 100, 200, 300, 500, 1000)
QUICK_SIZES = (2, 10)
ROUNDS, PROBLEMS = 3, 3
LONG = 0.1  # [s] a call, which then has one round


def problems(n: int) -> list[Problem]:
    stack = draw.definite_stack(np.random.default_rng(n), n, 2 * n, PROBLEMS)
    return [Problem(*parts) for parts in zip(*stack, strict=True)]


def measured(job: Job, n: int, eps: float) -> Row:
    some, settings = problems(n), qp_solvers.settings(job.solver, eps, job.limit)
    ask = partial(qpsolvers.solve_problem, solver=job.solver, **settings)
    ask(problems(2)[0])
    job.ready()
    medians, judged = [], []
    for problem in some:
        best = np.inf
        for _ in range(ROUNDS):
            solution, _, median = timing.median_time(partial(ask, problem))
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


SCENE, LEVEL = "sparse MPC, definite", "moves a little"
DRAWN = ("nam", "daqp", "quadprog", "piqp", "proxqp", "clarabel", "osqp", "qpoases")
"""Those that are drawn, where they were measured; other ways to call us are not."""


def plot(results: Path, figures: Path) -> None:
    calls = csv_files.read(results)
    steps = csv_files.read(results.parent / "sequences.csv")
    steps = tables.chosen(steps, scene=SCENE, level=LEVEL)
    figure, panels = plt.subplots(
        1, 2, figsize=(charts.WIDTH, 3.6), width_ratios=(1.5, 1.0)
    )
    figure.subplots_adjust(left=0.08, right=0.99, top=0.9, bottom=0.16, wspace=0.18)
    for axes, rows, across, title, below, beside in (
        (panels[0], calls, "n", "One dense QP, n variables and 2n rows", "n", "call"),
        (panels[1], steps, "variables", "One step of model predictive control",
         "variables (sparse QP, same matrices)", "step"),
    ):  # fmt: skip
        rows = [row for row in rows if row["solver"] in DRAWN]
        drawn = charts.lines(
            axes, rows, "solver", across, "microseconds", charts.looks, 1e-6
        )
        sizes = tables.distinct(rows, across)
        axes.set_xticks([float(size) for size in sizes], sizes)
        axes.minorticks_off()
        axes.set(title=title, xlabel=below, ylabel=f"time of a {beside} [s]")
        charts.name_lines(axes, drawn)
    charts.save(figure, figures / "front-repeated.svg")


SUITE = Suite(
    name="latency",
    requests=requests,
    work=measured,
    columns="n m solver eps microseconds solved problems residual status",
    keys="n solver eps",
    solvers=tuple("nam piqp daqp proxqp clarabel osqp quadprog".split()),
    tolerances=(1e-6,),
    limit=20.0,
    late=Late(by="n", same=(), copied=False),
    plot=plot,
)
