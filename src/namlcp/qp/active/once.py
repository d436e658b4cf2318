"""The answer of the active-set method to a QP, or None for other methods.

`solve_once` is for a single dense QP, `kept_for` for one after another.
"""

from typing import Any

from namlcp.limits import Limits
from namlcp.options import DEFAULT_OPTIONS
from namlcp.qp.active import solve
from namlcp.qp.active.dense import DenseActiveSet
from namlcp.qp.active.null import NullSpace
from namlcp.qp.active.sparse import SparseActiveSet, active_set_of
from namlcp.qp.active.state import ActiveSet, Code
from namlcp.qp.answer import Answer, proved
from namlcp.qp.certificates import accept_dual, accept_primal
from namlcp.qp.guess import NO_GUESS, Guess
from namlcp.qp.problem import QP, Point
from namlcp.residuals import qp_residuals
from namlcp.settings import Settings
from namlcp.status import Status


def settings_of(limits: Limits) -> Settings:
    """Return the tolerances and the count of `limits`."""
    most = limits.max_iter or DEFAULT_OPTIONS.max_iter
    return Settings(limits.eps_abs, limits.eps_rel, most, 0.0)


def solve_once(qp: QP, guess: Guess, limits: Limits) -> Answer | None:
    """Solve one dense QP; None where another method has to, or a number is bad."""
    m = new_attempt(qp, settings_of(limits), limits.deadline.at, guess)
    return answer_of(m, qp, limits)


def new_attempt(
    qp: QP, settings: Settings, until: float, guess: Guess = NO_GUESS
) -> DenseActiveSet:
    """Try to solve one dense QP; return what has tried."""
    m = DenseActiveSet()
    solve.attach(m, qp.P, qp.G, qp.A, True)
    if guess.active.size:
        solve.suggest(m, guess.active)
    solve.solve(m, qp.joined(), settings, until)
    return m


def answer_of(m: ActiveSet, qp: QP, limits: Limits) -> Answer | None:
    """Return the answer after a solve, judged on the data; None for other methods."""
    x, y, z, z_box = m.point
    if m.code in (Code.DONE, Code.SUMMED, Code.LATE):
        point = Point(x, y, z, z_box)
        residuals = solve.residuals_found(m)
        if m.code != Code.DONE:
            residuals = qp_residuals(*qp, *point)
        status = Status.TIME_LIMIT if m.code == Code.LATE else Status.SOLVED
        if m.code == Code.SUMMED and not residuals.solved(*limits.tolerances):
            return None
        return Answer(status, point, residuals, m.pivots, "dual")
    if m.code not in (Code.CONTRADICTION, Code.UNBOUNDED):
        return None
    proof: Point | None = Point(x, y, z, z_box)
    if isinstance(m, SparseActiveSet):
        proof = (
            accept_primal(qp, x, y, z, limits.eps_abs)
            if m.code == Code.CONTRADICTION
            else accept_dual(qp, x, y, z, z_box, limits.eps_abs)
        )
    status = solve.OUTCOMES[m.code]
    return None if proof is None else proved(status, proof, m.pivots, "dual")


# ---- QPs with the same matrices, one after another


def kept_for(qp: QP) -> Any:
    """Return a `NullSpace` or `SparseActiveSet` for these matrices, None for neither.

    It holds their arrays, which must not change, and is for one thread.
    """
    if not qp.is_dense:
        return active_set_of(qp)
    m = NullSpace()
    solve.attach(m, qp.P, qp.G, qp.A, False)
    return m


def renew(m: Any, qp: QP) -> None:
    """Take other matrices of the same sizes; the active rows become a hint."""
    hints = max(m.kept_k, m.hints)
    if qp.is_dense:
        solve.attach(m, qp.P, qp.G, qp.A, False)
    else:
        m.attach(qp.P, qp.G, qp.A)
    m.hints = hints  # the numbers of the rows are still in memory
