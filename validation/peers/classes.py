"""Seven classes of sparse QPs after the OSQP paper: time over the best peer's.

The problems: `osqp_classes`, four sizes of each class, from 10^3 to 10^6 entries of P,
G and A. They are measured as in `benchmark`, one problem after the other with every
solver in turn: `runtime` is the median of calls on a problem that the solver has seen,
`cold` its first call there. A peer's time limit is ten times what namlcp took; what
ran into the limit is not tried at a larger size of its class.

Every problem has a solution. The claim: all solved, time over that of the best peer at
most 0.7 in the geometric mean and 1.3 at worst.
"""

import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path

from qpsolvers import Problem

from validation.harness import Row
from validation.harness.suite import Args, Late, Suite
from validation.peers import runs
from validation.problems import osqp_classes

SIZES = len(osqp_classes.ENTRIES)


def load(_: Path, name: str, size: str) -> Problem:
    """Return the problem of a class and size."""
    return osqp_classes.generate(name, int(size))


def requests(args: Args) -> Iterator[Row]:
    """Yield the sizes of a class from the least; with --quick half of them."""
    for name, own in osqp_classes.CLASSES.items():
        for size in own.sizes[: SIZES // 2 if args.quick else SIZES]:
            for eps in args.eps:
                key = {"set": name, "problem": str(size), "eps": eps}
                yield from (key | {"solver": solver} for solver in args.solvers)


def about(request: Row) -> Row:
    """Return the variables of a problem, and the entries of its matrices."""
    problem = osqp_classes.generate(request["set"], int(request["problem"]))
    return {"variables": problem.q.size, "entries": osqp_classes.entries(problem)}


SUITE = Suite(
    name="classes",
    doc=__doc__,
    requests=requests,
    work=partial(runs.measure, load=load),
    about=about,
    columns=f"{runs.COLUMNS} variables entries",
    solvers=("nam", "piqp", "clarabel", "osqp", "proxqp", "highs", "moreau", "qtqp"),
    tolerances=(1e-6,),
    late=Late(by="problem", same=("set",)),
    beside=True,
)
main = SUITE.main

if __name__ == "__main__":
    sys.exit(main())
