"""The QPs of the campaign: each class a function of a `Draw`.

It returns the arrays and what is true of them:

- solvable: convex, with a solution that was planted; nam must find one;
- possible: the same, but rounding may forbid it: a refusal is no failure;
- infeasible, unbounded, both (either may be said): by construction;
- ask: unknown, HiGHS decides;
- far: solvable but for the range of floating-point numbers, which may have made it
  anything; a side may be refused by name;
- near: too close to call, any answer that can be proved is right;
- not convex: P has a curvature of less than -1e-3 of its size.
"""

from collections.abc import Callable

import numpy as np
import scipy.linalg

from namlcp.qp.problem import QP
from validation.problems.fuzzed.draw import MOST_ROWS, MOST_VARIABLES, Draw, symmetric

INF, Array = np.inf, np.ndarray
Truth = tuple[QP, str]
Cost = Callable[[Draw, int], Array]
Maker = Callable[[Draw], Truth]


def planted(
    draw: Draw, P: Array, G: Array, A: Array, weak: float = 0.1, box: float = 0.6
) -> tuple[QP, Array]:
    """Return a QP with these matrices around a random complementary point, and that.

    A share `box` of the variables has bounds: at one of them, between two, above or
    below one, or held by equal ones. A share `weak` of what holds has multiplier 0.
    """
    n, m, p = P.shape[0], G.shape[0], A.shape[0]
    x, y = draw.numbers(n), draw.numbers(p)
    on = draw.some(m, draw.one_of(0.1, 0.3, 0.6))
    z = np.where(on & ~draw.some(m, weak), draw.positive(m), 0.0)
    h = G @ x + np.where(on, 0.0, draw.positive(m))
    h[~on & draw.some(m, 0.1)] = INF
    side = np.where(draw.some(n, box), draw.rng.integers(0, 6, n), -1)
    lb = np.where(side == 0, x, -INF)
    ub = np.where(side == 1, x, INF)
    inside = (side == 2) | ((side < 2) & (side >= 0) & draw.some(n, 0.5))
    lb = np.where((inside & (side != 0)) | (side == 3), x - draw.positive(n), lb)
    ub = np.where((inside & (side != 1)) | (side == 4), x + draw.positive(n), ub)
    lb, ub = np.where(side == 5, x, lb), np.where(side == 5, x, ub)
    z_box = draw.positive(n) * ~draw.some(n, weak)
    z_box *= np.select([side == 0, side == 1, side == 5], [-1.0, 1.0, 1.0], 0.0)
    q = -(P @ x + G.T @ z + A.T @ y + z_box)
    return QP(P, q, G, h, A, A @ x, lb, ub), x


def ordinary(draw: Draw, P: Array, m: int, p: int) -> Truth:
    n = P.shape[0]
    return planted(draw, P, draw.matrix(m, n), draw.matrix(p, n))[0], "solvable"


def with_cost(name: str, cost: Cost, truth: str = "solvable") -> Maker:
    def made(draw: Draw) -> Truth:
        n, m, p = draw.sizes()
        return ordinary(draw, cost(draw, n), m, p)[0], truth

    made.__name__ = name
    return made


strictly_convex = with_cost("strictly_convex", Draw.definite)
semidefinite_cost = with_cost("semidefinite_cost", Draw.semidefinite)
linear_program = with_cost("linear_program", Draw.linear)
condition_1e8 = with_cost("condition_1e8", Draw.ill_conditioned)
nearly_singular_cost = with_cost("nearly_singular_cost", Draw.nearly_singular)
diagonal_cost = with_cost("diagonal_cost", Draw.diagonal)
not_convex = with_cost("not_convex", Draw.indefinite, "not convex")


def matrices(draw: Draw) -> tuple[Array, Array, Array]:
    """Return P of any cost, G and A."""
    n, m, p = draw.sizes()
    return draw.any_cost(n), draw.matrix(m, n), draw.matrix(p, n)


def bounds_alone(draw: Draw) -> Truth:
    n = draw.size(1, MOST_VARIABLES)
    P = draw.any_cost(n)
    none = np.zeros((0, n))
    return planted(draw, P, none, none, box=1.0)[0], "solvable"


def degenerate(draw: Draw) -> Truth:
    """Most of what holds has multiplier 0, and half of all rows hold."""
    qp, x = planted(draw, *matrices(draw), weak=0.7)
    touch = draw.some(qp.h.size, 0.5)
    return qp._replace(h=np.where(touch, qp.G @ x, qp.h)), "solvable"


def dependent_rows(draw: Draw, G: Array, A: Array) -> tuple[Array, Array]:
    """Add multiples and sums of rows, opposite pairs and rows of zeros; m, p <= 120."""
    m, p, n = G.shape[0], A.shape[0], A.shape[1]
    if m:
        factors = draw.power(-3, 3, m) if not draw.whole else draw.positive(m)
        which = draw.rng.integers(0, m, draw.size(1, m))
        G = np.vstack((G, factors[which, None] * G[which]))
    if p:
        G = np.vstack((G, A[:2], -A[:2]))
        sums = draw.rng.integers(-2, 3, (draw.size(1, p), p)).astype(float)
        A = np.vstack((A, sums @ A))
    if draw.chance(0.3):
        G, A = np.vstack((G, np.zeros((1, n)))), np.vstack((A, np.zeros((1, n))))
    return G[:MOST_ROWS], A[:MOST_ROWS]


def redundant(draw: Draw) -> Truth:
    P, G, A = matrices(draw)
    return planted(draw, P, *dependent_rows(draw, G, A))[0], "solvable"


def modelled(draw: Draw) -> Truth:
    """As modelling languages write: rows of one entry, residuals as free variables."""
    n, m, p = draw.sizes()
    n = min(n, 45)
    residuals, single = draw.size(1, 15), draw.size(1, n)
    P, weights = draw.any_cost(n), draw.rng.integers(0, 3, residuals).astype(float)
    P = scipy.linalg.block_diag(P, np.diag(weights))
    G = draw.matrix(m, n + residuals)
    G[:, n:] = 0.0
    rows = np.zeros((single, n + residuals))
    entries = draw.rng.choice([-2.0, -1.0, 1.0, 0.5], single)
    rows[np.arange(single), draw.rng.integers(0, n, single)] = entries
    G = np.vstack((G, rows))[:MOST_ROWS]
    A = np.hstack((draw.matrix(p, n), np.zeros((p, residuals))))
    own = np.hstack((draw.matrix(residuals, n), -np.eye(residuals)))
    return planted(draw, P, G, np.vstack((A, own)))[0], "solvable"


def large_sparse(draw: Draw) -> Truth:
    draw.density = 0.08
    n = int(draw.rng.integers(50, MOST_VARIABLES + 1))
    m = int(draw.rng.integers(100, MOST_ROWS + 1))
    return ordinary(draw, draw.any_cost(n), m, draw.size(0, n // 2))


def any_solvable(draw: Draw) -> tuple[QP, Array]:
    """Return a QP of any cost, with dependent rows or not, and its solution."""
    P, G, A = matrices(draw)
    if draw.chance(0.3):
        G, A = dependent_rows(draw, G, A)
    return planted(draw, P, G, A)


def rescaled(draw: Draw, decades: float) -> QP:
    """Return a solvable QP in other units, with factors 10^U(-decades, decades)."""
    qp, _ = any_solvable(draw)
    P, q, G, h, A, b, lb, ub = qp
    n = q.size
    how = int(draw.rng.integers(5))

    def factors(wanted: tuple[int, ...], size: int | None) -> Array:
        e = decades if how in wanted else 0.0
        return draw.power(-e, e, size)

    r, s = factors((0, 4), h.size), factors((0, 4), b.size)
    c = factors((1, 4), n) * factors((2,), None)
    cost = factors((3, 4), None)
    P = cost * (P * c[:, None] * c)
    G, A = r[:, None] * G * c, s[:, None] * A * c
    return QP((P + P.T) / 2.0, cost * q * c, G, r * h, A, s * b, lb / c, ub / c)


def scaled(draw: Draw) -> Truth:
    return rescaled(draw, draw.one_of(1.0, 2.0, 4.0)), "solvable"


def extreme_scales(draw: Draw) -> Truth:
    return rescaled(draw, draw.one_of(6.0, 8.0)), "possible"


def far_scales(draw: Draw) -> Truth:
    e = draw.one_of(15.0, 40.0, 75.0)
    P, q, G, h, A, b, lb, ub = any_solvable(draw)[0]
    c, r, s, cost = (draw.power(-e, e, k) for k in (q.size, h.size, b.size, 1))
    how = int(draw.rng.integers(6))  # one scale for all columns, none, or each its own
    c = np.full(c.size, (1.0, c[0], 1.0)[how % 3]) if how < 3 else c
    if how in (1, 5):
        r, s = np.full(r.size, 1.0 / c[0]), np.full(s.size, 1.0 / c[0])
    P = cost * symmetric(P * np.sqrt(c)[:, None] * np.sqrt(c))
    G, A = r[:, None] * G * c, s[:, None] * A * c
    return QP(P, cost * q * c, G, r * h, A, s * b, lb / c, ub / c), "far"


def at_bounds(draw: Draw) -> Truth:
    """Bounds on all variables, most of which hold, some with the multiplier 0."""
    P, G, A = matrices(draw)
    c = draw.power(-3, 3, len(P))
    P, q, G, h, A, b, lb, ub = planted(draw, P, G, A, weak=0.3, box=1.0)[0]
    P = symmetric(P * c[:, None] * c)
    return QP(P, q * c, G * c, h, A * c, b, lb / c, ub / c), "solvable"


def single_precision(draw: Draw) -> Truth:
    """P with an asymmetry of rounding to single precision, to be taken out."""
    qp, _ = any_solvable(draw)
    root = np.sqrt(np.diag(qp.P))
    off = 0.24e-6 * draw.rng.uniform(-1.0, 1.0, qp.P.shape) * np.outer(root, root)
    return qp._replace(P=qp.P + off - off.T), "solvable"


def huge_sides(draw: Draw) -> Truth:
    """Bounds and right sides from 1e18 to 1e21 where none was, or was not active."""
    qp, x = any_solvable(draw)
    n, m = qp.q.size, qp.h.size
    slack = draw.some(m, 0.5) & (qp.h > qp.G @ x)
    h = np.where(slack, draw.power(18, 21, m), qp.h)
    low, high = -draw.power(18, 21, n), draw.power(18, 21, n)
    lb = np.where(draw.some(n, 0.5) & np.isinf(qp.lb), low, qp.lb)
    ub = np.where(draw.some(n, 0.5) & np.isinf(qp.ub), high, qp.ub)
    return qp._replace(h=h, lb=lb, ub=ub), "solvable"


def empty(draw: Draw) -> Truth:
    """No variables, or no rows, or neither; with n = 0 the rows decide."""
    n = int(draw.rng.integers(0, 3))
    if n:
        m, p = ((0, 2), (2, 0), (0, 0))[int(draw.rng.integers(3))]
        return ordinary(draw, draw.any_cost(n), m, p)
    m, p = (int(k) for k in draw.rng.integers(0, 3, 2))
    none, G, A = np.zeros(0), np.zeros((m, 0)), np.zeros((p, 0))
    h = draw.rng.integers(-1, 3, m).astype(float)
    b = draw.rng.integers(0, 2, p).astype(float)
    holds = bool((h >= 0.0).all() and (b == 0.0).all())
    qp = QP(np.zeros((0, 0)), none, G, h, A, b, none, none)
    return qp, "solvable" if holds else "infeasible"


def more_rows(qp: QP, G: Array, h: Array) -> QP:
    return qp._replace(G=np.vstack((G, qp.G)), h=np.append(h, qp.h))


def contradiction(draw: Draw, qp: QP, x: Array, t: float) -> QP:
    """Return the QP with three rows whose sum asks for 0 <= -t."""
    g = draw.numbers(2, x.size)
    G = np.vstack((g, -g.sum(axis=0)))
    return more_rows(qp, G, G @ x - np.array([0.0, 0.0, t]))


def wrong_sum(draw: Draw, qp: QP, t: float) -> QP:
    """Return the QP with a sum of its equations that is wrong by t."""
    c = draw.rng.integers(1, 3, qp.b.size) * draw.one_of(-1.0, 1.0)
    b = np.append(qp.b, c @ qp.b + t)
    return qp._replace(A=np.vstack((qp.A, c @ qp.A)), b=b)


def infeasible(draw: Draw) -> Truth:
    """Rows, equations or bounds contradict each other by 1e-4 to 10."""
    qp, x = any_solvable(draw)
    t, how = float(draw.power(-4, 1)), int(draw.rng.integers(4))
    j = int(draw.rng.integers(x.size))
    if how == 0 and qp.b.size:
        qp = wrong_sum(draw, qp, t)
    elif how == 1:  # crossed bounds
        qp.lb[j], qp.ub[j] = x[j] + t, x[j]
    elif how == 2:  # a row that bounds do not allow
        g = draw.numbers(1, x.size)
        g[0, j] = 1.0
        used = g[0] != 0.0
        low = np.where(used & np.isinf(qp.lb), x - draw.positive(x.size), qp.lb)
        high = np.where(used & np.isinf(qp.ub), x + draw.positive(x.size), qp.ub)
        least = np.where(g[0] > 0.0, low, high)[used] @ g[0, used]
        qp = more_rows(qp, g, np.array([least - t]))._replace(lb=low, ub=high)
    else:
        qp = contradiction(draw, qp, x, t)
    return qp, "infeasible"


def infinite_side(draw: Draw) -> Truth:
    """One side of the wrong infinity: h = -inf, lb = inf or ub = -inf."""
    qp, _ = any_solvable(draw)
    place = [v for v in (qp.h, qp.lb, qp.ub) if v.size]
    v = place[int(draw.rng.integers(len(place)))]
    v[int(draw.rng.integers(v.size))] = INF if v is qp.lb else -INF
    return qp, "infeasible"


def nearly_feasible(draw: Draw) -> Truth:
    """Contradict by 1e-13 to 1e-7; below 1e-10 the tolerance forgives it."""
    qp, x = any_solvable(draw)
    t = float(draw.power(-13, -7))
    if qp.b.size and draw.chance(0.5):
        qp = wrong_sum(draw, qp, t)
    else:
        qp = contradiction(draw, qp, x, t)
    return qp, "near" if t > 1e-10 else "possible"


def descending(draw: Draw) -> tuple[QP, Array, Array]:
    """Return a feasible QP, d with P d = A d = 0, G d <= 0, q'd < 0, and a point."""
    qp, x = any_solvable(draw)
    n = x.size
    d = draw.numbers(n) * draw.some(n, 0.6)
    d[int(draw.rng.integers(n))] = 1.0
    d /= np.linalg.norm(d)
    across = np.eye(n) - np.outer(d, d)
    P, A = across @ qp.P @ across, qp.A @ across
    G = qp.G - np.outer(np.maximum(qp.G @ d, 0.0), d)
    for C in (A, G):
        C[np.abs(C) < 1e-12] = 0.0  # rows of rounding alone would bound what d leaves
    q = qp.q @ across - draw.one_of(1e-3, 1.0, 10.0) * d
    slack = np.where(np.isinf(qp.h), INF, draw.positive(qp.h.size))
    lb, ub = np.where(d < 0.0, -INF, qp.lb), np.where(d > 0.0, INF, qp.ub)
    moved = QP((P + P.T) / 2.0, q, G, G @ x + slack, A, A @ x, lb, ub)
    return moved, d, x


def unbounded(draw: Draw) -> Truth:
    return descending(draw)[0], "unbounded"


def both(draw: Draw) -> Truth:
    """Infeasible, and with a descending direction of recession."""
    qp, d, x = descending(draw)
    t = float(draw.power(-4, 1))
    if x.size == 1:
        # no row is across d: an equation 0 = t
        A, b = np.vstack((qp.A, np.zeros((1, 1)))), np.append(qp.b, t)
        return qp._replace(A=A, b=b), "both"
    g = draw.numbers(1, x.size)
    g -= (g @ d)[:, None] * d
    side = g[0] @ x
    return more_rows(qp, np.vstack((g, -g)), np.array([side, -side - t])), "both"


def wild(draw: Draw) -> Truth:
    n, m, p = draw.sizes()
    p = min(p, int(draw.rng.integers(0, n)) if n > 1 else 0)
    lb = np.where(draw.some(n, 0.5), draw.numbers(n) - 2.0, -INF)
    ub = np.where(draw.some(n, 0.5), np.maximum(lb, draw.numbers(n) + 2.0), INF)
    slack = draw.one_of(0.0, 2.0, 5.0)
    # nearly singular ones HiGHS would call unbounded
    costs = Draw.definite, Draw.semidefinite, Draw.linear, Draw.diagonal
    cost = costs[int(draw.rng.integers(4))]
    qp = QP(
        cost(draw, n), draw.numbers(n), draw.matrix(m, n), draw.numbers(m) + slack,
        draw.matrix(p, n), draw.numbers(p), lb, ub,
    )  # fmt: skip
    return qp, "ask"


def rounded_cost(draw: Draw) -> Truth:
    """P semidefinite but for its rounding to single precision."""
    n, m, p = draw.sizes()
    draw.whole = False
    P = draw.semidefinite(n).astype(np.float32).astype(float)
    return ordinary(draw, P, m, p)[0], "near"


# ---- changes


def moved_vectors(draw: Draw, qp: QP) -> QP:
    """Move q, h and b; in two of three cases A x = b stays consistent if it was."""
    step = draw.one_of(1e-3, 0.1, 1.0)
    n, p = qp.q.size, qp.b.size
    shift = qp.A @ draw.numbers(n) if draw.chance(0.67) else draw.numbers(p)
    q, h = (v + step * draw.numbers(v.size) for v in (qp.q, qp.h))
    return qp._replace(q=q, h=h, b=qp.b + step * shift)


def moved_bounds(draw: Draw, qp: QP) -> QP:
    """Move bounds, take some away, and bring some; they may contradict each other."""
    n, step = qp.q.size, draw.one_of(0.1, 1.0)
    lb, ub = qp.lb + step * draw.numbers(n), qp.ub + step * draw.numbers(n)
    if draw.chance(0.8):
        lb, ub = np.minimum(lb, ub), np.maximum(lb, ub)
    lb = np.where(draw.some(n, 0.1), -INF, lb)
    top = np.where(np.isfinite(lb), lb, 0.0) + draw.positive(n)
    return qp._replace(lb=lb, ub=np.where(draw.some(n, 0.1), top, ub))


def moved_matrices(draw: Draw, qp: QP) -> QP:
    """Change the values of P, G and A; zeros stay, and P as convex as it was."""
    d = draw.power(-0.5, 0.5, qp.q.size)
    G, A = (M * draw.power(-0.1, 0.1, M.size).reshape(M.shape) for M in (qp.G, qp.A))
    return qp._replace(P=symmetric(d[:, None] * qp.P * d), G=G, A=A)


CHANGES: tuple[Callable[[Draw, QP], QP], ...] = (
    moved_vectors, moved_vectors, moved_bounds, moved_matrices, lambda draw, qp: qp,
)  # fmt: skip


def changed(draw: Draw, qp: QP) -> QP:
    """Return a QP as it changes from one solve to the next."""
    return CHANGES[int(draw.rng.integers(len(CHANGES)))](draw, qp)
