"""Success and time of solver="nam" beside its peers, through qpsolvers.

A problem counts as solved when the solver says so and primal residual, dual residual
and duality gap (qpsolvers' own functions) and the wrong-signed part of the multipliers
are all at most eps, within the time limit. The time is the median of repeated calls of
qpsolvers.solve_problem, with eps_abs = eps and eps_rel = 0, on one thread, after a
tiny problem of the same kind; the first call is kept as `cold`.
"""

import sys
from pathlib import Path

from validation.harness import cli, machine, qp_solvers
from validation.peers.runs import print_tables, read_rows, run_all
from validation.problems import data_sets


@cli.needs_data
def main(arguments: list[str] | None = None) -> int:
    """Run the benchmark."""
    solvers = list(qp_solvers.SOLVERS)
    parser = cli.parser(
        __doc__, "limit", "csv", "go-on", data=..., eps=[1e-6, 1e-9], solvers=solvers
    )
    parser.add_argument(
        "--set", nargs="+", choices=data_sets.SETS, default=["mpc", "contact", "small"]
    )
    parser.add_argument("--also", type=Path, help="tabulate rows of an earlier --csv")
    args = parser.parse_args(arguments)
    names = {each: data_sets.set_names(args.data, each) for each in args.set}
    solvers = machine.installed(args.solvers)
    rows = read_rows(args.also) if args.also else []
    rows = [row for row in rows if row["solver"] not in solvers]
    print_tables(rows + run_all(names, solvers, args))
    return 0


if __name__ == "__main__":
    sys.exit(main())
