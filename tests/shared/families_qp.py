"""Families of QPs of which something is known: a solution, the least cost, a proof."""

from itertools import combinations
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp
from problems_qp import QP, complementary, dense, make_qp, residual_form
from ways_qp import DENSE, PATHS, WAYS

from namlcp import Status, solve_qp
from validation.problems.draw import around

INF = np.inf
SOLVED, INFEASIBLE = Status.SOLVED, Status.PRIMAL_INFEASIBLE
UNBOUNDED, STALLED = Status.DUAL_INFEASIBLE, Status.STALLED


class Case(NamedTuple):
    """A QP and what is known of it; `unit` are the units of x in which it is judged."""

    qp: QP
    x: Any = None
    status: Any = SOLVED
    obj: float | None = None
    tol: float = 1e-9
    near: float = 1e-8
    z: Any = None
    z_box: Any = None
    unit: Any = None
    plain: Any = None
    settings: Any = MappingProxyType({})
    says: str = ""
    form: str = ""
    ways: Any = WAYS


def known(*sizes, tol=1e-11, **others):
    """Constructed with its solution, which is unique where P is definite."""
    made = complementary(*sizes, **others)
    rank, n = sizes[4], sizes[1]
    x, qp = made.x, made.qp
    obj = 0.5 * x @ (qp.P @ x) + qp.q @ x
    is_small = rank >= n and sizes[2] + sizes[3] > 0 and n <= 20
    form = "dual" if is_small else ""
    return Case(qp, x if rank >= n else None, obj=obj, tol=tol, form=form)


def repeated(rng, G):
    """Return the rows, of small integers and repeated in other units now and then."""
    m = len(G)
    if m > 4 and rng.random() < 0.45:
        G = np.round(G)
        G[m // 2 :] = G[: m - m // 2] * rng.uniform(0.1, 10.0, (m - m // 2, 1))
    return G


def degenerate(seed, n=None, m=None, p=None, condition=None):
    """Strictly convex, often degenerate or with repeated rows."""
    rng = np.random.default_rng(seed)
    n = n or int(rng.integers(1, 30))
    m = int(rng.integers(0, 60)) if m is None else m
    p = int(rng.integers(0, 1 + n // 4)) if p is None else p
    Q, _ = np.linalg.qr(rng.standard_normal((n, n)))
    P = (Q * np.logspace(0, -np.log10(condition or 10.0 ** (seed % 8)), n)) @ Q.T
    G, A = rng.standard_normal((m, n)), rng.standard_normal((p, n))
    G, x, q = repeated(rng, G), rng.standard_normal(n), rng.standard_normal(n)
    h = G @ x + np.where(rng.random(m) < 0.5, 0.0, rng.random(m))
    lb = np.where(rng.random(n) < 0.5, x - rng.integers(0, 2, n), -INF)
    ub = np.where(rng.random(n) < 0.5, x + rng.random(n), INF)
    return QP((P + P.T) / 2, q, G, h, A, A @ x, lb, ub)


def singular(seed):
    """P of any rank, dependent and degenerate rows, the least cost by construction."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 40))
    m, p, rank = (int(rng.integers(0, k + 1)) for k in (2 * n, n // 3, n - 1))
    B = rng.standard_normal((rank if seed % 4 else 0, n))
    P, G, A = B.T @ B, rng.standard_normal((m, n)), rng.standard_normal((p, n))
    G = repeated(rng, G)
    if p > 1:
        A[-1] = A[0]
    x = np.round(rng.standard_normal(n), 1)
    on, at = rng.random(m) < 0.6, rng.integers(0, 4, n)  # at 0: lb, 1: ub, 2, 3: open
    slack = np.where(on, 0.0, rng.random(m))
    below = np.where(at == 0, 0.0, np.where(at == 2, INF, 1.0))
    above = np.where(at == 1, 0.0, np.where(at == 3, INF, 1.0))
    z = np.where(on & (rng.random(m) < 0.7), rng.random(m), 0.0)
    z_box = np.where(at == 0, -1.0, np.where(at == 1, 1.0, 0.0)) * rng.random(n)
    point = x, rng.standard_normal(p), z, z_box
    qp = QP(*around(P, G, A, point, slack, below, above).qp)
    return Case(qp, obj=0.5 * x @ P @ x + qp.q @ x)


def by_enumeration(seed):
    """The least cost over all active sets of seven rows."""
    made = degenerate(100 + seed, 3, 7, 0, 10.0)
    P, q, G, h = made[:4]
    best, x = INF, None
    for F in (list(F) for k in range(4) for F in combinations(range(7), k)):
        K = np.block([[P, G[F].T], [G[F], np.zeros((len(F), len(F)))]])
        if np.linalg.matrix_rank(K) < len(K):
            continue
        at = np.linalg.solve(K, np.concatenate((-q, h[F])))[:3]
        value = 0.5 * at @ P @ at + q @ at
        if (G @ at <= h + 1e-9).all() and value < best:
            best, x = value, at
    free = np.full(3, INF)
    return Case(made._replace(lb=-free, ub=free), x, obj=best, form="dual")


def definite_on_equations(seed):
    """P of rank n - p with p equations across its kernel: one linear system."""
    rng = np.random.default_rng(seed)
    n, p = 9, 4
    B, q = rng.standard_normal((n - p, n)), 1e3 * rng.standard_normal(n)
    P, A, b = B.T @ B, rng.standard_normal((p, n)), rng.standard_normal(p)
    K = np.block([[P, A.T], [A, np.zeros((p, p))]])
    x = np.linalg.solve(K, np.concatenate((-q, b)))[:n]
    qp = make_qp(P, q, A=A, b=b)
    return Case(qp, x, near=1e-9 * np.abs(x).max(), form="dual")


def in_units(case, d, e=None, f=None, **others):
    """The case with x = d x', rows of G and A times e and f."""
    P, q, G, h, A, b, lb, ub = dense(case.qp)
    e = np.ones(h.size) if e is None else e
    f = np.ones(b.size) if f is None else f
    P = d[:, None] * P * d
    rows = e[:, None] * G * d, e * h, f[:, None] * A * d, f * b
    qp = QP(0.5 * (P + P.T), d * q, *rows, lb / d, ub / d)
    return case._replace(qp=qp, unit=d, **others)


def columns_apart(seed):
    """c from 1e-8 to 1e8: rounding in one column is a whole unit in others."""
    qp = degenerate(seed, 12, 18, 2, 10.0)
    c = 10.0 ** np.random.default_rng(seed).permutation(np.linspace(-8.0, 8.0, 12))
    case = Case(qp, solve_qp(*qp).x, near=1e-9, plain=qp, form="dual")
    return in_units(case, c, ways=DENSE)


def all_apart(seed):
    """Rows and columns in units from 1e-3 to 1e3."""
    rng = np.random.default_rng(seed)
    d, e, f = (10.0 ** rng.uniform(-3, 3, k) for k in (20, 30, 5))
    return in_units(known(seed, 20, 30, 5, 12)._replace(tol=1e-9), d, e, f)


def odd_units(seed, unit):
    """Half of the variables in a tiny or huge unit: no proof may come of it."""
    qp = complementary(seed, 8, 10, 2, 3, 0.6).qp
    d = np.where(np.random.default_rng(seed).random(8) < 0.5, unit, 1.0)
    loose = {"eps_abs": 1e-6, "eps_rel": 1e-6}
    undecided = (SOLVED, STALLED, Status.MAX_ITER, Status.NUMERICAL_ERROR)
    return in_units(Case(qp, status=undecided, tol=1e-6, settings=loose), d)


def with_sums(seed, n, m, p, rank, off):
    """Sums of two equations, off by +-off: dependent rows, not proportional."""
    P, q, G, h, A, b, lb, ub = complementary(seed, n, m, p, rank).qp
    A = A.toarray()
    A = np.vstack((A, A[0] + A[1], A[1] + A[2]))
    b = np.concatenate((b, [b[0] + b[1] + off, b[1] + b[2] - off]))
    loose = {"eps_abs": 1e-6, "eps_rel": 0.0}
    status = SOLVED if off < 1e-6 else INFEASIBLE
    return Case(
        make_qp(P, q, G, h, A, b, lb, ub), status=status, tol=1e-6, settings=loose
    )


def proportional(off, ratio):
    """An equation that is a multiple of another, off by so much."""
    P, q, G, h, A, b, lb, ub = complementary(0, 20, 10, 4, 7).qp
    A = np.vstack((A.toarray(), ratio * A.toarray()[2]))
    qp = make_qp(P, q, G, h, A, np.append(b, ratio * (b[2] + off)), lb, ub)
    says = "" if off < 1e-6 else "rows 2 and 4 of A contradict each other"
    settings = {"eps_abs": 1e-6, "eps_rel": 0.0}
    status = INFEASIBLE if says else SOLVED
    return Case(qp, status=status, tol=1e-6, settings=settings, says=says)


def fitted(seed, rows, n, **others):
    """min |Bx - c|^2 with the residuals as variables; np.linalg.lstsq knows x."""
    qp, B, c = residual_form(seed, rows, n, **others)
    x = np.linalg.lstsq(B, c, rcond=None)[0]
    x = np.append(B @ x - c, x) if rows > n and not others else None
    return Case(qp, x, tol=1e-10)


def planted(seed):
    """Single rows, and residuals t = Ex - f, half of them with a linear cost only."""
    rng = np.random.default_rng(seed)
    made, k = complementary(seed, 12, 10, 3, 5, 0.5), 6
    base = made.qp
    E = rng.standard_normal((k, 12)) * (rng.random((k, 12)) < 0.4)
    p = np.where(np.arange(k) % 2, 0.5 + rng.random(k), 0.0)
    t, y = rng.standard_normal(k), rng.standard_normal(k)
    entry = rng.uniform(0.5, 2.0, k) * rng.choice((-1, 1), k)
    P = sp.block_diag((base.P, sp.diags_array(p)))
    q = np.concatenate((base.q - E.T @ y, -p * t - entry * y))
    A = np.block([[base.A.toarray(), np.zeros((3, k))], [E, np.diag(entry)]])
    b = np.concatenate((base.b, E @ made.x + entry * t))
    finite = np.isfinite(base.ub)
    G = np.vstack((base.G.toarray(), 3.0 * np.eye(12)[finite]))
    h = np.concatenate((base.h, 3.0 * base.ub[finite]))
    lb = np.concatenate((base.lb, np.full(k, -INF)))
    x = np.append(made.x, t)
    qp = make_qp(P, q, np.hstack((G, np.zeros((len(G), k)))), h, A, b, lb)
    return Case(qp, obj=0.5 * x @ (P @ x) + q @ x, tol=1e-10)


def short_and_long_rows():
    """Five long rows, whose squares would fill P, and two short ones."""
    qp, _, _ = residual_form(2, 5, 200, weight=0.1)
    rows = [1.0, -1.0, 1.0], ([0, 0, 1], [5, 6, 7])
    short = sp.hstack((sp.csr_array(rows, shape=(2, 405)), -sp.eye_array(2)))
    A = sp.vstack((sp.hstack((qp.A, sp.csr_array((5, 2)))), short))
    P = np.diag(np.concatenate((qp.P.diagonal(), np.ones(2))))
    G, b = sp.hstack((qp.G, sp.csr_array((400, 2)))), np.append(qp.b, [1.0, 2.0])
    return Case(make_qp(P, np.append(qp.q, [0, 0]), G, qp.h, A, b), tol=1e-10)


def large_terms():
    """Terms near 1e7 leave a gap of some units of them, above the tolerance."""
    rng = np.random.default_rng(9)  # one of five seeds that miss it otherwise
    band = rng.uniform(-0.4, 0.4, 119)
    P = sp.diags_array([band, np.ones(120), band], offsets=[-1, 0, 1])
    qp = make_qp(P, 1e3 * rng.standard_normal(120), lb=np.zeros(120))
    return Case(qp, settings={"eps_abs": 1e-9, "eps_rel": 0.0}, ways={"sparse"})


def spread(n=360, m=720):
    """BLAS prepares the responses to all rows: n + m > 500, and many are violated."""
    rng = np.random.default_rng(1)
    B, G, x = (rng.standard_normal(k) for k in ((2 * n, n), (m, n), n))
    z = np.where(rng.random(m) < 0.2, 10.0 * rng.random(m), 0.0)
    P, h, none = B.T @ B, G @ x + (z == 0.0) * rng.random(m), np.empty((0, n))
    free = np.full(n, INF)
    qp = QP(0.5 * (P + P.T), -(P @ x + G.T @ z), G, h, none, free[:0], -free, free)
    return Case(qp, x, z=z, ways={"dense"})


def with_kink(*offs, at=0, n=200, **bounds):
    """Variables of their own, and at one place a few coupled by `offs`."""
    k = len(offs) + 1
    chain = np.eye(k) + np.diag(offs, 1) + np.diag(offs, -1)
    P = sp.block_diag([2.0 * np.eye(at), sp.csc_array(chain), 2.0 * np.eye(n - at - k)])
    q = np.where(np.arange(n) == at, bounds.pop("push", -1.0), -1.0)
    return make_qp(P, q, **bounds)


def blocks(off, n=3300):
    """P is factored in blocks here; the last two variables are fixed at 0."""
    bands = [np.ones(n - 2 - k) for k in (1, 2, 3)]
    offsets = [0, 1, 2, 3, -1, -2, -3]
    full = [np.full(n - 2, 8.0), *bands, *bands]
    large = sp.diags_array(full, offsets=offsets, shape=(n - 2, n - 2))
    P = sp.block_diag((large, sp.csc_array([[1.0, off], [off, 1.0]])))
    ub = np.where(np.arange(n) < n - 2, 1.0, 0.0)
    return make_qp(P, -np.ones(n), lb=np.zeros(n), ub=ub)


def box(first):
    """Bounds of +-10, those of the first variable apart."""
    bound = np.full(200, 10.0)
    bound[0] = first
    return {"lb": -bound, "ub": bound}


def some_free(at):
    """Of three variables in a row the first is at its bound, the others are free."""
    lb = np.where(np.arange(200) > at, -10.0, 0.0)
    return {"at": at, "lb": lb, "push": 10.0}


def polynomial():
    """Degree 9 on 60 points: cond(B'B) is 1e14."""
    t = np.linspace(0.0, 1.0, 60)
    B = np.vander(t, 10)
    P = np.diag(np.concatenate((np.ones(60), np.zeros(10))))
    qp = make_qp(P, np.zeros(70), A=np.hstack((-np.eye(60), B)), b=np.sin(5 * t))
    return Case(qp, obj=0.5 * np.linalg.lstsq(B, np.sin(5 * t), rcond=None)[1][0])


def support_vectors(m=400, n=60):
    """min |w|^2/2 + sum t, t >= 1 - Bw, t >= 0: G has full columns."""
    B = np.random.default_rng(0).standard_normal((m, n))
    P = np.diag(np.concatenate((np.ones(n), np.zeros(m))))
    q = np.concatenate((np.zeros(n), np.ones(m)))
    G = np.block([[-B, -np.eye(m)], [np.zeros((m, n)), -np.eye(m)]])
    qp = make_qp(P, q, G, np.concatenate((-np.ones(m), np.zeros(m))))
    return Case(qp, tol=1e-10, ways={"sparse", "path"})


def weak_tridiagonal(n=150):
    """x = 2 with a weakly active row; qpsolvers, tests/problems.py."""
    M = sp.diags_array(
        [np.ones(n), np.r_[0.0, -np.ones(n - 2)], np.r_[np.ones(n - 2), 0.0]],
        offsets=[0, 1, -1],
    )
    qp = make_qp(M.T @ M, -np.ones(n), -np.eye(n), np.full(n, -2.0))
    return Case(qp, tol=1e-12)


def beside_a_huge_side(huge):
    """x1 + x2 <= -1, x1 - x2 <= -1, x1 >= 0 leave nothing; another row has room."""
    G = np.array([[1.0, 1.0], [1.0, -1.0], [-1.0, 0.0], [1.0, 2.0]])
    qp = make_qp(np.diag([1.0, 0.0]), [0, 0], G, [-1.0, -1.0, 0.0, huge])
    return Case(qp, status=(INFEASIBLE, STALLED, Status.MAX_ITER))


def ray_in_units(unit):
    """The least cost is at (-0.01, 0.6, 2, 8545) times the unit: no ray."""
    curvature = np.array([1.5e4, 0.0735, 0.0, 9.16e-9])
    q = np.array([276.0, 0.0904, -0.0596, -7.827e-5])
    lb, ub = np.array([-0.01, 0.6, -INF, -INF]), np.array([0.0, 9.0, 2.0, INF])
    P = np.diag(curvature / unit**2)
    x = np.array([-0.01, 0.6, 2.0, 7.827e-5 / 9.16e-9]) * unit
    qp = make_qp(P, q / unit, lb=lb * unit, ub=ub * unit)
    return Case(qp, x, near=1e-9 * x[3], ways=set(WAYS) - PATHS)
