"""The answer of the active-set method to a QP, or None for other methods.

`solve_dense` is for a single QP in dense form, `kept_for` for one after another.
"""

from typing import Any

import numpy as np

from namlcp.limits import Settings
from namlcp.options import DEFAULT_OPTIONS
from namlcp.qp.active import solve
from namlcp.qp.active.dense import DenseActiveSet
from namlcp.qp.active.engine import ActiveSet, Code
from namlcp.qp.active.null import NullSpace
from namlcp.qp.active.sparse import SparseActiveSet
from namlcp.qp.judge import Judge
from namlcp.qp.problem import QP, Guess, Point
from namlcp.status import Outcome, Status

FORM = "dual"
# Operations of what is made anew, over those from which on a method gives up.
MOST_ANEW = 0.2
# Most variables, rows and equations of a sparse QP together, as a response to a row has
# so many entries.
MOST_LENGTH = 20_000


def solve_dense(
    qp: QP, chain: Any, guess: Guess, judge: Judge, memory: Any = None
) -> Outcome | None:
    """Solve a QP in dense form; None where another method has to, or a number is bad.

    `chain`: the way from the user's QP to this one.
    """
    limits = judge.limits
    own = qp.in_dense_form()
    most = limits.max_iter or DEFAULT_OPTIONS.max_iter
    settings = Settings(limits.eps_abs, limits.eps_rel, most, 0.0)
    m = DenseActiveSet()
    solve.attach(m, own.P, own.G, own.A, True)
    if guess.active.size:
        solve.suggest(m, guess.active)
    solve.solve(m, own.joined(), settings, limits.deadline.at)
    if own is not judge.qp:
        return answer_of(m, judge, chain)
    answer = answer_of(m, judge)
    if answer is not None and answer.status is Status.SOLVED:
        answer = answer._replace(factors=solve.factors_of(m))
    return answer


def answer_of(m: ActiveSet, judge: Judge, chain: Any = None) -> Outcome | None:
    """Return the answer after a solve, None for other methods.

    `chain`: the way from the judge's QP to that of `m`, None where it is the same.
    """
    if m.code in (Code.DONE, Code.SUMMED, Code.LATE):
        if chain is not None:
            judge.offer(chain.point(*m.point))
        elif m.code == Code.DONE:
            judge.measure(Point(*m.point), solve.residuals_found(m))
        else:
            judge.measure(Point(*m.point))
        if m.code == Code.LATE:
            return judge.answer(Status.TIME_LIMIT, m.pivots, FORM)
        solved = judge.is_solved
        return judge.answer(Status.SOLVED, m.pivots, FORM) if solved else None
    if m.code not in (Code.CONTRADICTION, Code.UNBOUNDED):
        return None
    status = solve.OUTCOMES[m.code]
    point = x, y, z, z_box = Point(*m.point)
    if isinstance(m, SparseActiveSet):  # leaves candidates: y and z, or a ray in z_box
        if m.code == Code.CONTRADICTION:
            accepted = judge.accept_multipliers(x, y, z)
        else:
            accepted = judge.accept_ray(z_box, point)
    elif chain is None:
        proof = point, solve.residuals_found(m)  # it passed on the same arrays
        accepted = judge.keep(status, proof)
    else:
        zero = Point(*map(np.zeros_like, point))
        if m.code == Code.CONTRADICTION:
            proof = chain.point(*zero._replace(y=y, z=z), data=0.0)
            near = chain.point(*zero)
            accepted = judge.accept_multipliers(near.x, proof.y, proof.z)
        else:
            ray = chain.point(*zero._replace(x=x), data=0.0)
            accepted = judge.accept_ray(ray.x)
    return judge.answer(status, m.pivots, FORM) if accepted else None


# ---- QPs with the same matrices, one after another


def kept_for(qp: QP) -> Any:
    """Return a `NullSpace` or `SparseActiveSet` for these matrices, None for neither.

    None where they are sparse, and so large or full that other methods are quicker. It
    holds their arrays, which must not change, and is for one thread.
    """
    n, p = qp.q.size, qp.b.size
    if not qp.is_dense and (p > n or n + qp.h.size + p > MOST_LENGTH):
        return None
    m: Any = NullSpace() if qp.is_dense else SparseActiveSet()
    renew(m, qp)
    return m if qp.is_dense or m.is_ready else None


def is_slow_anew(m: Any) -> bool:
    """Tell whether others are quicker after `renew`: all active rows need responses."""
    if not isinstance(m, SparseActiveSet) or m.is_slow_anew:
        return m.is_slow_anew
    k = m.k + m.hints
    return k * m.response_operations + k**3 / 3 > MOST_ANEW * m.most_operations


def renew(m: Any, qp: QP) -> None:
    """Take other matrices of the same sizes; the active rows become a hint."""
    if qp.is_dense:
        solve.attach(m, qp.P, qp.G, qp.A, False)
    else:
        m.attach(qp.P, qp.G, qp.A)
