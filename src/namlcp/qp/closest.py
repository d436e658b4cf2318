"""The nearest feasible problem of an infeasible QP, and its solution.

All rows in one matrix, C = [G; A], d = [h; b], with shifts r of d, r >= 0 in a row of
G. Stage 1 finds the least ones,

    minimise  1/2 sum w_i r_i^2  (norm 2)  or  sum w_i |r_i|  (norm 1)
    subject to  G x <= h + r_G,  A x = b + r_A,  lb <= x <= ub,

a convex QP (Chiche and Gilbert, J. Convex Anal. 23 (2016) 425-459) or an LP (elastic
programming: Chinneck, Feasibility and Infeasibility in Optimization, 2008). Its
multipliers v of the rows and v_box of the bounds satisfy C'v + v_box = 0: they prove
that no x is feasible without shifts, and they describe all solutions (`Face`). Stage 2
minimises the cost over the x of all solutions.

Let v and v_box be any multipliers of stage 1. By complementary slackness, x belongs to
a solution if and only if it is feasible with some shifts and

    floor_i < v_i < ceiling_i    C_i x  = d_i + r_i,
    v_i = floor_i                C_i x <= d_i + r_i,
    v_i = ceiling_i              C_i x >= d_i + r_i,
    v_box_j < 0 (> 0)            x_j = lb_j (ub_j),

with floor_i = 0 in an inequality. Norm 2: r_i = v_i / w_i, no ceiling, and no floor in
an equality. Norm 1: here r_i = 0, the ceiling is w_i and the floor of an equality -w_i;
the shift is what C_i x exceeds or misses d_i by.

The multipliers of stage 2 plus k times those of stage 1 are stationary for the shifted
QP for any k; k is the least one that gives all of them their sign.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp

from namlcp.checks import from_arrays, vector
from namlcp.limits import Limits
from namlcp.linalg.csc import add_transposed, submatrix, times
from namlcp.options import SIDES, Relaxation
from namlcp.qp.certificates import largest
from namlcp.qp.problem import NO_GUESS, QP, Guess, Point, make_guess
from namlcp.residuals import UNDEFINED, Residuals, qp_residuals
from namlcp.status import OBJECTIVE, Outcome, Status

Solve = Callable[..., Outcome]
"""Solves a QP: (qp, guess, limits), see `namlcp.qp.route`."""

# eps_abs and eps_rel of both stages, at most: what is active is read from the last
# digits of multipliers.
STAGE_TOLERANCES = 1e-9, 1e-13
# The same where stage 2 fails on what stage 1 says is active: many multipliers and
# slacks that both vanish are left near the square root of their products.
FINEST = {"eps_abs": 1e-11, "eps_rel": 1e-15}
# Weighted sum of least shifts over that of stage 1, at most.
LARGER = 1.0 + 1e-7
NO_NEAREST = "No shift helps: the constraints that must stay contradict each other. "
NOT_LEAST = "The search for the least shifts ended with status {}: these are larger. "
NOT_MINIMISED = (
    "The shifts are the least ones, but the search for the least cost ended with "
    "status {}: x is some point with these shifts, its multipliers are not known. "
)
UNPROVED = (
    "The shifts are the least ones; that x has the least cost with them is not proved: "
    "the multipliers are so large that rounding leaves a primal residual of {:.1e}, a "
    "dual one of {:.1e} and a gap of {:.1e}. "
)

# Error of C x - d at a solution of stage 1, relative to the moduli of its terms: some
# fifty units of rounding. A larger one would drop rows in units 10^6 times larger.
ROUNDING = 1e-14
# A multiplier of stage 1 this close to its floor or ceiling, relative to the largest
# one, stands at it.
AT_LIMIT = 1e-9


class Rows(NamedTuple):
    """Rows C x <= d, the last p of them C x = d, within lb <= x <= ub.

    C holds the rows of G, then the bounds of finite weight x_j <= ub_j (j in `upper`)
    and -x_j <= -lb_j (j in `lower`), then the rows of A; lb and ub are infinite there.
    """

    C: Any
    d: np.ndarray
    weights: np.ndarray
    p: int
    lb: np.ndarray
    ub: np.ndarray
    upper: np.ndarray
    lower: np.ndarray
    norm: int

    @property
    def is_equality(self) -> np.ndarray:
        return np.arange(self.d.size) >= self.d.size - self.p

    def violations(self, x: np.ndarray) -> np.ndarray:
        r = times(self.C, x) - self.d
        return np.where(self.is_equality, r, np.maximum(r, 0.0))

    def cost(self, x: np.ndarray) -> float:
        """Return what stage 1 minimises (norm 2: twice that)."""
        soft = np.isfinite(self.weights)
        r = np.abs(self.violations(x)[soft])
        return float(self.weights[soft] @ r**self.norm)

    def parts(self, v: np.ndarray) -> list[np.ndarray]:
        """Return the parts of v: G, upper, lower, A; it may have leading axes."""
        ends = np.cumsum((self.p, self.lower.size, self.upper.size))
        return np.split(v, v.shape[-1] - ends[::-1], axis=-1)

    def point(self, x: np.ndarray, v: np.ndarray, v_box: np.ndarray) -> Point:
        z, of_upper, of_lower, y = self.parts(v)
        z_box = v_box.copy()
        z_box[self.upper] += of_upper
        z_box[self.lower] -= of_lower
        return Point(x, y, z, z_box)

    def shifts(self, r: np.ndarray) -> tuple[np.ndarray, ...]:
        """Return the shifts of h, b, lb and ub for those of d."""
        h, of_upper, of_lower, b = self.parts(r)
        lb, ub = np.zeros((2, self.lb.size))
        lb[self.lower] = 0.0 - of_lower
        ub[self.upper] = of_upper
        return h, b, lb, ub


def rows_of(qp: QP, relaxation: Relaxation) -> Rows:
    w = weights_of(qp, relaxation)
    upper, lower = (
        np.flatnonzero(np.isfinite(w[side]) & np.isfinite(bound))
        for side, bound in (("ub", qp.ub), ("lb", qp.lb))
    )
    lb, ub = qp.lb.copy(), qp.ub.copy()
    lb[lower], ub[upper] = -np.inf, np.inf
    n, soft = qp.q.size, []
    for at, sign in ((upper, 1.0), (lower, -1.0)):
        k, values = np.arange(at.size), np.full(at.size, sign)
        soft.append(scattered(k, at, values, (at.size, n), qp.is_dense))
    C = stacked(0, qp.G, *soft, qp.A)
    d = np.concatenate((qp.h, qp.ub[upper], -qp.lb[lower], qp.b))
    weights = np.concatenate((w["h"], w["ub"][upper], w["lb"][lower], w["b"]))
    return Rows(C, d, weights, qp.b.size, lb, ub, upper, lower, relaxation.norm)


def least_shifts(rows: Rows) -> QP:
    """Return stage 1: the QP in (x, r), or the LP in (x, r+, r-)."""
    n, dense = rows.lb.size, isinstance(rows.C, np.ndarray)
    soft = np.flatnonzero(np.isfinite(rows.weights) & (rows.d < np.inf))
    signs = np.repeat(-1.0, soft.size)
    if rows.norm == 1:
        both = soft[rows.is_equality[soft]]
        soft, signs = np.append(soft, both), np.append(signs, np.ones(both.size))
    k, w = soft.size, rows.weights[soft]
    squares, costs = (w, 0.0 * w) if rows.norm == 2 else (w[:0], w)
    at, columns = n + np.arange(squares.size), np.arange(k)
    shifts = scattered(soft, columns, signs, (rows.d.size, k), dense)
    C = stacked(1, rows.C, shifts)
    below, equal = np.split(np.arange(rows.d.size), [rows.d.size - rows.p])
    return QP(
        scattered(at, at, squares, (n + k, n + k), dense),
        np.append(np.zeros(n), costs),
        chosen(C, below),
        rows.d[below],
        chosen(C, equal),
        rows.d[equal],
        np.append(rows.lb, np.full(k, -np.inf if rows.norm == 2 else 0.0)),
        np.append(rows.ub, np.full(k, np.inf)),
    )


def weights_of(qp: QP, relaxation: Relaxation) -> dict[str, np.ndarray]:
    """Return the weight of each entry of h, b, lb and ub; raise unless they fit."""
    found = {}
    for side in SIDES:
        value, own = getattr(relaxation, side), getattr(qp, side)
        if np.ndim(value) == 0:
            found[side] = np.full(own.size, float(value))
        else:
            name = f"Relaxation.{side}"
            found[side] = vector(name, value, own.size, side, own.shape)
    return found


def scattered(
    rows: Any, columns: Any, values: Any, shape: tuple[int, int], dense: bool
) -> Any:
    """Return the matrix with these entries, given column by column."""
    if dense:
        M = np.zeros(shape)
        M[rows, columns] = values
        return M
    indptr = np.searchsorted(columns, np.arange(shape[1] + 1)).astype(np.int32)
    return from_arrays((indptr, rows.astype(np.int32), values), shape)


def stacked(axis: int, *blocks: Any) -> Any:
    if isinstance(blocks[0], np.ndarray):
        return np.concatenate(blocks, axis)
    return (sp.hstack if axis else sp.vstack)(blocks, "csc")


def chosen(C: Any, rows: np.ndarray, columns: np.ndarray | None = None) -> Any:
    if isinstance(C, np.ndarray):
        return C[rows] if columns is None else C[np.ix_(rows, columns)]
    return submatrix(C, rows, np.arange(C.shape[1]) if columns is None else columns)


class Face(NamedTuple):
    """The x of all solutions of stage 1: C x <= d + r, = or >= for sense 1, 0, -1.

    x, v, v_box: one of them. r: its shifts in norm 2, else 0.
    """

    rows: Rows
    x: np.ndarray
    v: np.ndarray
    v_box: np.ndarray
    sense: np.ndarray
    r: np.ndarray
    lb: np.ndarray
    ub: np.ndarray

    def refined(self, solve: Callable[[QP], Outcome]) -> "Face | None":
        """Return the face with C'v + v_box = 0 to rounding, None where that fails.

        An inequality with a force v_i C_i below that residual, in the 1-norm, is no
        longer held: rounding alone may have made its multiplier positive. The other
        held rows take the least change of v, a QP for `solve`.
        """
        C, one_sided, fixed = self.rows.C, ~self.rows.is_equality, self.v_box != 0.0
        forces = np.abs(self.v) * times(abs(C), np.ones(fixed.size))
        noisy = (self.sense == 0) & (forces <= np.abs(C.T @ self.v + self.v_box).sum())
        sense = np.where(one_sided & noisy, 1, self.sense)
        v, held = np.where(one_sided & (sense == 1), 0.0, self.v), sense == 0
        rows, dense, size = np.flatnonzero(held), isinstance(C, np.ndarray), largest(v)
        if not rows.size:
            return None
        A = chosen(C, rows, np.flatnonzero(~fixed)).T  # C_j'v = 0 in free columns
        A = np.ascontiguousarray(A) if dense else sp.csc_array(A)
        m, at = rows.size, np.arange(rows.size)
        none, zero, unlimited = np.empty(0), np.zeros(A.shape[0]), np.full(m, np.inf)
        P = scattered(at, at, np.ones(m), (m, m), dense)
        q = -v[held] / size  # of multipliers 1 the errors are relative ones
        change = QP(P, q, chosen(A, at[:0]), none, A, zero, -unlimited, unlimited)
        found = solve(change)
        if found.status is not Status.SOLVED:
            return None
        v[held] = size * found.point.x
        return face_of(self.rows, self.x, v, np.where(fixed, -(C.T @ v), 0.0))

    def problem(self, qp: QP) -> QP:
        """Return the QP of stage 2."""
        C, d, equal = self.rows.C, self.rows.d + self.r, self.held
        bounded = np.flatnonzero(self.sense)
        sense, G, A = self.sense[bounded], chosen(C, bounded), chosen(C, equal)
        if isinstance(G, np.ndarray):
            G = sense[:, None] * G
        else:
            turned = G.indptr, G.indices, sense[G.indices] * G.data
            G = from_arrays(turned, G.shape)
        h = sense * d[bounded]
        return QP(qp.P, qp.q, G, h, A, d[equal], self.lb, self.ub)

    @property
    def held(self) -> np.ndarray:
        return np.flatnonzero(self.sense == 0)

    @property
    def shifted(self) -> np.ndarray:
        return self.held[np.isfinite(self.rows.weights[self.held])]

    def spread(self, of_held: np.ndarray, of_bounded: np.ndarray) -> np.ndarray:
        out = np.empty(self.v.size)
        out[self.sense == 0], out[self.sense != 0] = of_held, of_bounded
        return out

    def least_shifts(self, x: np.ndarray) -> tuple[QP, Point]:
        """Return stage 1 of norm 2 with held rows and bounds, and its solution."""
        rows, held = self.rows, self.held
        C, d, weights = chosen(rows.C, held), rows.d[held], rows.weights[held]
        lb = np.where(self.v_box != 0.0, self.lb, -np.inf)
        ub = np.where(self.v_box != 0.0, self.ub, np.inf)
        alone = rows._replace(C=C, d=d, weights=weights, p=held.size, lb=lb, ub=ub)
        r = self.r[self.shifted]
        v_box = np.append(self.v_box, np.zeros(r.size))
        point = Point(np.append(x, r), self.v[held], np.empty(0), v_box)
        return least_shifts(alone), point

    def shifts(self, x: np.ndarray) -> np.ndarray:
        moves = (self.sense < 0) | ((self.sense > 0) & self.rows.is_equality)
        return np.where(moves, self.rows.violations(x), self.r)

    def point(self, found: Point) -> Point:
        """Return the point of the shifted QP for one of stage 2."""
        v, v_box = self.spread(found.y, found.z), found.z_box
        v = np.where(self.sense < 0, -v, v)
        signed = ~self.rows.is_equality & (self.sense != 1)  # where v >= 0 is at stake
        fixed = self.v_box != 0.0
        k = max(
            (-v[signed] / self.v[signed]).max(initial=0.0),
            (-v_box[fixed] / self.v_box[fixed]).max(initial=0.0),
        )
        v, v_box = v + k * self.v, v_box + k * self.v_box
        v[signed] = np.maximum(v[signed], 0.0)  # the least one may be rounded below 0
        return self.rows.point(found.x, v, v_box)


def face_of(rows: Rows, x: np.ndarray, v: np.ndarray, v_box: np.ndarray) -> Face:
    equality, zero = rows.is_equality, AT_LIMIT * largest(v, v_box)
    zero_box, r = max(zero, largest(rows.C.T @ v + v_box)), np.zeros(v.size)
    if rows.norm == 2:
        known = np.isfinite(rows.weights) & np.isfinite(rows.d)
        w, d = np.where(known, (rows.weights, rows.d), 0.0)
        moduli = abs(rows.C)
        # bounds of the errors of v = w (C x - d) and of C'v
        noise = ROUNDING * w * (times(moduli, np.abs(x)) + np.abs(d))
        sums = np.zeros(x.size)
        add_transposed(moduli, noise, sums)
        zero, zero_box = np.maximum(zero, noise), np.maximum(zero_box, sums)
        # r is as exact as C x - d, whose error times w is `noise`, or as v / w
        by_v = noise > ROUNDING * largest(v)
        r = np.where(np.isfinite(rows.weights), rows.violations(x), 0.0)
        forces = np.where(equality, v, np.maximum(v, 0.0))
        r[by_v] = forces[by_v] / rows.weights[by_v]
    ceiling = rows.weights if rows.norm == 1 else np.full(v.size, np.inf)
    at_floor = v <= np.where(equality, -ceiling, 0.0) + zero
    at_ceiling = v >= ceiling - zero
    v_box = np.where(np.abs(v_box) > zero_box, v_box, 0.0)
    sense = at_floor.astype(int) - at_ceiling
    lb = np.where(v_box > 0.0, rows.ub, rows.lb)
    ub = np.where(v_box < 0.0, rows.lb, rows.ub)
    return Face(rows, x, v, v_box, sense, r, lb, ub)


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Nearest:
    """What the search for the nearest feasible problem found, see `ClosestPoint`.

    stages, with SOLVED: the `Face`, the QP of stage 2 and its solution.
    """

    status: Status
    x: np.ndarray
    y: np.ndarray
    z: np.ndarray
    z_box: np.ndarray
    obj: float
    residuals: Residuals
    shift_h: np.ndarray
    shift_b: np.ndarray
    shift_lb: np.ndarray
    shift_ub: np.ndarray
    norm: int
    message: str
    stages: Any = None


StageOne = tuple[Rows, Outcome, Face | None]  # the last if it is solved


def nearest(
    qp: QP,
    relaxation: Relaxation,
    limits: Limits,
    solve: Solve,
    stage: StageOne | None = None,
) -> Nearest:
    """Return the solution of the feasible problem nearest to an infeasible QP.

    Both stages have the same limits; `stage` is the first, if it is solved already.
    """
    exactly = partial(solve_exactly, limits=limits, solve=solve)
    rows, answer, face = stage or stage_one(rows_of(qp, relaxation), exactly)
    if face is None:
        x, status, message = answer.point.x[: qp.q.size], answer.status, answer.message
        if status is Status.PRIMAL_INFEASIBLE:
            r, message = np.full(rows.d.size, np.nan), NO_NEAREST + message
        else:
            r, message = rows.violations(x), NOT_LEAST.format(status.value) + message
        return reported(qp, rows, without_multipliers(qp, x), r, status, message)
    found = least_cost(qp, face, limits, exactly)
    finer = partial(solve_exactly, limits=limits._replace(**FINEST), solve=solve)
    tries = (lambda: face.refined(exactly)), (lambda: stage_one(rows, finer)[-1])
    for sharpened in tries if found.status is Status.STALLED else ():
        sharper = sharpened()
        if sharper is not None:
            other = least_cost(qp, sharper, limits, exactly)
            if other.status is Status.DUAL_INFEASIBLE:
                return other
            # rows let go wrongly would leave a solution with larger shifts
            most = LARGER * rows.cost(face.x) + limits.eps_abs
            if other.status is Status.SOLVED and rows.cost(other.x) <= most:
                return other
    return found


def contradiction(
    qp: QP, limits: Limits, solve: Solve
) -> tuple[Point | None, StageOne]:
    """Return multipliers of the least shifts, which may prove that a QP needs some."""
    exactly = partial(solve_exactly, limits=limits, solve=solve)
    rows, _, face = stage = stage_one(rows_of(qp, Relaxation()), exactly)
    if face is None:
        return None, stage
    face = face.refined(exactly) or face
    return rows.point(face.x, face.v, face.v_box), stage


def stage_one(rows: Rows, exactly: Callable[[QP], Outcome]) -> StageOne:
    answer, n = exactly(least_shifts(rows)), rows.lb.size
    if answer.status is not Status.SOLVED:
        return rows, answer, None
    x, y, z, z_box = answer.point
    return rows, answer, face_of(rows, x[:n], np.concatenate((z, y)), z_box[:n])


def solve_exactly(
    qp: QP, limits: Limits, solve: Solve, guess: Guess = NO_GUESS
) -> Outcome:
    eps_abs, eps_rel = np.minimum(limits.tolerances, STAGE_TOLERANCES).tolist()
    answer = solve(qp, guess, limits._replace(eps_abs=eps_abs, eps_rel=eps_rel))
    if answer.status is Status.STALLED and answer.residuals.solved(*limits.tolerances):
        return answer._replace(status=Status.SOLVED)
    return answer


def least_cost(
    qp: QP, face: Face, limits: Limits, exactly: Callable[..., Outcome]
) -> Nearest:
    rows, x, easier = face.rows, face.x, face.problem(qp)
    # The rows active at x are those of the solution only if they leave x no freedom.
    settled = face.held.size + np.count_nonzero(face.v_box) >= x.size
    guess = make_guess(easier, x, None) if settled else NO_GUESS
    second = exactly(easier, guess=guess)
    status, message = second.status, second.message
    if status is Status.SOLVED:
        point = face.point(second.point)
        found = reported(qp, rows, point, face.shifts(point.x), status, message)
        residuals = found.residuals
        if residuals.solved(*limits.tolerances):
            return replace(found, stages=(face, easier, second.point))
        if residuals._replace(dual=0.0, gap=0.0).solved(*limits.tolerances):
            x = point.x
        status, message = Status.STALLED, UNPROVED.format(*residuals[:3]) + message
    elif status is not Status.DUAL_INFEASIBLE:
        message = NOT_MINIMISED.format(status.value) + message
        if status not in (Status.TIME_LIMIT, Status.MAX_ITER):
            status = Status.STALLED
    r = face.shifts(x)
    if status is Status.DUAL_INFEASIBLE:
        x = second.point.x
    return reported(qp, rows, without_multipliers(qp, x), r, status, message)


def reported(
    qp: QP, rows: Rows, point: Point, r: np.ndarray, status: Status, message: str
) -> Nearest:
    """Return a point and shifts of the rows with residuals, NaN without multipliers."""
    shifts, x = dict(zip(SIDES, rows.shifts(r), strict=True)), point.x
    residuals = UNDEFINED
    if not np.isnan(point.z_box).any():
        sides = {side: getattr(qp, side) + shift for side, shift in shifts.items()}
        residuals = qp_residuals(*qp._replace(**sides), *point)
    objective = float(x @ (0.5 * times(qp.P, x) + qp.q))
    return Nearest(
        **point._asdict(),
        **{f"shift_{side}": shift for side, shift in shifts.items()},
        status=status,
        obj=OBJECTIVE.get(status, objective),
        residuals=residuals,
        norm=rows.norm,
        message=message.strip(),
    )


def without_multipliers(qp: QP, x: np.ndarray) -> Point:
    return Point(x, *(np.full(v.size, np.nan) for v in (qp.b, qp.h, qp.q)))
