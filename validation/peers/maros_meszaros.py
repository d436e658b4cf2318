"""The whole Maros-Meszaros set: success, time and accuracy beside the peers.

Measured as in `benchmark`, one problem after the other with every solver in turn.
"""

import sys
from collections.abc import Iterator

from validation.harness import Row
from validation.harness.suite import Args, Late, Suite
from validation.peers import runs
from validation.problems import data_sets

LIMIT = 10.0  # [s]


def requests(args: Args) -> Iterator[Row]:
    """Yield all problems at the loosest tolerance, then at the next."""
    names = data_sets.set_names(args.data, "all")[:: 10 if args.quick else 1]
    for eps in sorted(args.eps, reverse=True):
        for name in names:
            key = {"limit": args.limit, "set": "all", "problem": name, "eps": eps}
            yield from (key | {"solver": solver} for solver in args.solvers)


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
)
main = SUITE.main

if __name__ == "__main__":
    sys.exit(main())
