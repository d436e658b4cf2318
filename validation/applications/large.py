"""Large sparse LCPs: time against n, beside one linear solve with the same matrix.

One row for each scene, size and solver. `seconds` is the best of two whole calls of
`solve_lcp` (of one beyond 20 s), checks and set-up included; `residual` Res, computed
here. `baseline`, in the same process, in turns with ours, is one linear solve: A x = -q
to 1e-8 by pyamg's default Ruge-Stueben hierarchy, its set-up included, and CG (BiCGStab
if A is not symmetric). `memory` is what the call needs at its peak, in units of the
bytes of A. OSQP, PIQP and Clarabel solve the forced obstacle to 1e-8 up to the size
that they do not finish in 60 s.
"""

import ctypes
import gc
import time
import warnings
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyamg
import qpsolvers
import scipy.sparse as sp
from matplotlib import pyplot as plt
from scipy.sparse.linalg import LinearOperator

from namlcp import LCPResult, natural_residual, solve_lcp
from validation.harness import Job, Row, charts, judging, qp_solvers, tables, timing
from validation.harness.suite import Args, Late, Suite
from validation.problems import contact_scenes, hertz, known_scenes
from validation.problems.sweep_scenes import paper_example, with_contact

SIZES = (10_000, 100_000, 1_000_000)
FORCED_SIZES = (10_000, 40_000, 90_000, 100_000, 1_000_000, 4_000_000)
PILE_SIZES = (1_000, 10_000, 100_000)
HERTZ_SIZES = (64**2, 128**2, 256**2, 512**2)  # 1024**2 takes minutes: `hertz`
PEER_SIZES = (10_000, 40_000, 90_000, 1_000_000)
WARM_UP = 12_000  # unknowns of the scene that loads what is compiled
EPS = 1e-9  # Res that is asked of us
PEER_EPS = 1e-8  # absolute, that is asked of the others
LIMIT = 600.0  # [s] for us
PEER_LIMIT = 60.0  # [s] for the others
ONCE = 20.0  # [s] from which a call is not repeated
FAILED = frozenset({"timeout", "too slow", "crashed", "not found", "inaccurate"})
CYCLES = 200  # of the baseline at most


def hertz_contact(n: int) -> known_scenes.BoxLCP:
    """Return a sphere on a half-space; A is a LinearOperator, a product by the FFT."""
    made = hertz.hertz(known_scenes.side(n))
    return known_scenes.nonnegative(made.A, made.q)


class Entry(NamedTuple):
    """How to make a scene of n unknowns, its title, which n, pyamg's Krylov method.

    Where it is `relative`, the tolerance and the residual of the row are: that of the
    problem scaled to a unit diagonal, over its value at z = 0.
    """

    make: Callable[[int], known_scenes.BoxLCP]
    title: str
    sizes: tuple[int, ...] = SIZES
    accel: str | None = "cg"
    relative: bool = False


wide_heap = partial(contact_scenes.heap, sideways=True)
FAMILIES = known_scenes.FAMILIES
PILES = "contact piles"
SCENES = {
    "forced": Entry(FAMILIES["forced"], "forced obstacle", FORCED_SIZES),
    "ball": Entry(FAMILIES["ball"], "ball obstacle"),
    "torsion": Entry(FAMILIES["torsion"], "torsion, two-sided"),
    "biactive": Entry(FAMILIES["biactive"], "half biactive"),
    "rough": Entry(FAMILIES["rough"], "rough obstacle"),
    "anisotropic": Entry(FAMILIES["anisotropic"], "anisotropic 1 : 0.01"),
    "3-D": Entry(FAMILIES["3-D"], "3-D, seven-point"),
    "mesh, jumps": Entry(FAMILIES["mesh, jumps"], "mesh, jumps 1 : 1000"),
    "transport": Entry(
        FAMILIES["transport"], "Example 2, $\\delta$ = 0", accel="bicgstab"
    ),
    "dominant": Entry(  # with half of the unknowns in contact
        lambda n: with_contact(paper_example(2, known_scenes.side(n)).A),
        "Example 2, $\\delta$ = 4", accel="bicgstab",
    ),
    "heap": Entry(contact_scenes.heap, PILES, PILE_SIZES, None, True),
    "heap, wide": Entry(wide_heap, PILES, PILE_SIZES, None, True),
    "wall": Entry(contact_scenes.brick_wall, PILES, PILE_SIZES, None, True),
    "hertz": Entry(hertz_contact, "Hertz, matrix-free", HERTZ_SIZES, None),
}  # fmt: skip


def work(job: Job, name: str, n: int) -> Row:
    if job.solver != "nam":
        return peer_row(job, name, n)
    job.ready()
    warnings.simplefilter("ignore")
    make, _, _, accel, relative = SCENES[name]
    call(make(min(n, WARM_UP)), 60.0, relative)
    scene = make(n)
    A = scene.A
    row: Row = {"n": scene.q.size}
    if sp.issparse(A):
        row["nnz"] = A.nnz
    release_memory()
    before = timing.resident_memory(reset_peak=True)
    times, baselines = [], []
    for turn in range(2):
        start = time.perf_counter()
        result = call(scene, LIMIT, relative)
        times.append(time.perf_counter() - start)
        if turn == 0 and sp.issparse(A):
            own = A.data.nbytes + A.indices.nbytes + A.indptr.nbytes
            row["memory"] = (timing.resident_memory() - before) / own
        if accel:
            baselines.append(linear_solve(A, scene.q, accel))
        if times[0] > ONCE:
            break
    row |= {"method": result.method, "status": result.status.value}
    row |= {"iterations": result.iterations, "seconds": min(times)}
    row["residual"] = residual_of(scene, result.z, relative)
    if baselines:
        row |= {"baseline": min(baselines), "ratio": min(times) / min(baselines)}
    return row


def call(scene: known_scenes.BoxLCP, limit: float, relative: bool) -> LCPResult:
    given: Row = {"eps_rel" if relative else "eps_abs": EPS, "time_limit": limit}
    if isinstance(scene.A, LinearOperator):
        corner = np.zeros(scene.q.size)
        corner[0] = 1.0
        given["diagonal"] = np.full_like(corner, (scene.A @ corner)[0])  # Toeplitz
    return solve_lcp(*scene, **given)


def release_memory() -> None:
    """Return freed memory to the system (glibc), so that the peak is not hidden."""
    gc.collect()
    libc = ctypes.CDLL(None)
    if hasattr(libc, "malloc_trim"):
        libc.malloc_trim(0)


def residual_of(scene: known_scenes.BoxLCP, z: np.ndarray, relative: bool) -> float:
    A, q, lower, upper = scene
    if relative:
        return judging.relative_residual(A, q, z)
    return natural_residual(z, A @ z + q, lower, upper)


def linear_solve(A: Any, q: np.ndarray, accel: str) -> float:
    """Return the time of A x = -q to 1e-8, NaN where CYCLES are not enough."""
    A = sp.csr_matrix(A)
    start = time.perf_counter()
    hierarchy = pyamg.ruge_stuben_solver(A)
    x = hierarchy.solve(-q, tol=1e-8, maxiter=CYCLES, accel=accel)
    seconds = time.perf_counter() - start
    solved = np.linalg.norm(A @ x + q) <= 1e-7 * np.linalg.norm(q)
    return seconds if solved else np.nan


def peer_row(job: Job, name: str, n: int) -> Row:
    """Solve a scene as the QP min 1/2 z'Az + q'z by a peer: the work of a child.

    It counts as solved if the solver says so and Res <= PEER_EPS sqrt(n), PEER_EPS in
    the mean over the entries.
    """
    settings = qp_solvers.settings(job.solver, PEER_EPS, job.limit)

    def solve(scene: known_scenes.BoxLCP) -> qpsolvers.Solution:
        A, q, lower, upper = scene
        problem = qpsolvers.Problem(sp.csc_matrix(A), q, lb=lower, ub=upper)
        return qpsolvers.solve_problem(problem, solver=job.solver, **settings)

    scene = SCENES[name].make(n)
    solve(SCENES[name].make(100))

    def judge(answer: qpsolvers.Solution) -> Row:
        if not answer.found or answer.x is None:
            return {"status": "not found"}
        residual = residual_of(scene, answer.x, False)
        good = residual <= PEER_EPS * np.sqrt(scene.q.size)
        return {"residual": residual, "status": "solved" if good else "inaccurate"}

    row = judging.timed(job, lambda: solve(scene), judge)
    about = {"n": scene.q.size, "nnz": scene.A.nnz, "method": job.solver}
    return about | row | {"seconds": row.get("runtime")}


def requests(args: Args) -> Iterator[Row]:
    for name, entry in SCENES.items():
        for n in entry.sizes:
            peers = name == "forced" and n in PEER_SIZES
            for solver in args.solvers if peers else ["nam"]:
                yield {"scene": name, "size": n, "n": n, "solver": solver}


MARKERS = {"heap": "o", "heap, wide": "s", "wall": "^"}


def plot(results: Path, figures: Path) -> None:
    """Draw time against n, a panel for each title of a scene."""
    rows = tables.read(results)
    dashed = {"color": charts.DARK, "linestyle": "--", "label": "one linear solve"}
    size = charts.WIDTH, 7.5
    figure, grid = plt.subplots(
        3, 4, figsize=size, sharex=True, sharey=True, layout="constrained"
    )
    titles = dict.fromkeys(entry.title for entry in SCENES.values())
    for axes, title in zip(grid.flat, titles, strict=True):
        axes.set_title(title, fontsize=9.0)
        own = [row for row in rows if SCENES[row["scene"]].title == title]
        if title == PILES:
            look = lambda name: {  # noqa: E731
                "color": charts.BLUE, "marker": MARKERS[name], "label": name,
            }  # fmt: skip
            charts.lines(axes, own, "scene n seconds", look)
        else:
            ours = tables.chosen(own, solver="nam")
            charts.lines(axes, ours, "solver n baseline", lambda _: dashed)
            solved = tables.chosen(own, status="solved")
            charts.lines(axes, solved, "solver n seconds", charts.looks)
        if title == PILES:
            axes.legend(fontsize=7.5)
    # beside the panel of which it is, where there is room
    names = grid[0, 0].get_legend_handles_labels()
    grid[0, 1].legend(*names, fontsize=7.5, loc="upper left")
    figure.supxlabel("n", fontsize=9.0)
    figure.supylabel("time [s]", fontsize=9.0)
    charts.save(figure, figures / "large.svg")


SUITE = Suite(
    name="large", requests=requests, work=work,
    columns=(
        "scene size solver | n nnz method status iterations seconds residual baseline "
        "ratio memory"
    ),
    solvers=("nam", "osqp", "piqp", "clarabel"), limit=LIMIT, peer_limit=PEER_LIMIT,
    late=Late(by="size", same=("scene",), copied=False, words=FAILED), alone=True,
    plot=plot,
)  # fmt: skip
