"""The interface to qpsolvers: a Problem in, a Solution out, nothing computed here."""

import importlib
import time
import warnings
from typing import Any

import numpy as np

with warnings.catch_warnings():
    # qpsolvers warns where it finds no solver; `register` adds one.
    warnings.filterwarnings("ignore", message="no QP solver found")
    import qpsolvers
from qpsolvers.exceptions import ParamError, ProblemError, SolverError

from namlcp.options import DEFAULT_OPTIONS, Options
from namlcp.qp import (
    QP,
    ClosestPoint,
    Done,
    Memory,
    NotConvex,
    checked,
    make_guess,
    needs_more,
    parted,
    qp_arrays,
    result_of,
    solve_checked,
    solve_shortly,
)
from namlcp.residuals import Residuals
from namlcp.result import SOLVED, QPResult
from namlcp.status import Status

KEYWORD = "nam"
NO_ENTRIES = np.empty(0)


def nam_solve_problem(
    problem: qpsolvers.Problem,
    initvals: Any = None,
    verbose: bool = False,
    **settings: Any,
) -> qpsolvers.Solution:
    """Solve a quadratic program with namlcp.

    Parameters
    ----------
    problem : qpsolvers.Problem
        Dense, sparse or mixed; any SciPy sparse class. It is not changed.
    initvals : (n,) array, optional
        A guess of x; the constraints active there are tried first.
    verbose : bool
        Print a table of the progress.
    **settings
        eps_abs, eps_rel, max_iter, time_limit [s], threads, infeasible as in
        `namlcp.Options`, and warm_start, a Solution of a similar problem.

    Returns
    -------
    qpsolvers.Solution
        `found` only if the tolerances are met on the problem as it came; otherwise x
        is the best point, or None for an infeasible or unbounded problem, whose proof
        is extras["certificate"]; with infeasible="closest" x, y, z and z_box are those
        of the `ClosestPoint` extras["closest"]. extras also has status, message,
        iterations, form and residuals.

    Raises
    ------
    qpsolvers.ParamError
        A setting is unknown or has no meaning; the message names it.
    qpsolvers.ProblemError
        The problem is malformed, or P is not positive semidefinite.
    qpsolvers.SolverError
        The solver failed unexpectedly.
    """
    start = time.perf_counter()
    try:
        warm_start = settings.pop("warm_start", None)
        try:
            if verbose:
                settings["verbose"] = True
            options = Options.from_names(settings) if settings else DEFAULT_OPTIONS
        except (TypeError, ValueError) as error:
            raise ParamError(str(error)) from error
        try:
            qp, known, in_vain = qp_arrays(*problem.unpack()), None, False
            given = problem.P, problem.G, problem.A
            if initvals is None and warm_start is None:
                ready = time.perf_counter()
                done, known, in_vain, _ = solve_shortly(qp, options, start, given)
                if done is not None:
                    return short_solution(problem, qp, done, (start, ready))
                if known is not None and not needs_more(options, known):
                    result = result_of(known, (qp, given), start, ready)
                    return solution(problem, result)
            qp = checked(qp)
        except (TypeError, ValueError) as error:
            raise ProblemError(str(error)) from error
        try:
            guess = make_guess(qp, initvals, warm_start, "initvals")
        except (TypeError, ValueError) as error:
            raise ParamError(str(error)) from error
        try:
            result = solve_checked(
                qp, options, guess, start, False, Memory(in_vain), given, known
            )
        except NotConvex as error:
            raise ProblemError(str(error)) from error
        return solution(problem, result)
    except qpsolvers.exceptions.QPError:
        raise
    except Exception as error:  # a KeyError would mean "solver not installed"
        raise SolverError(f"namlcp failed: {error!r}") from error


def solution(problem: qpsolvers.Problem, result: QPResult) -> qpsolvers.Solution:
    """Return `result` as a Solution."""
    extras = extras_of(
        result.status,
        result.message,
        result.iterations,
        result.form,
        result.residuals,
    )
    answer = qpsolvers.Solution(
        problem,
        extras,
        result.status is Status.SOLVED,
        result.obj,
        build_time=result.setup_time,
        solve_time=result.solve_time,
    )
    absent = problem.lb is None and problem.ub is None
    z_box = NO_ENTRIES if absent else result.z_box
    point: QPResult | ClosestPoint = result
    if result.status is Status.PRIMAL_INFEASIBLE:
        extras["certificate"] = {"y": result.y, "z": result.z, "z_box": z_box}
        if result.closest is None:
            return answer
        extras["closest"] = point = result.closest
    elif result.status is Status.DUAL_INFEASIBLE:
        extras["certificate"] = {"x": result.x}
        return answer
    answer.x, answer.y = point.x, point.y
    answer.z, answer.z_box = point.z, NO_ENTRIES if absent else point.z_box
    return answer


def short_solution(
    problem: qpsolvers.Problem, qp: QP, done: Done, times: tuple[float, float]
) -> qpsolvers.Solution:
    """Return the answer `done` as a Solution, as `solution` does, in half of its time.

    times: the values of time.perf_counter() at the call and after its checks.
    """
    numbers, iterations, form = done
    point, residuals = parted(numbers, qp.q.size, qp.h.size, qp.b.size)
    x, y, z, z_box = point
    if problem.lb is None and problem.ub is None:
        z_box = NO_ENTRIES
    extras = extras_of(SOLVED, "", iterations, form, residuals)
    start, ready = times
    now = time.perf_counter()
    return qpsolvers.Solution(  # names of arguments would take 0.4 us
        problem, extras, True, residuals.objective, x, y, z, z_box,
        ready - start, now - ready,
    )  # fmt: skip


def extras_of(
    status: Status, message: str, iterations: int, form: str, residuals: Residuals
) -> dict[str, Any]:
    """Return what a Solution has no attributes for."""
    return {
        "status": status._value_,  # which is the value, without a descriptor
        "message": message or status.explanation,
        "iterations": iterations,
        "form": form,
        "residuals": residuals,
    }


def nam_solve_qp(
    P: Any,
    q: Any,
    G: Any = None,
    h: Any = None,
    A: Any = None,
    b: Any = None,
    lb: Any = None,
    ub: Any = None,
    initvals: Any = None,
    verbose: bool = False,
    **settings: Any,
) -> np.ndarray | None:
    """Return x of `nam_solve_problem`, or None where no solution was found."""
    problem = qpsolvers.Problem(P, q, G, h, A, b, lb, ub)
    answer = nam_solve_problem(problem, initvals, verbose, **settings)
    return answer.x if answer.found else None


def register() -> None:
    """Make solver="nam" known to qpsolvers; calling it again changes nothing.

    qpsolvers has no entry points; its table and lists are shared objects, so that
    earlier imports of them see the new name. A worker process started by spawn or
    forkserver must import namlcp again.
    """
    # The attribute qpsolvers.solve_problem is the function, hence import_module.
    module = importlib.import_module("qpsolvers.solve_problem")
    module.solve_function[KEYWORD] = nam_solve_problem
    for names in (
        qpsolvers.available_solvers,
        qpsolvers.dense_solvers,
        qpsolvers.sparse_solvers,
    ):
        if KEYWORD not in names:
            names.append(KEYWORD)
