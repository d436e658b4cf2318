"""What people model in CVXPY, solved with NAM beside OSQP and Clarabel.

Each model (`problems.models`) at two sizes. The objective is
compared with Clarabel's, at its tightest tolerances unless it fails there. Residuals
are computed on the data that CVXPY hands over, min 1/2 x'Px + q'x, Ax = b, Fx <= g,
from the point and the multipliers that the solver's interface hands back:

- primal: largest violation over max(1, |Ax|, |b|, |Fx|, |g|);
- dual: largest |Px + q + A'y + F'z| or wrong sign over max(1, |Px|, |q|, |A'y|, |F'z|);
- complementarity: largest |z_i (g - Fx)_i|, and the duality gap, over max(1, x'Px, q'x,
  b'y, g'z);
- proof, of an infeasible problem: largest |A'y + F'z| or wrong sign over -(b'y + g'z);
  of an unbounded one: largest |Px|, |Ax| or (Fx)_i > 0 over -q'x, for the ray x.

The time is the median of repeated calls of CVXPY's solve_via_data, without its
compilation and without a warm start: processor time, on one thread.
"""

import sys

from validation.applications.cvxpy_bench import (
    REFERENCE,
    RESIDUALS,
    SOLVERS,
    conclude,
    work,
)
from validation.harness import Row, cli, csv_files, processes, tables

SHOWN = (
    "problem:24 set:6 solver success:8 status:18 runtime iterations form "
    + " ".join([*RESIDUALS, "proof"])
)
DEFAULT = ["nam", "osqp", "clarabel", REFERENCE]
COLUMNS = (
    "problem set solver variables equalities inequalities compile runtime cold status "
    "expected success objective objective_error against primal_residual dual_residual "
    "complementarity proof iterations form message"
).split()


def print_wrong(rows: list[Row]) -> None:
    """Print what each solver has wrong."""
    print("\nwho is wrong, by the status that is known and the residuals:")
    for solver in tables.distinct(rows, "solver"):
        wrong = tables.chosen(rows, solver=solver, success=False)
        text = "; ".join(verdict(row) for row in wrong)
        print(f"{solver}: {text or 'nothing'}")


def markdown(rows: list[Row]) -> str:
    """Return the table of sizes and solvers: what is right, and times."""
    lines = [
        (size, *cells)
        for size in tables.distinct(rows, "set")
        for cells in tables.compared(tables.chosen(rows, set=size))
    ]
    return tables.markdown(("size", *tables.compared_columns()), lines)


def print_table(rows: list[Row]) -> None:
    """Print time and worst error of the solvers side by side, in Markdown."""
    heads = ["model", "size", "n"]
    heads += [f"{solver} [ms], error" for solver in tables.distinct(rows, "solver")]
    lines = []
    for size, name in tables.distinct(rows, "set", "problem"):
        found = tables.chosen(rows, set=size, problem=name)
        n = next((r["variables"] for r in found if "variables" in r), "")
        lines.append([name, size, n, *map(cell, found)])
    print("\n" + tables.markdown(heads, lines))


def cell(row: Row) -> str:
    """Return time and worst error of a solve, or what it said instead."""
    if row["status"] != row["expected"]:
        return row["status"]
    errors = [row.get(name) for name in [*RESIDUALS, "proof"]]
    known = [error for error in errors if error is not None]
    error = f", {max(known):.0e}" if known else ""
    runtime = f"{1e3 * row['runtime']:.3g}" if "runtime" in row else ""
    return runtime + error or "right"


def verdict(row: Row) -> str:
    """Return in words what is wrong with an answer."""
    place = f"{row['problem']} {row['set']}"
    if row["status"] != row["expected"]:
        return f"{place} ({row['status']}, is {row['expected']})"
    errors = {name: row.get(name) or 0.0 for name in RESIDUALS}
    most = max(errors, key=lambda name: errors[name])
    return f"{place} ({most.replace('_', ' ')} {errors[most]:.0e})"


def main(arguments: list[str] | None = None) -> int:
    """Run the models; return the number of NAM's failures, at most 100."""
    parser = cli.parser(__doc__, "csv", limit=60.0)
    parser.add_argument("--models", nargs="+", help="names; all without")
    parser.add_argument("--size", nargs="+", choices=["small", "large"])
    parser.add_argument("--solvers", nargs="+", choices=SOLVERS, default=DEFAULT)
    args = parser.parse_args(arguments)
    from validation.problems.models import MODELS

    header = cli.begin(["nam", "cvxpy", "osqp", "clarabel"])
    rows: list[Row] = []
    with (
        processes.benches(work, args.solvers, args.limit) as children,
        csv_files.writer(args.csv, header, COLUMNS) as write,
    ):
        for size in args.size or ["small", "large"]:
            for name in args.models or MODELS:
                found = [c.run(size, name, 0.0) for c in children.values()]
                conclude(found, MODELS[name].expected)
                for row in found:
                    tables.print_row(row, SHOWN)
                    write(row)
                rows += found
    print_table(rows)
    print("\n" + markdown(rows))
    print_wrong(rows)
    return min(100, len(tables.chosen(rows, solver="nam", success=False)))


if __name__ == "__main__":
    sys.exit(main())
