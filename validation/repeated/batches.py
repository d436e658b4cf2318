"""Batches of small dense QPs, all different: microseconds an item, items a second.

"nam" is `namlcp.solve_batch`, with 1 thread and with 2; "daqp" is a loop over
daqp.solve. The time is that of the whole batch, the least of ROUNDS; with two threads
it means something only where two cores are free.
`residual` is the largest of all items: primal, dual, gap or a negative multiplier.
"""

import time
from collections.abc import Callable, Iterator

import numpy as np

import namlcp
from validation.harness import Job, Row
from validation.harness.suite import Args, Suite
from validation.problems import draw

SHAPES = {(5, 10): 100_000, (10, 20): 100_000, (30, 60): 10_000}
"""Variables and rows of an item; items of the largest batch."""
BATCHES = (100, 1000, 10_000, 100_000)
QUICK_BATCH = 50
THREADS = (1, 2)
ROUNDS = 3
EPS = 1e-9
Stack = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]
Answers = tuple[np.ndarray, np.ndarray, np.ndarray]
"""x and z, stacked, and whether each was found."""


def at_once(stack: Stack, threads: int) -> Answers:
    r = namlcp.solve_batch(*stack, threads=threads)
    return r.x, r.z, r.codes == list(namlcp.Status).index(namlcp.Status.SOLVED)


def by_daqp(stack: Stack, _: int) -> Answers:
    import daqp

    P, q, G, h = stack
    lower, sense = np.full(h.shape[1], -1e30), np.zeros(h.shape[1], dtype=np.int32)
    settings = {"primal_tol": EPS, "dual_tol": EPS}
    answers = [
        daqp.solve(P[i], q[i], G[i], h[i], lower, sense, **settings)
        for i in range(len(q))
    ]
    found = np.array([flag > 0 for _, _, flag, _ in answers])
    x = np.array([each[0] for each in answers])
    return x, np.array([each[3]["lam"] for each in answers]), found


LOOPS: dict[str, Callable[[Stack, int], Answers]] = {
    "nam": at_once,
    "daqp": by_daqp,
}


def worst_residual(stack: Stack, x: np.ndarray, z: np.ndarray) -> float:
    P, q, G, h = stack
    Px, Gx = (np.einsum("kij,kj->ki", M, x) for M in (P, G))
    dual = Px + q + np.einsum("kij,ki->kj", G, z)
    gap = np.einsum("ki,ki->k", Px + q, x) + np.einsum("ki,ki->k", h, z)
    return float(max(np.abs(dual).max(), (Gx - h).max(), np.abs(gap).max(), -z.min()))


def measured(job: Job, n: int, m: int, items: int, threads: int) -> Row:
    solve = LOOPS[job.solver]
    rng = np.random.default_rng(n)
    solve(draw.definite_stack(rng, n, m, 2), threads)
    stack = draw.definite_stack(rng, n, m, items)
    job.ready()
    seconds = np.inf
    for _ in range(ROUNDS):
        start = time.perf_counter()
        x, z, found = solve(stack, threads)
        seconds = min(seconds, time.perf_counter() - start)
    return {
        "microseconds": 1e6 * seconds / items,
        "throughput": items / seconds,
        "solved": int(found.sum()),
        "residual": worst_residual(stack, x, z),
        "status": "solved" if found.all() else "not found",
    }


def requests(args: Args) -> Iterator[Row]:
    for (n, m), most in SHAPES.items():
        for items in [QUICK_BATCH] if args.quick else BATCHES:
            for solver in args.solvers if items <= most else []:
                for threads in THREADS if solver == "nam" else [1]:
                    key = {"n": n, "m": m, "items": items, "threads": threads}
                    yield key | {"solver": solver}


SUITE = Suite(
    name="batches",
    requests=requests,
    work=measured,
    columns=("n m items threads solver microseconds throughput solved residual status"),
    keys="n m items threads solver",
    solvers=tuple(LOOPS),
    limit=120.0,
)
