"""Judge an answer by the definition of its problem, not by the solver's own words.

Nothing here is taken from namlcp: residuals, signs and certificates are computed anew,
and HiGHS (`infeasible_cases`) decides what was not constructed. The outcomes:

- right: solved within tolerance where a solution exists, infeasible or unbounded called
  so with a proof that holds, malformed input refused with its argument named;
- refused: no answer claimed;
- wrong: an answer that the definition contradicts;
- raised: an exception where none belongs, or one that does not say what is wrong.

A closest point of an infeasible QP is judged by its two problems. The first, least
shifts, has for shifts of 2-norm the multipliers v = shift of its rows: a point is its
solution if and only if C'v plus multipliers of the bounds vanish, with the signs that
the bounds allow. For shifts of 1-norm HiGHS says how large their sum is. The second,
least cost, is the shifted QP.
"""

import re
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import linprog

Verdict = tuple[str, str]  # the outcome, and why it is not right
ROUNDING = 1e-14  # of the terms of a residual, which the judge adds up in another order
PROOF = 1.01e-8  # residual of a certificate over its largest entry, without rounding
SLOPE = 1e-12  # of an LCP's ray, relative to its terms
LEAST = 1e-6  # excess of a sum of shifts over HiGHS's, which stops at 1e-7
AT_BOUND = 1e-8  # relative distance to a bound that may have a multiplier


class Answer(NamedTuple):
    """What a solver says, and what it returns with it.

    said: solved, infeasible, unbounded, unsolvable, exhausted (unsolvable, without a
    ray), refused, or error; then `words` is the message. For a QP (x, y, z, z_box) are
    the point or the certificate; for an LCP x is z, or the ray.
    """

    said: str
    x: Any = None
    y: Any = None
    z: Any = None
    z_box: Any = None
    words: str = ""
    kind: type[BaseException] | None = None


class Tolerance(NamedTuple):
    """A residual may be factor * (eps_abs + eps_rel * size of its terms)."""

    eps_abs: float
    eps_rel: float
    factor: float = 1.0

    def allows(self, residual: float, size: float, terms: float) -> bool:
        """Tell whether it does; `terms` is what the sum rounds with."""
        allowed = self.factor * (self.eps_abs + self.eps_rel * size)
        return residual <= allowed + ROUNDING * terms


NAM = Tolerance(1e-9, 1e-10)  # the defaults of namlcp


def largest(*arrays: np.ndarray) -> Any:
    return max((np.abs(a).max() for a in arrays if a.size), default=0.0)


def excess(*arrays: np.ndarray) -> Any:
    return max(0.0, *(a.max() for a in arrays if a.size), 0.0)


def wide(parts: Any) -> list[np.ndarray]:
    """Return the arrays in a type of more than twice the exponents, and more digits."""
    return [np.asarray(v, np.longdouble) for v in parts]


def qp_faults(
    qp: Any, x: np.ndarray, y: np.ndarray, z: np.ndarray, z_box: np.ndarray,
    tolerance: Tolerance,
) -> str:  # fmt: skip
    """Return what is wrong with a primal-dual point, "" if it solves the QP."""
    P, q, G, h, A, b, lb, ub = qp
    if not all(np.isfinite(v).all() for v in (x, y, z, z_box)):
        return "not finite"
    row = np.isfinite(h)
    low, high = np.isfinite(lb), np.isfinite(ub)
    Px, Gx, Ax, Aty, Gtz = P @ x, G @ x, A @ x, A.T @ y, G.T @ z
    primal = excess(Gx - h, lb - x, x - ub, np.abs(Ax - b))
    size = largest(Gx[row], Ax, b, x[low | high])
    terms = largest(np.abs(G) @ np.abs(x), np.abs(A) @ np.abs(x), size * np.ones(1))
    faults = []
    if not tolerance.allows(primal, size, terms):
        faults.append(f"primal {primal:.1e} of {size:.1e}")
    dual = largest(Px + q + Gtz + Aty + z_box)
    sign = excess(-z, -z_box[~low], z_box[~high], np.abs(z[~row]))
    size = largest(Px, q, Aty + Gtz, z_box)
    terms = largest(
        np.abs(P) @ np.abs(x) + np.abs(G.T) @ np.abs(z) + np.abs(A.T) @ np.abs(y),
        size * np.ones(1),
    )
    if not tolerance.allows(max(dual, sign), size, terms):
        faults.append(f"dual {dual:.1e}, signs {sign:.1e}, of {size:.1e}")
    side = np.where(z_box < 0.0, lb, ub)
    used = (z_box != 0.0) & np.isfinite(side)
    parts = (x * Px, q * x, b * y, h[row] * z[row], side[used] * z_box[used])
    sums = [part.sum() for part in parts]
    gap, size = abs(sum(sums)), max(map(abs, sums))
    terms = sum(np.abs(part).sum() for part in parts)
    terms += np.abs(x) @ (np.abs(P) @ np.abs(x))
    if not tolerance.allows(gap, size, terms):
        faults.append(f"gap {gap:.1e} of {size:.1e}")
    return ", ".join(faults)


def bit_faults(qp: Any, x: np.ndarray, z: np.ndarray, z_box: np.ndarray) -> str:
    """Return what is not as promised to the last bit: bounds of x, signs."""
    *_, lb, ub = qp
    crossed = lb > ub  # by less than the tolerance
    if ((x < lb) | (x > ub))[~crossed].any():
        return "x outside of its bounds"
    wrong = (z_box < 0.0) & np.isinf(lb) | (z_box > 0.0) & np.isinf(ub)
    return "a sign" if (z < 0.0).any() or wrong.any() else ""


def farkas_faults(qp: Any, y: np.ndarray, z: np.ndarray, z_box: np.ndarray) -> str:
    """Return what is wrong with a proof of infeasibility, "" if it holds.

    b'y + h'z + lb'z_box^- + ub'z_box^+ = -1, z >= 0, A'y + G'z + z_box = 0 up to PROOF
    and the rounding of the sum. Or one multiplier alone is not 0, that of a row with
    h = -inf, or of a variable whose bounds leave no finite x: then lb - ub = 1 / z_box.
    """
    _, _, G, h, A, b, lb, ub = qp
    if not np.isfinite(np.concatenate((y, z, z_box))).all():
        return "proof: not finite"
    none = (lb > ub) | (lb == np.inf) | (ub == -np.inf)
    own = np.concatenate((0.0 * y, z * (h == -np.inf), z_box * none))
    if own.any():
        others = np.count_nonzero(y) + np.count_nonzero(z) + np.count_nonzero(z_box)
        for low, high, mu in np.column_stack((lb, ub, z_box))[z_box != 0.0]:
            if np.isfinite([low, high]).all() and abs((low - high) * mu - 1.0) > 1e-9:
                return "proof: value"
        return "" if others == 1 else "proof: not alone"
    side = np.where(z_box < 0.0, lb, ub)
    rows, used = z != 0.0, z_box != 0.0
    if (z < 0.0).any() or np.isinf(h[rows]).any() or np.isinf(side[used]).any():
        return "proof: a sign"
    summands = np.concatenate((b * y, h[rows] * z[rows], side[used] * z_box[used]))
    value, rounding = summands.sum(), ROUNDING * np.abs(summands).sum()
    if not abs(value + 1.0) <= 1e-6 + rounding or rounding > 0.01:
        return f"proof: value {value} of terms {largest(summands):.1e}"
    sums, most = np.abs(A.T @ y + G.T @ z + z_box), largest(y, z, z_box)
    terms = np.abs(A.T) @ np.abs(y) + np.abs(G.T) @ z + np.abs(z_box)
    if (sums > PROOF * most + ROUNDING * terms).any():
        return f"proof: residual {largest(sums) / most:.1e}"
    return ""


def ray_faults(qp: Any, d: np.ndarray) -> str:
    """Return what is wrong with a proof of unboundedness, "" if it holds.

    q'd = -1, P d = 0, A d = 0, G d <= 0 up to PROOF and the rounding of the sums, d in
    the recession cone of the bounds.
    """
    P, q, G, h, A, _, lb, ub = qp
    if not np.isfinite(d).all():
        return "ray: not finite"
    if abs(q @ d + 1.0) > 1e-6:
        return f"ray: slope {q @ d}"
    if (d[np.isfinite(lb)] < 0.0).any() or (d[np.isfinite(ub)] > 0.0).any():
        return "ray: into a bound"
    Gd, row = G @ d, np.isfinite(h)
    sums = np.concatenate((np.abs(P @ d), np.abs(A @ d), np.maximum(Gd[row], 0.0)))
    terms = np.concatenate([np.abs(M) @ np.abs(d) for M in (P, A, G[row])])
    if (sums > PROOF * largest(d) + ROUNDING * terms).any():
        return f"ray: residual {largest(sums) / largest(d):.1e}"
    return ""


def lcp_faults(lcp: Any, z: np.ndarray, eps_rel: float) -> str:
    """Return what is wrong with z, "" if it solves the LCP.

    The natural residual of the problem scaled to a unit diagonal is at most eps_rel
    times its value at z = clip(0).
    """
    A, q, lower, upper = lcp
    if not np.isfinite(z).all():
        return "not finite"
    if (z < lower).any() or (z > upper).any():
        return "outside of the box"
    slopes = np.diag(A)
    d = np.sqrt(np.where(slopes > 0.0, slopes, 1.0))

    def residual(z: np.ndarray) -> tuple[float, float]:
        w = A @ z + q
        terms = np.abs(A) @ np.abs(z) + np.abs(q)
        r = np.maximum(np.minimum(w / d, (z - lower) * d), (z - upper) * d)
        scale = largest(r)
        if scale == 0.0:
            return 0.0, float(largest(terms / d))
        return scale * float(np.linalg.norm(r / scale)), largest(terms / d)

    here, terms = residual(z)
    start, _ = residual(np.clip(np.zeros(q.size), lower, upper))
    if here > eps_rel * start * (1.0 + 1e-9) + ROUNDING * terms:
        return f"residual {here:.1e} of {start:.1e}"
    return ""


def lcp_ray_faults(lcp: Any, v: np.ndarray) -> str:
    """Return what is wrong with a proof that an LCP has no solution, "" if it holds."""
    A, q, lower, upper = lcp
    if not np.isfinite(v).all():
        return "ray: not finite"
    if ((v > 0.0) & (upper < np.inf)).any() or ((v < 0.0) & (lower > -np.inf)).any():
        return "ray: into a bound"
    s, terms = A.T @ v, np.abs(A.T) @ np.abs(v)
    side = np.where(s > 0.0, upper, lower)
    moving = np.isfinite(side) | (np.abs(s) > SLOPE * terms)
    most = float(q @ v + side[moving] @ s[moving])
    if not abs(most + 1.0) <= 1e-6:
        return f"ray: at most {most}"
    rounding = np.abs(q) @ np.abs(v) + np.abs(side[moving]) @ terms[moving]
    return "ray: rounding alone" if SLOPE * rounding > 1.0 else ""


def judge_malformed(answer: Answer, name: str) -> Verdict:
    if answer.said != "error":
        return "wrong", f"{name} malformed: {answer.said}"
    named = re.search(rf"\b{name}\b", answer.words) is not None
    if answer.kind in (ValueError, TypeError) and named:
        return "right", ""
    return "raised", f"{name} malformed: {answer.words}"


def judge_qp(
    qp: Any, truth: str, answer: Answer, tolerance: Tolerance, proofs: bool
) -> Verdict:
    """Judge an answer; truth as in `fuzzed.qps`."""
    said = answer.said
    if said == "error":
        fitting = truth in ("not convex", "near", "far")
        fitting = fitting and issubclass(answer.kind or KeyError, ValueError)
        side, P = "h must be +inf", "P must be positive semidefinite"
        named = (side if truth == "far" else P) in answer.words
        return ("right" if fitting and named else "raised"), answer.words
    if said == "refused":
        return "refused", answer.words
    why = ""
    if truth == "far":
        qp = type(qp)(*wide(qp))
        answer = Answer(answer.said, *wide(answer[1:5]), *answer[5:])
    if said == "solved":
        why = qp_faults(qp, answer.x, answer.y, answer.z, answer.z_box, tolerance)
        if proofs and not why:
            why = bit_faults(qp, answer.x, answer.z, answer.z_box)
    elif proofs and said == "infeasible":
        why = farkas_faults(qp, answer.y, answer.z, answer.z_box)
    elif proofs:
        why = ray_faults(qp, answer.x)
    possible = {
        **dict.fromkeys(("solvable", "possible"), ("solved",)),
        **dict.fromkeys(("both", "not convex"), ("infeasible", "unbounded")),
        **dict.fromkeys(("far", "near"), ("solved", "infeasible", "unbounded")),
    }
    if said not in possible.get(truth, (truth,)):
        why = f"called {said}" + (f", {why}" if why else "")
    return ("wrong" if why else "right"), why


def judge_lcp(lcp: Any, truth: str, answer: Answer, eps_rel: float) -> Verdict:
    if truth == "far":
        lcp, truth = type(lcp)(*wide(lcp)), "near"
    if answer.said == "error":
        return "raised", answer.words
    if answer.said == "refused" or (answer.said == "exhausted" and truth == "near"):
        return "refused", answer.words
    if answer.said == "exhausted":  # no ray: all faces were looked at
        why = "" if truth == "unsolvable" else "called unsolvable"
    elif answer.said == "unsolvable":
        why = lcp_ray_faults(lcp, answer.x)
        if truth in ("solvable", "possible"):
            why = f"called unsolvable {why}"
    else:
        why = lcp_faults(lcp, answer.x, eps_rel)
        if truth == "unsolvable":
            why = f"called solved {why}"
    return ("wrong" if why else "right"), why


def judge_closest(qp: Any, norm: int, bounds_stay: bool, found: Any) -> Verdict:
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
    return largest(into) / largest(d)


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
    terms = largest(np.abs(qp.G.T) @ s + np.abs(qp.A.T) @ np.abs(t), up, low)
    if bounds_stay:
        x = found.x
        at_lb = x - qp.lb <= AT_BOUND * (1.0 + np.abs(qp.lb))
        at_ub = qp.ub - x <= AT_BOUND * (1.0 + np.abs(qp.ub))
        rest = np.where(at_lb, np.maximum(force, 0.0), force)
        rest = np.where(at_ub, np.minimum(rest, 0.0), rest)
    else:
        rest = force - up - low
    error = largest(rest)
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
