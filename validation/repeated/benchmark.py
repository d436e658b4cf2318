"""QPs that are solved again and again: dense ones, batches of them, and sequences.

latency
    A single QP around a planted solution, n = 2 to 1000 variables and 2n rows: the
    median time of a call of qpsolvers.solve_problem, the least of ROUNDS medians (the
    first if it is above LONG seconds), each over PROBLEMS problems of a size (one where
    a call takes a second). What ran into the limit is not tried at a larger size.
batches
    Batches of such QPs of 10 variables and 20 rows, all different: microseconds an
    item. "nam" is `namlcp.solve_batch`, with 1 thread and with 2; "daqp" is a loop over
    daqp.solve. The time is that of the whole batch, the least of ROUNDS; with two
    threads it means something only where two cores are free. `residual` is the largest
    of all items: primal, dual, gap or a negative multiplier.
sequences
    Sequences of QPs with the same matrices: microseconds a step, worst residuals. A
    scene's loop is run once with fresh solves of ours, which give the next step its
    vectors. Then every solver repeats these steps by its own workspace (`workspaces`).
    Of REPEATS runs, each with a new workspace, the quickest counts for each step;
    `microseconds` is the median of the steps. Each answer is judged with the problem as
    given: the largest residual and the distance of x to the fresh solve, relative to
    the largest entry, of all steps.
"""

import statistics
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import qpsolvers
from matplotlib import pyplot as plt
from qpsolvers import Problem

import namlcp
from validation.harness import Job, Row, charts, judging, qp_solvers, qps, tables
from validation.harness.suite import Args, Late, Suite
from validation.harness.timing import SLOW, median_time
from validation.problems import draw, sequences
from validation.repeated.workspaces import WORKSPACES

SIZES, QUICK_SIZES = (2, 5, 10, 20, 50, 100, 200, 300, 500, 1000), (2, 10)
ROUNDS, PROBLEMS = 3, 3
LONG = 0.1  # [s] a call, which then has one round
SHAPE = 10, 20  # variables and rows of an item
BATCHES, QUICK_BATCHES = (100, 1000, 10_000, 100_000), (50,)
ASKED = (("nam", 1), ("nam", 2), ("daqp", 1))  # solvers of batches, and threads
EPS = 1e-9  # of daqp in batches


def latency(job: Job, n: int, eps: float) -> Row:
    settings = qp_solvers.settings(job.solver, eps, job.limit)
    ask = partial(qpsolvers.solve_problem, solver=job.solver, **settings)
    rng = np.random.default_rng(n)
    stack = draw.definite_stack(rng, n, 2 * n, PROBLEMS)
    ask(Problem(*(part[0] for part in draw.definite_stack(rng, 2, 4, 1))))
    job.ready()
    medians, judged = [], []
    for parts in zip(*stack, strict=True):
        best, problem = np.inf, Problem(*parts)
        for _ in range(ROUNDS):
            solution, _, median = median_time(partial(ask, problem))
            best = min(best, median)
            if best > LONG:
                break
        medians.append(best)
        judged.append(judging.judge(problem, solution, eps))
        if best > SLOW:
            break
    row: Row = {"microseconds": 1e6 * statistics.median(medians)}
    return row | {"problems": len(judged)} | judging.summary(judged)


SCENE, LEVEL = "sparse MPC, definite", "moves a little"
DRAWN = ("nam", "daqp", "quadprog", "piqp", "proxqp", "clarabel", "osqp")
"""Those that are drawn, where they were measured; other ways to call us are not."""


def plot(results: Path, figures: Path) -> None:
    steps = tables.read(results.parent / "sequences.csv")
    steps = tables.chosen(steps, scene=SCENE, level=LEVEL)
    figure, panels = plt.subplots(
        1, 2, figsize=(charts.WIDTH, 3.6), width_ratios=(1.5, 1.0), layout="constrained"
    )
    for axes, rows, across, title, below in (
        (panels[0], tables.read(results), "n",
         "One dense QP, n variables and 2n rows", "n"),
        (panels[1], steps, "variables", "One step of model predictive control",
         "variables (sparse QP, same matrices)"),
    ):  # fmt: skip
        rows = [row for row in rows if row["solver"] in DRAWN]
        columns = f"solver {across} microseconds"
        drawn = charts.lines(axes, rows, columns, charts.looks, 1e-6)
        sizes = tables.distinct(rows, across)
        axes.set_xticks([float(size) for size in sizes], sizes)
        axes.minorticks_off()
        axes.set(title=title, xlabel=below, ylabel="time [s]")
        charts.name_lines(axes, drawn)
    charts.save(figure, figures / "front-repeated.svg")


# ---- batches

Stack = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]
Answers = tuple[np.ndarray, np.ndarray, np.ndarray]
"""x and z, stacked, and whether each was found."""


def solved(solver: str, stack: Stack, threads: int) -> Answers:
    if solver == "nam":
        r = namlcp.solve_batch(*stack, threads=threads)
        return r.x, r.z, r.codes == list(namlcp.Status).index(namlcp.Status.SOLVED)
    import daqp

    lower = np.full(stack[3].shape[1], -1e30)
    sense = np.zeros(lower.size, dtype=np.int32)
    given = {"primal_tol": EPS, "dual_tol": EPS}
    items = zip(*stack, strict=True)
    answers = [daqp.solve(*item, lower, sense, **given) for item in items]
    x, z = np.array([a[0] for a in answers]), np.array([a[3]["lam"] for a in answers])
    return x, z, np.array([flag > 0 for _, _, flag, _ in answers])


def worst_residual(stack: Stack, x: np.ndarray, z: np.ndarray) -> float:
    P, q, G, h = stack
    Px, Gx = (np.einsum("kij,kj->ki", M, x) for M in (P, G))
    dual = Px + q + np.einsum("kij,ki->kj", G, z)
    gap = np.einsum("ki,ki->k", Px + q, x) + np.einsum("ki,ki->k", h, z)
    return float(max(np.abs(dual).max(), (Gx - h).max(), np.abs(gap).max(), -z.min()))


def batch(job: Job, n: int, m: int, items: int, threads: int) -> Row:
    rng = np.random.default_rng(n)
    solved(job.solver, draw.definite_stack(rng, n, m, 2), threads)
    stack = draw.definite_stack(rng, n, m, items)
    job.ready()
    seconds = np.inf
    for _ in range(ROUNDS):
        start = time.perf_counter()
        x, z, found = solved(job.solver, stack, threads)
        seconds = min(seconds, time.perf_counter() - start)
    row = {"microseconds": 1e6 * seconds / items, "throughput": items / seconds}
    row["residual"] = worst_residual(stack, x, z)
    return row | {"solved": int(found.sum())}


def of_batches(args: Args) -> Iterator[Row]:
    n, m = SHAPE
    for items in QUICK_BATCHES if args.quick else BATCHES:
        key = {"n": n, "m": m, "items": items}
        for solver, threads in ASKED:
            yield key | {"threads": threads, "solver": solver}


# ---- sequences

REPEATS = 3
LONG_RUN = 2.0  # [s] a run through the sequence, which is then not repeated
STEPS, QUICK_STEPS = 100, 12


class Recorded(NamedTuple):
    """A problem, the vectors that change in each step, and x of fresh solves."""

    problem: Problem
    vectors: list[dict[str, np.ndarray]]
    fresh: np.ndarray


def recorded(scene: str, size: int, level: str, most: int) -> Recorded:
    """Run a scene's loop with fresh solves; keep at most so many steps."""
    problem, loop = sequences.SCENES[scene].make(size, level)
    data = qps.by_name(problem)
    vectors, fresh = [], []
    x = None
    while len(vectors) < most:
        try:
            changed = loop.send(x)
        except StopIteration:
            break
        data |= changed
        result = namlcp.solve_qp(**data)
        x = result.x if result.status is namlcp.Status.SOLVED else None
        if x is not None:
            vectors.append(changed)
            fresh.append(x)
    return Recorded(problem, vectors, np.array(fresh))


def replayed(job: Job, sequence: Recorded, eps: float) -> Row:
    problem, vectors, fresh = sequence
    times = np.full((REPEATS, len(vectors)), np.inf)
    judged: list[Row] = []
    job.ready()
    for repeat in range(REPEATS):
        if repeat and times[0].sum() > LONG_RUN:
            break
        workspace = WORKSPACES[job.solver](problem, eps)
        now = qps.by_name(problem)
        for k, changed in enumerate(vectors):
            arguments = workspace.prepared(changed)
            start = time.perf_counter()
            workspace.step(arguments)
            times[repeat, k] = time.perf_counter() - start
            if repeat == 0:
                now |= changed
                judged.append(judged_step(workspace, Problem(**now), fresh[k], eps))
    best = 1e6 * times.min(axis=0)
    found = judging.summary(judged) | {"microseconds": np.median(best)}
    return found | {"difference": max(row["difference"] for row in judged)}


def judged_step(workspace: Any, problem: Problem, fresh: np.ndarray, eps: float) -> Row:
    """Return the verdict on a step, with its distance to fresh x."""
    solution = workspace.solution(problem)
    row = judging.judge(problem, solution, eps)
    size = max(1.0, judging.largest(fresh))
    row["difference"] = judging.largest(solution.x - fresh) / size
    return row


def of_sequences(args: Args) -> Iterator[Row]:
    steps = QUICK_STEPS if args.quick else STEPS
    for name, scene in sequences.SCENES.items():
        for size in scene.sizes[:1] if args.quick else scene.sizes:
            for level in sequences.LEVELS:
                made = recorded(name, size, level, steps)
                _, q, _, h, _, b, _, _ = qps.parts(made.problem)
                yield {
                    "scene": name, "size": size, "level": level, "variables": q.size,
                    "inequalities": h.size, "equalities": b.size,
                    "steps": len(made.vectors), "ask": (made, args.eps[0]),
                }  # fmt: skip


SUITES = {
    "latency": Suite(
        name="latency",
        requests=lambda args: (
            {"n": n, "eps": args.eps[0]} for n in (QUICK_SIZES if args.quick else SIZES)
        ),
        work=latency,
        columns="n solver eps | microseconds solved problems residual status",
        solvers=tuple("nam piqp daqp proxqp clarabel osqp quadprog".split()),
        tolerances=(1e-6,), limit=20.0, late=Late(by="n", same=(), copied=False),
        plot=plot,
    ),
    "batches": Suite(
        name="batches", requests=of_batches, work=batch,
        columns="n m items threads solver | microseconds throughput solved residual",
        solvers=("nam", "daqp"), limit=120.0,
    ),
    "sequences": Suite(
        name="sequences", requests=of_sequences, work=replayed,
        columns=(
            "scene size level solver | variables inequalities equalities steps solved "
            "microseconds residual difference status"
        ),
        solvers=tuple(WORKSPACES), tolerances=(1e-9,), limit=30.0,
    ),
}  # fmt: skip
