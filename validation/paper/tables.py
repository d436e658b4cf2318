"""Tables 1 and 2 of the paper, checked, and the rows that the paper does not have.

run
    paper-tables.csv: the 48 printed runs (delta = 4), iterations and Res beside the
    printed ones. paper-methods.csv: the same problems, and delta = 1 and 0, by every
    method of the package: as the paper has it or with the parameters that need the
    fewest sweeps ("tuned": a pattern search at every size). Times are of whole calls
    of `solve_lcp` with a sparse matrix: median and quartiles.
plot
    The figures of both.
large
    paper-large.csv: sizes that the paper does not have, up to n = 10^6, beside a plain
    transcription of the matrix formula.

Without a subcommand: run and plot. The paper does not say what Omega is; with Omega =
D/(2 alpha^2) all printed counts come out.
"""

import itertools
import multiprocessing as mp
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from namlcp import LCPResult, solve_lcp
from validation.harness import Row, cli, csv_files
from validation.paper import figures
from validation.paper.printed import EPS, SIZES, TABLES
from validation.paper.variants import VARIANTS, arguments, best_values
from validation.problems import sweep_scenes

DELTAS = (4.0, 1.0, 0.0)
HELD_OUT = (20, 70, 120, 316, 1000)  # m
REPEATS, REPEAT_TIME = 15, 0.3  # calls, [s]: repeat until either is reached


def solve(
    scene: sweep_scenes.Scene, method: str, max_iter: int, **given: Any
) -> LCPResult:
    """Run a sweep method from the paper's start to the paper's tolerance."""
    return solve_lcp(
        scene.A, scene.q, method=method, s0=scene.s0, eps_abs=EPS,
        max_iter=max_iter, **given,
    )  # fmt: skip


def timed(scene: sweep_scenes.Scene, method: str, max_iter: int, **given: Any) -> Row:
    times: list[float] = []
    while not times or (len(times) <= REPEATS and sum(times) < REPEAT_TIME):
        start = time.perf_counter()
        result = solve(scene, method, max_iter, **given)
        times.append(time.perf_counter() - start)
    if len(times) > 1:
        del times[0]
    low, median, high = np.percentile(times, (25, 50, 75))
    row = {"iterations": result.iterations, "residual": result.residual}
    row |= {"status": result.status.value, "time": median, "time_q1": low}
    return row | {"time_q3": high, "runs": len(times)}


def table_rows() -> Iterator[Row]:
    """Yield the 48 printed runs with what was printed."""
    for (example, method, alpha), printed in TABLES.items():
        given: Row = {} if alpha is None else {"alpha": alpha}
        if method.startswith("nam"):
            given["shift"] = 1.0
        for m, count, digits, cpu in zip(SIZES, *printed, strict=True):
            key = {"example": example, "method": method, "alpha": alpha or 1.0}
            row = timed(sweep_scenes.paper_example(example, m), method, 100, **given)
            yield (
                key
                | {"n": m * m}
                | row
                | {
                    "printed_iterations": count,
                    "printed_residual": digits / 1e7,
                    "printed_time": cpu,
                    "count_agrees": row["iterations"] == count,
                    "residual_agrees": f"{row['residual']:.1e}"
                    == f"{digits / 1e7:.1e}",
                }
            )


def method_rows(jobs: int) -> Iterator[Row]:
    """Yield every variant on every problem; see `variants`.

    `jobs` processes search for the parameters; the runs are timed in this one.
    """
    cases = list(itertools.product((1, 2), DELTAS, VARIANTS))
    with ProcessPoolExecutor(jobs, mp.get_context("spawn")) as pool:
        found = list(pool.map(best_values, *zip(*cases, strict=True)))
    for (example, delta, variant), best in zip(cases, found, strict=True):
        for m, values in zip(SIZES, best, strict=True):
            scene = sweep_scenes.paper_example(example, m, delta)
            given = arguments(variant, values, scene)
            row: Row = {"example": example, "delta": delta, "n": m * m}
            row |= {"variant": variant.label, "method": variant.method}
            row |= {name: values.get(name) for name in ("alpha", "beta", "c")}
            row |= timed(scene, variant.method, variant.cap, **given)
            yield row | {"cap": variant.cap}


def large_rows() -> Iterator[Row]:
    """Yield held-out sizes up to n = 10^6 beside the plain transcription."""
    cases = itertools.product((1, 2), ((4.0, 0.5), (1.0, 0.8)), HELD_OUT)
    for example, (delta, c), m in cases:
        scene = sweep_scenes.paper_example(example, m, delta)
        omega = c * scene.A.diagonal()
        start = time.perf_counter()
        result = solve(scene, "namgs", 1000, omega=omega, shift=1.0)
        seconds = time.perf_counter() - start
        count, residual = transcription(scene, omega)
        error = np.max(np.abs(result.z - np.tile([1.0, 2.0], m * m // 2)))
        row: Row = {"example": example, "delta": delta, "Omega": f"{c:g} D"}
        row |= {"n": m * m, "iterations": result.iterations, "transcription": count}
        row |= {"residual": result.residual, "transcription_residual": residual}
        yield row | {"error": float(error), "time": seconds}


def transcription(scene: sweep_scenes.Scene, omega: np.ndarray) -> tuple[int, float]:
    """Return count and Res of NAMGS written down as the paper does, r = 2.

    (D - 2L + Omega + I) s+ = (U + I - L) s + (Omega - A)|s| - 2 q
    """
    A, q, s = scene.A, scene.q, np.array(scene.s0)
    D = sp.csr_array(sp.diags_array(A.diagonal()))
    L, U = sp.csr_array(-sp.tril(A, -1)), sp.csr_array(-sp.triu(A, 1))
    Omega, eye = sp.diags_array(omega), sp.eye_array(q.size)
    left = splu(sp.csc_array(D - 2 * L + eye + Omega), permc_spec="NATURAL")
    N, B = sp.csr_array(U + eye - L), sp.csr_array(Omega - A)
    for count in itertools.count():
        z = 0.5 * (np.abs(s) + s)
        residual = float(np.linalg.norm(np.minimum(z, A @ z + q)))
        if residual < EPS or count == 1000:
            break
        s = left.solve(N @ s + B @ np.abs(s) - 2.0 * q)
    return count, residual


def main(arguments: list[str] | None = None) -> int:
    parser = cli.parser(__doc__, "results", "figures")
    parser.add_argument("part", nargs="?", choices=("run", "plot", "large"))
    parser.add_argument("--jobs", type=int, default=2, help="processes that tune")
    args = parser.parse_args(arguments)
    files: dict[str, Iterator[Row]] = {}
    if args.part in (None, "run"):
        files = {"tables": table_rows(), "methods": method_rows(args.jobs)}
    if args.part == "large":
        files = {"large": large_rows()}
    header = cli.begin() if files else []
    for name, rows in files.items():
        csv_files.write(args.results / f"paper-{name}.csv", header, list(rows))
    if args.part in (None, "plot"):
        figures.plot(args.results, args.figures)
    return 0
