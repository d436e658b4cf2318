"""Success on problems that the constants of the path were not tuned on.

Two kinds of problems, judged and timed as in `benchmark`:

- families: random QPs around a planted primal-dual solution, so that every one of them
  can be solved. For a seed, the size comes from the seed as well.
- changes: Maros-Meszaros problems with their data changed. noise: every stored number
  times 1 + 1e-3 N(0, 1), where P becomes D P D so that it stays convex, and equal rows
  and pinned variables stay consistent only by chance; rows, columns: scaled by
  10^U(-3, 3), the same problem in other units; plain: unchanged, to compare with. The
  noise can make a problem infeasible: what is called so is asked of HiGHS (an LP
  without cost) and left out of the count if it agrees.
"""

import sys
from functools import partial
from pathlib import Path

import numpy as np
from qpsolvers import Problem

from validation.harness import MissingDataError, Row, cli, machine
from validation.peers.runs import measure, print_tables, run_all
from validation.problems import data_sets, infeasible_cases, planted


def load(data: Path, kind: str, name: str) -> Problem:
    """Return the problem of a family and seed, or a changed Maros-Meszaros problem."""
    if kind in planted.FAMILIES:
        return planted.FAMILIES[kind](np.random.default_rng(int(name)))
    seed = int.from_bytes(name.encode(), "big") % 2**32  # the same in every run
    problem = data_sets.maros_problem(data, name, dense=False)
    return planted.CHANGES[kind](problem, np.random.default_rng(seed))


def excuse(row: Row, data: Path) -> Row:
    """Count it as a success to call infeasible what HiGHS calls infeasible too."""
    if row["set"] == "noise" and "infeasible" in row["status"]:
        problem = load(data, row["set"], row["problem"])
        if infeasible_cases.is_feasible(problem) is False:
            row |= {"success": True, "status": "infeasible, as HiGHS says"}
    return row


def main(arguments: list[str] | None = None) -> int:
    """Run the families and the changed problems; return 2 if the data are missing."""
    parser = cli.parser(
        __doc__, "data", "limit", "csv", "go-on", eps=[1e-6],
        solvers=["nam", "piqp", "clarabel"],
    )  # fmt: skip
    kinds = {"--families": planted.FAMILIES, "--changes": planted.CHANGES}
    for option, known in kinds.items():
        parser.add_argument(option, nargs="*", choices=list(known), default=list(known))
    parser.add_argument("--problems", nargs="+", help="change these, not all 137")
    parser.add_argument("--seeds", type=int, default=40, help="problems of a family")
    args = parser.parse_args(arguments)
    seeds = [str(seed) for seed in range(args.seeds)]
    names = dict.fromkeys(args.families, seeds)
    missing = False
    if args.changes:
        try:
            maros = data_sets.set_names(args.data or Path("data"), "all")
            names |= dict.fromkeys(args.changes, args.problems or maros)
        except MissingDataError as error:
            print(f"{error}: the changed Maros-Meszaros problems are left out")
            missing = True
    rows = run_all(
        names,
        machine.installed(args.solvers),
        args,
        partial(measure, load=load),
        partial(excuse, data=args.data),
    )
    print_tables(rows)
    return cli.MISSING if missing else 0


if __name__ == "__main__":
    sys.exit(main())
