"""A class of the campaign: closest points of infeasible QPs, by their two problems.

The first, least shifts, has for shifts of 2-norm the multipliers v = shift of its rows:
a point is its solution if and only if C'v plus multipliers of the bounds vanish, with
the signs that the bounds allow. For shifts of 1-norm HiGHS says how large their sum is.
The second, least cost, is the shifted QP: `campaign_judge.qp_faults`.
"""

from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.optimize import linprog

import namlcp
from validation.harness import judging
from validation.problems.fuzzed import cases, draw
from validation.stress.campaign_answers import NAM, clean, qp_answer
from validation.stress.campaign_judge import PROOF, judge_qp, qp_faults, ray_faults

SOFT = namlcp.Relaxation(lb=1.0, ub=1.0)
CHOICES = ("closest", 2, True), ("elastic", 1, True), (SOFT, 2, False)
"""What is asked for, the norm of the shifts, and whether bounds stay."""
LEAST = 1e-6  # excess of a sum of shifts over HiGHS's, which stops at 1e-7
AT_BOUND = 1e-8  # relative distance to a bound that may have a multiplier


def closest(maker: cases.Maker, d: draw.Draw) -> tuple[str, str]:
    """Return the outcome for a QP, and why it is not right; nothing if feasible."""
    qp, _ = maker(d)
    choice, norm, bounds_stay = CHOICES[int(d.rng.integers(len(CHOICES)))]
    wrap = sp.csc_array if d.chance(0.5) else np.asarray
    given = {k: wrap(v) if v.ndim == 2 else v for k, v in qp._asdict().items()}
    result = namlcp.solve_qp(**given, infeasible=choice)
    if result.closest is None:
        return "right", ""
    outcome, why = judge_qp(clean(qp), "both", qp_answer(result), NAM, proofs=True)
    if outcome != "right":
        return outcome, why
    return judge_closest(clean(qp), norm, bounds_stay, result.closest)


def judge_closest(qp: Any, norm: int, bounds_stay: bool, found: Any) -> tuple[str, str]:
    said = found.status.value
    if said == "primal_infeasible":
        clear = (qp.lb > qp.ub).any() and bounds_stay
        clear |= (qp.h == -np.inf).any() or (qp.lb == np.inf).any()
        return ("right", "") if clear else ("wrong", "called impossible")
    if said not in ("solved", "dual_infeasible"):
        return "refused", f"{said}, {found.message}"
    why = first_faults(qp, norm, bounds_stay, found)
    if not why and said == "dual_infeasible":
        free = np.full(qp.q.size, np.inf)
        cone = qp if bounds_stay else qp._replace(lb=-free, ub=free)
        why = ray_faults(cone, found.x)
        if not why and not bounds_stay and largest_fall(qp, found.x) > PROOF:
            why = "ray: into a bound"
    elif not why:
        sides = ("h", "b", "lb", "ub")
        moved = {k: getattr(qp, k) + getattr(found, f"shift_{k}") for k in sides}
        shifted = qp._replace(**moved)
        why = qp_faults(shifted, found.x, found.y, found.z, found.z_box, NAM)
    return ("wrong", why) if why else ("right", "")


def largest_fall(qp: Any, d: np.ndarray) -> float:
    """Return how far a ray runs into bounds, relative to its largest entry."""
    into = np.where(np.isfinite(qp.lb), np.maximum(-d, 0.0), 0.0)
    into = np.maximum(into, np.where(np.isfinite(qp.ub), d, 0.0))
    return judging.largest(into) / judging.largest(d)


def first_faults(qp: Any, norm: int, bounds_stay: bool, found: Any) -> str:
    """Return what is wrong with the shifts, "" if they are the least."""
    s, t = found.shift_h, found.shift_b
    low, up = found.shift_lb, found.shift_ub
    if not np.isfinite(np.concatenate((s, t, low, up))).all():
        return "shifts: not finite"
    if (s < 0.0).any() or (up < 0.0).any() or (low > 0.0).any():
        return "shifts: a sign"
    if bounds_stay and (low.any() or up.any()):
        return "shifts: of bounds"
    if norm == 1:
        total, least = float(s.sum() + np.abs(t).sum()), least_sum(qp)
        far = total > least + LEAST * (1.0 + least)
        return f"shifts: {total}, not {least}" if far else ""
    if found.status.value != "solved":
        return ""  # there is no point to tell which bounds hold
    force = -(qp.G.T @ s + qp.A.T @ t)
    terms = judging.largest(np.abs(qp.G.T) @ s + np.abs(qp.A.T) @ np.abs(t), up, low)
    if bounds_stay:
        x = found.x
        at_lb = x - qp.lb <= AT_BOUND * (1.0 + np.abs(qp.lb))
        at_ub = qp.ub - x <= AT_BOUND * (1.0 + np.abs(qp.ub))
        rest = np.where(at_lb, np.maximum(force, 0.0), force)
        rest = np.where(at_ub, np.minimum(rest, 0.0), rest)
    else:
        rest = force - up - low
    error = judging.largest(rest)
    least = NAM.allows(error, terms, terms)
    return "" if least else f"shifts: not least, {error:.1e} of {terms:.1e}"


def least_sum(qp: Any) -> float:
    on = np.isfinite(qp.h)
    G, h, A, b = qp.G[on], qp.h[on], qp.A, qp.b
    n, m, p = qp.q.size, h.size, b.size
    cost = np.concatenate((np.zeros(n), np.ones(m + 2 * p)))
    rows = np.hstack((G, -np.eye(m), np.zeros((m, 2 * p))))
    equations = np.hstack((A, np.zeros((p, m)), -np.eye(p), np.eye(p)))
    sides = np.column_stack((qp.lb, qp.ub)).tolist() + [(0.0, None)] * (m + 2 * p)
    answer = linprog(cost, rows, h, equations, b, sides, method="highs")
    return float(answer.fun) if answer.status == 0 else np.inf
