"""The whole Maros-Meszaros set: success, time and accuracy beside the peers.

`run` measures as benchmark does, one problem after the other with every solver in
turn, and writes a row at once; it goes on where an earlier run of the same file has
stopped. With a larger --limit only what was late under the smaller one is run again.
`table` prints the tables of every limit in Markdown.

The shifted geometric mean is qpbenchmark's: exp(mean(log(t + 10 s))) - 10 s over all
problems, with the time limit for t where a problem is not solved.
"""

import argparse
import sys
from collections import Counter
from itertools import pairwise
from pathlib import Path

import numpy as np

from validation.harness import (
    LATE,
    Row,
    cli,
    csv_files,
    judging,
    machine,
    processes,
    tables,
    timing,
)
from validation.peers.runs import (
    COLUMNS,
    failure_text,
    late_ones,
    measure,
    read_rows,
    run_problem,
)
from validation.problems import data_sets

PEERS = ["nam", "piqp", "clarabel", "proxqp", "osqp"]
TOLERANCES = [1e-3, 1e-6, 1e-9]
SUMMARY = (
    "solver,solved,shifted mean [s],over the best,nam/solver (both),median error,wrong"
).split(",")
SHIFT = 10.0  # [s]
WRONG = 10.0  # a "found" with a residual above so many tolerances is a lie
CLASSES = (0.0, 1e-3, 1e-2, 1e-1, np.inf)  # [s] of the peer's time
SUBSETS = {
    "all": lambda row: True,
    "strictly convex": lambda row: row["def"] == "pd",
    "dense": lambda row: row["subset"] == "dense_subset",
    "sparse": lambda row: row["subset"] == "sparse_subset",
}
"""Which rows of index.csv belong to a subset."""


def read_results(file: Path) -> list[Row]:
    """Return the rows written so far, with numbers for limits and residuals."""
    rows = read_rows(file)
    for row in rows:
        row["limit"], row["found"] = float(row["limit"]), row["found"] == "True"
        for name in judging.RESIDUALS:
            row[name] = float(row[name] or "nan")
    return rows


def run(args: argparse.Namespace) -> None:
    """Measure what the CSV file does not have yet."""
    solvers = machine.installed(args.solvers)
    known = read_results(args.csv)
    done = {
        (row["problem"], row["solver"], row["eps"])
        for row in known
        if row["limit"] == args.limit
        or (row["limit"] < args.limit and row["status"] not in LATE)
    }
    enough = [row for row in known if row["limit"] >= args.limit]
    slow = {solver: late_ones(enough, "all", solver) for solver in solvers}
    names = args.only or data_sets.set_names(args.data, "all")
    header = cli.begin(machine.installed(PEERS))  # others may come into the file later
    with (
        csv_files.writer(args.csv, header, ["limit", *COLUMNS], append=True) as write,
        processes.benches(measure, solvers, args.limit, args.data) as children,
    ):
        for eps in sorted(args.eps, reverse=True):
            for name in names:
                for solver, child in children.items():
                    if (name, solver, eps) in done:
                        continue
                    row = run_problem(child, "all", name, eps, slow[solver])
                    write(row | {"limit": args.limit})


def at_limit(rows: list[Row], limit: float) -> list[Row]:
    """Return, of each run, the row under the largest limit up to this one."""
    last: dict[tuple[str, str, float], Row] = {}
    for row in sorted(rows, key=lambda row: row["limit"]):
        if row["limit"] <= limit:
            last[row["problem"], row["solver"], row["eps"]] = row
    return list(last.values())


def shifted_mean(rows: list[Row], limit: float) -> float:
    """Return the shifted geometric mean of the times [s]."""
    times = [row["runtime"] if row["success"] else limit for row in rows]
    return float(np.exp(np.mean(np.log(np.array(times) + SHIFT))) - SHIFT)


def worst_residual(row: Row) -> float:
    """Return the largest of the residuals and wrong-signed multipliers."""
    return max(row[name] for name in judging.RESIDUALS)


def is_wrong(row: Row) -> bool:
    """Tell whether a solver says found and misses its tolerance tenfold."""
    return bool(row["found"]) and not worst_residual(row) <= WRONG * row["eps"]


def by_solver(rows: list[Row]) -> dict[str, list[Row]]:
    """Return the rows of each solver, the largest number of successes first."""
    groups = {s: tables.chosen(rows, solver=s) for s in tables.distinct(rows, "solver")}
    count = {s: sum(row["success"] for row in own) for s, own in groups.items()}
    return {s: groups[s] for s in sorted(groups, key=lambda s: (-count[s], s))}


def common(ours: list[Row], theirs: list[Row]) -> list[tuple[float, float]]:
    """Return the pairs of times on problems that both solve."""
    times = {row["problem"]: row["runtime"] for row in theirs if row["success"]}
    return [
        (row["runtime"], times[row["problem"]])
        for row in ours
        if row["success"] and row["problem"] in times
    ]


def summary(rows: list[Row], limit: float, total: int) -> list[list[str]]:
    """Return the lines of the table of one subset at one tolerance."""
    groups = by_solver(rows)
    means = {solver: shifted_mean(own, limit) for solver, own in groups.items()}
    lines = []
    for solver, own in groups.items():
        solved = [row for row in own if row["success"]]
        pairs = common(groups.get("nam", []), own)
        ratio = timing.geometric_mean([ours / theirs for ours, theirs in pairs])
        error = np.median([worst_residual(row) for row in solved]) if solved else np.nan
        lines.append(
            [
                solver,
                f"{len(solved)}/{total}" + ("" if len(own) == total else "?"),
                f"{means[solver]:.3f}",
                f"{means[solver] / min(means.values()):.1f}",
                f"{ratio:.2f} ({len(pairs)})" if pairs and solver != "nam" else "",
                f"{error:.0e}",
                str(sum(is_wrong(row) for row in own)),
            ]
        )
    return lines


def markdown(rows: list[Row], limit: float = SHIFT) -> str:
    """Return the tables of the whole collection, and what namlcp misses."""
    known, total = at_limit(rows, limit), len(tables.distinct(rows, "problem"))
    lines, missed = [], []
    for eps in sorted(tables.distinct(known, "eps"), reverse=True):
        own, name = tables.chosen(known, eps=eps), tables.power_of_ten(eps)
        lines += [[name, *line] for line in summary(own, limit, total)]
        missed.append(f"Missed by namlcp at {name}: {failures(own)}.")
    every = tables.markdown(("eps", *SUMMARY), lines)
    return "\n\n".join([every, by_time(tables.chosen(known, eps=1e-6)), *missed])


def by_time(rows: list[Row], peer: str = "piqp") -> str:
    """Return the table of our time over a peer's, by the peer's time."""
    groups = by_solver(rows)
    pairs = common(groups.get("nam", []), groups.get(peer, []))
    lines = []
    for low, high in pairwise(CLASSES):
        own = [ours / theirs for ours, theirs in pairs if low <= theirs < high]
        if own:
            text, mean = f"{1e3 * low:g} to {1e3 * high:g}", timing.geometric_mean(own)
            lines.append([text, str(len(own)), f"{mean:.2f}", f"{max(own):.1f}"])
    columns = [f"{peer} [ms]", "problems", f"nam/{peer}", "largest"]
    return tables.markdown(columns, lines)


def failures(rows: list[Row]) -> str:
    """Return the problems that we miss, each with its reason."""
    failed = tables.chosen(rows, solver="nam", success=False)
    return "; ".join(failure_text(row) for row in failed)


def print_failures(rows: list[Row]) -> None:
    """Print what we miss, what is wrong, and the forms that solved it."""
    print(f"\nnam fails: {failures(rows)}")
    wrong = [row for row in rows if is_wrong(row)]
    if wrong:
        names = (f"{row['solver']} {row['problem']}" for row in wrong)
        print("\nfound, but tenfold off: " + "; ".join(names))
    solved = tables.chosen(rows, solver="nam", success=True)
    forms = Counter(row["form"] for row in solved)
    parts = (f"{form} {count}" for form, count in forms.most_common())
    print("\nforms that solved it: " + ", ".join(parts))


def print_tables(data: Path, rows: list[Row]) -> None:
    """Print all tables, limit by limit and tolerance by tolerance."""
    index = data_sets.maros_index(data, "all")
    for limit in sorted({row["limit"] for row in rows}):
        known = at_limit(rows, limit)
        for eps in sorted({row["eps"] for row in known}, reverse=True):
            for subset, belongs in SUBSETS.items():
                names = {name for name, row in index.items() if belongs(row)}
                own = [r for r in known if r["eps"] == eps and r["problem"] in names]
                print(f"\n{subset}, eps {eps:.0e}, {limit:g} s")
                lines = summary(own, limit, len(names))
                print("\n" + tables.markdown(SUMMARY, lines))
            own = tables.chosen(known, eps=eps)
            print("\n" + by_time(own))
            print_failures(own)


@cli.needs_data
def main(arguments: list[str] | None = None) -> int:
    """Run or tabulate."""
    parser = cli.parser(__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    for name in ("run", "table"):
        command = commands.add_parser(name)
        cli.add_usual(command, data=..., csv=..., solvers=PEERS)
        if name == "run":
            cli.add_usual(command, "limit", eps=TOLERANCES)
            command.add_argument("--only", nargs="+", help="names of problems")
    args = parser.parse_args(arguments)
    data_sets.set_names(args.data, "all")
    if args.command == "run":
        run(args)
    else:
        rows = read_results(args.csv)
        print_tables(args.data, [row for row in rows if row["solver"] in args.solvers])
    return 0


if __name__ == "__main__":
    sys.exit(main())
