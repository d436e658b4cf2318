"""The forms of a QP: a box LCP, the multipliers' LCP in dense matrices, the path.

Each tells whether the problem fits and makes an `Answer` of what its solver returns,
judged on the data it was given; None where it does not decide.
"""

from typing import Any

import numpy as np

from namlcp.checks import QPData, as_sparse
from namlcp.deadline import Deadline
from namlcp.lcp.auto import LARGE, solve_auto
from namlcp.lcp.exact import ACCURACY, Outcome, solve_box
from namlcp.lcp.kernels import relax_csr
from namlcp.lcp.pivoting import pivot
from namlcp.options import Options
from namlcp.progress import Progress
from namlcp.qp import certificates, dense, path
from namlcp.qp.answer import Answer
from namlcp.qp.csc import as_dense
from namlcp.qp.memory import Memory
from namlcp.qp.reduction import box_lcp, box_point, is_box_open
from namlcp.qp.start import NOTHING, Guess
from namlcp.qp.units import column_units, in_units
from namlcp.residuals import UNDEFINED, Residuals, qp_residuals
from namlcp.status import Status

# Up to here a dense QP is small; beyond, its pivots take seconds.
DENSE_VARIABLES = 2000
DENSE_ENTRIES = 16_000_000
# Sparse problems below this many entries are cheaper as dense ones.
SPARSE_ENTRIES = 10_000

# From this density on the matrices of a sparse problem are treated as dense.
FULL = 0.3

# Relative residuals of the LCP tried one after another for a large QP with bounds.
SHARPER = (ACCURACY, 1e-11, 1e-13)

NO_HINT = np.empty(0, dtype=np.int64)

# A tolerance below this times the terms of the gap is decided by their rounding.
ROUNDING = 4e-15


def is_small(qp: QPData) -> bool:
    """Tell whether the dense form fits."""
    n = qp.q.size
    entries = n * (n + qp.h.size + qp.b.size)
    if n > DENSE_VARIABLES or entries > DENSE_ENTRIES:
        return False
    if qp.is_dense or entries <= SPARSE_ENTRIES:
        return True
    return qp.P.nnz + qp.G.nnz + qp.A.nnz >= FULL * entries


def is_box(qp: QPData) -> bool:
    """Tell whether there are bounds and nothing else."""
    return qp.h.size == 0 and qp.b.size == 0 and is_box_open(qp.lb, qp.ub)


def solve_dense(
    qp: QPData,
    options: Options,
    guess: Guess,
    deadline: Deadline,
    progress: Progress | None,
) -> Answer | None:
    """Pivot on the multipliers' LCP; None where it does not decide."""
    if progress is not None:
        progress.announce(dense.solve)
    own = qp
    if not qp.is_dense:
        own = qp._replace(P=as_dense(qp.P), G=as_dense(qp.G), A=as_dense(qp.A))
    hint = NO_HINT
    if guess.active.size:
        hint = qp.b.size + np.flatnonzero(guess.active)
    found = call_dense(own, guess.x, hint, options, deadline)
    c = None
    if found[0] == dense.UNEVEN:
        c = column_units(own.P)
        start = guess.x / c if guess.x.size else guess.x
        found = call_dense(in_units(own, c), start, hint, options, deadline)
    code, pivots, x, y, z, z_box, numbers = found
    if code in (dense.NOT_CONVEX, dense.UNEVEN):
        return None
    if c is not None:
        x, z_box = c * x, c * z_box if code == dense.UNBOUNDED else z_box / c
    residuals = Residuals(*numbers)
    if c is not None or residuals.gap_size * ROUNDING > options.eps_abs:
        residuals = qp_residuals(*qp, x, y, z, z_box)
    solved = residuals.solved(options.eps_abs, options.eps_rel)
    status = Status.TIME_LIMIT if code == dense.LATE else Status.STALLED
    if solved:
        status = Status.SOLVED
    if code in (dense.INFEASIBLE, dense.UNBOUNDED):
        tol = options.eps_abs
        if code == dense.INFEASIBLE:
            status = Status.PRIMAL_INFEASIBLE
            proof = certificates.accept_primal(qp, x, y, z, tol)
        else:
            status = Status.DUAL_INFEASIBLE
            proof = certificates.accept_dual(qp, x, y, z, z_box, tol)
        if proof is None:
            return None
        x, y, z, z_box = proof
        residuals = UNDEFINED
    if progress is not None:
        progress.row(pivots, *residuals[:3], 0.0, int((z > 0).sum()))
    return Answer(status, x, y, z, z_box, residuals, pivots, "dual", "")


def call_dense(
    qp: QPData,
    start: np.ndarray,
    hint: np.ndarray,
    options: Options,
    deadline: Deadline,
) -> tuple[Any, ...]:
    """Return what `dense.solve` returns, by the deadline."""
    n, rows = qp.q.size, qp.h.size + qp.b.size
    work = 4.0 * options.max_iter * n * (n + rows)
    return deadline.run(dense.solve, work, *qp, start, hint, options.max_iter)


def solve_bounds(
    qp: QPData,
    options: Options,
    guess: Guess,
    deadline: Deadline,
    progress: Progress | None,
    memory: Memory,
) -> Answer | None:
    """Solve the box LCP that bounds alone make; None where it does not decide."""
    A, q, lower, upper = box_lcp(qp)
    large = not qp.is_dense and q.size >= LARGE
    if progress is not None:
        progress.announce(relax_csr if large else pivot)
    limits: dict[str, Any] = {"max_iter": options.max_iter, "deadline": deadline}
    if large:
        memory.ensure_convex(A)
        outcome = solve_large_box(qp, options, guess, memory, limits)
    else:
        outcome = solve_box(A, q, lower, upper, guess.point, ask_convex=True, **limits)
    status, x, w, iterations, ray, convex = outcome
    x, z_box = box_point(x, w, lower, upper)
    if ray is not None:
        memory.ensure_convex(as_sparse(qp.P))
        proof = certificates.accept_dual(qp, x, NOTHING, NOTHING, ray, options.eps_abs)
        if proof is None:
            return None
        return Answer(
            Status.DUAL_INFEASIBLE, *proof, UNDEFINED, iterations, "bounds", ""
        )
    residuals = qp_residuals(*qp, x, NOTHING, NOTHING, z_box)
    if residuals.solved(options.eps_abs, options.eps_rel):
        if not convex:
            return None  # the path looks closer, and may refuse
        status = Status.SOLVED
    elif status is Status.SOLVED:
        status = Status.STALLED
    return Answer(
        status, x, NOTHING, NOTHING, z_box, residuals, iterations, "bounds", ""
    )


def solve_large_box(
    qp: QPData,
    options: Options,
    guess: Guess,
    memory: Memory,
    limits: dict[str, Any],
) -> Outcome:
    """Solve the box LCP of a convex QP until that, not the LCP, is solved.

    The gap adds up what each of many unknowns leaves.
    """
    A, q, lower, upper = box_lcp(qp)
    matrix, z0 = memory.prepared(A), guess.point
    for eps_rel in SHARPER:
        found, _ = solve_auto(
            matrix, q, lower, upper, z0, eps_abs=0.0, eps_rel=eps_rel, **limits
        )
        x, z_box = box_point(found.z, found.w, lower, upper)
        residuals = qp_residuals(*qp, x, NOTHING, NOTHING, z_box)
        if found.status is not Status.SOLVED or residuals.solved(
            options.eps_abs, options.eps_rel
        ):
            break
        z0 = found.z
    return found._replace(convex=True)


def solve_path(
    qp: QPData,
    options: Options,
    guess: Guess,
    deadline: Deadline,
    progress: Progress | None,
    memory: Memory,
) -> Answer:
    """Follow the path, which is sparse."""
    if progress is not None:
        progress.announce(path.evaluate)
    own = qp
    if qp.is_dense:
        own = qp._replace(P=as_sparse(qp.P), G=as_sparse(qp.G), A=as_sparse(qp.A))
    report = None if progress is None else progress.row
    found = path.solve(own, options, guess, deadline, report, memory)
    status, residuals = found.status, found.residuals
    point = found.x, found.y, found.z, found.z_box
    if qp.is_dense and status is Status.SOLVED:  # dense sums round differently
        residuals = qp_residuals(*qp, *point)
        if not residuals.solved(options.eps_abs, options.eps_rel):
            status = Status.STALLED
    return Answer(status, *point, residuals, found.iterations, "path", found.message)
