"""A single QP by the active-set method: its answer, or None for other methods."""

from namlcp.limits import Limits
from namlcp.options import DEFAULT_OPTIONS
from namlcp.qp.active import solve
from namlcp.qp.active.dense import DenseActiveSet
from namlcp.qp.active.state import ActiveSet, Code
from namlcp.qp.answer import Answer, proved
from namlcp.qp.certificates import accept_dual, accept_primal
from namlcp.qp.guess import NO_GUESS, Guess
from namlcp.qp.problem import QP, Point
from namlcp.residuals import Residuals, qp_residuals
from namlcp.settings import Settings
from namlcp.status import Status

RHO = 1e-4
# Other values of rho for P + W, see `weight`: where too many rounds were needed, and
# where rounding errors were too large.
LESS_RHO, MORE_RHO = 1e-2 * RHO, 1e2 * RHO


def settings_of(limits: Limits) -> Settings:
    """Return the tolerances and the count of `limits`."""
    most = limits.max_iter or DEFAULT_OPTIONS.max_iter
    return Settings(limits.eps_abs, limits.eps_rel, most, 0.0)


def solve_once(qp: QP, guess: Guess, limits: Limits) -> Answer | None:
    """Solve one dense QP; None where another method has to, or a number is bad."""
    m = new_attempt(qp, settings_of(limits), limits.deadline.at, guess)
    if guess.active.size:
        answer = answer_of(m, qp, limits)
        if answer is not None or m.code in (Code.UNSUITED, Code.FAULTY):
            return answer
        solve.again(m, m.wanted)  # from nothing, as a wrong guess may mislead
    return decide(m, qp, limits)


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


def decide(m: DenseActiveSet, qp: QP, limits: Limits) -> Answer | None:
    """Return the answer to a QP that was tried, if need be after trying other W."""
    while True:
        answer = answer_of(m, qp, limits)
        if answer is not None or not takes_another_weight(m):
            return answer


def takes_another_weight(m: DenseActiveSet) -> bool:
    """Solve a QP again, with another W; False if none may help.

    Without W, rounding errors are to blame; with W, these or too many rounds.
    """
    if m.code not in (Code.STUCK, Code.CONTRADICTION) or m.wanted != 0.0:
        return False
    if m.pivots > m.max_iter or m.operations > m.most_operations:
        return False
    # Where P is definite, a small W leaves little to the passes.
    is_long = m.rho == 0.0 or (m.code == Code.STUCK and m.rounds > 1)
    solve.again(m, LESS_RHO if is_long else MORE_RHO)
    return True


def answer_of(m: ActiveSet, qp: QP, limits: Limits) -> Answer | None:
    """Return the answer after a solve, judged on the data; None for other methods."""
    x, y, z, z_box = m.point
    if m.code in (Code.DONE, Code.SUMMED, Code.LATE):
        point = Point(x, y, z, z_box)
        residuals = Residuals(*solve.residuals_of(m))
        if m.code != Code.DONE:
            residuals = qp_residuals(*qp, *point)
        status = Status.TIME_LIMIT if m.code == Code.LATE else Status.SOLVED
        if m.code == Code.SUMMED and not residuals.solved(*limits.tolerances):
            return None
        return Answer(status, point, residuals, m.pivots, "dual")
    if m.code == Code.CONTRADICTION:
        proof = accept_primal(qp, x, y, z, limits.eps_abs)
        status = Status.PRIMAL_INFEASIBLE
    elif m.code == Code.UNBOUNDED:
        proof = accept_dual(qp, x, y, z, z_box, limits.eps_abs)
        status = Status.DUAL_INFEASIBLE
    else:
        return None
    return None if proof is None else proved(status, proof, m.pivots, "dual")
