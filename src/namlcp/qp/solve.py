"""solve_qp: check, choose the smallest form, solve, recover, judge.

First `substitution` takes out of a sparse problem what one row or column decides. The
forms, smallest first: bounds alone make a box LCP with A = P; a problem that is small
or full goes to `dense` (its multipliers' LCP); everything else follows the `path`. A
form that cannot finish hands over to the path, and the better of the two points is
returned. Whatever a form says, SOLVED is decided here, on the user's own data.
"""

import time
from typing import Any

import numpy as np

from namlcp.limits import Deadline, interruptible
from namlcp.linalg import blas_threads
from namlcp.options import DEFAULT_OPTIONS, Options, check_flag
from namlcp.progress import QP_COLUMNS, Progress
from namlcp.qp import certificates
from namlcp.qp.answer import FINAL, OBJECTIVE, Answer, better, is_decided, late
from namlcp.qp.bounds import solve_bounds
from namlcp.qp.dense import solve_dense
from namlcp.qp.forms import is_box, is_small
from namlcp.qp.guess import NO_GUESS, Guess, make_guess
from namlcp.qp.judge import Judge
from namlcp.qp.memory import Memory
from namlcp.qp.path import solve_path
from namlcp.qp.problem import QP, qp_data
from namlcp.qp.transforms import Substitution, confirmed, substitute, without_far_sides
from namlcp.result import QPResult
from namlcp.status import Status

# Bounds alone, and fewer variables: the dense form is quicker than the box LCP.
DENSE_BOX = 50


def solve_qp(
    P: Any,
    q: Any,
    G: Any = None,
    h: Any = None,
    A: Any = None,
    b: Any = None,
    lb: Any = None,
    ub: Any = None,
    *,
    x0: Any = None,
    warm_start: Any = None,
    history: bool = False,
    **settings: Any,
) -> QPResult:
    """Solve a convex quadratic program.

    ``minimise 1/2 x'Px + q'x  subject to  Gx <= h,  Ax = b,  lb <= x <= ub``

    Parameters
    ----------
    P : (n, n) array or sparse matrix
        Cost matrix, symmetric positive semidefinite.
    q : (n,) array
        Cost vector.
    G, h : (m, n) array or sparse matrix, (m,) array, optional
        Inequalities; h_i = +inf (from 1e20 on) switches a row off.
    A, b : (p, n) array or sparse matrix, (p,) array, optional
        Equalities.
    lb, ub : (n,) array, optional
        Bounds; lb_i <= -1e20 and ub_i >= 1e20 mean none.
    x0 : (n,) array, optional
        A guess of x; the rows active there are tried first.
    warm_start : QPResult or qpsolvers.Solution, optional
        The solution of a similar problem, of the same sizes; the rows with a multiplier
        there are tried first. Overrides x0.
    history : bool
        Keep the rows of the verbose table in the result.
    **settings
        The fields of `Options`: eps_abs, eps_rel, max_iter, time_limit [s], verbose,
        threads.

    Returns
    -------
    QPResult
        Read `status` first. Signs of y, z, z_box as in qpsolvers.

    Raises
    ------
    ValueError
        Shapes disagree, an entry is NaN, P is not symmetric or not positive
        semidefinite, an option has no meaning. The message names the argument.
    TypeError
        An argument is no array of real numbers, or an option is unknown.
    MemoryError
        A matrix to be made would have more entries than int32 can count.

    Notes
    -----
    SOLVED means that primal residual, dual residual and duality gap, recomputed on the
    arguments as they came, are within eps_abs + eps_rel * (size of their terms);
    `namlcp.residuals` has the formulas. The forms and their sources: module docstring.

    P is refused as not convex if, scaled to a unit diagonal, it has an eigenvalue below
    -1e-6; what lies between that and 0 is taken for rounding to single precision. (Of
    the Maros-Meszaros collection that refuses VALUES, whose smallest is -1.3e-5.)

    Examples
    --------
    >>> import numpy as np
    >>> import namlcp
    >>> P = np.array([[4.0, 1.0], [1.0, 2.0]])
    >>> result = namlcp.solve_qp(P, np.ones(2), A=np.ones((1, 2)), b=np.ones(1),
    ...                          lb=np.zeros(2), ub=np.full(2, 0.7))
    >>> result.status.value, result.x.round(6), round(result.obj, 6)
    ('solved', array([0.3, 0.7]), 1.88)
    """
    start = time.perf_counter()
    qp = qp_data(P, q, G, h, A, b, lb, ub)
    options = Options.from_names(settings) if settings else DEFAULT_OPTIONS
    check_flag("history", history)
    return solve_checked(qp, options, make_guess(qp, x0, warm_start), start, history)


@interruptible
def solve_checked(
    qp: QP,
    options: Options,
    guess: Guess,
    start: float,
    history: bool = False,
    memory: Memory | None = None,
) -> QPResult:
    """Solve a checked QP; `start` is the time.perf_counter() of the call.

    `memory` is kept by the caller from one problem to the next of the same pattern.
    """
    deadline = Deadline(start + options.time_limit)
    progress = None
    if options.verbose or history:
        progress = Progress(QP_COLUMNS, options.verbose)
        progress.say(describe(qp, options))
    ready = time.perf_counter()
    with blas_threads(options.threads, qp.q.size + qp.h.size + qp.b.size):
        answer = solve_far_sides(qp, options, guess, deadline, progress, memory)
    if deadline.interrupted:
        answer = answer._replace(status=deadline.verdict(answer.status))
    end = time.perf_counter()
    if progress is not None:
        progress.close(conclude(answer, end - start))
    return QPResult(
        status=answer.status,
        x=answer.x,
        y=answer.y,
        z=answer.z,
        z_box=answer.z_box,
        obj=OBJECTIVE.get(answer.status, answer.residuals.objective),
        residuals=answer.residuals,
        iterations=answer.iterations,
        form=answer.form,
        message=answer.message,
        setup_time=ready - start,
        solve_time=end - ready,
        history=progress.history() if progress is not None and history else None,
    )


def solve_far_sides(
    qp: QP,
    options: Options,
    guess: Guess,
    deadline: Deadline,
    progress: Progress | None,
    memory: Memory | None,
) -> Answer:
    """Solve; where that stalls, once more without bounds and sides that are far out."""
    answer = solve_forms(qp, options, guess, deadline, progress, memory)
    if answer.status in (Status.STALLED, Status.NUMERICAL_ERROR):
        near = without_far_sides(qp)
        if near is not None:
            other = solve_forms(near, options, NO_GUESS, deadline, progress, None)
            if other.status is Status.TIME_LIMIT:  # a longer limit may let it succeed
                answer = answer._replace(status=other.status)
            answer = confirmed(qp, other, options) or answer
    return answer


def solve_forms(
    qp: QP,
    options: Options,
    guess: Guess,
    deadline: Deadline,
    progress: Progress | None,
    memory: Memory | None,
) -> Answer:
    """Substitute what one row or column decides, then solve the smallest form.

    What comes back unsolved from the smaller problem is tried again as it came.
    """
    if memory is None:
        memory = Memory()
    else:
        qp = memory.recognised(qp)
    smaller = None
    if not qp.is_dense and (qp.h.size or qp.b.size):
        with deadline.listening():
            smaller = substitute(qp, memory.substitution, deadline)
        memory.substitution = smaller
        if deadline.reached():
            return late(qp)
    if smaller is None:
        return try_forms(qp, options, guess, deadline, progress, memory)
    if smaller.solved.size:
        memory.convex = smaller.P  # P was asked, and squares were added
    near = smaller.guess(guess)
    answer = try_forms(smaller.qp, options, near, deadline, progress, memory)
    answer = restored(answer, smaller, options)
    if answer.status in (Status.STALLED, Status.NUMERICAL_ERROR):
        near = make_guess(qp, None, answer)
        other = try_forms(qp, options, near, deadline, progress, Memory())
        return better(answer, other, options)
    return answer


def restored(answer: Answer, smaller: Substitution, options: Options) -> Answer:
    """Return the answer for the user's QP, judged anew; STALLED if it does not pass."""
    qp, tol = smaller.user, options.eps_abs
    proof = None
    if answer.status is Status.PRIMAL_INFEASIBLE:
        y, z, _ = smaller.multipliers(answer.y, answer.z, answer.z_box)
        proof = certificates.accept_primal(qp, np.zeros(qp.q.size), y, z, tol)
    elif answer.status is Status.DUAL_INFEASIBLE:
        x, y, z = (np.zeros(v.size) for v in (qp.q, qp.b, qp.h))
        d = smaller.direction(answer.x)
        proof = certificates.accept_dual(qp, x, y, z, d, tol)
    if proof is not None:
        x, y, z, z_box = proof
        return answer._replace(x=x, y=y, z=z, z_box=z_box)
    judge = Judge(qp, options)
    judge.offer(*smaller.point(answer.x, answer.y, answer.z, answer.z_box))
    x, y, z, z_box = judge.point
    residuals = judge.residuals
    status = answer.status
    if judge.best <= 1.0:
        status = Status.SOLVED
    elif status in FINAL:
        status = Status.STALLED
    return answer._replace(
        status=status, x=x, y=y, z=z, z_box=z_box, residuals=residuals
    )


def try_forms(
    qp: QP,
    options: Options,
    guess: Guess,
    deadline: Deadline,
    progress: Progress | None,
    memory: Memory,
) -> Answer:
    """Try the smallest form that fits, then the path; return the better answer."""
    answer = None
    small = is_small(qp)
    if is_box(qp) and not (small and qp.q.size <= DENSE_BOX):
        with deadline.listening():
            answer = solve_bounds(qp, options, guess, deadline, progress, memory)
    starts = [guess, NO_GUESS] if guess.x.size else [NO_GUESS]
    while small and starts and not is_decided(answer):
        # once more without the guess: a wrong one may cost time, not the answer
        found = solve_dense(qp, options, starts.pop(0), deadline, progress)
        if found is None:
            break
        answer = found if answer is None else better(answer, found, options)
    if answer is not None and is_decided(answer):
        return answer
    with deadline.listening():
        other = solve_path(qp, options, guess, deadline, progress, memory)
    return other if answer is None else better(answer, other, options)


def describe(qp: QP, options: Options) -> str:
    """Return the first lines of the verbose output."""
    bounds = np.count_nonzero(np.isfinite(qp.lb)) + np.count_nonzero(np.isfinite(qp.ub))
    kind = "dense" if qp.is_dense else "sparse"
    return (
        f"namlcp  QP: n = {qp.q.size}, equalities = {qp.b.size}, "
        f"inequalities = {qp.h.size}\n"
        f"  {kind}, bounds = {bounds}; stop: eps_abs = {options.eps_abs:g}, "
        f"eps_rel = {options.eps_rel:g}"
    )


def conclude(answer: Answer, seconds: float) -> str:
    """Return the closing sentence of the verbose output."""
    r = answer.residuals
    return (
        f"{answer.status.value}: {answer.form}, {answer.iterations} it, {seconds:.1e} s"
        f", primal {r.primal:.0e}, dual {r.dual:.0e}, gap {r.gap:.0e}"
    )
