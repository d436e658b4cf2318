"""Sequences of QPs with the same matrices: microseconds a step, worst residuals.

A scene's loop is run once with fresh solves of ours, which give the next step its
vectors. Then every solver repeats these steps by its own workspace (`workspaces`). Of
REPEATS runs, each with a new workspace, the quickest counts for each step;
`microseconds` is the median of the steps. Each answer is judged with the problem as
given: the largest residual and the distance of x to the fresh solve, relative to the
largest entry, of all steps.
"""

import time
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from qpsolvers import Problem

from namlcp import Status, solve_qp
from validation.harness import Job, Row, judging, qps
from validation.harness.suite import Args, Suite
from validation.problems import sequences as known
from validation.repeated.workspaces import WORKSPACES

REPEATS = 3
LONG = 2.0  # [s] a run through the sequence, which is then not repeated
STEPS, QUICK_STEPS = 100, 12


class Recorded(NamedTuple):
    """A problem, the vectors that change in each step, and x of fresh solves."""

    problem: Problem
    vectors: list[dict[str, np.ndarray]]
    fresh: np.ndarray


def recorded(scene: str, size: int, level: str, most: int) -> Recorded:
    """Run a scene's loop with fresh solves; keep at most so many steps."""
    problem, loop = known.SCENES[scene].make(size, level)
    data = qps.by_name(problem)
    vectors, fresh = [], []
    x = None
    while len(vectors) < most:
        try:
            changed = loop.send(x)
        except StopIteration:
            break
        data |= changed
        result = solve_qp(**data)
        x = result.x if result.status is Status.SOLVED else None
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
        if repeat and times[0].sum() > LONG:
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


def requests(args: Args) -> Iterator[Row]:
    steps = QUICK_STEPS if args.quick else STEPS
    for name, scene in known.SCENES.items():
        for size in scene.sizes[:1] if args.quick else scene.sizes:
            for level in known.LEVELS:
                made = recorded(name, size, level, steps)
                _, q, _, h, _, b, _, _ = qps.parts(made.problem)
                yield {
                    "scene": name, "size": size, "level": level, "variables": q.size,
                    "inequalities": h.size, "equalities": b.size,
                    "steps": len(made.vectors), "ask": (made, args.eps[0]),
                }  # fmt: skip


SUITE = Suite(
    name="sequences", requests=requests, work=replayed,
    columns=(
        "scene size level solver | variables inequalities equalities steps solved "
        "microseconds residual difference status"
    ),
    solvers=tuple(WORKSPACES), tolerances=(1e-9,), limit=30.0,
)  # fmt: skip
