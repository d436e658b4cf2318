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

Forward, along a direction of the data, with r = dP x + dq + dG'z + dA'y:

    dx_B = dlb or dub,   e = (db - dA x, (dh - dG x)_I),   dx0 = (dx_B, 0)
    K (dx_F, dv) = (-(r + P dx0)_F, e - C dx0)
    dz_box_B = -(P dx + C'dv + r)_B

(Amos and Kolter, OptNet, ICML 2017; Magoon et al., dQP, 2024.) These are the
derivatives where all active constraints are strictly active and K is regular.
Elsewhere the solution has kinks, and an element of the generalised Jacobian is chosen:

1. weakly active constraints are dropped;
2. where strictly active ones depend on each other, independent ones that carry all
   multipliers are held (`independent`);
3. where K is still singular, weakly active constraints are held, too;
4. where it is singular even so, because x is not unique, a solution of least norm is
   taken.

Steps 1 and 2 are derivatives nearby: with the right-hand sides of the dropped rows
raised, x is still the solution, with the multipliers taken, and all is regular.

The multipliers of constraints that depend on each other are not unique. Let N span the
combinations (y, z, z_box) of active constraints that vanish, A'y + G'z + z_box = 0 with
z_box zero outside the active bounds. All multipliers of the solution are then those of
one plus N t, with the signs that rows and bounds want.
"""

from functools import partial
from typing import Any, NamedTuple

import numpy as np

from namlcp.checks import clean_copy, real_array, refuse_number
from namlcp.derivatives.dense import DenseItem, differentiate_part
from namlcp.derivatives.factors import DenseFactors, KKTFactors
from namlcp.derivatives.gradients import (
    BatchGradients,
    QPGradients,
    QPTangent,
    change,
    product_of,
    right_sides,
)
from namlcp.derivatives.marks import sides_of
from namlcp.linalg.csc import add_transposed, by_rows, submatrix, times
from namlcp.options import check_count
from namlcp.qp.batch import Items, available_cores, chunks_of, on_threads
from namlcp.qp.kkt import KKT
from namlcp.qp.problem import QP, Point

VANISHED = 1e-9
"""Entries of a combination up to this multiple of its largest one count as 0."""

INDEPENDENT = 1e-6
"""A combination of null vectors counts as 0 in the multipliers below this norm."""


class QPDerivative:
    """The derivative of one solution.

    Attributes
    ----------
    qp, solution : QP, Point
        The problem and its solution.
    item : DenseItem or None
        A dense QP whose strictly active constraints have good Cholesky factors.
    point : Point
        The solution, with multipliers 0 of constraints that are not held.
    held, factors : array, DenseFactors or KKTFactors
        Else the sides of the constraints held, see `marks`, and the factors of K.
    weak : int
        How many constraints are active with a multiplier 0.
    singular : bool
        Whether K is singular with the strictly active constraints alone.
    """

    def __init__(
        self,
        qp: QP,
        point: Point,
        given: tuple[Any, Any, Any] = (None, None, None),
        factors: Any = None,
    ) -> None:
        """Factor; `given`: P, G and A of the user.

        `factors`: those of the solve, if they are there.
        """
        self.qp, self.given, self.solution = qp, given, point
        self.item: Any = None
        if qp.is_dense:
            item = DenseItem(qp.q.size, qp.h.size, qp.b.size)
            if item.take(qp, point, factors):
                self.item, self.point = item, point
                self.weak, self.singular = item.weak, False
                return
        self.hold()

    def hold(self) -> None:
        """Choose the constraints to hold, and factor K, as the module describes."""
        qp, point = self.qp, self.solution
        strict, whole, self.weak = sides_of(qp, point)
        self.singular = False
        for held in (strict, whole) if self.weak else (strict,):
            self.held, self.point, self.factors = held, point, factored(qp, held)
            if self.factors.regular:
                break
            self.singular = True
            N = dependencies(qp, held, self.factors.null_space)
            if N.size:
                self.held, self.point = independent(qp, held, point, N)
                self.factors = factored(qp, self.held)
                if self.factors.regular:
                    break

    def backward(self, dx: Any, dy: Any, dz: Any, dz_box: Any) -> QPGradients:
        parts = zip(Point._fields, (dx, dy, dz, dz_box), self.solution, strict=True)
        given = tuple(
            None if d is None else change(f"d{name}", d, name, own)
            for name, d, own in parts
        )
        vectors, matrices = self.solve(given, True)
        q, h, b, lb, ub = vectors
        matrix, weak, singular = partial(self.matrix, vectors), self.weak, self.singular
        gradients = QPGradients(q, h, b, lb, ub, weak, singular, matrix)
        if matrices:
            gradients.P, gradients.G, gradients.A = matrices
        return gradients

    def solve(
        self, cotangents: tuple[np.ndarray | None, ...], with_matrices: bool = False
    ) -> tuple[tuple[np.ndarray, ...], tuple[np.ndarray, ...]]:
        """Return the gradients in q, h, b, lb and ub, small ones in P, G and A too."""
        if self.item is not None:
            return self.item.backward(cotangents, with_matrices)
        pairs = zip(cotangents, self.solution, strict=True)
        given = (np.zeros(own.size) if v is None else v for v, own in pairs)
        gx, gy, gz, gz_box = given
        P, _, G, _, A = self.qp[:5]
        p, rows = gy.size, gy.size + gz.size
        at, side = np.flatnonzero(self.held[:rows]), self.held[rows:]
        free, held = np.flatnonzero(side == 0), side != 0
        u, v = held * gz_box, np.zeros(rows)
        of_x, of_v = gx, np.concatenate((gy, gz))
        if u.any():
            of_x = gx - times(P, u)
            of_v -= np.concatenate((times(A, u), times(G, u)))
        w = self.factors.solve(np.concatenate((of_x[free], of_v[at])))
        u[free], v[at] = np.split(w, [free.size])
        nu, lam = np.split(v, [p])
        terms = times(P, u)
        add_transposed(G, lam, terms)
        add_transposed(A, nu, terms)
        mu = held * (gx - terms)
        return (0.0 - u, lam, nu, (side < 0) * mu, (side > 0) * mu), ()

    def matrix(self, vectors: tuple[np.ndarray, ...], name: str) -> Any:
        """Return the gradient in P, G or A in the form of the user's matrix."""
        pattern = self.given["PGA".index(name)]
        return product_of(vectors, self.point, name).on(pattern)

    def forward(self, changes: dict[str, Any]) -> QPTangent:
        """Return the derivative of the solution along a direction of the data.

        K is symmetric: `solve` has its system, with other right-hand sides.
        """
        d = self.direction(changes)
        r, dh, db = right_sides(d, self.point)
        side = self.solution.z_box if self.item else self.held[-d["q"].size :]
        moved = np.where(side > 0, d["ub"], d["lb"])  # read where x_j is held
        (q, h, b, lb, ub), _ = self.solve((-r, db, dh, moved))
        return QPTangent(0.0 - q, b, h, lb + ub, self.weak, self.singular)

    def direction(self, changes: dict[str, Any]) -> dict[str, Any]:
        """Return the changes of the data by their names; an absent matrix is None."""
        pairs = zip(QP._fields, self.qp, strict=True)
        return {k: change(f"d{k}", changes[k], k, own) for k, own in pairs}


def factored(qp: QP, held: np.ndarray) -> DenseFactors | KKTFactors:
    """Return the factors of the KKT matrix K of held constraints."""
    (P, _, G, _, A, *_), p, m = qp, qp.b.size, qp.h.size
    equalities, rows = np.flatnonzero(held[:p]), np.flatnonzero(held[p : p + m])
    free = np.flatnonzero(held[p + m :] == 0)
    if qp.is_dense:
        C = np.concatenate((A[equalities], G[rows]))[:, free]
        zero = np.zeros((C.shape[0], C.shape[0]))
        return DenseFactors(np.block([[P[np.ix_(free, free)], C.T], [C, zero]]))
    A, G = submatrix(A, equalities, free), submatrix(G, rows, free)
    return KKTFactors(KKT(submatrix(P, free, free), by_rows(A), by_rows(G)))


def dependencies(qp: QP, held: np.ndarray, null_space: np.ndarray) -> np.ndarray:
    """Return N, which spans the combinations of held constraints that vanish.

    It is read from the null space of the KKT matrix. A vector (u, v) of that has
    P u = 0, C u = 0 and C'v = 0: v alone is a dependency.
    """
    p, rows = qp.b.size, qp.b.size + qp.h.size
    at = np.flatnonzero(held[:rows])
    V = null_space[null_space.shape[0] - at.size :]
    size = np.linalg.norm(null_space, axis=0)
    left, values, _ = np.linalg.svd(V / size, full_matrices=False)
    V = left[:, values > INDEPENDENT]
    N = np.zeros((held.size, V.shape[1]))
    N[at] = V
    N[rows:] = -(qp.A.T @ N[:p] + qp.G.T @ N[p:rows])
    N[rows:][held[rows:] == 0] = 0.0
    return N


def signs(qp: QP, held: np.ndarray) -> np.ndarray:
    """Return the signs that (y, z, z_box) must have, 0 where any sign will do."""
    of_box = np.where(qp.lb == qp.ub, 0, held[held.size - qp.q.size :])
    return np.concatenate((np.zeros(qp.b.size), np.ones(qp.h.size), of_box))


def independent(
    qp: QP, held: np.ndarray, point: Point, N: np.ndarray
) -> tuple[np.ndarray, Point]:
    """Return independent constraints among the held that carry all multipliers alone.

    Each dependency is followed until a first multiplier is 0, whose constraint then
    counts as inactive (Caratheodory's theorem). Where a dependency has equalities
    alone, one of them is left out.
    """
    p, m, sign = qp.b.size, qp.h.size, signs(qp, held)
    value, left_out = np.concatenate(point[1:]), np.zeros(sign.size, dtype=bool)
    value[sign * value < 0.0] = 0.0
    for k in range(N.shape[1]):
        column = N[:, k]
        size = np.abs(column)
        limiting = (size > VANISHED * size.max()) & (sign != 0) & ~left_out
        places = np.flatnonzero(limiting)
        if places.size:
            i = places[np.argmin(np.abs(value[places]) / size[places])]
            value = value - value[i] / column[i] * column
            value[sign * value < 0.0] = 0.0
            value[i] = 0.0
        else:
            i = int(np.argmax(size[:p]))
        left_out[i] = True
        N[:, k + 1 :] -= np.outer(column, N[i, k + 1 :] / column[i])
    return np.where(left_out, 0, held), Point(point.x, *np.split(value, (p, p + m)))


# ---- batches


class Found(NamedTuple):
    """Gradients in the data of items, one after another, and what they hold.

    sides (N, m + n): 1 for rows of G that are held; -1 for variables held at the lower
    bound, 1 at the upper one; else 0. weak (N,): constraints with a multiplier 0;
    regular (N,): whether the KKT system of the strictly active constraints is regular.
    """

    q: np.ndarray
    h: np.ndarray
    b: np.ndarray
    lb: np.ndarray
    ub: np.ndarray
    sides: np.ndarray
    weak: np.ndarray
    regular: np.ndarray


def differentiate_items(
    items: Items,
    solutions: Point,
    which: np.ndarray,
    cotangents: tuple[np.ndarray, ...],
    threads: int,
) -> tuple[Found, Point]:
    """Return the gradients of each item, and the solutions with the multipliers used.

    Items that are not in `which` (N,) have gradients and solutions 0. `solutions` and
    `cotangents` have a leading axis.
    """
    shown = which[:, None]
    points = Point(*(np.where(shown, v, 0.0) for v in solutions))
    parts = tuple(np.where(shown, v, 0.0) for v in cotangents)
    for name, part in zip(Point._fields, parts, strict=True):
        refuse_number(f"d{name}", part, False)
    n, m, p = points.x.shape[1], points.z.shape[1], points.y.shape[1]
    count, chosen = which.size, np.flatnonzero(which)
    q, h, b, lb, ub = (np.zeros((count, size)) for size in (n, m, p, n, n))
    sides, weak = np.zeros((count, m + n), np.int8), np.zeros(count, np.intp)
    found = Found(q, h, b, lb, ub, sides, weak, np.zeros(count, bool))
    if items.shared.is_dense:
        given = (items.shared._asdict() | items.stacked).values()
        clean = (clean_copy(v) for v in given)
        arrays, dense = (*clean, *points, *parts), chosen
        chunks = chunks_of(dense.size, (n + m + p) * n * n, threads)

        def work_on_part(k: int) -> None:
            differentiate_part(dense[chunks[k]], arrays, found)

        on_threads(work_on_part, len(chunks), threads)
        chosen = dense[~found.regular[dense]]

    def work(k: int) -> None:
        i = chosen[k]
        point = Point(*(v[i] for v in points))
        derivative = QPDerivative(items.item(i)[0], point)
        vectors, _ = derivative.solve(tuple(v[i] for v in parts))
        for own, vector in zip(found, vectors, strict=False):
            own[i] = vector
        found.weak[i], found.regular[i] = derivative.weak, not derivative.singular
        found.sides[i] = derivative.held[p:]
        _, points.y[i], points.z[i], _ = derivative.point

    on_threads(work, chosen.size, threads)
    return found, points


def differentiate_batch(
    items: Items,
    points: Point,
    used: np.ndarray,
    cotangents: tuple[Any, ...],
    threads: int | None,
) -> BatchGradients:
    """Return the gradients of the used items from those in their points."""
    threads = available_cores() if threads is None else threads
    check_count("threads", threads)
    pairs = zip(Point._fields, cotangents, points, strict=True)
    given = tuple(checked_gradient(*pair) for pair in pairs)
    found, points = differentiate_items(items, points, used, given, threads)

    def matrix(name: str) -> Any:
        product = product_of(found, points, name)
        if name in items.stacked:
            return product.stacked()
        return product.on(items.given["PGA".index(name)])

    q, h, b, lb, ub = (
        v.copy() if name in items.stacked else v.sum(axis=0)
        for name, v in zip(("q", "h", "b", "lb", "ub"), found, strict=False)
    )
    singular = used & ~found.regular
    return BatchGradients(q, h, b, lb, ub, found.weak, singular, matrix, used)


def checked_gradient(name: str, value: Any, own: np.ndarray) -> np.ndarray:
    """Return gradients in a part of all points checked, zeros if absent."""
    if value is None:
        return np.zeros(own.shape)
    array = real_array(f"d{name}", value)
    if array.shape != own.shape:
        raise ValueError(
            f"d{name} must have shape {own.shape} to match {name}, got {array.shape}"
        )
    return array
