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
errors
    The computations behind paper.md.

Without a subcommand: run and plot. The paper does not say what Omega is; with Omega =
D/(2 alpha^2) all printed counts come out.
"""

import itertools
import multiprocessing as mp
import sys
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp

from namlcp import LCPResult, solve_lcp
from validation.harness import Row, cli, csv_files, tables
from validation.paper import errors, figures
from validation.paper.printed import EPS, SIZES, TABLES
from validation.paper.variants import (
    CAP,
    FACTORED_CAP,
    VARIANTS,
    arguments,
    best_values,
)
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


def quartiles(call: Callable[[], Any], first: float) -> Row:
    """Return median and quartiles of the time of a call; `first` stands for one."""
    times = [] if first < REPEAT_TIME else [first]
    while len(times) < REPEATS and sum(times) < REPEAT_TIME:
        start = time.perf_counter()
        call()
        times.append(time.perf_counter() - start)
    low, median, high = np.percentile(times, (25, 50, 75))
    return {"time": median, "time_q1": low, "time_q3": high, "runs": len(times)}


def timed(scene: sweep_scenes.Scene, method: str, max_iter: int, **given: Any) -> Row:
    """Return count, Res, status and times of one method on one scene."""
    start = time.perf_counter()
    result = solve(scene, method, max_iter, **given)
    first = time.perf_counter() - start
    row = {
        "iterations": result.iterations,
        "residual": result.residual,
        "status": result.status.value,
    }
    return row | quartiles(lambda: solve(scene, method, max_iter, **given), first)


def table_rows() -> list[Row]:
    """Return the 48 printed runs with what was printed."""
    rows = []
    for (example, method, alpha), printed in TABLES.items():
        given: Row = {} if alpha is None else {"alpha": alpha}
        if method.startswith("nam"):
            given["shift"] = 1.0
        for m, count, digits, cpu in zip(SIZES, *printed, strict=True):
            key = {"example": example, "method": method, "alpha": alpha or 1.0}
            row = timed(sweep_scenes.paper_example(example, m), method, 100, **given)
            row |= {
                "printed_iterations": count,
                "printed_residual": digits / 1e7,
                "printed_time": cpu,
                "count_agrees": row["iterations"] == count,
                "residual_agrees": f"{row['residual']:.1e}" == f"{digits / 1e7:.1e}",
            }
            rows.append(key | {"n": m * m} | row)
    return rows


def print_tables(rows: list[Row]) -> None:
    """Print both tables, the printed figures below ours, and the agreement."""
    for example in (1, 2):
        print(f"\nTable {example}   n = " + "".join(f"{m * m:>9}" for m in SIZES))
        for (number, method, alpha), _ in TABLES.items():
            if number != example:
                continue
            own = tables.chosen(rows, example=example, method=method)
            for word, ours, theirs, form in (
                ("IT", "iterations", "printed_iterations", "d"),
                ("Res", "residual", "printed_residual", ".1e"),
            ):
                name = f"{method} {alpha or ''}" if word == "IT" else ""
                mine = "".join(f"{format(row[ours], form):>9}" for row in own)
                paper = "".join(f"{format(row[theirs], form):>9}" for row in own)
                print(f"{name:<12}{word:<4}{mine}\n{'':<9}printed{paper}")
            micro = [1e6 * row["time"] / row["iterations"] for row in own]
            print(f"{'':<8}us/sweep" + "".join(f"{t:>9.2f}" for t in micro))
    counts = sum(row["count_agrees"] for row in rows)
    digits = sum(row["residual_agrees"] for row in rows)
    print(f"\niteration counts: {counts}/{len(rows)} as printed")
    print(f"residuals: {digits}/{len(rows)} to both printed digits")
    for row in rows:
        if not row["residual_agrees"]:
            print(
                f"  Example {row['example']} {row['method']} n = {row['n']}: "
                f"{row['residual']:.3e}, printed {row['printed_residual']:.1e}"
            )


def method_rows(jobs: int) -> list[Row]:
    """Return every variant on every problem; see `variants`.

    `jobs` processes search for the parameters; the runs are timed in this one.
    """
    cases = list(itertools.product((1, 2), DELTAS, VARIANTS))
    context = mp.get_context("spawn")
    with ProcessPoolExecutor(jobs, context) as pool:
        found = list(pool.map(best_values, *zip(*cases, strict=True)))
    rows = []
    for (example, delta, variant), best in zip(cases, found, strict=True):
        cap = FACTORED_CAP if variant.factored else CAP
        for m, values in zip(SIZES, best, strict=True):
            scene = sweep_scenes.paper_example(example, m, delta)
            given = arguments(variant, values, scene)
            row = timed(scene, variant.method, cap, **given)
            key: Row = {"example": example, "delta": delta, "n": m * m}
            key |= {"variant": variant.label, "method": variant.method}
            key |= {name: values.get(name) for name in ("alpha", "beta", "c")}
            rows.append(key | row | {"cap": cap})
    return rows


def print_methods(rows: list[Row]) -> None:
    """Print the counts at the largest size; > means the limit was reached."""
    n = max(row["n"] for row in rows)
    print(f"\nsweeps to Res < 1e-5, n = {n}")
    cases = [(example, delta) for example in (1, 2) for delta in DELTAS]
    print(f"{'':<30}" + "".join(f"   Ex {e}, {d:g}" for e, d in cases))
    for variant in VARIANTS:
        cells = []
        for case in cases:
            for row in rows:
                key = (row["example"], row["delta"])
                if (key, row["n"], row["variant"]) == (case, n, variant.label):
                    solved = row["status"] == "solved"
                    sign = ">" if row["status"] == "max_iter" else "!"
                    cells.append(f"{'' if solved else sign}{row['iterations']}")
        print(f"{variant.label:<30}" + "".join(f"{cell:>10}" for cell in cells))
    print("> not solved within so many sweeps; ! found to diverge after so many")


def large_rows() -> list[Row]:
    """Return held-out sizes up to n = 10^6 beside the plain transcription."""
    solve(sweep_scenes.paper_example(1, 10), "namgs", 100, shift=1.0)  # compile or load
    rows = []
    cases = itertools.product((1, 2), ((4.0, 0.5), (1.0, 0.8)), HELD_OUT)
    for example, (delta, c), m in cases:
        scene = sweep_scenes.paper_example(example, m, delta)
        omega = c * scene.A.diagonal()
        start = time.perf_counter()
        result = solve(scene, "namgs", 1000, omega=omega, shift=1.0)
        seconds = time.perf_counter() - start
        count, residual = transcription(scene, omega)
        error = np.max(np.abs(result.z - np.tile([1.0, 2.0], m * m // 2)))
        rows.append(
            {
                "example": example,
                "delta": delta,
                "Omega": f"{c:g} D",
                "n": m * m,
                "iterations": result.iterations,
                "transcription": count,
                "residual": result.residual,
                "transcription_residual": residual,
                "error": float(error),
                "time": seconds,
            }
        )
    return rows


def transcription(scene: sweep_scenes.Scene, omega: np.ndarray) -> tuple[int, float]:
    """Return count and Res of NAMGS written down as the paper does, r = 2.

    (D - 2L + Omega + I) s+ = (U + I - L) s + (Omega - A)|s| - 2 q
    """
    D, L, U = errors.parts(scene.A)
    eye = sp.eye_array(scene.q.size)
    run = errors.sweeps(scene, D - 2 * L + eye, U + eye - L, sp.diags_array(omega))
    return next((k, r) for k, r in enumerate(run) if r < EPS or k == 1000)


def run(results: Path, jobs: int) -> None:
    """Measure and write both CSV files."""
    header = cli.begin()
    start = time.perf_counter()
    timed(sweep_scenes.paper_example(1, 10), "namgs", 100)  # compile or load
    rows = table_rows()
    print_tables(rows)
    csv_files.write(results / "paper-tables.csv", header, rows)
    rows = method_rows(jobs)
    print_methods(rows)
    csv_files.write(results / "paper-methods.csv", header, rows)
    print(f"{time.perf_counter() - start:.0f} s")


def main(arguments: list[str] | None = None) -> int:
    """Do what the subcommand says."""
    parser = cli.parser(__doc__, "results", "figures")
    parts = ("run", "plot", "large", "errors")
    parser.add_argument("part", nargs="?", choices=parts)
    parser.add_argument("--jobs", type=int, default=2, help="processes that tune")
    args = parser.parse_args(arguments)
    if args.part in (None, "run"):
        run(args.results, args.jobs)
    if args.part in (None, "plot"):
        figures.plot(args.results, args.figures)
    if args.part == "large":
        header, rows = cli.begin(), large_rows()
        tables.print_rows(
            rows,
            "example:7 delta:5 Omega:6 n iterations transcription:13 residual time",
        )
        csv_files.write(args.results / "paper-large.csv", header, rows)
    if args.part == "errors":
        errors.report()
    return 0


if __name__ == "__main__":
    sys.exit(main())
