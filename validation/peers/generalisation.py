"""Success on problems that the constants of the path were not tuned on.

Judged and timed as in `benchmark`:

families, random QPs around a planted primal-dual solution, so that every one of them
    can be solved. The size comes from the seed as well.
changes, Maros-Meszaros problems with their data changed. noise: every stored number
    times 1 + 1e-3 N(0, 1), where P becomes D P D so that it stays convex, and equal
    rows and pinned variables stay consistent only by chance; rows, columns: scaled by
    10^U(-3, 3), the same problem in other units; plain: unchanged, to compare with. The
    noise can make a problem infeasible: what is called so is asked of HiGHS (an LP
    without cost) and left out of the count if it agrees.
"""

import sys
from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
from qpsolvers import Problem

from validation.harness import Job, Row
from validation.harness.suite import Args, Late, Suite, chosen_by_name
from validation.peers import runs
from validation.problems import data_sets, infeasible_cases, planted

SEEDS = 40


def load(data: Path, kind: str, name: str) -> Problem:
    """Return the problem of a family and seed, or a changed Maros-Meszaros problem."""
    if kind in planted.FAMILIES:
        return planted.FAMILIES[kind](np.random.default_rng(int(name)))
    seed = int.from_bytes(name.encode(), "big") % 2**32  # the same in every run
    problem = data_sets.maros_problem(data, name, dense=False)
    return planted.CHANGES[kind](problem, np.random.default_rng(seed))


def measure(job: Job, kind: str, name: str, eps: float) -> Row:
    """Measure; calling infeasible what HiGHS calls infeasible too is a success."""
    row = runs.measure(job, kind, name, eps, load)
    if kind == "noise" and "infeasible" in row["status"]:
        changed = load(job.data, kind, name)
        if infeasible_cases.is_feasible(changed) is False:
            row |= {"success": True, "status": "infeasible, as HiGHS says"}
    return row


def requests(kinds: Iterable[str], names: list[str], args: Args) -> Iterator[Row]:
    """Yield all problems of a kind, solver by solver."""
    for kind, solver, eps in product(kinds, args.solvers, args.eps):
        for name in names[:: 10 if args.quick else 1]:
            yield {"set": kind, "problem": name, "solver": solver, "eps": eps}


def of_families(args: Args) -> Iterator[Row]:
    """Yield random problems, so many of each family."""
    return requests(planted.FAMILIES, [str(seed) for seed in range(SEEDS)], args)


def of_changes(args: Args) -> Iterator[Row]:
    """Yield changed problems."""
    return requests(planted.CHANGES, data_sets.set_names(args.data, "all"), args)


FAMILIES = Suite(
    name="generalisation-families",
    doc=__doc__,
    requests=of_families,
    work=measure,
    columns=runs.COLUMNS,
    solvers=("nam", "piqp", "clarabel"),
    tolerances=(1e-6,),
    late=Late(),
)
CHANGES = replace(FAMILIES, name="generalisation", requests=of_changes, needs_data=True)
main = chosen_by_name({"families": FAMILIES, "changes": CHANGES})

if __name__ == "__main__":
    sys.exit(main())
