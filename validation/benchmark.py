"""Success and time of solver="nam" beside its peers, through qpsolvers.

Usage::

    python validation/benchmark.py --data DIR [--set mpc contact small strict all]
        [--eps 1e-6 1e-9] [--solvers nam piqp ...] [--csv FILE]

A problem counts as solved when the solver says so and primal residual, dual residual
and duality gap (qpsolvers' own functions) and the wrong-signed part of the multipliers
are all at most eps, within the time limit. The time is the median of repeated calls of
qpsolvers.solve_problem, with eps_abs = eps and eps_rel = 0, on one thread, after a
tiny problem of the same kind; the first call is kept as `cold`.
"""

import argparse
import contextlib
import csv
import datetime
import importlib.metadata
import importlib.util
import os
import platform
import sys
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any, Literal

import numpy as np
import qpsolvers

import problems
from measure import Bench, bench
from settings import SOLVERS

COLUMNS = (
    "problem set solver eps runtime cold found primal_residual dual_residual "
    "duality_gap sign_violation success status iterations form"
).split()
RESIDUALS = COLUMNS[7:11]
PACKAGES = {"nam": "namlcp", "proxqp": "proxsuite", "highs": "highspy"}
LATE = {"timeout", "too slow"}  # what a row says that ran into the time limit
THREADS = ("OMP", "OPENBLAS", "MKL", "NUMEXPR", "RAYON")  # numba has its own: threads=
Row = dict[str, Any]


def machine_lines(solvers: Iterable[str]) -> list[str]:
    """Return what the figures depend on: machine, threads, versions, date."""
    packages = ["numpy", "scipy", "numba", "qdldl", "qpsolvers"]
    packages += [PACKAGES.get(solver, solver) for solver in solvers]
    versions = [f"{name} {package_version(name)}" for name in packages]
    return [
        f"date: {datetime.date.today()}",
        f"cpu: {cpu_name()}, {os.cpu_count()} cores, 1 thread used",
        f"python: {platform.python_version()} on {platform.system()}",
        f"versions: {', '.join(versions)}",
    ]


@contextlib.contextmanager
def csv_writer(
    path: Path | None,
    header: list[str],
    columns: list[str],
    extras: Literal["raise", "ignore"] = "raise",
    *,
    append: bool = False,
) -> Iterator[Callable[[Row], None]]:
    """Yield a function that writes a row at once, below the lines of the header.

    Without a path nothing is written; extras="ignore" leaves out other columns;
    append=True goes on with a file that is there.
    """
    goes_on = append and path is not None and path.exists()
    with open(path or os.devnull, "a" if goes_on else "w", newline="") as file:
        writer = csv.DictWriter(
            file, columns, restval="", extrasaction=extras, lineterminator="\n"
        )
        if not goes_on:
            file.writelines(f"# {line}\n" for line in header)
            writer.writeheader()

        def write(row: Row) -> None:
            writer.writerow(row)
            file.flush()

        yield write


def package_version(name: str) -> str:
    """Return the version of an installed package, else of its source tree."""
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return "(source)"


def cpu_name() -> str:
    """Return the name of the processor."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.exists() else []
    names = [line.split(":")[1].strip() for line in lines if "model name" in line]
    return names[0] if names else platform.processor()


def use_one_thread() -> None:
    """Let the child processes, which inherit the environment, use one thread."""
    for library in THREADS:
        os.environ[f"{library}_NUM_THREADS"] = "1"


def installed(solvers: Iterable[str]) -> list[str]:
    """Return the solvers that can run here; name the others."""
    found = []
    for solver in solvers:
        here = solver in qpsolvers.available_solvers
        if solver == "nam":
            here = importlib.util.find_spec("namlcp") is not None
        if here:
            found.append(solver)
        else:
            print(f"{solver}: not installed, left out")
    return found


def run_set(
    data: Path,
    problem_set: str,
    solver: str,
    tolerances: list[float],
    limit: float,
    names: list[str] | None = None,
    kind: type[Bench] = Bench,
) -> Iterable[Row]:
    """Yield the rows of one solver on one set, loose tolerances first.

    What ran into the time limit is not tried at a tighter tolerance. `kind` is where
    problems other than those of `problems` come from, `names` are theirs.
    """
    if names is None:
        names = problems.set_names(data, problem_set)
    slow: dict[str, Row] = {}
    with bench(data, solver, limit, kind) as child:
        for eps in sorted(tolerances, reverse=True):
            for name in names:
                yield run_problem(child, problem_set, name, eps, slow)


def run_problem(
    child: Bench, problem_set: str, name: str, eps: float, slow: dict[str, Row]
) -> Row:
    """Return the row of one problem; `slow` holds those that ran into the limit.

    They are not tried again, and what runs into it now is added.
    """
    if name in slow:
        return slow[name] | {"eps": eps}
    row = child.run(problem_set, name, eps)
    if row["status"] in LATE:
        slow[name] = row
    return row


def geometric_mean(values: list[float]) -> float:
    """Return the geometric mean, NaN of nothing."""
    return float(np.exp(np.mean(np.log(values)))) if values else np.nan


def print_table(rows: list[Row], reference: str) -> None:
    """Print success, time and failures of all solvers on one set at one tolerance."""
    solvers = list(dict.fromkeys(row["solver"] for row in rows))
    times = {
        solver: {
            row["problem"]: row["runtime"]
            for row in rows
            if row["solver"] == solver and row["success"]
        }
        for solver in solvers
    }
    total = len({row["problem"] for row in rows})
    print(f"\nset {rows[0]['set']}, eps {rows[0]['eps']:.0e}: {total} problems")
    print(f"{'solver':<10}{'solved':>9}{'time [ms]':>12}{reference + '/solver':>14}")
    base = times.get(reference, {})
    for solver, own in times.items():
        mean = 1e3 * geometric_mean(list(own.values()))
        ratios = [base[name] / own[name] for name in own if name in base]
        ratio = f"{geometric_mean(ratios):.2f} ({len(ratios)})" if ratios else "-"
        print(f"{solver:<10}{f'{len(own)}/{total}':>9}{mean:>12.3f}{ratio:>14}")
    for solver in solvers:
        failed = [r for r in rows if r["solver"] == solver and not r["success"]]
        if failed:
            print(f"{solver} fails: " + "; ".join(failure_text(row) for row in failed))


def failure_text(row: Row) -> str:
    """Return the name of a problem and what went wrong with it."""
    errors = {name: float(row.get(name) or 0.0) for name in RESIDUALS}
    if row["status"] != "inaccurate":
        return f"{row['problem']} ({row['status']})"
    worst = max(errors, key=lambda name: np.nan_to_num(errors[name], nan=np.inf))
    return f"{row['problem']} ({worst.replace('_', ' ')} {errors[worst]:.1e})"


def print_tables(rows: list[Row], reference: str = "nam") -> None:
    """Print one table for each set and tolerance, in the order of the rows."""
    for key in dict.fromkeys((row["set"], row["eps"]) for row in rows):
        print_table([r for r in rows if (r["set"], r["eps"]) == key], reference)


def header_lines(file: Path) -> list[str]:
    """Return what the first lines of a CSV file say of the run."""
    lines = file.read_text().splitlines()
    return [line[2:].strip() for line in lines if line[:2] == "# "]


def read_csv(file: Path) -> list[dict[str, str]]:
    """Return the rows of a CSV file whose first lines start with #."""
    with file.open(newline="") as stream:
        return list(csv.DictReader(line for line in stream if line[0] != "#"))


def read_rows(file: Path) -> list[Row]:
    """Return the rows that an earlier run has written."""
    rows: list[Row] = list(read_csv(file))
    for row in rows:
        row["eps"], row["success"] = float(row["eps"]), row["success"] == "True"
        row["runtime"] = float(row["runtime"] or "nan")
    return rows


def parse_arguments(arguments: list[str] | None) -> argparse.Namespace:
    """Return the command line, checked."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, required=True, help="the data folder")
    parser.add_argument(
        "--set", nargs="+", choices=problems.SETS, default=["mpc", "contact", "small"]
    )
    parser.add_argument("--eps", nargs="+", type=float, default=[1e-6, 1e-9])
    parser.add_argument("--solvers", nargs="+", default=list(SOLVERS))
    parser.add_argument("--limit", type=float, default=10.0, help="[s] a problem")
    parser.add_argument("--csv", type=Path, help="write all rows to this file")
    parser.add_argument("--also", type=Path, help="tabulate rows of an earlier --csv")
    return parser.parse_args(arguments)


def main(arguments: list[str] | None = None) -> int:
    """Run the benchmark; return 2 if the data folder lacks something."""
    args = parse_arguments(arguments)
    use_one_thread()
    try:
        for problem_set in args.set:
            problems.set_names(args.data, problem_set)
    except problems.MissingDataError as error:
        print(f"{error}; --data must be a folder with the sets {args.set}")
        return 2
    solvers = installed(args.solvers)
    header = machine_lines(solvers)
    print("\n".join(header))
    rows = read_rows(args.also) if args.also else []
    rows = [row for row in rows if row["solver"] not in solvers]
    with csv_writer(args.csv, header, COLUMNS) as write:
        for problem_set in args.set:
            for solver in solvers:
                for row in run_set(
                    args.data, problem_set, solver, args.eps, args.limit
                ):
                    write(row)
                    rows.append(row)
    print_tables(rows)
    return 0


if __name__ == "__main__":
    sys.exit(main())
