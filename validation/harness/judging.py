"""Is an answer right? Residuals and signs, recomputed from the point."""

import time
from typing import Any

import numpy as np
import scipy.sparse as sp
from qpsolvers import Problem, Solution

from validation.harness import timing
from validation.harness.processes import Job, failure, raised
from validation.harness.qps import parts
from validation.harness.tables import Row

RESIDUALS = ["primal_residual", "dual_residual", "duality_gap", "sign_violation"]


def said_by(solution: Solution) -> str:
    extras = solution.extras or {}
    return str(extras.get("status", getattr(extras.get("info"), "status", "")))


def largest(*arrays: Any) -> float:
    """Return the largest modulus of an entry, 0 of nothing."""
    return max((float(np.abs(a).max()) for a in arrays if a.size), default=0.0)


def sign_violation(problem: Problem, solution: Solution) -> float:
    """Return the largest entry of a multiplier with a sign that it must not have."""
    *_, lb, ub = parts(problem)
    z = np.zeros(0) if solution.z is None else np.asarray(solution.z)
    z_box = np.zeros(0) if solution.z_box is None else np.asarray(solution.z_box)
    wrong = [np.zeros(1), -z]
    if z_box.size:
        wrong += [z_box[np.isinf(ub)], -z_box[np.isinf(lb)]]
    return float(np.max(np.concatenate(wrong)))


def judge(problem: Problem, solution: Solution, eps: float) -> dict[str, Any]:
    """Return found, residuals, success, a status in words; of ours also iterations.

    `residual` is the worst of the residuals, infinite if one is no number.
    """
    extras = solution.extras or {}
    row: dict[str, Any] = {"found": bool(solution.found)}
    row |= {key: extras[key] for key in ("iterations", "form") if key in extras}
    if not row["found"] or solution.x is None:
        return row | failure(f"not found {said_by(solution)}".strip())
    residuals = solution.primal_residual(), solution.dual_residual()
    others = solution.duality_gap(), sign_violation(problem, solution)
    errors = [float(error) for error in (*residuals, *others)]
    row |= zip(RESIDUALS, errors, strict=True)
    row["residual"] = max(np.inf if np.isnan(error) else error for error in errors)
    row["success"] = row["residual"] <= eps
    row["status"] = "solved" if row["success"] else "inaccurate"
    return row


def summary(rows: list[Row]) -> Row:
    """Return how many answers are right, what the first wrong one is, the residual."""
    failed = [row["status"] for row in rows if not row["success"]]
    found: Row = {"solved": len(rows) - len(failed)}
    found["residual"] = max(row.get("residual", np.inf) for row in rows)
    return found | {"status": failed[0] if failed else "solved"}


def timed(
    job: Job, call: timing.Call, judge: Any, clock: timing.Call = time.perf_counter
) -> Row:
    """Time a call, judge(its first answer); errors and lateness are rows as well."""
    job.ready()
    try:
        answer, cold, runtime = timing.median_time(call, clock)
        row = judge(answer)
    except Exception as error:
        return raised(error)
    late = failure("too slow") if cold > job.limit else {}
    return row | late | {"runtime": runtime, "cold": cold}


def filled(part: Any, size: int) -> np.ndarray:
    absent = part is None or np.size(part) != size
    return np.zeros(size) if absent else np.asarray(part, dtype=float)


def relative_residual(A: sp.csr_matrix, q: np.ndarray, z: np.ndarray) -> float:
    """Return the relative natural residual of the LCP scaled to unit diagonal."""
    d = 1.0 / np.sqrt(A.diagonal())
    residual = np.linalg.norm(np.minimum(z / d, d * (A @ z + q)))
    return float(residual / np.linalg.norm(np.minimum(d * q, 0.0)))


def verdict(problem: Problem, solution: Solution, eps: float) -> tuple[str, str]:
    said = said_by(solution)
    plain = said.lower().replace("_", "").replace(" ", "")
    if "primalinfeasible" in plain:
        return "infeasible", said
    if "dualinfeasible" in plain:
        return "unbounded", said
    if not solution.found:
        return "undecided", said
    accurate = judge(problem, solution, 10.0 * eps)["success"]
    return "solved" if accurate else "inaccurate", said
