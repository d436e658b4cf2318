"""What people model in CVXPY, solved with NAM beside OSQP and Clarabel.

Each model (`problems.models`) at two sizes. The objective is
compared with Clarabel's, at its tightest tolerances unless it fails there. Residuals
are computed on the data that CVXPY hands over, min 1/2 x'Px + q'x, Ax = b, Fx <= g,
from the point and the multipliers that the solver's interface hands back:

- primal: largest violation over max(1, |Ax|, |b|, |Fx|, |g|);
- dual: largest |Px + q + A'y + F'z| or wrong sign over max(1, |Px|, |q|, |A'y|, |F'z|);
- complementarity: largest |z_i (g - Fx)_i|, and the duality gap, over max(1, x'Px, q'x,
  b'y, g'z).

The time is the median of repeated calls of CVXPY's solve_via_data, without its
compilation and without a warm start: processor time, on one thread.
"""

from collections.abc import Iterator

from validation.applications.cvxpy_bench import (
    REFERENCE,
    conclude,
    known_models,
    work,
)
from validation.harness import Row
from validation.harness.suite import Args, Suite

QUICK = 10  # every so many models, small


def requests(args: Args) -> Iterator[Row]:
    for size in ("small",) if args.quick else ("small", "large"):
        for name in list(known_models())[:: QUICK if args.quick else 1]:
            expected = known_models()[name].expected
            yield {"set": size, "problem": name, "expected": expected}


SUITE = Suite(
    name="cvxpy-models",
    doc=__doc__,
    requests=requests,
    work=work,
    conclude=conclude,
    columns=(
        "problem set solver variables equalities inequalities runtime cold status "
        "expected success objective objective_error against primal_residual "
        "dual_residual complementarity iterations form message"
    ),
    keys="set problem solver",
    solvers=("nam", "osqp", "clarabel", REFERENCE),
    packages={REFERENCE: "cvxpy"},
    limit=60.0,
)
