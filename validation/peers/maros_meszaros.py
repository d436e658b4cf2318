"""The whole Maros-Meszaros set: success, time and accuracy beside the peers.

Measured as in `benchmark`, one problem after the other with every solver in turn.

The shifted geometric mean is qpbenchmark's: exp(mean(log(t + 10 s))) - 10 s over all
problems, with the time limit for t where a problem is not solved.
"""

import sys
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import numpy as np

from validation.harness import Row, csv_files, judging, tables, timing
from validation.harness.suite import Args, Late, Suite
from validation.peers import runs
from validation.peers.runs import failure_text
from validation.problems import data_sets

LIMIT = 10.0  # [s]
SUMMARY = (
    "solver,solved,shifted mean [s],over the best,nam/solver (both),median error,wrong"
).split(",")
SHIFT = 10.0  # [s]
WRONG = 10.0  # a "found" with a residual above so many tolerances is a lie
CLASSES = (0.0, 1e-3, 1e-2, 1e-1, np.inf)  # [s] of the peer's time


def requests(args: Args) -> Iterator[Row]:
    """Yield all problems at the loosest tolerance, then at the next."""
    names = data_sets.set_names(args.data, "all")[:: 10 if args.quick else 1]
    for eps in sorted(args.eps, reverse=True):
        for name in names:
            key = {"limit": args.limit, "set": "all", "problem": name, "eps": eps}
            yield from (key | {"solver": solver} for solver in args.solvers)


def read_results(file: Path) -> list[Row]:
    """Return the rows under LIMIT, with numbers for limits and residuals."""
    columns = ("limit", *judging.RESIDUALS)
    rows = [csv_files.with_numbers(row, columns) for row in runs.read_rows(file)]
    for row in rows:
        row["found"] = row["found"] == "True"
    return [row for row in rows if row["limit"] == LIMIT]


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


def markdown(rows: list[Row]) -> str:
    """Return the tables of the whole collection, and what namlcp misses."""
    lines, missed = [], []
    for eps in sorted(tables.distinct(rows, "eps"), reverse=True):
        own, name = tables.chosen(rows, eps=eps), tables.power_of_ten(eps)
        total = len(tables.distinct(own, "problem"))
        lines += [[name, *line] for line in summary(own, LIMIT, total)]
        missed.append(f"Missed by namlcp at {name}: {failures(own)}.")
    every = tables.markdown(("eps", *SUMMARY), lines)
    return "\n\n".join([every, by_time(tables.chosen(rows, eps=1e-6)), *missed])


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


SUITE = Suite(
    name="maros-meszaros",
    doc=__doc__,
    requests=requests,
    work=runs.measure,
    columns=f"limit {runs.COLUMNS}",
    solvers=("nam", "piqp", "clarabel", "proxqp", "osqp"),
    tolerances=(1e-3, 1e-6, 1e-9),
    limit=LIMIT,
    late=Late(),
    needs_data=True,
    read=read_results,
    table=markdown,
)
main = SUITE.main

if __name__ == "__main__":
    sys.exit(main())
