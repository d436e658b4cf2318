"""solve_qp: check, solve by the `route`, and make the result."""

from time import perf_counter
from typing import Any

import numpy as np

from namlcp.limits import Deadline, interruptible
from namlcp.linalg import blas_threads
from namlcp.options import DEFAULT_OPTIONS, Options, check_flag
from namlcp.progress import QP_COLUMNS, Progress
from namlcp.qp.active import (
    solve_small,
)
from namlcp.qp.active.dense import DenseActiveSet
from namlcp.qp.active.state import Code
from namlcp.qp.answer import OBJECTIVE, Answer
from namlcp.qp.closest import check_weights, closest_point
from namlcp.qp.guess import Guess, make_guess
from namlcp.qp.judge import NOT_GIVEN, Matrices
from namlcp.qp.memory import Memory
from namlcp.qp.problem import QP, qp_data, stamp_of
from namlcp.qp.route import route
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
    `namlcp.residuals` has the formulas, `namlcp.qp.route` the methods.

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
    qp = qp_data(*arguments)
    guess, memory = make_guess(qp, x0, warm_start, name), None
    if tried is not None:
        memory = Memory(in_vain=tried.code not in (Code.UNSUITED, Code.FAULTY))
    result = solve_checked(qp, options, guess, start, history, memory, (P, G, A))
    result.stamp = stamp_of(qp)
    return result


@interruptible
def solve_checked(
    qp: QP,
    options: Options,
    guess: Guess,
    start: float,
    history: bool = False,
    memory: Memory | None = None,
    given: Matrices = NOT_GIVEN,
    known: Answer | None = None,
) -> QPResult:
    """Solve a checked QP; `start` is the perf_counter() of the call.

    `memory` may be kept for the next problem of the same pattern; it is changed.
    `given`: P, G and A as the user holds them, in whose order sums are judged, and in
    whose form gradients are. `known`: the answer, if the closest point is left to find.
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
        answer = known or route(qp, guess, limits, memory, given)
        if relaxation and answer.status is Status.PRIMAL_INFEASIBLE:
            closest = closest_point((qp, given), relaxation, limits, route)
    if progress is not None:
        progress.close(conclude(answer, perf_counter() - start))
    kept = progress.history() if progress is not None and history else None
    return result_of(answer, (qp, given), start, ready, kept, closest)


def result_of(
    answer: Answer,
    problem: tuple[QP, Matrices],
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
