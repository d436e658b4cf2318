"""The whole Maros-Meszaros set: success, time and accuracy beside the peers.

Measured as in `benchmark`, one problem after the other with every solver in turn.

The shifted geometric mean is qpbenchmark's: exp(mean(log(t + 10 s))) - 10 s over all
problems, with the time limit for t where a problem is not solved.
"""

import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from validation.harness import Row, csv_files, judging, tables
from validation.harness.suite import Args, Late, Suite
from validation.peers import runs
from validation.peers.runs import failure_text
from validation.problems import data_sets

LIMIT = 10.0  # [s]
SUMMARY = ("solver,solved,shifted mean [s],nam/solver (both),median error,wrong").split(
    ","
)
SHIFT = 10.0  # [s]
WRONG = 10.0  # a "found" with a residual above so many tolerances is a lie


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


def markdown(rows: list[Row]) -> str:
    """Return the table of the whole collection, and what namlcp misses."""
    lines, missed = [], []
    for eps in sorted(tables.distinct(rows, "eps"), reverse=True):
        own = tables.chosen(rows, eps=eps)
        every = sorted(own, key=lambda row: row["solver"] != "nam")
        name = tables.power_of_ten(eps)
        for solver, solved, _, ratio in tables.compared(every):
            own = tables.chosen(every, solver=solver)
            errors = [worst_residual(row) for row in own if row["success"]]
            wrong = sum(
                row["found"] and not worst_residual(row) <= WRONG * eps for row in own
            )
            error = f"{np.median(errors):.0e}" if errors else ""
            mean = f"{shifted_mean(own, LIMIT):.3f}"
            lines.append((name, solver, solved, mean, ratio, error, wrong))
        failed = tables.chosen(every, solver="nam", success=False)
        texts = "; ".join(failure_text(row) for row in failed)
        missed.append(f"Missed by namlcp at {name}: {texts}.")
    return "\n\n".join([tables.markdown(("eps", *SUMMARY), lines), *missed])


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
