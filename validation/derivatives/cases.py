"""QPs and LCPs whose solutions are differentiable, and families where they are not.

The regular ones are made around a solution whose active constraints are independent and
have multipliers of at least 0.1 in their own units; the families of kinks are those of
the literature: weakly active rows and bounds, rows that repeat each other, more active
rows than variables, a P that is singular on the strictly active rows.
"""

from typing import Any

import numpy as np

from namlcp.qp.problem import QP
from validation.problems.known_scenes import BoxLCP

Array = np.ndarray
Kept = dict[str, Array]


def definite(n: int, rng: np.random.Generator) -> Array:
    """Return a random positive definite matrix, of a condition below about 100."""
    B = rng.standard_normal((2 * n, n))
    return B.T @ B / n + 0.1 * np.eye(n)


def regular_qp(
    seed: int, n: int = 16, m: int = 9, p: int = 2, scale: float = 1.0
) -> QP:
    """Return a QP with about n / 4 bounds and m / 3 rows active, two variables pinned.

    Variables and rows are in units that differ by up to `scale`.
    """
    rng = np.random.default_rng(seed)
    P, x = definite(n, rng), rng.standard_normal(n)
    G, A = rng.standard_normal((m, n)), rng.standard_normal((p, n))
    order = rng.permutation(n)
    side = np.zeros(n)
    side[order[: n // 4]] = rng.choice((-1.0, 1.0), n // 4)
    pinned = order[n // 4 : n // 4 + 2]
    z_box = side * (0.1 + rng.random(n))
    z_box[pinned] = rng.standard_normal(2)
    z = np.where(np.arange(m) < m // 3, 0.1 + rng.random(m), 0.0)
    lb = np.where(side < 0, x, x - 0.1 - rng.random(n))
    ub = np.where(side > 0, x, x + 0.1 + rng.random(n))
    lb[order[-2]], ub[order[-2:]] = -np.inf, np.inf
    lb[pinned] = ub[pinned] = x[pinned]
    h = G @ x + (0.1 + rng.random(m)) * (z == 0.0)
    y = rng.standard_normal(p)
    q = -(P @ x + G.T @ z + A.T @ y + z_box)
    c, d = (scale ** rng.uniform(-0.5, 0.5, k) for k in (n, m))
    G, h = G * c * d[:, None], h * d
    return QP(P * c * c[:, None], q * c, G, h, A * c, A @ x, lb / c, ub / c)


def regular_lcp(seed: int, n: int = 12, symmetric: bool = False) -> BoxLCP:
    """Return an LCP with a third of the unknowns free, and two pinned."""
    rng = np.random.default_rng(seed)
    A = definite(n, rng)
    if not symmetric:
        skew = rng.standard_normal((n, n))
        A += skew - skew.T
    side = rng.integers(-1, 2, n)
    z, w = rng.standard_normal(n), -side * (0.1 + rng.random(n))
    lower = np.where(side < 0, z, z - 0.1 - rng.random(n))
    upper = np.where(side > 0, z, z + 0.1 + rng.random(n))
    lower[0], upper[0], w[0] = -np.inf, np.inf, 0.0
    lower[1:3] = upper[1:3] = z[1:3]
    w[1:3] = rng.standard_normal(2)
    return BoxLCP(A, w - A @ z, lower, upper)


def around(x: Array, P: Array, G: Array, z: Array, active: Array) -> QP:
    """Return a QP that x solves with multipliers z; inactive rows have slack 1."""
    none = np.empty((0, x.size)), np.empty(0)
    free = np.full(x.size, np.inf)
    h = G @ x + np.where(active, 0.0, 1.0)
    return QP(P, -P @ x - G.T @ z, G, h, *none, -free, free)


def weak_rows(seed: int) -> QP:
    """Two rows are active with multiplier 0, two with positive ones."""
    rng = np.random.default_rng(seed)
    z = np.where(np.arange(7) < 2, 0.5 + rng.random(7), 0.0)
    G, x = rng.standard_normal((7, 6)), rng.standard_normal(6)
    return around(x, definite(6, rng), G, z, np.arange(7) < 4)


def weak_bounds(seed: int) -> QP:
    """Two bounds are active with multiplier 0, a third with another one."""
    rng = np.random.default_rng(seed)
    z = np.where(np.arange(4) < 1, 0.5 + rng.random(4), 0.0)
    G, x = rng.standard_normal((4, 8)), rng.standard_normal(8)
    qp = around(x, definite(8, rng), G, z, z > 0.0)
    qp.lb[0], qp.ub[1], qp.ub[2] = x[:3]
    qp.q[2] -= 0.7
    return qp


def repeated_row(seed: int) -> QP:
    """Two rows are the same but for their units; both can carry the multiplier."""
    rng = np.random.default_rng(seed)
    G, x = rng.standard_normal((5, 6)), rng.standard_normal(6)
    G[1] = 3.0 * G[0]
    z = np.array([0.7, 0.3, 0.4, 0.0, 0.0])
    return around(x, definite(6, rng), G, z, z > 0.0)


def vertex(seed: int) -> QP:
    """Five rows meet in a point of R^3, all of them with positive multipliers."""
    rng = np.random.default_rng(seed)
    G, x = rng.standard_normal((5, 3)), rng.standard_normal(3)
    G *= np.sign(G[:, :1])  # so that x - (t, 0, 0) is feasible
    z = 0.5 + rng.random(5)
    return around(x, definite(3, rng), G, z, z > 0.0)


def flat(seed: int) -> QP:
    """P is singular on the strictly active row; weakly active ones make x unique."""
    rng = np.random.default_rng(seed)
    B, G = rng.standard_normal((3, 5)), rng.standard_normal((6, 5))
    line = np.linalg.svd(np.vstack((B, G[:1])))[2][-1]  # where P and row 0 leave x free
    G[1:4] *= np.sign(G[1:4] @ line)[:, None] * np.array([[1.0], [-1.0], [1.0]])
    z = np.where(np.arange(6) < 1, 0.8, 0.0)
    return around(rng.standard_normal(5), B.T @ B, G, z, np.arange(6) < 4)


KINKS = {  # with the data to be changed; "qh" means both
    weak_rows: ("q", "h", "P", "G", "qh"),
    weak_bounds: ("q", "h", "P", "lb", "ub"),
    repeated_row: ("q", "h", "P", "qh"),
    vertex: ("q", "h", "P", "qh"),
    flat: ("q",),  # with other h x may not be unique
}


def contradictory(seed: int, n: int, m: int, p: int = 2, bounds: bool = False) -> Kept:
    """Return the arguments of an infeasible QP: two rows of G are opposed."""
    rng = np.random.default_rng(seed)
    B, x = rng.standard_normal((n, n)), rng.standard_normal(n)
    G, A = rng.standard_normal((m, n)), rng.standard_normal((p, n))
    G[1] = -G[0]
    h = -1.0 - rng.random(m) if m > 2 * n else G @ x + rng.random(m)
    h[1] = -h[0] - 1.0
    q, P = rng.standard_normal(n), B.T @ B / n + np.eye(n)
    found = {"P": P, "q": q, "G": G, "h": h, "A": A, "b": A @ x}
    if bounds:
        found |= {"lb": x - rng.random(n), "ub": x + rng.random(n)}
    return found


def weak_lcp(seed: int, n: int = 8) -> tuple[Array, Array]:
    """Return (A, q) with two unknowns at 0 with w = 0; A is not symmetric."""
    rng = np.random.default_rng(seed)
    skew = rng.standard_normal((n, n))
    A = definite(n, rng) + skew - skew.T
    z = np.where(np.arange(n) < 4, 0.2 + rng.random(n), 0.0)
    w = np.where(np.arange(n) >= 6, 0.2 + rng.random(n), 0.0)
    return A, w - A @ z


def direction(qp: QP, seed: int, names: str | tuple[str, ...] = QP._fields) -> Kept:
    """Return a change of the named data, in their units; pinned variables stay so."""
    rng = np.random.default_rng([seed, 1])
    wanted = {"qh": ("q", "h")}.get(names, (names,)) if type(names) is str else names
    d = {name: np.zeros(own.shape) for name, own in qp._asdict().items()}
    for name in wanted:
        own = getattr(qp, name)
        size = np.abs(np.where(np.isfinite(own), own, 0.0))
        d[name] = size * rng.standard_normal(own.shape)
    pinned = qp.lb == qp.ub
    d["lb"][pinned] = d["ub"][pinned]
    d["P"] = 0.5 * (d["P"] + d["P"].T)
    return d


def moved(problem: Any, d: Kept, t: float) -> Any:
    arrays = {name: getattr(problem, name) + t * change for name, change in d.items()}
    return problem._replace(**arrays)
