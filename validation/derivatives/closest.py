"""The closest feasible problem of infeasible QPs: whether it is right, and its cost.

The problems: random infeasible QPs, dense and sparse (those of `infeasible_cases`, and
`gross` ones, whose random rows contradict each other everywhere), steps of
model-predictive control from states that cannot be led back (`control`, condensed and
stagewise), and with --data the infeasible ones made of Maros-Meszaros problems whose
bounds have a point. Of each, one row:

norm        2-norm of the shifts of h and b; the bounds stay
clarabel    largest difference of a shift to that of the QP in x and the shifts, posed
piqp        to these solvers at 1e-12, over 1 + the largest shift
conditions  the worst violation of the conditions of optimality of the two nested
            problems, computed here, over 1 + the largest multiplier
closest     time of solve_qp(..., infeasible="closest"), median [s of processor time]
feasible    that of solve_qp on the feasible problem that was found: the same matrices,
            h and b shifted
ratio       closest over feasible
soft        time of "closest" where bounds are shifted as rows are
proxqp      time of proxsuite with `primal_infeasibility_solving`, dense, n <= 40,
            which shifts bounds as rows too
excess      norm of its shifts over that of `soft`, minus 1
said        what proxqp says
"""

import importlib.util
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
from qpsolvers import Problem

import namlcp
from validation.harness import Job, Row, judging, qp_solvers, qps, timing
from validation.harness.suite import Args, Suite
from validation.problems import infeasible_cases
from validation.problems.sequences import Controller, condensed, single, stagewise

COLUMNS = (
    "problem | group n rows norm clarabel piqp conditions closest feasible ratio soft "
    "proxqp excess said"
)
ORACLES = {"clarabel": 1e6, "piqp": 1.0}
"""The oracles, with a factor of the cost posed to each: they end by its value, and the
larger that is, the nearer the minimiser (piqp does not end with a larger one)."""
EPS = 1e-12  # tolerance of the oracles
LIMIT = 20.0  # [s] for one solve
MOST_DENSE = 40  # variables up to which proxqp is asked, in dense form
STAGES = (10, 30)
STATES = 3  # infeasible states for each number of stages
GROSS = (10, 30, 100, 300)  # variables of the gross problems


def gross(n: int, dense: bool) -> Problem:
    """Return a QP with 3 n rows G x <= h, h < 0, and n / 10 equations, all random."""
    rng = np.random.default_rng(n)
    rows = infeasible_cases.random_rows
    B, G, A = (rows(rng, k, n, dense) for k in (n, 3 * n, n // 10))
    q, b = rng.standard_normal(n), rng.standard_normal(n // 10)
    free = np.full(n, np.inf)
    arrays = [B.T @ B, q, G, -1.0 - rng.random(3 * n), A, b, -free, free]
    return infeasible_cases.shaped(arrays, dense)


def lost(build: Callable[[int], Controller], stages: int, seed: int) -> Problem:
    """Return the first step of a controller from a state that nothing leads back."""
    state = np.random.default_rng(seed).standard_normal(12)
    while infeasible_cases.is_feasible(problem := single(build, stages, state)):
        state *= 2.0
    return problem


def problems(data: Path | None, quick: bool) -> Iterator[tuple[str, str, Problem]]:
    for dense in (True, False):
        kind = "dense" if dense else "sparse"
        for n in GROSS[: 2 if quick else None]:
            yield f"gross {n} {kind}", f"gross, {kind}", gross(n, dense)
    for build in (condensed, stagewise):
        for stages in STAGES[: 1 if quick else None]:
            for seed in range(1 if quick else STATES):
                name = f"MPC {build.__name__} {stages} {seed}"
                yield name, f"MPC, {build.__name__}", lost(build, stages, seed)
    makers = infeasible_cases.all_cases(None if quick else data, step=6)
    for name, make in makers.items():
        case = make()
        if case is not None and case.truth == "infeasible":
            yield name, case.group, case.problem


def distances(problem: Problem, shift: np.ndarray) -> dict[str, float]:
    """Return how far the shifts of h and b are from those of the oracles."""
    _, q, G, h, A, b, lb, ub = qps.parts(problem)
    n, m, p = q.size, h.size, b.size
    k = m + p
    G = sp.hstack((G, -sp.eye(m), sp.csc_matrix((m, p))), format="csc")
    A = sp.hstack((A, sp.csc_matrix((p, m)), -sp.eye(p)), format="csc")
    free = np.full(k, np.inf)
    sides = np.append(lb, -free), np.append(ub, free)
    found = {}
    for solver, factor in ORACLES.items():
        P = sp.block_diag((sp.csc_matrix((n, n)), factor * sp.eye(k)), format="csc")
        explicit = qps.joined(P, np.zeros(n + k), G, h, A, b, *sides)
        settings = qp_solvers.settings(solver, EPS, LIMIT)
        x = qp_solvers.solve(explicit, solver, **settings).x
        difference = np.inf if x is None else judging.largest(x[n:] - shift)
        found[solver] = difference / (1.0 + judging.largest(shift))
    return found


def conditions(problem: Problem, found: Any) -> float:
    """Return the worst violation of the conditions of optimality of both problems.

    The first: least |shifts|^2 / 2 subject to the shifted constraints; the shifts are
    the multipliers of its rows. The second: least cost subject to them.
    """
    P, q, G, h, A, b, lb, ub = qps.parts(problem)
    x, h, b = found.x, h + found.shift_h, b + found.shift_b
    slack = h - G @ x
    violations = [np.minimum(slack, 0.0), A @ x - b, np.minimum(x - lb, 0.0)]
    violations += [np.minimum(ub - x, 0.0), np.minimum(found.shift_h, 0.0)]
    worst = judging.largest(*violations) / (1.0 + judging.largest(x))
    first = found.shift_h, found.shift_b, -(G.T @ found.shift_h + A.T @ found.shift_b)
    second = found.z, found.y, found.z_box
    rest = P @ x + q + G.T @ found.z + A.T @ found.y + found.z_box
    for (z, y, z_box), gradient in ((first, np.zeros(1)), (second, rest)):
        size = 1.0 + judging.largest(z, y, z_box)
        # a multiplier vanishes, or its constraint holds with equality
        at_ub, at_lb = np.maximum(z_box, 0.0), np.minimum(z_box, 0.0)
        products = [np.minimum(np.abs(z), np.abs(slack)), np.minimum(z, 0.0)]
        products += [np.minimum(at_ub, abs(ub - x)), np.minimum(-at_lb, abs(x - lb))]
        worst = max(worst, judging.largest(gradient, *products) / size)
    return worst


def seconds(call: Callable[[], Any]) -> float:
    return timing.median_time(call, time.process_time)[2]


def shifted_norm(found: Any) -> float:
    parts = found.shift_h, found.shift_b, found.shift_lb, found.shift_ub
    return float(np.linalg.norm(np.concatenate(parts)))


def proxqp_row(problem: Problem, least: float) -> Row:
    from proxsuite import proxqp

    P, q, G, h, A, b, lb, ub = qps.parts(problem)
    eye = np.eye(q.size)
    up, low = np.isfinite(ub), np.isfinite(lb)
    P, G, A = (M.toarray() if sp.issparse(M) else M for M in (P, G, A))
    C, u = np.vstack((G, eye[up], -eye[low])), np.concatenate((h, ub[up], -lb[low]))
    low_sides = np.full(u.size, -np.inf)

    def solve() -> Any:
        qp = proxqp.dense.QP(q.size, b.size, u.size)
        qp.settings.primal_infeasibility_solving = True
        qp.settings.eps_abs, qp.settings.eps_rel, qp.settings.max_iter = 1e-9, 0.0, 100
        qp.init(P, q, A, b, C, low_sides, u)
        qp.solve()
        return qp

    qp, _, spent = timing.median_time(solve, time.process_time)
    x = qp.results.x
    norm = np.linalg.norm(np.append(np.maximum(C @ x - u, 0.0), A @ x - b))
    said = qp.results.info.status.name.removeprefix("PROXQP_").lower()
    return {"proxqp": spent, "excess": float(norm) / least - 1.0, "said": said}


def work(job: Job, problem: Problem) -> Row:
    job.ready()
    arrays = qps.by_name(problem)
    ask = partial(namlcp.solve_qp, **arrays, time_limit=LIMIT)
    closest = partial(ask, infeasible="closest")
    found = closest().closest
    rows = sum(v.size for v in (problem.h, problem.b) if v is not None)
    row: Row = {"n": problem.q.size, "rows": rows}
    if found is None or found.status.value != "solved":
        return row | {"said": "no closest point" if found is None else found.message}
    row["norm"] = shifted_norm(found)
    row |= distances(problem, np.append(found.shift_h, found.shift_b))
    row["conditions"] = conditions(problem, found)
    row["closest"] = seconds(closest)
    shifts = {"h": found.shift_h, "b": found.shift_b}
    shifted = {k: arrays[k] + v for k, v in shifts.items() if arrays[k] is not None}
    easier = partial(namlcp.solve_qp, **arrays | shifted)
    if easier(time_limit=LIMIT).status.value == "solved":
        row["feasible"] = seconds(easier)
        row["ratio"] = row["closest"] / row["feasible"]
    if problem.q.size <= MOST_DENSE:
        soft = partial(ask, infeasible=namlcp.Relaxation(lb=1.0, ub=1.0))
        least = soft().closest
        row["soft"] = seconds(soft)
        if importlib.util.find_spec("proxsuite"):
            row |= proxqp_row(problem, shifted_norm(least))
    return row


def requests(args: Args) -> Iterator[Row]:
    for name, group, problem in problems(args.data, args.quick):
        yield {"problem": name, "group": group, "ask": (problem,)}


SUITE = Suite(
    name="closest", requests=requests, work=work, columns=COLUMNS, limit=600.0
)  # fmt: skip
