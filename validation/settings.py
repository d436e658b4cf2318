"""What each solver is told: eps_abs = eps and eps_rel = 0 in its own words.

Of the settings that were tried (tolerances divided by 2, 10 and 100, duality gap check
off, iterative refinement always on, regularisation, scaling of the cost, polishing)
each solver has those with which it solves most; a comment says where that matters.
"""

from typing import Any

SOLVERS = ("nam", "piqp", "daqp", "proxqp", "clarabel", "osqp")


def solver_settings(solver: str, eps: float, limit: float) -> dict[str, Any]:
    """Return the keyword arguments for qpsolvers.solve_problem.

    Parameters
    ----------
    solver : str
        Keyword of the solver in qpsolvers.
    eps : float
        Absolute tolerance on primal residual, dual residual and duality gap.
    limit : float
        Time limit [s], for the solvers that know one.
    """
    known: dict[str, dict[str, Any]] = {
        "nam": {"eps_abs": eps, "eps_rel": 0.0, "time_limit": limit},
        "piqp": {
            "max_iter": 100_000,  # 250 end one problem of strict early
            "eps_abs": eps,
            "eps_rel": 0.0,
            "check_duality_gap": True,
            "eps_duality_gap_abs": eps,
            "eps_duality_gap_rel": 0.0,
        },
        "daqp": {"primal_tol": eps, "dual_tol": eps},
        "proxqp": {
            "eps_abs": eps,
            "eps_rel": 0.0,
            "check_duality_gap": True,
            "eps_duality_gap_abs": eps,
            "eps_duality_gap_rel": 0.0,
        },
        "clarabel": {
            "tol_feas": eps,
            "tol_gap_abs": eps,
            "tol_gap_rel": 0.0,
            "max_threads": 1,
            "time_limit": limit,
        },
        "osqp": {
            "eps_abs": eps,
            "eps_rel": 0.0,
            "check_dualgap": True,
            "polishing": True,
            "polish_refine_iter": 10,  # 3 leave up to two more of each set inaccurate
            "eps_prim_inf": 1e-10,  # 1e-4 calls solvable problems infeasible
            "eps_dual_inf": 1e-10,
            "max_iter": 1_000_000_000,
            "time_limit": limit,
        },
        "scs": {"eps_abs": eps, "eps_rel": 0.0, "max_iters": 1_000_000_000},
        "highs": {
            "primal_feasibility_tolerance": eps,
            "dual_feasibility_tolerance": eps,
            "time_limit": limit,
        },
        "quadprog": {},
    }
    return known[solver]
