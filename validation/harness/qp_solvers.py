"""What each solver is told: eps_abs = eps and eps_rel = 0 in its own words.

Of the settings that were tried (tolerances divided by 2, 10 and 100, duality gap check
off, iterative refinement always on, regularisation, scaling of the cost, polishing)
each solver has those with which it solves most; a comment says where that matters.
"""

from typing import Any

import qpsolvers
from qpsolvers import Problem, Solution

from validation.harness.qps import sparse


def settings(solver: str, eps: float, limit: float) -> dict[str, Any]:
    """Return the arguments of solve_problem; limit [s] for those that know one."""
    both = {"eps_abs": eps, "eps_rel": 0.0}
    tol = {"tol_feas": eps, "tol_gap_abs": eps, "tol_gap_rel": 0.0}
    gap = {"eps_duality_gap_abs": eps, "eps_duality_gap_rel": 0.0}
    gap["check_duality_gap"] = True
    known: dict[str, dict[str, Any]] = {
        "nam": both | {"time_limit": limit},
        # 250 iterations end one problem of strict early
        "piqp": both | gap | {"max_iter": 100_000},
        "daqp": {"primal_tol": eps, "dual_tol": eps},
        "proxqp": both | gap,
        "clarabel": tol | {"max_threads": 1, "time_limit": limit},
        "osqp": both
        | {
            "check_dualgap": True,
            "polishing": True,
            "polish_refine_iter": 10,  # 3 leave up to two more of each set inaccurate
            "eps_prim_inf": 1e-10,  # 1e-4 calls solvable problems infeasible
            "eps_dual_inf": 1e-10,
            "max_iter": 1_000_000_000,
            "time_limit": limit,
        },
        "quadprog": {},
        "qtqp": tol,
    }
    return known[solver]


def solve(problem: Problem, solver: str, **settings: Any) -> Solution:
    if solver == "qtqp":  # warns of every matrix that it has to convert
        problem = sparse(problem)
    return qpsolvers.solve_problem(problem, solver=solver, **settings)


DETECTION: dict[str, dict[str, Any]] = {
    "osqp": {"eps_prim_inf": 1e-6, "eps_dual_inf": 1e-6, "max_iter": 20_000},
    "piqp": {"max_iter": 1000},
}


def detecting_settings(solver: str, eps: float, limit: float) -> dict[str, Any]:
    """Return settings with which a solver recognises problems without a solution."""
    return settings(solver, eps, limit) | DETECTION.get(solver, {})
