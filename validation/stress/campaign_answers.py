"""What namlcp and its peers say of a fuzzed problem, in the judge's terms."""

import warnings
from typing import Any

import numpy as np
import qpsolvers
import scipy.sparse as sp

from validation.harness import judging, qp_solvers, qps
from validation.problems.fuzzed import cases
from validation.stress.campaign_judge import Answer

NAM_LCP = 1e-9  # its default
INFINITE = 0.999e20  # what the documentation calls no bound


def clean(qp: Any) -> Any:
    """Return the QP with sides from 1e20 on infinite, P symmetric, as documented."""
    h = np.where(qp.h >= INFINITE, np.inf, qp.h)
    lb = np.where(qp.lb <= -INFINITE, -np.inf, qp.lb)
    ub = np.where(qp.ub >= INFINITE, np.inf, qp.ub)
    return qp._replace(P=(qp.P + qp.P.T) * 0.5, h=h, lb=lb, ub=ub)


def qpsolvers_problem(case: cases.Case) -> qpsolvers.Problem:
    """Return a clean QP without rows that are switched off, sparse where P is."""
    P, q, G, h, A, b, lb, ub = clean(case.problem)
    on = h < np.inf
    G, h = G[on], h[on]
    if sp.issparse(case.arguments["P"]):
        P, G, A = (sp.csc_matrix(M) for M in (P, G, A))
    bounds = [v if np.isfinite(v).any() else None for v in (lb, ub)]
    return qps.joined(P, q, G, h, A, b, *bounds)


def snapshot(arguments: dict[str, Any]) -> list[bytes]:
    """Return the numbers of the arguments, to see whether they change."""
    found = []
    for value in arguments.values():
        parts = [value]
        if sp.issparse(value):
            names = ("data", "indices", "indptr", "row", "col", "offsets")
            parts = [getattr(value, name, None) for name in names]
        found += [part.tobytes() for part in parts if isinstance(part, np.ndarray)]
    return found


SAID = {"primal_infeasible": "infeasible", "dual_infeasible": "unbounded"}


def ask_nam(case: cases.Case) -> tuple[Answer, Any]:
    """Return the answer, and namlcp's own result or exception."""
    import namlcp

    before = snapshot(case.arguments)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            if "P" in case.arguments:
                result: Any = namlcp.solve_qp(**case.arguments)
                answer = qp_answer(result)
            else:
                result = namlcp.solve_lcp(**case.arguments)
                answer = lcp_answer(result)
    except Exception as error:
        answer, result = Answer("error", words=f"{error}", kind=type(error)), error
    if snapshot(case.arguments) != before:
        answer = Answer("error", words="an input was changed", kind=RuntimeError)
    return answer, result


def qp_answer(result: Any) -> Answer:
    said = result.status.value
    arrays = result.x, result.y, result.z, result.z_box
    word = SAID.get(said, "solved" if said == "solved" else "refused")
    return Answer(word, *arrays, said)


def lcp_answer(result: Any) -> Answer:
    said = result.status.value
    if said == "unsolvable":
        kind = "exhausted" if result.ray is None else said
        return Answer(kind, result.ray, words=said)
    return Answer("solved" if said == "solved" else "refused", result.z, words=said)


def ask_peer(case: cases.Case, solver: str, eps: float, limit: float) -> Answer:
    problem = qpsolvers_problem(case)
    if solver == "quadprog":
        problem = qpsolvers.Problem(*problem.unpack_as_dense())
    settings = qp_solvers.detecting_settings(solver, eps, limit)
    if solver == "osqp":
        settings["max_iter"] = 4000  # its own limit, without a clock
    try:
        solution = qpsolvers.solve_problem(problem, solver=solver, **settings)
        said, words = judging.verdict(problem, solution, eps)
    except Exception as error:
        words = f"{type(error).__name__}: {error}"
        if "unbounded below" in words:
            return Answer("unbounded", words=words)
        return Answer("error", words=words, kind=type(error))
    if not solution.found:
        known = said in ("infeasible", "unbounded")
        return Answer(said if known else "refused", words=words)
    on = case.problem.h < INFINITE
    z = np.zeros(on.size)
    z[on] = judging.filled(solution.z, int(on.sum()))
    y = judging.filled(solution.y, case.problem.b.size)
    z_box = judging.filled(solution.z_box, problem.q.size)
    return Answer("solved", np.asarray(solution.x), y, z, z_box, words)
