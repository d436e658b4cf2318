"""Large sparse LCPs: time against n, beside one linear solve with the same matrix.

Usage::

    python validation/large.py [run | plot | table] [--quick]
        [--scenes forced ball ...] [--method auto] [--no-peers]
        [--results DIR] [--figures DIR]

run
    large.csv: one row for each scene, size and solver. `seconds` is the best of two
    whole calls of `solve_lcp` (of one beyond a minute), checks and set-up included,
    compiled kernels loaded; `residual` || z - clip(z - (A z + q), lower, upper) ||_2,
    computed here. `baseline`, in the same process, in turns with ours and the best of
    as many, is one linear solve: A x = -q to 1e-8 by pyamg's default Ruge-Stueben
    hierarchy, its set-up included, and CG (BiCGStab if A is not symmetric). `product`
    is the median time of A @ x, which reads A once. `memory` is what the call needs at
    its peak and `hierarchy` what the levels of the baseline take, A one of them, both
    in units of the bytes of A. OSQP, PIQP and Clarabel solve the forced obstacle to
    1e-8 up to the size that they do not finish in 120 s. The row of the American put
    has one time step, and one of Brennan and Schwartz as its baseline.
plot
    large.svg from large.csv.
table
    large.csv as Markdown, the claims below it.

--quick: n up to 10^5. Without a subcommand: run and plot.
"""

import argparse
import ctypes
import gc
import resource
import sys
import time
import warnings
from collections.abc import Callable, Iterator
from functools import partial
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyamg
import qpsolvers
import scipy.sparse as sp
from scipy.sparse.linalg import LinearOperator

import american_put
import large_figures
from benchmark import csv_writer, installed, machine_lines, use_one_thread
from contact_scenes import brick_wall, heap
from hertz import hertz
from known_scenes import BoxLCP, nonnegative
from large_scenes import FAMILIES, side
from lcp import isolated, relative_residual, resident_memory
from measure import MEMORY, Bench, failure, median_time, silence
from namlcp import LCPResult, solve_lcp
from namlcp.residuals import natural_residual
from settings import solver_settings
from sweep_scenes import paper_example, with_contact

Row = dict[str, Any]
HERE = Path(__file__).parent
COLUMNS = (
    "scene n nnz solver method status iterations setup solve seconds residual active "
    "baseline baseline_iterations ratio product memory hierarchy"
).split()
SIZES = (10_000, 100_000, 1_000_000)
FORCED_SIZES = (10_000, 40_000, 90_000, 100_000, 1_000_000, 4_000_000)
PILE_SIZES = (1_000, 10_000, 100_000)
HERTZ_SIZES = (64**2, 128**2, 256**2, 512**2, 1024**2)
PUT_SIZES = (1_000, 4_000, 16_000)
PUT_STEPS = 4_000
PEER_SIZES = (10_000, 40_000, 90_000, 1_000_000)
QUICK = 100_000
WARM_UP = 12_000  # unknowns of the scene that loads what is compiled
EPS = 1e-9  # Res that is asked of us
PEER_EPS = 1e-8
LIMIT, PEER_LIMIT = 600.0, 120.0  # [s]
ONCE = 60.0  # [s] from which a call is not repeated
CYCLES = 200  # of the baseline at most
PEERS = ("osqp", "piqp", "clarabel")


def strongly_dominant(n: int) -> BoxLCP:
    """Return Example 2 at delta = 4 with half of the unknowns in contact."""
    return BoxLCP(*with_contact(paper_example(2, side(n)))[1:5])


def pile(kind: str, n: int) -> BoxLCP:
    """Return contacts in a heap of discs or in a wall of bricks."""
    made = brick_wall(n) if kind == "wall" else heap(n, sideways=kind == "heap, wide")
    return nonnegative(made.A, made.q)


def hertz_contact(n: int) -> BoxLCP:
    """Return a sphere on a half-space; A is a LinearOperator, a product by the FFT."""
    made = hertz(side(n))
    return nonnegative(made.A, made.q)


class Entry(NamedTuple):
    """How to make a scene of n unknowns, which n, and pyamg's Krylov method for A.

    Where it is `relative`, the tolerance and the residual of the row are: that of the
    problem scaled to a unit diagonal, over its value at z = 0.
    """

    make: Callable[[int], BoxLCP]
    sizes: tuple[int, ...] = SIZES
    accel: str | None = "cg"
    relative: bool = False


PLAIN = [*"ball torsion biactive rough anisotropic 3-D".split(), "mesh, jumps"]
SCENES = {
    "forced": Entry(FAMILIES["forced"], FORCED_SIZES),
    **{name: Entry(FAMILIES[name]) for name in PLAIN},
    "transport": Entry(FAMILIES["transport"], accel="bicgstab"),
    "dominant": Entry(strongly_dominant, accel="bicgstab"),
    "heap": Entry(partial(pile, "heap"), PILE_SIZES, None, True),
    "heap, wide": Entry(partial(pile, "heap, wide"), PILE_SIZES, None, True),
    "wall": Entry(partial(pile, "wall"), PILE_SIZES, None, True),
    "hertz": Entry(hertz_contact, HERTZ_SIZES, None),
}
SIZES_OF = {name: entry.sizes for name, entry in SCENES.items()} | {"put": PUT_SIZES}


def scene_row(name: str, n: int, method: str) -> Row:
    """Solve one scene and the linear system in turns; return the row."""
    warnings.simplefilter("ignore")
    make, _, accel, relative = SCENES[name]
    call(make(min(n, WARM_UP)), method, 60.0, relative)
    scene = make(n)
    A = scene.A
    row: Row = {"scene": name, "n": scene.q.size, "solver": "nam"}
    if sp.issparse(A):
        row["nnz"], own = A.nnz, memory_of(A)
    release_memory()
    before = resident_memory(reset_peak=True)
    times, baselines = [], []
    for turn in range(2):
        start = time.perf_counter()
        result = call(scene, method, LIMIT, relative)
        times.append(time.perf_counter() - start)
        if turn == 0 and sp.issparse(A):
            row["memory"] = (resident_memory() - before) / own
        if accel:
            baselines.append(linear_solve(A, scene.q, accel))
        if times[0] > ONCE:
            break
    row |= judged(scene, result.z, relative)
    row |= {
        "method": result.method,
        "status": result.status.value,
        "iterations": result.iterations,
        "setup": result.setup_time,
        "solve": result.solve_time,
        "seconds": min(times),
        "product": median_time(lambda: A @ scene.q)[2],
    }
    if baselines:
        row["baseline"], row["baseline_iterations"], levels = min(baselines)
        row["hierarchy"] = levels / own
        row["ratio"] = row["seconds"] / row["baseline"]
    return row


def call(scene: BoxLCP, method: str, limit: float, relative: bool) -> LCPResult:
    """Make the call that is timed."""
    kind = "eps_rel" if relative else "eps_abs"
    given: Row = {"method": method, kind: EPS, "time_limit": limit}
    if isinstance(scene.A, LinearOperator):
        corner = np.zeros(scene.q.size)
        corner[0] = 1.0
        given["diagonal"] = np.full_like(corner, (scene.A @ corner)[0])  # Toeplitz
    return solve_lcp(*scene, **given)


def put_row(n: int) -> Row:
    """Return the row of an American put on n nodes: one time step, the median.

    The baseline is a step of the method of Brennan and Schwartz, the faster variant.
    """
    found = american_put.timing("S = K = 100", n, PUT_STEPS)
    return {
        "scene": "put",
        "n": n,
        "nnz": 3 * n - 2,
        "solver": "nam",
        "method": f"error {found['error']:.1e}",
        "status": "solved",
        "iterations": found["most_faces"],
        "seconds": 1e-6 * found["us_a_step"],
        "residual": found["worst_residual"],
        "baseline": 1e-6 * min(found["us_kept"], found["us_anew"]),
        "ratio": found["ratio"],
    }


def memory_of(M: Any) -> float:
    """Return the bytes of a matrix in CSR form."""
    return float(M.data.nbytes + M.indices.nbytes + M.indptr.nbytes)


def release_memory() -> None:
    """Return freed memory to the system (glibc), so that the peak is not hidden."""
    gc.collect()
    libc = ctypes.CDLL(None)
    if hasattr(libc, "malloc_trim"):
        libc.malloc_trim(0)


def judged(scene: BoxLCP, z: np.ndarray, relative: bool = False) -> Row:
    """Return the natural residual of z and the share of unknowns at a bound."""
    A, q, lower, upper = scene
    active = np.mean((z <= lower) | (z >= upper))
    if relative:
        residual = relative_residual(A, q, z)
    else:
        residual = natural_residual(z, A @ z + q, lower, upper)
    return {"residual": residual, "active": float(active)}


def linear_solve(A: Any, q: np.ndarray, accel: str) -> tuple[float, int, float]:
    """Return time, iterations and bytes of the levels of A x = -q to 1e-8.

    The time is NaN where 200 iterations are not enough.
    """
    A = sp.csr_matrix(A)
    steps: list[float] = []
    start = time.perf_counter()
    hierarchy = pyamg.ruge_stuben_solver(A)
    x = hierarchy.solve(
        -q,
        tol=1e-8,
        maxiter=CYCLES,
        accel=accel,
        residuals=steps,
    )
    seconds = time.perf_counter() - start
    if not np.linalg.norm(A @ x + q) <= 1e-7 * np.linalg.norm(q):
        seconds = np.nan
    matrices = [level.A for level in hierarchy.levels]
    for level in hierarchy.levels[:-1]:
        matrices += [level.P, level.R]
    return seconds, len(steps) - 1, sum(memory_of(M) for M in matrices)


def peer_row(pipe: Connection, name: str, n: int, solver: str, limit: float) -> Row:
    """Solve a scene as the QP min 1/2 z'Az + q'z by a peer, through qpsolvers.

    It counts as solved if the solver says so and Res <= 1e-8 sqrt(n), that is 1e-8 in
    the mean over the entries.
    """
    settings = solver_settings(solver, PEER_EPS, limit)

    def problem(n: int) -> qpsolvers.Problem:
        A, q, lower, upper = SCENES[name].make(n)
        return qpsolvers.Problem(sp.csc_matrix(A), q, lb=lower, ub=upper)

    scene = SCENES[name].make(n)
    row: Row = {"n": scene.q.size, "nnz": scene.A.nnz}
    qpsolvers.solve_problem(problem(100), solver=solver, **settings)
    given = problem(n)
    pipe.send("ready")
    answer, cold, runtime = median_time(
        lambda: qpsolvers.solve_problem(given, solver=solver, **settings)
    )
    if not answer.found or answer.x is None:
        return row | failure("not found")
    row |= judged(scene, answer.x) | {"seconds": runtime, "status": "solved"}
    if cold > limit:
        row["status"] = "too slow"
    elif not row["residual"] <= PEER_EPS * np.sqrt(row["n"]):
        row["status"] = "inaccurate"
    return row


def serve(pipe: Connection, _: None, solver: str, limit: float) -> None:
    """Answer requests (scene, n, _) until None comes: the child process."""
    warnings.simplefilter("ignore")
    silence()
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    for name, n, _ in iter(pipe.recv, None):
        try:
            pipe.send(peer_row(pipe, name, int(n), solver, limit))
        except Exception as error:
            pipe.send(failure(f"{type(error).__name__}: {error}"))


class PeerBench(Bench):
    """A child process that solves scenes with one peer."""

    work = staticmethod(serve)


def peer_rows(scene: str, sizes: tuple[int, ...]) -> Iterator[Row]:
    """Yield the rows of the peers, each up to the first size that it fails at."""
    for solver in installed(PEERS):
        bench = PeerBench(None, solver, PEER_LIMIT)
        try:
            for n in sizes:
                answer = bench.run(scene, str(n), PEER_EPS)
                yield {"n": n, **answer, "scene": scene, "method": solver}
                if answer["status"] != "solved":
                    break
        finally:
            bench.stop()


def print_row(row: Row) -> None:
    """Print one solve on one line."""

    def text(key: str, form: str, width: int) -> str:
        value = row.get(key, "")
        return f"{value if value == '' else format(value, form):>{width}}"

    print(
        f"{row['scene']:<13}{row['n']:>9} {row.get('method', ''):<15}"
        f"{row['status']:<11.10}{text('iterations', 'd', 6)}"
        f"{text('seconds', '.3g', 9)} s{text('residual', '.1e', 9)}"
        f"{text('baseline', '.3g', 9)}{text('ratio', '.2f', 7)}"
        f"{text('product', '.2g', 9)}{text('memory', '.1f', 7)}"
        f"{text('hierarchy', '.1f', 7)}",
        flush=True,
    )


def run(args: argparse.Namespace) -> None:
    """Solve the scenes and write large.csv."""
    header = machine_lines(["nam", "pyamg", *PEERS])
    print("\n".join(header))
    print(
        f"{'scene':<13}{'n':>9} {'method':<15}{'status':<11}{'cycles':>6}{'time':>11}"
        f"{'Res':>9}{'AMG-CG':>9}{'ratio':>7}{'A @ x':>9}{'memory':>7}{'levels':>7}"
    )
    most = QUICK if args.quick else max(FORCED_SIZES)
    args.results.mkdir(parents=True, exist_ok=True)
    with csv_writer(args.results / "large.csv", header, COLUMNS, "ignore") as write:

        def put(row: Row) -> None:
            print_row(row)
            write(row)

        for name in args.scenes:
            for n in SIZES_OF[name]:
                if n > most:
                    continue
                if name == "put":
                    put(isolated(put_row, n))
                else:
                    put(isolated(scene_row, name, n, args.method))
            if name == "forced" and args.peers:
                for row in peer_rows(name, tuple(n for n in PEER_SIZES if n <= most)):
                    put(row)


def main(arguments: list[str] | None = None) -> int:
    """Run and plot, or what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("task", nargs="?", choices=["run", "plot", "table"])
    parser.add_argument("--quick", action="store_true", help="n up to 10^5")
    parser.add_argument("--scenes", nargs="+", choices=SIZES_OF, default=list(SIZES_OF))
    parser.add_argument("--method", default="auto", help="of solve_lcp")
    parser.add_argument("--no-peers", dest="peers", action="store_false")
    parser.add_argument("--results", type=Path, default=HERE / "results")
    parser.add_argument("--figures", type=Path, default=HERE / "figures")
    args = parser.parse_args(arguments)
    use_one_thread()
    if args.task in (None, "run"):
        run(args)
    if args.task in (None, "plot"):
        large_figures.plot(args.results / "large.csv", args.figures)
    if args.task == "table":
        large_figures.table(args.results / "large.csv")
    return 0


if __name__ == "__main__":
    sys.exit(main())
