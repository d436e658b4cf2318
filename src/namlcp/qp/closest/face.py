"""Stage 2: the least cost over the x of all solutions of stage 1.

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
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp

from namlcp.checks import from_arrays
from namlcp.linalg import times
from namlcp.qp.certificates import largest
from namlcp.qp.closest.rows import (
    ROUNDING,
    Rows,
    chosen,
    least_shifts,
    scattered,
)
from namlcp.qp.problem import QP, Point
from namlcp.status import Outcome, Status

# A multiplier of stage 1 this close to its floor or ceiling, relative to the largest
# one, stands at it. Those of a solution are exact to rounding.
AT_LIMIT = 1e-9


class Face(NamedTuple):
    """The x of all solutions of stage 1: C x <= d + r, = or >= for sense 1, 0, -1.

    x: one of them. v, v_box: the multipliers of stage 1. r: its shifts in norm 2, else
    0. lb = ub where x_j stays at a bound. `moves` marks the rows whose shift depends on
    x.
    """

    rows: Rows
    x: np.ndarray
    v: np.ndarray
    v_box: np.ndarray
    sense: np.ndarray
    r: np.ndarray
    lb: np.ndarray
    ub: np.ndarray
    moves: np.ndarray

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
        size = largest(v)  # of multipliers 1 the errors are relative ones
        if not held.any():
            return None
        found = solve(least_change(C, held, ~fixed, v / size))
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
        """Return values of the held rows and of the others as values of all rows."""
        out = np.empty(self.v.size)
        out[self.sense == 0], out[self.sense != 0] = of_held, of_bounded
        return out

    def least_shifts(self, x: np.ndarray) -> tuple[QP, Point]:
        """Return stage 1 of norm 2 with held rows and bounds alone, and its solution.

        Its variables are x and the shifts of those held rows that have a weight.
        """
        rows, held = self.rows, self.held
        alone = rows._replace(
            C=chosen(rows.C, held),
            d=rows.d[held],
            weights=rows.weights[held],
            p=held.size,
            lb=np.where(self.v_box != 0.0, self.lb, -np.inf),
            ub=np.where(self.v_box != 0.0, self.ub, np.inf),
        )
        r = self.r[self.shifted]
        v_box = np.append(self.v_box, np.zeros(r.size))
        point = Point(np.append(x, r), self.v[held], np.empty(0), v_box)
        return least_shifts(alone), point

    def shifts(self, x: np.ndarray) -> np.ndarray:
        """Return the shifts of d for an x of the face."""
        return np.where(self.moves, self.rows.violations(x), self.r)

    def point(self, found: Point) -> Point:
        """Return the point of stage 2 as one of the shifted user's QP."""
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


def least_change(C: Any, held: np.ndarray, free: np.ndarray, v: np.ndarray) -> QP:
    """Return the QP for the least change of v_held with C_j'v = 0 in free columns."""
    dense, held = isinstance(C, np.ndarray), np.flatnonzero(held)
    A = chosen(C, held, np.flatnonzero(free)).T
    A = np.ascontiguousarray(A) if dense else sp.csc_array(A)
    m, at = held.size, np.arange(held.size)
    none, zero, unlimited = np.empty(0), np.zeros(A.shape[0]), np.full(m, np.inf)
    P = scattered(at, at, np.ones(m), (m, m), dense)
    return QP(P, -v[held], chosen(A, at[:0]), none, A, zero, -unlimited, unlimited)


def face_of(rows: Rows, x: np.ndarray, v: np.ndarray, v_box: np.ndarray) -> Face:
    """Return the face that a solution of stage 1 describes: x, and the multipliers."""
    equality, zero = rows.is_equality, AT_LIMIT * largest(v, v_box)
    zero_box, r = max(zero, largest(rows.C.T @ v + v_box)), np.zeros(v.size)
    if rows.norm == 2:
        noise, sums = rows.rounding(x)
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
    return Face(
        rows=rows,
        x=x,
        v=v,
        v_box=v_box,
        sense=at_floor.astype(int) - at_ceiling,
        r=r,
        lb=np.where(v_box > 0.0, rows.ub, rows.lb),
        ub=np.where(v_box < 0.0, rows.lb, rows.ub),
        moves=at_ceiling | (at_floor & equality),
    )
