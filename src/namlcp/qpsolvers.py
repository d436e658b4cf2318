"""The interface to qpsolvers: a Problem in, a Solution out, nothing computed here."""

import importlib
import warnings
from time import perf_counter
from types import SimpleNamespace
from typing import Any

import numpy as np

with warnings.catch_warnings():
    # qpsolvers warns where it finds no solver; `register` adds one.
    warnings.filterwarnings("ignore", message="no QP solver found")
    import qpsolvers
from qpsolvers.exceptions import ParamError, ProblemError, SolverError

from namlcp.options import DEFAULT_OPTIONS, Options, remembered
from namlcp.qp.active.solve import solve_small
from namlcp.results import QPResult
from namlcp.solve.qp import solve_arguments
from namlcp.status import Status

KEYWORD = "nam"
NO_ENTRIES, NOTHING = np.empty(0), SimpleNamespace(x=None, y=None, z=None)
# Members of an Enum take 0.1 us to look up.
SOLVED, INFEASIBLE, UNBOUNDED = (
    Status.SOLVED, Status.PRIMAL_INFEASIBLE, Status.DUAL_INFEASIBLE
)  # fmt: skip


def nam_solve_problem(
    problem: "qpsolvers.Problem",
    initvals: Any = None,
    verbose: bool = False,
    warm_start: Any = None,
    **settings: Any,
) -> "qpsolvers.Solution":
    """Solve a quadratic program with namlcp.

    Parameters
    ----------
    problem : qpsolvers.Problem
        Dense, sparse or mixed; any SciPy sparse class. It is not changed.
    initvals : (n,) array, optional
        A guess of x; the constraints active there are tried first.
    verbose : bool
        Print a table of the progress.
    warm_start : qpsolvers.Solution, optional
        That of a similar problem; overrides initvals.
    **settings
        eps_abs, eps_rel, max_iter, time_limit [s], threads, infeasible as in
        `namlcp.Options`.

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
    start = perf_counter()
    try:
        if verbose:
            settings["verbose"] = True
        # the body of `from_names`, whose call would take 0.1 us
        options = remembered(**settings) if settings else DEFAULT_OPTIONS
    except (TypeError, ValueError):
        options = named_options(settings)
    arguments = problem.unpack()
    try:
        result = None
        if options.is_plain:
            result = solve_small(
                QPResult, options.settings, start, False, arguments, initvals,
                warm_start,
            )  # fmt: skip
        if result is None:
            result = solve_arguments(
                arguments, options, start, initvals, warm_start, name="initvals"
            )
        return solution(problem, result)
    except (TypeError, ValueError) as error:
        of_guess = str(error).startswith(("initvals", "warm_start"))
        raise (ParamError if of_guess else ProblemError)(str(error)) from error
    except Exception as error:  # a KeyError would mean "solver not installed"
        raise SolverError(f"namlcp failed: {error!r}") from error


def named_options(settings: dict[str, Any]) -> Options:
    try:
        return Options.from_names(settings)
    except (TypeError, ValueError) as error:
        raise ParamError(str(error)) from error


def solution(problem: "qpsolvers.Problem", result: QPResult) -> "qpsolvers.Solution":
    """Return `result` as a Solution."""
    status, extras = result.status, result.summary()
    is_free = problem.lb is None and problem.ub is None
    point: Any = result
    z_box: Any = NO_ENTRIES if is_free else result.z_box
    if status is INFEASIBLE:
        extras["certificate"] = {"y": result.y, "z": result.z, "z_box": z_box}
        point, z_box = NOTHING, None
        if result.closest is not None:
            extras["closest"] = point = result.closest
            z_box = NO_ENTRIES if is_free else point.z_box
    elif status is UNBOUNDED:
        extras["certificate"], point, z_box = {"x": result.x}, NOTHING, None
    return qpsolvers.Solution(  # names of arguments would take 0.4 us
        problem, extras, status is SOLVED, result.obj, point.x, point.y, point.z, z_box,
        result.setup_time, result.solve_time,
    )  # fmt: skip


def register() -> None:
    """Make solver="nam" known to qpsolvers, unless it has one of that name.

    Its table and lists are shared objects, so that earlier imports of them see the new
    name. A worker process started by spawn or forkserver must import namlcp again.
    """
    if not hasattr(qpsolvers, "__version__"):  # it is importing one that imports namlcp
        return
    # The attribute qpsolvers.solve_problem is the function, hence import_module.
    table = importlib.import_module("qpsolvers.solve_problem").solve_function
    if KEYWORD not in table:
        table[KEYWORD] = nam_solve_problem
        for kind in "available_solvers", "dense_solvers", "sparse_solvers":
            getattr(qpsolvers, kind).append(KEYWORD)
