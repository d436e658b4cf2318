"""Success and time of solver="nam" beside its peers, through qpsolvers.

A problem counts as solved when the solver says so and primal residual, dual residual
and duality gap (qpsolvers' own functions) and the wrong-signed part of the multipliers
are all at most eps, within the time limit. The time is the median of repeated calls of
qpsolvers.solve_problem, with eps_abs = eps and eps_rel = 0, on one thread, after a
tiny problem of the same kind; the first call is kept as `cold`.

The sets: `data_sets`; --only takes names of sets or problems.
"""

import sys
from collections.abc import Iterator

from validation.harness import Row, qp_solvers
from validation.harness.suite import Args, Late, Suite
from validation.peers import runs
from validation.problems import data_sets

SETS = ("mpc", "contact", "small", "strict")


def requests(args: Args) -> Iterator[Row]:
    """Yield every problem for one solver at one tolerance, then for the next."""
    for problem_set in SETS:
        names = data_sets.set_names(args.data, problem_set)[:: 4 if args.quick else 1]
        for solver in args.solvers:
            for eps in sorted(args.eps, reverse=True):
                for name in names:
                    key = {"set": problem_set, "problem": name}
                    yield key | {"solver": solver, "eps": eps}


SUITE = Suite(
    name="benchmark",
    doc=__doc__,
    requests=requests,
    work=runs.measure,
    columns=runs.COLUMNS,
    solvers=qp_solvers.SOLVERS,
    tolerances=(1e-6, 1e-9),
    late=Late(),
    needs_data=True,
)
main = SUITE.main

if __name__ == "__main__":
    sys.exit(main())
