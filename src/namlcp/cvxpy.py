"""The interface to CVXPY: data dict in, Solution out, nothing computed here.

``prob.solve(solver=namlcp.cvxpy.NAM())`` works as it stands; after `register` so does
``prob.solve(solver="NAM")``. Needs cvxpy >= 1.8.
"""

import time
from contextlib import suppress
from dataclasses import replace
from typing import Any

import cvxpy.settings as s
import numpy as np
import scipy.sparse as sp
from cvxpy.error import SolverError
from cvxpy.reductions.solution import Solution
from cvxpy.reductions.solvers import defines
from cvxpy.reductions.solvers.qp_solvers.qp_solver import QpSolver
from cvxpy.reductions.solvers.utilities import extract_dual_value, get_dual_values

import namlcp
from namlcp.options import Options
from namlcp.qp.problem import NotConvex
from namlcp.results import ClosestPoint, QPResult
from namlcp.solve.qp import solve_arguments
from namlcp.solve.solver import OtherShape, Solver
from namlcp.status import Status

KEYWORD = "NAM"


class NAM(QpSolver):
    """Solver of min 1/2 x'Px + q'x, A x = b, F x <= g for ``Problem.solve(solver=)``.

    Options, by keyword of ``Problem.solve``: eps_abs, eps_rel, max_iter, time_limit
    [s], threads and infeasible as in `namlcp.Options`; an unknown one is a TypeError. A
    problem solved again with other Parameters starts from its last solution unless
    ``warm_start=False``.

    ``Problem.status`` is "optimal" only if the tolerances are met on CVXPY's own data;
    "infeasible" leaves a Farkas certificate in the dual values (A'y + F'z = 0, z >= 0,
    b'y + g'z < 0), "unbounded" a ray in ``solver_stats.extra_stats["ray"]``;
    "user_limit" the best point, where iterations or time ran out or rounding errors
    stopped progress. With ``infeasible="closest"`` an infeasible problem has this
    status, too (CVXPY warns of it), and the values of the closest point, which is
    ``solver_stats.extra_stats["closest"]``: the shifts in it are those of the rows that
    CVXPY has made of the constraints. A P that is not positive semidefinite raises
    SolverError.

    Examples
    --------
    >>> import cvxpy as cp
    >>> import namlcp.cvxpy
    >>> x = cp.Variable(2)
    >>> problem = cp.Problem(cp.Minimize(cp.sum_squares(x - [1.0, -1.0])), [x >= 0.0])
    >>> round(problem.solve(solver=namlcp.cvxpy.NAM()), 9), problem.status
    (1.0, 'optimal')
    """

    MIP_CAPABLE = False
    BOUNDED_VARIABLES = False  # cvxpy 1.9 bounds auxiliary variables wrongly with True
    STATUS_MAP = {  # noqa: RUF012
        Status.SOLVED: s.OPTIMAL,
        Status.PRIMAL_INFEASIBLE: s.INFEASIBLE,
        Status.DUAL_INFEASIBLE: s.UNBOUNDED,
        Status.MAX_ITER: s.USER_LIMIT,
        Status.TIME_LIMIT: s.USER_LIMIT,
        Status.STALLED: s.USER_LIMIT,
        Status.NUMERICAL_ERROR: s.SOLVER_ERROR,
    }

    def name(self) -> str:
        return KEYWORD

    def import_solver(self) -> None:
        """Do nothing: the solver came with this module."""

    def __eq__(self, other: object) -> bool:
        """Equal by type, or every inline ``NAM()`` would recompile the problem."""
        return type(other) is type(self)

    def __hash__(self) -> int:
        """Match `__eq__`."""
        return hash(type(self))

    def solve_via_data(
        self,
        data: dict[str, Any],
        warm_start: bool,
        verbose: bool,
        solver_opts: dict[str, Any],
        solver_cache: dict[str, Any] | None = None,
    ) -> QPResult:
        """Solve CVXPY's QP.

        `solver_cache` keeps the result of the first solve, and a `Solver` from the
        second one on: it takes longer to make than a small problem takes to solve.
        Raises TypeError or ValueError for an option, SolverError for all else.
        """
        start = time.perf_counter()
        names = {k: v for k, v in solver_opts.items() if k != "use_quad_obj"}  # CVXPY's
        options = Options.from_names({**names, "verbose": bool(verbose)})
        cache = {} if solver_cache is None else solver_cache
        try:
            known = cache.get(KEYWORD) if warm_start else None
            if known is None:
                result = cache[KEYWORD] = solve_arguments(
                    arguments(data), options, start
                )
            else:
                solver, last = solver_of(data, known)
                solver.options = options
                cache[KEYWORD] = solver
                result = solver.solve(warm_start=last)
            if result.status is Status.DUAL_INFEASIBLE:
                result = infeasible_or(result, data, options, start)
        except NotConvex as error:
            raise SolverError(str(error)) from error
        except Exception as error:
            raise SolverError(f"namlcp failed: {error!r}") from error
        return result

    def invert(self, solution: QPResult, inverse_data: Any) -> Solution:
        """Return the result in CVXPY's terms; the signs of the duals are the same."""
        status = self.STATUS_MAP[solution.status]
        point: QPResult | ClosestPoint = solution
        closest = solution.closest
        if closest is not None and closest.status is Status.SOLVED:
            status, point = s.USER_LIMIT, closest
        y, z = point.y, point.z
        extra: dict[str, Any] = solution.summary() | {"closest": closest}
        # NaN where the problem is unbounded; an infinite equation has become a row.
        wanted = sum(constraint.size for constraint in inverse_data[self.EQ_CONSTR])
        have_duals = y.size == wanted and np.isfinite(np.append(y, z)).all()
        if status == s.INFEASIBLE and have_duals:
            extra["certificate"] = {"y": y, "z": z}  # cvxpy 1.8 drops duals here
        elif status == s.UNBOUNDED:
            extra["ray"] = solution.x
        attr = {
            s.SOLVE_TIME: solution.solve_time,
            s.SETUP_TIME: solution.setup_time,
            s.NUM_ITERS: int(solution.iterations),
            s.EXTRA_STATS: extra,
        }
        value = point.obj + inverse_data[s.OFFSET]  # infinite without a point
        x = {self.VAR_ID: point.x} if status in s.SOLUTION_PRESENT else {}
        duals: dict[int, Any] = {}
        if have_duals:
            for kind, values in (self.EQ_CONSTR, y), (self.NEQ_CONSTR, z):
                constraints = inverse_data[kind]
                duals |= get_dual_values(values, extract_dual_value, constraints)
        return Solution(status, value, x, duals, attr)

    def cite(self, data: dict[str, Any]) -> str:
        """Return the BibTeX entry that ``verbose=True, bibtex=True`` prints."""
        return (
            "@misc{namlcp,\n  author = {The namlcp authors},\n"
            "  title = {namlcp: linear complementarity problems and convex quadratic "
            "programs, solved exactly},\n"
            f"  note = {{version {namlcp.__version__}}}\n}}\n"
        )


def arguments(data: dict[str, Any]) -> tuple[Any, ...]:
    """Return P, q, G, h, A, b, lb, ub of CVXPY's data.

    An equality with an infinite side, which CVXPY lets pass, becomes a'x <= -inf.
    """
    P, q, A, b, F, g = (data[key] for key in (s.P, s.Q, s.A, s.B, s.F, s.G))
    infinite = np.isinf(b)
    if infinite.any():
        F = sp.vstack((F, A[infinite]))
        g = np.append(g, np.full(infinite.sum(), -np.inf))
        A, b = A[~infinite], b[~infinite]
    return P, q, F, g, A, b, None, None


def solver_of(
    data: dict[str, Any], known: Solver | QPResult
) -> tuple[Solver, QPResult | None]:
    whole = P, q, G, h, A, b, _, _ = arguments(data)
    sizes = q.size, h.size, b.size
    if isinstance(known, QPResult):
        fits = sizes == (known.x.size, known.z.size, known.y.size)
        return Solver(*whole), known if known and fits else None
    if sizes == known.sizes[:3]:
        with suppress(OtherShape):  # entries outside the pattern
            known.update(P=P, q=q, G=G, h=h, A=A, b=b)
            return known, None
    return Solver(*whole), None


def infeasible_or(
    unbounded: QPResult, data: dict[str, Any], options: Options, start: float
) -> QPResult:
    """Return a proof that no x is feasible if one is found, else `unbounded`.

    CVXPY's "unbounded" says that some x is feasible, which a ray does not prove.
    """
    P, q, *rows = arguments(data)
    proof_alone = replace(options, infeasible="certificate")
    flat = solve_arguments((0.0 * P, 0.0 * q, *rows), proof_alone, start)
    return flat if flat.status is Status.PRIMAL_INFEASIBLE else unbounded


def register() -> None:
    """Make ``solver="NAM"`` known to CVXPY, last in its order of preference."""
    defines.SOLVER_MAP_QP[KEYWORD] = NAM()
    for names in defines.QP_SOLVERS, defines.INSTALLED_SOLVERS:  # cvxpy 1.8 asks both
        if KEYWORD not in names:
            names.append(KEYWORD)
