"""General LCPs by families, sizes and seeds, and time steps: who solves them, how fast.

families
    All problems have a solution. Solved means that the solver says so and Res(z) <=
    1e-9 max |q_i| on the data as given. Solvers: `nam`, method="auto"; `lemke`,
    method="lemke"; `quantecon`, Lemke's method of QuantEcon; `daqp`, its mode for
    variational inequalities, made for definite matrices. Each solves twice, unless the
    first takes a second, and the last time counts. `runtime` is processor time. The
    last three keep dense matrices and are asked up to DENSE unknowns; a solver that has
    run into the limit LATES times at sizes up to n of a family is not asked for more of
    them. From DENSE unknowns on there are FEW seeds.
steps
    Discs that fall with friction for 300 steps: an LCP each, from the last one or not.
    A row for every step: unknowns, method, Res over max |q_i|, processor time, energy
    and deepest overlap.
"""

import time
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np

from examples.falling import FallingDiscs
from namlcp import solve_lcp
from validation.harness import Job, Row, qps, timing
from validation.harness.suite import Args, Late, Suite
from validation.problems.general import families

FRICTION_SIZES = (80, 200, 500, 1000, 2000, 6000)
SIZES = dict.fromkeys(families.FRICTION, FRICTION_SIZES) | {
    "games": (4, 10, 40, 140, 400)
}
OTHER_SIZES = (10, 20, 50, 100, 200)
QUICK = 2  # sizes of each family, and seeds, with --quick
RATIO = 1e4  # mass ratio of every third seed of a family with friction
DENSE = 600  # unknowns up to which dense methods are asked
SEEDS, FEW = 12, 3  # seeds, and those of larger problems
LATES = 2  # times over the limit that end a solver's part in a family
WARM_UP = 10  # unknowns of a problem before the clock runs
LATE = frozenset({"timeout", "time_limit"})
EPS = 1e-9  # times max |q_i|
Answer = tuple[str, np.ndarray | None]


def make(family: str, n: int, seed: int) -> families.Problem:
    maker = families.FAMILIES[family]
    if family in families.FRICTION and seed % 3 == 2:
        return maker(n, seed, RATIO)
    return maker(n, seed)


def by_nam(A: Any, q: np.ndarray, limit: float, method: str = "auto") -> Answer:
    accuracy = EPS * float(np.abs(q).max())
    result = solve_lcp(A, q, method=method, time_limit=limit, eps_abs=accuracy)
    return result.status.value, result.z


def by_quantecon(A: Any, q: np.ndarray, limit: float) -> Answer:
    from quantecon.optimize import lcp_lemke

    result = lcp_lemke(qps.dense(A), q)
    return ("solved" if result.success else f"status {result.status}"), result.z


def by_daqp(A: Any, q: np.ndarray, limit: float) -> Answer:
    import daqp

    n = q.size
    bounds = np.full(n, 1e30), np.zeros(n), np.zeros(n, dtype=np.int32)
    none = np.zeros((0, n))
    z, _, flag, _ = daqp.solve(qps.dense(A), q, none, *bounds, is_avi=True)
    return ("solved" if flag == 1 else f"flag {flag}"), z


ASK: dict[str, Callable[[Any, np.ndarray, float], Answer]] = {
    "nam": by_nam,
    "lemke": partial(by_nam, method="lemke"),
    "quantecon": by_quantecon,
    "daqp": by_daqp,
}


def residual(A: Any, q: np.ndarray, z: np.ndarray | None) -> float:
    """Return || min(z, A z + q) || over max |q_i|, infinite without a point."""
    if z is None or not np.isfinite(z).all():
        return np.inf
    return float(np.linalg.norm(np.minimum(z, A @ z + q)) / np.abs(q).max())


def work(job: Job, family: str, n: int, seed: int) -> Row:
    A, q = make(family, n, seed)
    row: Row = {"order": q.size}
    ASK[job.solver](*make(family, WARM_UP, seed), job.limit)
    job.ready()
    for _ in range(2):
        start, clock = time.process_time(), time.perf_counter()
        said, z = ASK[job.solver](A, q, job.limit)
        row["runtime"] = time.process_time() - start
        if time.perf_counter() - clock > timing.SLOW:
            break
    found = residual(A, q, z)
    row |= {"success": said == "solved" and found <= EPS, "residual": found}
    return row | {"said": said}


def requests(args: Args) -> Iterator[Row]:
    for seed in range(QUICK if args.quick else SEEDS):
        for family in families.FAMILIES:
            sizes = SIZES.get(family, OTHER_SIZES)
            for n in sizes[: QUICK if args.quick else None]:
                if n <= DENSE or seed < FEW:
                    for solver in args.solvers if n <= DENSE else ["nam"]:
                        yield {"family": family, "n": n, "seed": seed, "solver": solver}


def complete(row: Row) -> Row:
    return {"said": row.get("status")} | row


# ---- time steps

COUNTS, FEW_DISCS = (5, 10, 30, 60), (5, 10)
STEPS = 300
STARTS = ("last step", "nothing")


def fall(job: Job, count: int, start: str) -> Row:
    warm_up = FallingDiscs(FEW_DISCS[0])
    for _ in range(STEPS):
        warm_up.step()
    job.ready()
    discs = FallingDiscs(count, warm=start == "last step")
    records = [discs.step()._asdict() for _ in range(STEPS)]
    return {"rows": [r | {"status": r["status"].value} for r in records]}


def conclude(rows: list[Row]) -> list[Row]:
    steps = rows[0].get("rows", [{"status": rows[0].get("status")}])
    return [rows[0] | {"step": k} | step for k, step in enumerate(steps)]


SUITES = {
    "families": Suite(
        name="general-lcps", requests=requests, work=work, complete=complete,
        columns="family n seed solver | order success said residual runtime",
        solvers=tuple(ASK), packages={"lemke": "namlcp"},
        late=Late(by="n", same=("family",), copied=False, times=LATES, words=LATE),
    ),
    "steps": Suite(
        name="time-stepping",
        requests=lambda args: (
            {"discs": count, "start": start}
            for count in (FEW_DISCS if args.quick else COUNTS)
            for start in STARTS
        ),
        work=fall, conclude=conclude,
        columns="discs start | step n status method residual seconds energy overlap",
        limit=600.0,
    ),
}  # fmt: skip
