"""One-sided derivatives of solutions, also at kinks, by one more QP or LCP.

Along a direction of the data the solution of a QP moves like the solution of

    min 1/2 dx'P dx + r'dx,   r = dP x + dq + dG'z + dA'y
    G_i dx  = (dh - dG x)_i  where z_i > 0,   <=  where row i is weakly active
    A dx = db - dA x,   bounds alike,

whose multipliers are the derivatives of y, z and z_box (Robinson, Math. Programming
Study 19 (1982) 200-221; Bonnans and Shapiro, Perturbation Analysis of Optimization
Problems, 2000, ch. 5). Where multipliers are not unique, those have to be taken that
maximise the derivative of the optimal value,

    (dG x - dh)'z + (dA x - db)'y - dlb'z_box^- - dub'z_box^+   (Danskin),

an LP in the dependencies of the active constraints. For an LCP, dz solves the LCP with
A and dA z + dq in which free unknowns are free, strictly active ones fixed, and weakly
active ones have one bound.
"""

from time import perf_counter
from typing import Any

import numpy as np
from scipy.sparse import vstack

from namlcp.derivatives.gradients import LCPTangent, QPTangent, right_sides
from namlcp.derivatives.lcp import LCPDerivative
from namlcp.derivatives.marks import sides_of
from namlcp.derivatives.qp import QPDerivative, dependencies, factored, signs
from namlcp.lcp.data import lcp_data
from namlcp.lcp.methods import solve_by_method
from namlcp.lcp.pivoting.pivot import ACCURACY
from namlcp.limits import Limits
from namlcp.options import DEFAULT_OPTIONS
from namlcp.qp.intake import qp_data
from namlcp.qp.problem import NO_GUESS, Point
from namlcp.qp.route import solve_checked
from namlcp.status import Status


def qp_directional(derivative: QPDerivative, changes: dict[str, Any]) -> QPTangent:
    if not derivative.weak and not derivative.singular:
        return derivative.forward(changes)
    qp, d = derivative.qp, derivative.direction(changes)
    _, whole, _ = sides_of(qp, derivative.solution)
    point = steepest(derivative, whole, d)
    r, dh, db = right_sides(d, point)
    held, _, _ = sides_of(qp, point)
    p, rows = qp.b.size, qp.b.size + qp.h.size
    side, fixed = whole[rows:], held[rows:] != 0
    strict = np.flatnonzero(held[p:rows])
    weak = np.flatnonzero((whole[p:rows] != 0) & (held[p:rows] == 0))
    parts, b = (qp.A, qp.G[strict]), np.concatenate((db, dh[strict]))
    A = np.concatenate(parts) if qp.is_dense else vstack(parts, "csc")
    change = np.where(side < 0, d["lb"], d["ub"])
    lower = np.where(fixed | (side < 0), change, -np.inf)
    upper = np.where(fixed | (side > 0), change, np.inf)
    words = (
        "the solution has no derivative along this direction: the QP of the critical "
        "cone is {}"
    )
    dx, y, z, dz_box = solved(words, qp.P, r, qp.G[weak], dh[weak], A, b, lower, upper)
    dz = np.zeros(qp.h.size)
    dz[weak], dz[strict] = z, y[db.size :]
    return QPTangent(dx, y[: db.size], dz, dz_box, derivative.weak, derivative.singular)


def solved(words: str, *arguments: Any) -> Point:
    """Return the solution of a QP of these arguments; raise with the words if none."""
    qp = qp_data(*arguments)
    given = qp.P, qp.G, qp.A
    found = solve_checked(qp, DEFAULT_OPTIONS, NO_GUESS, perf_counter(), given=given)
    if found.status is not Status.SOLVED:
        raise ValueError(words.format(found.status.value))
    return found.point


def steepest(derivative: QPDerivative, whole: np.ndarray, d: dict[str, Any]) -> Point:
    """Return the multipliers that maximise the derivative of the optimal value."""
    qp, point = derivative.qp, derivative.solution
    N = dependencies(qp, whole, factored(qp, whole).null_space)
    if not N.size:
        return point
    sign, value = signs(qp, whole), np.concatenate(point[1:])
    _, dh, db = right_sides(d, point)
    change = np.where(whole[-qp.q.size :] < 0, d["lb"], d["ub"])
    slope = np.concatenate((db, dh, change)) @ N
    zero, signed = np.zeros((slope.size, slope.size)), sign != 0
    G, h = -(sign[:, None] * N)[signed], np.maximum(sign * value, 0.0)[signed]
    words = (
        "the QP has no solution along this direction: its constraints contradict each "
        "other (the LP of the multipliers is {})"
    )
    best = solved(words, zero, slope, G, h, None, None, None, None)
    value = value + N @ best.x
    return Point(point.x, *np.split(value, (qp.b.size, qp.b.size + qp.h.size)))


def lcp_directional(
    derivative: LCPDerivative, dA: Any, dq: Any, dlower: Any, dupper: Any
) -> LCPTangent:
    if not derivative.weak and not derivative.singular:
        return derivative.forward(dA, dq, dlower, dupper)
    lcp, weak_side = derivative.lcp, derivative.weak_side
    r, dl, du = derivative.direction(dA, dq, dlower, dupper)
    change = np.where(weak_side < 0, dl, du)
    fixed = derivative.strict_side != 0
    lower = np.where(fixed | (weak_side < 0), change, -np.inf)
    upper = np.where(fixed | (weak_side > 0), change, np.inf)
    direction = lcp_data(lcp.matrix, r, lower, upper)
    found = solve_by_method(*direction, Limits(eps_rel=ACCURACY), is_next=True)
    if found.status is not Status.SOLVED:
        raise ValueError(
            "the solution has no derivative along this direction: the LCP of the "
            f"critical cone is {found.status.value}"
        )
    dz, dw, _ = found.point
    return LCPTangent(dz, dw, derivative.weak, derivative.singular)
