"""The derivative of the solution of a QP in all of its data.

min 1/2 x'Px + q'x with Gx <= h (z), Ax = b (y), lb <= x <= ub (z_box). Let I be the
strictly active rows of G, B the variables at strictly active bounds, F the others,
C = [A; G_I] and v = (y, z_I). The KKT conditions of the active set are equations with
the symmetric matrix

    K = [P_FF  C_F']
        [C_F   0   ],

whose factors serve both directions. Backward, from the gradients (gx, gy, gz, gz_box)
of a scalar in the solution:

    u_B = gz_box_B,   K (u_F, v) = ((gx - P u0)_F, (gy, gz_I) - C u0),   u0 = (u_B, 0),
    v = (nu, lam_I),  mu = gx - P u - G'lam - A'nu  (0 on F)
    g_q = -u,   g_h = lam,   g_b = nu,   g_lb, g_ub = mu at the bounds active there
    g_P = -(u x' + x u')/2,   g_G = -(z u' + lam x'),   g_A = -(y u' + nu x')

Forward, the derivatives are (u, nu, lam, mu) of the same system with -(dP x + dq + dG'z
+ dA'y), db - dA x, dh - dG x and dlb or dub in place of gx, gy, gz and gz_box.

(Amos and Kolter, OptNet, ICML 2017; Magoon et al., dQP, 2024.) This holds where all
active constraints are strictly active and K is regular. Elsewhere the solution has
kinks, and an element of the generalised Jacobian is chosen:

1. weakly active constraints are dropped;
2. where strictly active ones depend on each other, independent ones that carry all
   multipliers are held (`independent`);
3. where K is still singular, weakly active constraints are held, too;
4. where it is singular even so, because x is not unique, a solution of least norm is
   taken.

Steps 1 and 2 are derivatives nearby: with the right-hand sides of the dropped rows
raised, x is still the solution, with the multipliers taken, and all is regular.

Along one direction the solution moves like that of the QP of the critical cone, with
the right-hand sides e of the forward derivative,

    min 1/2 dx'P dx + r'dx,   G_i dx = e_i where z_i > 0,  <= where row i is weakly
    active,   A dx = e,   bounds alike,

whose multipliers are the derivatives of y, z and z_box (Robinson, Math. Programming
Study 19 (1982) 200-221; Bonnans and Shapiro, Perturbation Analysis of Optimization
Problems, 2000, ch. 5). Multipliers of constraints that depend on each other are not
unique: they are those of one solution plus N t, with the signs that rows and bounds
want, where N spans the combinations (y, z, z_box) of active constraints with A'y + G'z
+ z_box = 0. Of these the derivative of the optimal value has to be largest (Danskin),
an LP in t: e'(y, z) and the moves of the bounds times z_box least.
"""

from collections.abc import Callable, Sequence
from functools import cached_property, partial
from time import perf_counter
from types import SimpleNamespace
from typing import Any

import numpy as np

from namlcp.checks import as_sparse, from_arrays, no_rows, real_array, refuse_number
from namlcp.derivatives.dense import DenseItem, differentiate_part, sides_of
from namlcp.derivatives.gradients import (
    BatchGradients,
    QPGradients,
    QPTangent,
    change,
    matrix_gradient,
    right_sides,
)
from namlcp.linalg.csc import add_transposed, by_rows, submatrix, times
from namlcp.options import DEFAULT_OPTIONS, check_count
from namlcp.qp.batch import Items, available_cores, chunks_of, on_threads
from namlcp.qp.certificates import largest
from namlcp.qp.closest import Face, stacked
from namlcp.qp.intake import qp_data
from namlcp.qp.kkt import KKT, equilibrate
from namlcp.qp.problem import NO_GUESS, QP, Point
from namlcp.qp.route import solve_checked
from namlcp.status import Status

# Most steps of refinement, and the residual that ends it, relative to the largest
# number of right-hand side and solution.
REFINEMENTS, ROUNDING = 20, 1e-15
# DELTA. A smaller shift makes smaller pivots, whose rounding errors would exceed it;
# the larger ones are tried where a pivot is 0 by rounding.
SHIFTS = 1e-8, 3.7e-8, 1.3e-7
# Steps that project random vectors to the null space of K; how many vectors, until the
# null space has fewer dimensions (of one with more than the last a part is found).
PROJECTIONS, WIDTHS = 4, (1, 4, 16, 64)
# A projected unit vector with a norm below LOST over sqrt(order) counts as 0: a random
# one has a larger part in any null space. Those with singular values below NULL,
# relative to the largest, are multiples of the others; of a unit vector v of the null
# space || K v || is at most ZERO_IMAGE, for K scaled.
LOST, NULL, ZERO_IMAGE = 1e-3, 1e-6, 1e-12
# Entries of a combination up to VANISHED of its largest one count as 0; in the
# multipliers a combination of null vectors counts as 0 below the norm INDEPENDENT.
VANISHED, INDEPENDENT = 1e-9, 1e-6


class QPDerivative:
    """The derivative of one solution.

    item: a dense QP whose strictly active constraints have good Cholesky factors, or
    None. Otherwise there are the sides of the constraints `held`, see `dense`, and the
    `factors` of K. point: the `solution`, with multipliers 0 of what is not held.
    """

    def __init__(
        self, qp: QP, point: Point, given: Any = None, factors: Any = None
    ) -> None:
        """Factor; `given`: P, G and A of the user; `factors`: those of the solve."""
        self.qp, self.given, self.solution = qp, given, point
        self.item, self.singular = None, False
        if qp.is_dense:
            item = DenseItem(qp.q.size, qp.h.size, qp.b.size)
            if item.take(qp, point, factors):
                self.item, self.point, self.weak = item, point, item.weak
                return
        self.hold()

    def hold(self) -> None:
        """Choose the constraints to hold, and factor K, as the module describes."""
        qp, point = self.qp, self.solution
        strict, whole, self.weak = sides_of(qp, point)
        for held in (strict, whole) if self.weak else (strict,):
            self.held, self.point, self.factors = held, point, self.factored(held)
            if not self.factors.regular:
                self.singular = True
                N = self.dependencies(held, self.factors.null_space)
                if N.size:
                    self.held, self.point = independent(qp, held, point, N)
                    self.factors = self.factored(self.held)
            if self.factors.regular:
                break

    @cached_property
    def C(self) -> Any:
        """[A; G]."""
        return stacked(0, self.qp.A, self.qp.G)

    def factored(self, held: np.ndarray) -> "KKTFactors":
        P, C = as_sparse(self.qp.P), as_sparse(self.C)
        at = np.flatnonzero(held[: C.shape[0]])
        free = np.flatnonzero(held[C.shape[0] :] == 0)
        return KKTFactors(submatrix(P, free, free), submatrix(C, at, free))

    def dependencies(self, held: np.ndarray, null_space: np.ndarray) -> np.ndarray:
        """Return N, which spans the combinations of held constraints that vanish.

        A vector (u, v) of the null space of K has P u = 0, C u = 0 and C'v = 0.
        """
        C, rows = self.C, self.C.shape[0]
        at = np.flatnonzero(held[:rows])
        V = null_space[null_space.shape[0] - at.size :]
        size = np.linalg.norm(null_space, axis=0)
        left, values, _ = np.linalg.svd(V / size, full_matrices=False)
        V = left[:, values > INDEPENDENT]
        N = np.zeros((held.size, V.shape[1]))
        N[at] = V
        N[rows:] = -(C.T @ N[:rows])
        N[rows:][held[rows:] == 0] = 0.0
        size = np.abs(N)
        return np.where(size > VANISHED * size.max(axis=0), N, 0.0)

    def backward(self, dx: Any, dy: Any, dz: Any, dz_box: Any) -> QPGradients:
        x, y, z, z_box = self.solution
        dx, dy = change("dx", dx, "x", x), change("dy", dy, "y", y)
        dz, dz_box = change("dz", dz, "z", z), change("dz_box", dz_box, "z_box", z_box)
        vectors = q, h, b, lb, ub = self.solve((dx, dy, dz, dz_box))
        matrix = partial(matrix_gradient, self.given, vectors, self.point)
        return QPGradients(q, h, b, lb, ub, self.weak, self.singular, matrix)

    def solve(self, cotangents: tuple[np.ndarray, ...]) -> tuple[Any, ...]:
        """Return the gradients in q, h, b, lb and ub."""
        if self.item is not None:
            return self.item.backward(cotangents)
        gx, gy, gz, gz_box = cotangents
        P, C, rows = self.qp.P, self.C, gy.size + gz.size
        at, side = np.flatnonzero(self.held[:rows]), self.held[rows:]
        free, held = np.flatnonzero(side == 0), side != 0
        u, v = held * gz_box, np.zeros(rows)
        of_x, of_v = gx, np.concatenate((gy, gz))
        if u.any():
            of_x = gx - times(P, u)
            of_v -= times(C, u)
        w = self.factors.solve(np.concatenate((of_x[free], of_v[at])))
        u[free], v[at] = np.split(w, [free.size])
        terms = times(P, u)
        add_transposed(C, v, terms)
        nu, lam = np.split(v, [gy.size])
        mu = held * (gx - terms)
        return 0.0 - u, lam, nu, (side < 0) * mu, (side > 0) * mu

    def forward(self, changes: dict[str, Any]) -> QPTangent:
        d = self.direction(changes)
        side = self.solution.z_box if self.item else self.held[self.C.shape[0] :]
        q, h, b, lb, ub = self.solve(right_sides(d, self.point, side))
        return QPTangent(0.0 - q, b, h, lb + ub, self.weak, self.singular)

    def directional(self, changes: dict[str, Any]) -> QPTangent:
        if not self.weak and not self.singular:
            return self.forward(changes)
        qp, d, C = self.qp, self.direction(changes), self.C
        _, whole, _ = sides_of(qp, self.solution)
        p, rows = qp.b.size, C.shape[0]
        side = whole[rows:]
        *rights, moved = right_sides(d, self.solution, side)
        # a short direction is scaled to size 1: tolerances are absolute
        unit = min(1.0, np.ldexp(1.0, np.frexp(largest(*rights, side * moved))[1]))
        d = {name: v if v is None else v / unit for name, v in d.items()}
        point = self.steepest(whole, d)
        held, _, _ = sides_of(qp, point)
        fixed = held[rows:] != 0
        r, db, dh, moved = right_sides(d, point, side)
        e = np.concatenate((db, dh))
        at = np.flatnonzero(held[:rows])
        weak = np.flatnonzero((whole[:rows] != 0) & (held[:rows] == 0))
        lower = np.where(fixed | (side < 0), moved, -np.inf)
        upper = np.where(fixed | (side > 0), moved, np.inf)
        dx, y, z, dz_box = solved(
            "the solution has no derivative along this direction: the QP of the "
            "critical cone is {}",
            qp.P, -r, C[weak], e[weak], C[at], e[at], lower, upper,
        )  # fmt: skip
        v = np.zeros(rows)
        v[at], v[weak] = y, z
        dx, v, dz_box = unit * dx, unit * v, unit * dz_box
        return QPTangent(dx, v[:p], v[p:], dz_box, self.weak, self.singular)

    def steepest(self, whole: np.ndarray, d: dict[str, Any]) -> Point:
        """Return the multipliers that maximise the derivative of the optimal value."""
        qp, point = self.qp, self.solution
        N = self.dependencies(whole, self.factored(whole).null_space)
        if not N.size:
            return point
        sign, value = signs(qp, whole), np.concatenate(point[1:])
        _, *rights = right_sides(d, point, whole[self.C.shape[0] :])
        slope = np.concatenate(rights) @ N
        zero, signed = np.zeros((slope.size, slope.size)), sign != 0
        G, h = -(sign[:, None] * N)[signed], np.maximum(sign * value, 0.0)[signed]
        best = solved(
            "the QP has no solution along this direction: its constraints contradict "
            "each other (the LP of the multipliers is {})",
            zero, slope, G, h, None, None, None, None,
        )  # fmt: skip
        # entries of 0 that rounding has moved would be strictly active
        share = np.abs(N).sum(axis=1)
        rounding = VANISHED * share * largest(value[share > 0.0])
        if rounding.any():
            value = value + N @ best.x
            value[np.abs(value) < rounding] = 0.0
        return Point(point.x, *np.split(value, (qp.b.size, qp.b.size + qp.h.size)))

    def direction(self, changes: dict[str, Any]) -> dict[str, Any]:
        """Return the changes of the data by their names; an absent matrix is None."""
        pairs = zip(QP._fields, self.qp, strict=True)
        return {k: change(f"d{k}", changes[k], k, own) for k, own in pairs}


def solved(words: str, *arguments: Any) -> Point:
    """Return the solution of a QP of these arguments; raise with the words if none."""
    qp = qp_data(*arguments)
    found = solve_checked(qp, DEFAULT_OPTIONS, NO_GUESS, perf_counter())
    if found.status is not Status.SOLVED:
        raise ValueError(words.format(found.status.value))
    return found.point


def signs(qp: QP, held: np.ndarray) -> np.ndarray:
    """Return the signs that (y, z, z_box) must have, 0 where any sign will do."""
    of_box = np.where(qp.lb == qp.ub, 0, held[held.size - qp.q.size :])
    return np.concatenate((np.zeros(qp.b.size), np.ones(qp.h.size), of_box))


def independent(
    qp: QP, held: np.ndarray, point: Point, N: np.ndarray
) -> tuple[np.ndarray, Point]:
    """Return independent constraints among the held that carry all multipliers alone.

    Each dependency is followed until a first multiplier is 0, whose constraint is left
    out (Caratheodory's theorem); one of equalities alone loses one of them.
    """
    p, m, sign = qp.b.size, qp.h.size, signs(qp, held)
    value, left_out = np.concatenate(point[1:]), np.zeros(sign.size, dtype=bool)
    for k in range(N.shape[1]):
        column = N[:, k]
        size = np.abs(column)
        limiting = (size > VANISHED * size.max()) & (sign != 0) & ~left_out
        places = np.flatnonzero(limiting)
        if places.size:
            i = places[np.argmin(np.abs(value[places]) / size[places])]
            value = value - value[i] / column[i] * column
        else:
            i = int(np.argmax(size[:p]))
        left_out[i] = True
        N[:, k + 1 :] -= np.outer(column, N[i, k + 1 :] / column[i])
    value[(left_out & (sign != 0)) | (sign * value < 0.0)] = 0.0
    return np.where(left_out, 0, held), Point(point.x, *np.split(value, (p, p + m)))


def refined(
    solve: Callable[[np.ndarray], Any],
    product: Callable[[np.ndarray], np.ndarray],
    r: np.ndarray,
) -> np.ndarray:
    """Solve K w = r: by what solves it up to errors, and by products with K."""
    w, rest, error = np.zeros(r.size), r, np.inf
    for _ in range(REFINEMENTS):
        trial = w + solve(rest)
        rest = r - product(trial)
        before, error = error, float(np.abs(rest).max(initial=0.0))
        if not error < before:
            break
        w = trial
        size = max(np.abs(v).max(initial=0.0) for v in (r, w))
        if not ROUNDING * size < error < 0.5 * before:
            break
    return w


class KKTFactors:
    """L D L' of the sparse matrix K of P and C, which are in CSC.

    K is scaled to rows of size 1 and factored as the quasi-definite K~ = K + DELTA
    diag(I, -I): each step of refinement multiplies the error by about DELTA over the
    least singular value of K. null_space (order, k): a basis of what K maps to 0.
    """

    def __init__(self, P: Any, C: Any) -> None:
        self.kkt = kkt = KKT(P, by_rows(C), by_rows(no_rows(C.shape[1])))
        self.scale = np.ones(kkt.size)
        values = kkt.base.copy()
        equilibrate(kkt.indptr, kkt.indices, values, self.scale)
        self.diagonal, shape = values[kkt.diagonal], (kkt.size, kkt.size)
        self.triangle = from_arrays((kkt.indptr, kkt.indices, values), shape)
        for shift in SHIFTS:
            kkt.data[:] = values
            kkt.data[kkt.diagonal[: kkt.n]] += shift
            kkt.data[kkt.diagonal[kkt.n :]] -= shift
            if kkt.factor():
                break
        else:
            raise ValueError("the KKT matrix of the active constraints has no factors")
        self.basis = self.find_null_space()
        self.null_space = (self.basis * self.scale).T
        self.regular = not self.basis.size

    def find_null_space(self) -> np.ndarray:
        """Return an orthonormal basis of the null space of K scaled, by rows.

        v - K~^-1 K v keeps what K maps to 0, and little else.
        """
        size, V = self.kkt.size, np.empty((0, 0))
        for width in WIDTHS if size else ():
            V = np.random.default_rng(0).standard_normal((min(width, size), size))
            V /= np.linalg.norm(V, axis=1)[:, None]
            for _ in range(PROJECTIONS):
                V = np.array([v - self.kkt.plan().solve(self.product(v)) for v in V])
                if np.linalg.norm(V, axis=1).max() < LOST / np.sqrt(size):
                    return V[:0]
            values, V = np.linalg.svd(V, full_matrices=False)[1:]
            image = np.array([np.linalg.norm(self.product(v)) for v in V])
            V = V[(values > NULL * values[0]) & (image <= ZERO_IMAGE)]
            if V.shape[0] < width:
                break
        return V

    def product(self, w: np.ndarray) -> np.ndarray:
        Kw = times(self.triangle, w) - self.diagonal * w
        add_transposed(self.triangle, w, Kw)
        return Kw

    def solve(self, r: np.ndarray, transposed: bool = False) -> np.ndarray:
        """Return the solution, of least norm for the scaled K if it is singular."""
        r, N = r * self.scale, self.basis
        w = refined(self.kkt.plan().solve, self.product, r - N.T @ (N @ r))
        return (w - N.T @ (N @ w)) * self.scale


# ---- infeasible QPs


class ClosestDerivative:
    """The derivative of the closest point of an infeasible QP, for shifts of norm 2.

    The two stages of `namlcp.qp.closest` are differentiated one after the other, with
    the constraints held that are active in each (C, d: all rows and right sides):

    1. the shifts r of the held rows: min 1/2 r'W r, C x - r = d, x_j fixed at held
       bounds; x may be any point with these shifts, here that of stage 2;
    2. the point x: min 1/2 x'Px + q'x, C x = d + r in held rows, <= in the others. The
       gradient in r is that in the right side.
    """

    def __init__(
        self, qp: QP, given: Any, face: Face, easier: QP, point: Point
    ) -> None:
        self.qp, self.given, self.face = qp, given, face
        self.first = QPDerivative(*face.least_shifts(point.x))
        self.second = QPDerivative(easier, point)

    def backward(self, dx: Any, dshift_h: Any, dshift_b: Any) -> QPGradients:
        qp, face = self.qp, self.face
        dx = change("dx", dx, "x", qp.q)
        dshift_h = change("dshift_h", dshift_h, "h", qp.h)
        dshift_b = change("dshift_b", dshift_b, "b", qp.b)
        second = self.second.backward(dx, None, None, None)
        lam = face.spread(second.b, second.h)  # the gradient in d, then also that in r
        soft = np.zeros(lam.size - dshift_h.size - dshift_b.size)  # bounds
        dr = (np.concatenate((dshift_h, soft, dshift_b)) + lam)[face.shifted]
        before = np.concatenate((np.zeros(dx.size), dr))
        first = self.first.backward(before, None, None, None)
        mu = face.spread(first.b, np.zeros(second.h.size))
        slopes = face.rows.parts(np.array((lam, mu)))
        g_h, g_upper, g_lower, g_b = (v.sum(axis=0) for v in slopes)
        fixed, up = face.v_box != 0.0, face.v_box > 0.0
        moved = second.lb + second.ub + (first.lb + first.ub)[: dx.size]
        lb = np.where(fixed, np.where(up, 0.0, moved), second.lb)
        ub = np.where(fixed, np.where(up, moved, 0.0), second.ub)
        lb[face.rows.lower] -= g_lower
        ub[face.rows.upper] += g_upper

        x, y, z, z_box = point = self.second.point
        forces = face.spread(y, z), face.spread(self.first.point.y, 0.0 * z)
        z, _, _, y = face.rows.parts(np.array(forces))
        vectors = second.q, g_h, g_b, lb, ub
        of_both = np.array((second.q, first.q[: x.size])), slopes[0], slopes[-1]
        at_both = Point(np.array((x, x)), y, z, z_box)

        def matrix(name: str) -> Any:
            of, at = (vectors, point) if name == "P" else (of_both, at_both)
            return matrix_gradient(self.given, of, at, name)

        return QPGradients(*vectors, second.weak, first.singular, matrix)


# ---- batches


class BatchDerivative:
    """The derivatives of the solutions of a batch, 0 of items that are not `used`."""

    def __init__(
        self, items: Items, points: Point, used: np.ndarray, threads: int | None
    ) -> None:
        self.items, self.used = items, used
        self.points = Point(*(np.where(used[:, None], v, 0.0) for v in points))
        self.threads = available_cores() if threads is None else threads
        check_count("threads", self.threads)

    def solve(self, cotangents: Sequence[Any]) -> SimpleNamespace:
        """Return what is found of the items, one after another.

        vectors: the gradients in q, h, b, lb and ub. points, sides (N, m + n), weak: as
        of `QPDerivative` and `dense`; regular: whether K of strictly active rows is.
        """
        items, points = self.items, Point(*map(np.copy, self.points))
        pairs = zip(Point._fields, cotangents, points, strict=True)
        parts = tuple(self.checked(*pair) for pair in pairs)
        n, m, p = points.x.shape[1], points.z.shape[1], points.y.shape[1]
        count, chosen = self.used.size, np.flatnonzero(self.used)
        out = np.zeros((count, 3 * n + m + p))
        sides, weak = np.zeros((count, m + n), np.int8), np.zeros(count, np.intp)
        regular = np.zeros(count, bool)
        if items.shared.is_dense:
            pairs, dense = items.shared._asdict().items(), chosen
            data = (items.stacked.get(k, own[None]) for k, own in pairs)
            arrays = *data, *points, *parts
            chunks = chunks_of(dense.size, (n + m + p) * n * n, self.threads)

            def work_on_part(k: int) -> None:
                differentiate_part(dense[chunks[k]], arrays, out, sides, weak, regular)

            on_threads(work_on_part, len(chunks), self.threads)
            chosen = dense[~regular[dense]]

        def work(k: int) -> None:
            i = chosen[k]
            point = Point(*(v[i] for v in points))
            derivative = QPDerivative(items.item(i)[0], point)
            out[i] = np.concatenate(derivative.solve(tuple(v[i] for v in parts)))
            weak[i], regular[i] = derivative.weak, not derivative.singular
            sides[i] = derivative.held[p:]
            _, points.y[i], points.z[i], _ = derivative.point

        on_threads(work, chosen.size, self.threads)
        vectors = np.split(out, np.cumsum((n, m, p, n)), axis=1)
        return SimpleNamespace(
            vectors=vectors, points=points, sides=sides, weak=weak, regular=regular
        )

    def checked(self, name: str, value: Any, own: np.ndarray) -> np.ndarray:
        """Return gradients in a part of all points, 0 of items that are not used."""
        array = np.zeros(own.shape) if value is None else real_array(f"d{name}", value)
        if array.shape != own.shape:
            raise ValueError(
                f"d{name} must have shape {own.shape} to match {name}, "
                f"got {array.shape}"
            )
        array = np.where(self.used[:, None], array, 0.0)
        refuse_number(f"d{name}", array, False)
        return array

    def backward(self, *cotangents: Any) -> BatchGradients:
        found, stacked = self.solve(cotangents), self.items.stacked
        given, vectors, points = self.items.given, found.vectors, found.points
        matrix = partial(matrix_gradient, given, vectors, points, stacked=stacked)
        q, h, b, lb, ub = (
            v.copy() if name in stacked else v.sum(axis=0)
            for name, v in zip(("q", "h", "b", "lb", "ub"), vectors, strict=True)
        )
        singular = self.used & ~found.regular
        return BatchGradients(q, h, b, lb, ub, found.weak, singular, matrix, self.used)
