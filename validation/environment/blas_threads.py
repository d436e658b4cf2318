"""What a second BLAS thread does to a solve that did not ask for it.

Every problem is solved in turn with one and with two threads set for the BLAS of NumPy
and SciPy, as a user would set them or have them by default, and once more with two
where the package leaves the setting alone. `ratio` is the time with two over that with
one, of the lower quartiles (on a busy core many solves are interrupted, whatever they
do); `unguarded` the same without the package's care. --busy lets another process
compute on each core meanwhile.
"""

import contextlib
import multiprocessing
import os
import sys
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
import qpsolvers

import namlcp
from namlcp.linalg.threads import settings
from validation.harness import cli, csv_files, machine, timing
from validation.problems import data_sets

SETS = ("mpc", "contact", "small", "strict", "dense")
DENSE_SIZES = (50, 100), (150, 3000), (300, 300), (300, 20), (600, 300), (1000, 100)
LIMIT = 10.0  # [s] a solve, and of one kind of solve on a problem
LEAST = 0.1  # [s] of each kind of solve, at least
REPEATS = 8  # solves of each kind, at least
COLUMNS = "set problem one two unguarded_two ratio unguarded".split()


def dense_problems() -> Iterator[tuple[str, Callable[[], Any]]]:
    """Yield dense QPs and LCPs of the sizes at which OpenBLAS begins to use threads."""
    rng = np.random.default_rng(0)
    for n, m in DENSE_SIZES:
        M = rng.standard_normal((n, n))
        data = M @ M.T + np.eye(n), rng.standard_normal(n)
        rows = rng.standard_normal((m, n)), rng.uniform(0.0, 1.0, m)
        yield f"qp_{n}_{m}", lambda data=data, rows=rows: namlcp.solve_qp(*data, *rows)
    for n in (200, 500, 1000):
        M = rng.standard_normal((n, n))
        A, q = M @ M.T / n + 0.1 * np.eye(n), rng.standard_normal(n)
        yield f"lcp_{n}", lambda A=A, q=q: namlcp.solve_lcp(A, q)


def tasks(data: Path, name: str) -> Iterator[tuple[str, Callable[[], Any]]]:
    """Yield name and solve of each problem of a set."""
    if name == "dense":
        yield from dense_problems()
        return
    for each in data_sets.set_names(data, name):
        problem = data_sets.load(data, name, each)
        given = {"solver": "nam", "time_limit": LIMIT}
        yield each, partial(qpsolvers.solve_problem, problem, **given)


def set_threads(number: int) -> None:
    """Set the number of threads of NumPy's and SciPy's BLAS."""
    for put, _ in settings():
        put(number)


def seconds(solve: Callable[[], Any], threads: int, guarded: bool) -> float:
    """Return the time of one solve."""
    set_threads(threads)
    nothing_to_set = mock.patch.object(namlcp.linalg.threads, "settings", list)
    with contextlib.nullcontext() if guarded else nothing_to_set:
        start = time.perf_counter()
        solve()
        return time.perf_counter() - start


def compare(solve: Callable[[], Any]) -> dict[str, float]:
    """Return the lower quartiles of some rounds, each with every setting in turn."""
    solve()  # load or compile
    kinds = {"one": (1, True), "two": (2, True), "unguarded_two": (2, False)}
    times: dict[str, list[float]] = {kind: [] for kind in kinds}
    while sum(times["one"]) < LEAST or len(times["one"]) < REPEATS:
        for kind, (threads, guarded) in kinds.items():
            times[kind].append(seconds(solve, threads, guarded))
        if sum(times["unguarded_two"]) > LIMIT:
            break
    row = {kind: float(np.quantile(values, 0.25)) for kind, values in times.items()}
    row["ratio"] = row["two"] / row["one"]
    row["unguarded"] = row["unguarded_two"] / row["one"]
    return row


def compute_for_ever() -> None:
    """Keep a core busy."""
    x = np.ones(1000)
    while True:
        x = np.sin(x)


@contextlib.contextmanager
def busy(wanted: bool) -> Iterator[None]:
    """Let another process compute on each core meanwhile."""
    others = [
        multiprocessing.Process(target=compute_for_ever, daemon=True)
        for _ in range(os.cpu_count() or 1 if wanted else 0)
    ]
    for other in others:
        other.start()
    try:
        yield
    finally:
        for other in others:
            other.terminate()


def main(arguments: list[str] | None = None) -> int:
    """Run the sets and print a line for each."""
    parser = cli.parser(__doc__, "csv", data=...)
    parser.add_argument("--sets", nargs="+", choices=SETS, default=SETS)
    parser.add_argument("--busy", action="store_true")
    options = parser.parse_args(arguments)
    header = machine.lines(["nam"])
    with busy(options.busy), csv_files.writer(options.csv, header, COLUMNS) as write:
        for name in options.sets:
            rows = []
            for problem, solve in tasks(options.data, name):
                rows.append({"set": name, "problem": problem} | compare(solve))
                write(rows[-1])
            for kind in ("ratio", "unguarded"):
                values = [row[kind] for row in rows]
                mean = timing.geometric_mean(values)
                worst = max(rows, key=lambda row: row[kind])
                print(
                    f"{name:<10}{kind:<12}mean {mean:5.2f}   most {worst[kind]:5.2f} "
                    f"({worst['problem']})",
                    flush=True,
                )
    return 0


if __name__ == "__main__":
    sys.exit(main())
