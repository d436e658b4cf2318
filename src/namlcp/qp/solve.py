"""solve_qp: check, substitute, solve the smallest form, map back, check residuals."""

from time import perf_counter
from typing import Any

import numpy as np

from namlcp.limits import Deadline, Limits, interruptible
from namlcp.linalg import blas_threads
from namlcp.options import DEFAULT_OPTIONS, Options, check_flag
from namlcp.progress import QP_COLUMNS, Progress
from namlcp.qp.active import (
    MOST_ORDER,
    answer_of,
    factors_of,
    new_attempt,
    solve_once,
    solve_small,
)
from namlcp.qp.active.dense import DenseActiveSet
from namlcp.qp.active.solve import MOST_BOX
from namlcp.qp.active.state import Code
from namlcp.qp.answer import OBJECTIVE, UNDECIDED, Answer, better, out_of_time
from namlcp.qp.closest import check_weights, solve_or_approach
from namlcp.qp.forms import is_tiny, solve_smallest_form
from namlcp.qp.guess import NO_GUESS, Guess, make_guess
from namlcp.qp.judge import confirmed, upheld
from namlcp.qp.memory import Memory
from namlcp.qp.problem import QP, checked, qp_arrays, stamp_of
from namlcp.qp.transforms import substitute, without_huge_bounds
from namlcp.residuals import qp_residuals
from namlcp.result import QPResult
from namlcp.status import Status


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
    derivative: bool = False,
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
        Inequalities; h_i = +inf (from 1e20 on) switches a row off. A finite h_i >= 1e20
        below 1e10 max_j |G_ij| is refused: that row is a constraint.
    A, b : (p, n) array or sparse matrix, (p,) array, optional
        Equalities.
    lb, ub : (n,) array, optional
        Bounds; lb_i <= -1e20 and ub_i >= 1e20 mean none.
    x0 : (n,) array, optional
        A guess of x; the constraints active there are tried first.
    warm_start : QPResult or qpsolvers.Solution, optional
        The solution of a similar problem of the same sizes; the constraints with a
        multiplier there are tried first. Overrides x0.
    history : bool
        Keep the rows of the verbose table in the result.
    derivative : bool
        Keep the factors of a dense QP in the result, where the method has left some, so
        that `backward` need not make them. Such a result is for one thread at a time.
    **settings
        The fields of `Options`: eps_abs, eps_rel, max_iter, time_limit [s], verbose,
        threads, infeasible.

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
        A matrix that the solve needs would have more entries than int32 can count.

    Notes
    -----
    SOLVED means that primal residual, dual residual and duality gap, recomputed on the
    arguments as they came, are within eps_abs + eps_rel * (size of their terms);
    `namlcp.residuals` has the formulas, `namlcp.qp.forms` the methods.

    P is refused as not convex if, scaled to a unit diagonal, it has an eigenvalue below
    -1e-6; those between that and 0 count as rounding to single precision. (VALUES of
    the Maros-Meszaros collection is refused: its smallest eigenvalue is -1.3e-5.)

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
    start = perf_counter()
    options = Options.from_names(settings) if settings else DEFAULT_OPTIONS
    check_flag("history", history)
    check_flag("derivative", derivative)
    arguments, tried = (P, q, G, h, A, b, lb, ub), None
    if x0 is None and warm_start is None and not history and options.is_plain:
        tried = solve_small(QPResult, *arguments, options.settings, start, derivative)
        if type(tried) is QPResult:
            return tried
    return solve_arguments(
        arguments, options, start, tried, x0, warm_start, history, derivative
    )


def solve_arguments(
    arguments: tuple[Any, ...],
    options: Options,
    start: float,
    tried: DenseActiveSet | None,
    x0: Any = None,
    warm_start: Any = None,
    history: bool = False,
    derivative: bool = False,
    name: str = "x0",
) -> QPResult:
    """Solve the QP of arguments of any kind; `name` stands for x0 in messages.

    `tried`: what has tried to solve it already, if anything has.
    """
    P, _, G, _, A, *_ = arguments
    qp, given = qp_arrays(*arguments), (P, G, A)
    known, in_vain = None, False
    if x0 is None and warm_start is None and not history:
        ready = perf_counter()
        known, tried, in_vain = solve_shortly(qp, options, start, given, tried)
        if known is not None and not needs_more(options, known):
            result = result_of(known, (qp, given), start, ready)
            result.stamp = stamp_of(qp)
            if derivative and qp.is_dense and tried is not None:
                result.factors = factors_of(tried)
            return result
    qp = checked(qp)
    guess = make_guess(qp, x0, warm_start, name)
    memory = Memory(in_vain) if in_vain else None
    result = solve_checked(qp, options, guess, start, history, memory, given, known)
    result.stamp = stamp_of(qp)
    return result


def solve_shortly(
    qp: QP,
    options: Options,
    start: float,
    given: tuple[Any, Any, Any],
    tried: DenseActiveSet | None,
) -> tuple[Answer | None, DenseActiveSet | None, bool]:
    """Solve a QP of `qp_arrays` by a method that checks its numbers.

    Returns the answer, what has found it, and whether the dense form of the QP was
    tried in vain. None where that is not the way to solve it: with sparse matrices
    unless it is tiny, or has bounds alone. `tried`: what has tried it already, if
    anything; `start` and `given` as for `solve_checked`.
    """
    order = qp.q.size + qp.h.size + qp.b.size
    if order > MOST_ORDER or options.verbose:
        return None, None, False
    if order == qp.q.size > MOST_BOX or not (qp.is_dense or is_tiny(qp)):
        return solve_box_shortly(qp, options, start, given), None, False
    if options.relaxation:
        check_weights(qp, options.relaxation)
    limits, own = options.limits(Deadline(start + options.time_limit)), qp
    if tried is None:
        own = qp.in_dense_form()
        tried = new_attempt(own, options.settings, start + options.time_limit)
    answer = answer_of(tried, own, limits)
    if answer is not None:
        answer = upheld(answer, qp, given, limits)
    is_left = tried.code in (Code.UNSUITED, Code.FAULTY)  # for `checked` to tell why
    return answer, tried, answer is None and not is_left


@interruptible
def solve_box_shortly(
    qp: QP, options: Options, start: float, given: tuple[Any, Any, Any]
) -> Answer | None:
    """Solve a QP of `qp_arrays` with bounds alone; else return None.

    Most of such a solve, as an LCP, takes less time than the way there through all
    other forms.
    """
    if qp.h.size + qp.b.size > 0 or options.relaxation:
        return None
    qp = checked(qp)
    limits = options.limits(Deadline(start + options.time_limit))
    with blas_threads(options.threads, qp.q.size):
        answer = solve_smallest_form(qp, NO_GUESS, limits, Memory())
    return upheld(answer, qp, given, limits)


def needs_more(options: Options, answer: Answer) -> bool:
    """Tell whether `solve_checked` is to go on from an answer.

    That is so if it is undecided, and if it is to lead to the closest point.
    """
    infeasible = answer.status is Status.PRIMAL_INFEASIBLE
    return answer.status in UNDECIDED or (infeasible and bool(options.relaxation))


@interruptible
def solve_checked(
    qp: QP,
    options: Options,
    guess: Guess,
    start: float,
    history: bool = False,
    memory: Memory | None = None,
    given: tuple[Any, Any, Any] = (None, None, None),
    known: Answer | None = None,
) -> QPResult:
    """Solve a checked QP; `start` is the perf_counter() of the call.

    `memory` may be kept for the next problem of the same pattern; it is changed.
    `given`: P, G and A as the user holds them, whose sums `upheld` asks, and in whose
    form their gradients are. `known`: the answer of `solve_shortly`, if it needs more.
    """
    progress = None
    if options.verbose or history:
        progress = Progress(QP_COLUMNS, options.verbose)
        progress.say(describe(qp, options))
    deadline = Deadline(start + options.time_limit)
    limits = options.limits(deadline, progress)
    ready = perf_counter()
    closest, relaxation = None, options.relaxation
    if relaxation:
        check_weights(qp, relaxation)
    with blas_threads(options.threads, qp.q.size + qp.h.size + qp.b.size):
        if relaxation:
            answer, closest = solve_or_approach(
                (qp, given), relaxation, (guess, memory), limits, solve_or_relax, known
            )
        else:
            answer = solve_or_relax(qp, guess, limits, memory, known)
    answer = upheld(answer, qp, given, limits)
    if progress is not None:
        progress.close(conclude(answer, perf_counter() - start))
    kept = progress.history() if progress is not None and history else None
    return result_of(answer, (qp, given), start, ready, kept, closest)


def result_of(
    answer: Answer,
    problem: tuple[QP, tuple[Any, Any, Any]],
    start: float,
    ready: float,
    history: Any = None,
    closest: Any = None,
) -> QPResult:
    """Return the answer to `problem`, the checked QP and (P, G, A) as they were given.

    start, ready: the values of perf_counter() at the call and after its checks.
    """
    status, (x, y, z, z_box), residuals, iterations, form, message = answer
    objective = residuals.objective
    if status is not Status.SOLVED:
        objective = OBJECTIVE.get(status, objective)
    return QPResult(
        status=status,
        x=x,
        y=y,
        z=z,
        z_box=z_box,
        obj=objective,
        residuals=residuals,
        iterations=iterations,
        form=form,
        message=message,
        setup_time=ready - start,
        solve_time=perf_counter() - ready,
        history=history,
        closest=closest,
        problem=problem,
    )


def solve_or_relax(
    qp: QP,
    guess: Guess,
    limits: Limits,
    memory: Memory | None = None,
    known: Answer | None = None,
) -> Answer:
    """Solve the QP; if it stalls, solve it without its huge bounds.

    A proof that this relaxed QP is infeasible holds for the QP, too. The residuals of
    its solution are computed with the huge bounds. `known`: the answer to the QP, where
    there is one.
    """
    answer = known or solve_substituted(qp, guess, limits, memory)
    relaxed = without_huge_bounds(qp) if answer.status in UNDECIDED else None
    if relaxed is None:
        return answer
    other = solve_substituted(relaxed, NO_GUESS, limits, None)
    if other.status is Status.PRIMAL_INFEASIBLE:
        return other
    if other.status is Status.SOLVED:
        residuals = qp_residuals(*qp, *other.point)
        if residuals.solved(*limits.tolerances):
            return other._replace(residuals=residuals)
    if other.status is Status.TIME_LIMIT:  # a longer limit may let it succeed
        return answer._replace(status=other.status)
    return answer


def solve_substituted(
    qp: QP, guess: Guess, limits: Limits, memory: Memory | None
) -> Answer:
    """Substitute free columns, solve, and map back.

    If that remains undecided, the QP is solved without the substitution. A tiny QP is
    first tried in dense form as it came.
    """
    if memory is None:
        memory = Memory()
    else:
        qp = memory.recognised(qp)
    substitution = None
    if not qp.is_dense and (qp.h.size or qp.b.size):
        if is_tiny(qp) and not memory.in_vain:
            found = solve_once(qp.in_dense_form(), guess, limits)
            if found is not None and found.ends:
                return found
        substitution = substitute(qp, memory.substitution, limits.deadline)
        memory.substitution = substitution
        if limits.deadline.reached():
            return out_of_time(qp)
    if substitution is None:
        return solve_smallest_form(qp, guess, limits, memory)
    memory.convex = substitution.P  # the user's P was checked; it adds only squares
    memory.in_vain = False
    answer = solve_smallest_form(
        substitution.problem, substitution.guess(guess), limits, memory
    )
    answer = confirmed(answer, substitution, limits)
    if answer.status not in UNDECIDED:
        return answer
    guess = make_guess(qp, None, answer.point)
    return better(answer, solve_smallest_form(qp, guess, limits, Memory()), limits)


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
