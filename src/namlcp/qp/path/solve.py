"""A QP by the interior-point method, as an `Answer`."""

from namlcp.checks import as_sparse
from namlcp.limits import Deadline
from namlcp.options import Options
from namlcp.progress import Progress
from namlcp.qp.answer import Answer
from namlcp.qp.guess import Guess
from namlcp.qp.memory import Memory
from namlcp.qp.path import loop
from namlcp.qp.problem import QP
from namlcp.residuals import qp_residuals
from namlcp.status import Status


def solve_path(
    qp: QP,
    options: Options,
    guess: Guess,
    deadline: Deadline,
    progress: Progress | None,
    memory: Memory,
) -> Answer:
    """Follow the path, which is sparse."""
    if progress is not None:
        progress.announce(loop.evaluate)
    own = qp
    if qp.is_dense:
        own = qp._replace(P=as_sparse(qp.P), G=as_sparse(qp.G), A=as_sparse(qp.A))
    report = None if progress is None else progress.row
    found = loop.solve(own, options, guess, deadline, report, memory)
    status, residuals = found.status, found.residuals
    point = found.x, found.y, found.z, found.z_box
    if qp.is_dense and status is Status.SOLVED:  # dense sums round differently
        residuals = qp_residuals(*qp, *point)
        if not residuals.solved(options.eps_abs, options.eps_rel):
            status = Status.STALLED
    return Answer(status, *point, residuals, found.iterations, "path", found.message)
