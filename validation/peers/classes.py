"""Seven classes of sparse QPs after the OSQP paper: time over the best peer's.

Usage::

    python -m validation.peers.classes [--classes SVM ...] [--sizes 1 2 3 4]
        [--eps 1e-6] [--limit 10] [--solvers nam piqp ...]
        [--csv FILE] [--table]

The problems: `osqp_classes`, four sizes of each class, from 10^3 to 10^6 entries of P,
G and A. They are measured as in `benchmark`, one problem after the other with every
solver in turn: `runtime` is the median of calls on a problem that the solver has seen,
`cold` its first call there. A peer's time limit is ten times what namlcp took
(`runs.limit_beside`); what ran into the limit is not tried at a larger size of its
class. A run goes on where an earlier one with the same --csv has stopped; --table
prints the tables of that file and runs nothing.

Every problem has a solution. The claim: all solved, time over that of the best peer at
most 0.7 in the geometric mean and 1.3 at worst.
"""

import argparse
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np
from qpsolvers import Problem

from validation.harness import (
    LATE,
    Row,
    cli,
    csv_files,
    machine,
    processes,
    tables,
    timing,
)
from validation.peers.runs import (
    COLUMNS,
    KEY,
    failure_text,
    limit_beside,
    measure,
    read_rows,
)
from validation.problems import osqp_classes

SOLVERS = ["nam", "piqp", "clarabel", "osqp", "proxqp", "highs", "moreau", "qtqp"]
SIZES = range(1, len(osqp_classes.ENTRIES) + 1)


def load(_: Path, name: str, size: str) -> Problem:
    """Return the problem of a class and size."""
    return osqp_classes.generate(name, int(size))


def run(args: argparse.Namespace, known: list[Row]) -> Iterator[Row]:
    """Yield the rows that are not `known` yet, every solver in turn."""
    solvers = machine.installed(args.solvers)
    largest_first = sorted(known, key=lambda row: -int(row["problem"]))
    late = {(r["set"], r["solver"]): r for r in largest_first if r["status"] in LATE}
    work = partial(measure, load=load)
    columns = [*COLUMNS, "variables", "entries"]
    with (
        csv_files.growing(args.csv, cli.begin(solvers), columns, KEY) as file,
        processes.benches(work, solvers, args.limit) as children,
    ):
        for name in args.classes:
            sizes = osqp_classes.CLASSES[name].sizes
            for size in (sizes[k - 1] for k in sorted(args.sizes)):
                problem = osqp_classes.generate(name, size)
                sizes_of = {
                    "variables": problem.q.size,
                    "entries": osqp_classes.entries(problem),
                }
                for solver, child in children.items():
                    for eps in sorted(args.eps, reverse=True):
                        if file.has(name, size, solver, eps):
                            continue
                        if solver != "nam":
                            ours = own_times(file.rows, name, size, eps)
                            child.limit = limit_beside(ours, args.limit)
                        row = late.get((name, solver))
                        if row is None or int(row["problem"]) > size:
                            row = child.run(name, str(size), eps)
                        if row["status"] in LATE:
                            late[name, solver] = row
                        yield file.add(
                            row | {"problem": str(size), "eps": eps} | sizes_of
                        )


def own_times(rows: list[Row], name: str, size: int, eps: float) -> list[float]:
    """Return the time [s] that namlcp has taken, nothing if it has not solved."""
    own = tables.chosen(rows, set=name, problem=str(size), solver="nam")
    return [
        float(row["runtime"])
        for row in own
        if str(row["success"]) == "True" and float(row["eps"]) == eps
    ]


def compared(rows: list[Row]) -> list[Row]:
    """Return, problem by problem, nam's time, the best peer's, and their ratio."""
    found = []
    for name, size, eps in tables.distinct(rows, "set", "problem", "eps"):
        own = tables.chosen(rows, set=name, problem=size, eps=eps)
        times = {row["solver"]: row["runtime"] for row in own if row["success"]}
        line = {"set": name, "problem": size, "eps": eps, "entries": own[0]["entries"]}
        line["nam"] = times.pop("nam", np.nan)
        line["peer"] = min(times, key=times.__getitem__, default="")
        line["best"] = times.get(line["peer"], np.nan)
        line["ratio"] = line["nam"] / line["best"]
        found.append(line)
    return found


def milliseconds(seconds: float) -> str:
    """Return a time in milliseconds with three digits, "-" of none."""
    return "-" if np.isnan(seconds) else tables.short(1e3 * seconds)


def of_problems(lines: list[Row]) -> str:
    """Return the table of all problems: entries, nam's time, the best peer's, ratio."""
    columns = "class", "size", "entries", "nam [ms]", "best peer", "[ms]", "nam/best"
    cells = (
        (
            line["set"],
            f"{line['problem']} {osqp_classes.CLASSES[line['set']].unit}",
            line["entries"],
            milliseconds(line["nam"]),
            line["peer"] or "none",
            milliseconds(line["best"]),
            "-" if np.isnan(line["ratio"]) else f"{line['ratio']:.2f}",
        )
        for line in lines
    )
    return tables.markdown(columns, cells)


def markdown(rows: list[Row]) -> str:
    """Return the table of all problems by class and size, at the first tolerance."""
    lines = compared(tables.chosen(rows, eps=rows[0]["eps"]))
    by_size = sorted(lines, key=lambda line: float(line["entries"]))
    return of_problems(sorted(by_size, key=lambda line: str(line["set"])))


def print_claim(rows: list[Row], lines: list[Row]) -> None:
    """Print the figures of the claim, class by class too, and what nam fails."""
    own = tables.chosen(rows, solver="nam")
    ratios = {
        name: [line["ratio"] for line in lines if line["set"] == name]
        for name in tables.distinct(lines, "set")
    }
    known = {name: [r for r in each if r == r] for name, each in ratios.items()}
    means = (
        f"{name} {timing.geometric_mean(each):.2f}"
        for name, each in known.items()
        if each
    )
    every = [ratio for each in known.values() for ratio in each]
    if every:
        print(
            f"\nnam over the best peer: {timing.geometric_mean(every):.2f} in the "
            f"geometric mean of {len(every)}, {max(every):.2f} at worst\n"
            + ", ".join(means)
        )
    print(f"solved: {sum(row['success'] for row in own)} of {len(own)}")
    failed = tables.chosen(own, success=False)
    if failed:
        texts = (f"{row['set']} {failure_text(row)}" for row in failed)
        print("nam fails: " + "; ".join(texts))


def print_tables(rows: list[Row]) -> None:
    """Print the tables of every tolerance."""
    for eps in tables.distinct(rows, "eps"):
        own = tables.chosen(rows, eps=eps)
        lines = compared(own)
        print(f"\neps {eps:.0e}")
        print("\n" + of_problems(lines))
        print("\n" + tables.markdown(tables.compared_columns(), tables.compared(own)))
        print_claim(own, lines)


def main(arguments: list[str] | None = None) -> int:
    """Run, or print the tables of an earlier run."""
    parser = cli.parser(__doc__, "limit", "csv", eps=[1e-6], solvers=SOLVERS)
    known = list(osqp_classes.CLASSES)
    parser.add_argument("--classes", nargs="+", choices=known, default=known)
    parser.add_argument(
        "--sizes", nargs="+", type=int, choices=SIZES, default=list(SIZES)
    )
    parser.add_argument("--table", action="store_true", help="run nothing")
    args = parser.parse_args(arguments)
    rows = read_rows(args.csv) if args.csv else []
    if not args.table:
        rows += run(args, rows)
    print_tables(rows)
    return 0


if __name__ == "__main__":
    sys.exit(main())
