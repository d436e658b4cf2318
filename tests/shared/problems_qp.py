"""QPs with known answers, and what it means to solve one or to prove it impossible."""

from typing import NamedTuple

import numpy as np
from problems_lcp import DATA
from scipy.sparse import (
    block_diag,
    csc_array,
    csr_array,
    eye_array,
    hstack,
    issparse,
    vstack,
)

from namlcp import Status, qp_residuals
from namlcp.options import Options
from namlcp.qp.interior.loop import solve_interior
from namlcp.qp.judge import Judge
from namlcp.qp.problem import NO_GUESS, QP
from namlcp.qp.route import NO_TRANSFORMS, Memory
from validation.problems.data_sets import mat_problem
from validation.problems.draw import Known, around


class Found(NamedTuple):
    """What the interior-point method found, laid out as a `QPResult`."""

    status: Status
    x: np.ndarray
    y: np.ndarray
    z: np.ndarray
    z_box: np.ndarray
    iterations: int = 0
    message: str = ""


def solve_sparse(qp, limits=Options().limits(), guess=NO_GUESS) -> Found:  # noqa: B008
    """Solve by the interior-point method, whatever the form."""
    with np.errstate(all="ignore"):
        answer = solve_interior(qp, NO_TRANSFORMS, guess, Judge(qp, limits), Memory())
    return Found(answer.status, *answer.point, answer.iterations, answer.message)


def make_qp(P, q, G=None, h=None, A=None, b=None, lb=None, ub=None) -> QP:
    """Return a QP as it comes out of the gate, in CSC."""
    q = np.asarray(q, dtype=float)
    n = q.size

    def matrix(M, rows):
        M = csc_array(np.zeros((rows, n)) if M is None else M, dtype=float)
        M.sum_duplicates()
        M.indptr, M.indices = M.indptr.astype(np.int32), M.indices.astype(np.int32)
        return M

    def vector(v, value, size):
        return np.full(size, value) if v is None else np.asarray(v, dtype=float)

    rows = matrix(G, 0), vector(h, 0.0, 0), matrix(A, 0), vector(b, 0.0, 0)
    bounds = vector(lb, -np.inf, n), vector(ub, np.inf, n)
    return QP(matrix(P, n), q, *rows, *bounds)


def dense(qp: QP) -> QP:
    """Return the QP with arrays."""
    return qp._replace(
        **{k: M.toarray() for k in "PGA" if issparse(M := getattr(qp, k))}
    )


def sparse(qp: QP) -> QP:
    """Return the QP with CSC matrices."""
    return make_qp(*qp)


def complementary(seed, n, m, p, rank, density=1.0, weak=0) -> Known:
    """Pick (x, y, z, z_box) complementary, then q and h to match.

    P has the given rank. A third of the rows and of the bounds is active; `weak` of the
    active rows have multiplier 0.
    """
    rng = np.random.default_rng(seed)
    B = rng.standard_normal((rank, n)) * (rng.random((rank, n)) < density)
    P = B.T @ B
    G = rng.standard_normal((m, n)) * (rng.random((m, n)) < density)
    A = rng.standard_normal((p, n)) * (rng.random((p, n)) < density)
    x, y = rng.standard_normal(n), rng.standard_normal(p)
    active = rng.random(m) < 1 / 3
    z = np.where(active, 0.1 + rng.random(m), 0.0)
    z[np.flatnonzero(active)[:weak]] = 0.0
    side = rng.integers(0, 6, n)  # 0: at lb, 1: at ub, 2: free, else inside
    below = np.where(side == 2, np.inf, (0.1 + rng.random(n)) * (side != 0))
    above = np.where(side == 2, np.inf, (0.1 + rng.random(n)) * (side != 1))
    z_box = (0.1 + rng.random(n)) * (1.0 * (side == 1) - 1.0 * (side == 0))
    slack = (0.1 + rng.random(m)) * ~active
    known = around(P, G, A, (x, y, z, z_box), slack, below, above)
    return known._replace(qp=make_qp(*known.qp))


def infeasible(seed, n, m, p, rank) -> QP:
    """Return a QP whose last row of G is minus a combination of all other rows."""
    rng = np.random.default_rng(seed)
    B = rng.standard_normal((rank, n))
    G, A = rng.standard_normal((m, n)), rng.standard_normal((p, n))
    h, b = rng.standard_normal(m), rng.standard_normal(p)
    z, y = 0.1 + rng.random(m - 1), rng.standard_normal(p)
    G[-1] = -(G[:-1].T @ z + A.T @ y)
    h[-1] = -1.0 - h[:-1] @ z - b @ y
    return make_qp(B.T @ B, rng.standard_normal(n), G, h, A, b)


def unbounded(seed, n, m, p, rank, has_bounds=False) -> QP:
    """Return a feasible QP with a direction d: P d = 0, A d = 0, G d <= 0, q'd = -1.

    Bounds are open where d goes, nowhere else.
    """
    rng = np.random.default_rng(seed)
    d = rng.standard_normal(n)
    d /= np.linalg.norm(d)

    def across(M):
        return M - np.outer(M @ d, d)

    B, A = across(rng.standard_normal((rank, n))), across(rng.standard_normal((p, n)))
    G = rng.standard_normal((m, n))
    G = np.where((G @ d > 0.0)[:, None], across(G), G)
    x, q = rng.standard_normal(n), rng.standard_normal(n)
    q -= (q @ d + 1.0) * d
    lb = np.where(has_bounds & (d > 0.0), x - rng.random(n), -np.inf)
    ub = np.where(has_bounds & (d < 0.0), x + rng.random(n), np.inf)
    return make_qp(B.T @ B, q, G, G @ x + rng.random(m), A, A @ x, lb, ub)


def least_squares(n) -> QP:
    """Return min |x - s|^2/2, Gx <= 1, sum(x) = 42, x >= 0 with a dense row.

    qpsolvers, tests/problems.py, get_sparse_least_squares (there n = 15000).
    """
    i = np.arange(n)
    G = np.zeros((3, n))
    for row, step in enumerate((2, 3, 5)):
        G[row] = i % step == 0
    rows, columns = np.r_[i, i[:-1], i[1:]], np.r_[i, i[1:], i[:-1]]
    G = csc_array((np.r_[G[0], G[1][:-1], G[2][:-1]], (rows, columns)))
    G.eliminate_zeros()
    one = np.ones((1, n))
    return make_qp(eye_array(n), -i.astype(float), G, np.ones(n), one, [42.0], 0.0 * i)


def maros_meszaros(name) -> QP:
    """Read a Maros-Meszaros problem."""
    path = DATA / "maros_meszaros" / f"{name}.mat"
    return make_qp(*mat_problem(path).unpack())


def singular_block(seed, n) -> Known:
    """Return a QP whose P is zero but for one definite block."""
    known = complementary(seed, n, n, 3, 0)
    B = np.random.default_rng(seed).standard_normal((n // 2, n // 2))
    P = block_diag((csc_array(B.T @ B + np.eye(n // 2)), csc_array((n - n // 2,) * 2)))
    q = known.qp.q - P @ known.x
    qp = make_qp(P, q, *known.qp[2:])
    return known._replace(qp=qp)


FIVE = np.diag([2.0, 4, 2, 2, 2])
FIVE[0, 1] = FIVE[1, 0] = -2.0
FIVE[1, 2] = FIVE[2, 1] = 2.0
FIVE_52 = FIVE.copy()
FIVE_52[:2, :2] = [[32, -8], [-8, 4]]
LINEAR = [0, -4, -4, -2, -2]
EQUAL = [[1, 3, 0, 0, 0], [0, 0, 1, 1, -2], [0, 1, 0, 0, -1]]

# W. Hock, K. Schittkowski, Test Examples for Nonlinear Programming Codes, 1981:
# number -> (QP, constant of the objective, optimal value).
HOCK_SCHITTKOWSKI = {
    21: (
        make_qp(
            np.diag([0.02, 2.0]), [0, 0], [[-10, 1]], [-10], lb=[2, -50], ub=[50, 50]
        ),
        -100.0,
        -99.96,
    ),
    35: (
        make_qp(
            [[4, 2, 2], [2, 4, 0], [2, 0, 2]], [-8, -6, -4], [[1, 1, 2]], [3],
            lb=[0, 0, 0],
        ),
        9.0,
        1.0 / 9.0,
    ),
    51: (make_qp(FIVE, LINEAR, A=EQUAL, b=[4, 0, 0]), 6.0, 0.0),
    52: (make_qp(FIVE_52, LINEAR, A=EQUAL, b=[0, 0, 0]), 6.0, 1859.0 / 349.0),
    53: (
        make_qp(FIVE, LINEAR, A=EQUAL, b=[0, 0, 0], lb=[-10] * 5, ub=[10] * 5),
        6.0,
        176.0 / 43.0,
    ),
    76: (
        make_qp(
            [[2, 0, -1, 0], [0, 1, 0, 0], [-1, 0, 2, 1], [0, 0, 1, 1]],
            [-1, -3, 1, -1],
            [[1, 2, 1, 1], [3, 1, 2, -1], [0, -1, -4, 0]],
            [5, 4, -1.5],
            lb=[0, 0, 0, 0],
        ),
        0.0,
        -103.0 / 22.0,
    ),
}  # fmt: skip


def assert_solves_qp(qp: QP, result, tol=1e-9) -> None:
    """Status, residuals and signs of a solution."""
    assert result.status is Status.SOLVED, result.message
    residuals = qp_residuals(*qp, result.x, result.y, result.z, result.z_box)
    assert residuals.solved(tol, tol), residuals
    assert (result.z >= 0.0).all()
    assert (result.z[np.isinf(qp.h)] == 0.0).all()
    assert (result.z_box[np.isinf(qp.lb)] >= 0.0).all()
    assert (result.z_box[np.isinf(qp.ub)] <= 0.0).all()


def assert_in_bounds(qp: QP, found) -> None:
    """To the last bit."""
    low, high = np.isfinite(qp.lb), np.isfinite(qp.ub)
    assert ((qp.lb <= found.x) & (found.x <= qp.ub)).all()
    assert (found.z >= 0.0).all()
    assert (found.z_box[~low] >= 0.0).all()
    assert (found.z_box[~high] <= 0.0).all()


def assert_certificate(qp: QP, result, tol=1e-8) -> None:
    """A Farkas vector with value -1, or a ray with q'x = -1, to a relative `tol`."""
    P, q, G, h, A, b, lb, ub = qp
    found = getattr(result, "residuals", None)
    if result.status is Status.DUAL_INFEASIBLE:
        d = result.x
        size = tol * np.abs(d).max()
        assert found is None or max(found.dual, found.primal) <= size
        assert abs(q @ d + 1.0) <= 1e-9
        assert np.abs(P @ d).max(initial=0.0) <= size
        assert np.abs(A @ d).max(initial=0.0) <= size
        assert (G @ d)[np.isfinite(h)].max(initial=0.0) <= size
        assert (d[np.isfinite(ub)] <= 0.0).all()
        assert (d[np.isfinite(lb)] >= 0.0).all()
        return
    assert result.status is Status.PRIMAL_INFEASIBLE, result.status
    y, z, z_box = result.y, result.z, result.z_box
    size = tol * max(np.abs(v).max(initial=0.0) for v in (y, z, z_box))
    assert found is None or found.dual <= size
    assert np.isnan(result.x).all()
    assert (z >= 0.0).all()
    none = (lb > ub) | (lb == np.inf) | (ub == -np.inf)
    alone = np.concatenate((z * (h == -np.inf), z_box * none))
    if alone.any():
        assert sum(map(np.count_nonzero, (y, z, z_box))) == 1
        for low, high, mu in np.column_stack((lb, ub, z_box))[z_box != 0.0]:
            assert np.isinf([low, high]).any() or abs((low - high) * mu - 1.0) <= 1e-9
        return
    assert np.abs(A.T @ y + G.T @ z + z_box).max(initial=0.0) <= size
    side = np.where(z_box > 0.0, ub, lb)
    used, rows = z_box != 0.0, z != 0.0
    value = b @ y + h[rows] @ z[rows] + side[used] @ z_box[used]
    assert abs(value + 1.0) <= 1e-9


def residual_form(seed, rows, n, lower=-np.inf, upper=np.inf, weight=0.0):
    """min |Bx - c|^2 + weight |x|_1 as cvxpy writes it: t = Bx - c, bounds as rows."""
    rng = np.random.default_rng(seed)
    B, c = rng.standard_normal((rows, n)), rng.standard_normal(rows)
    I, O = eye_array(n), csr_array((n, rows))
    P = np.concatenate((np.full(rows, 2.0), np.zeros(n)))
    A = hstack((-eye_array(rows), B))
    q = np.zeros(rows + n)
    sides = [(1.0, upper), (-1.0, -lower)]
    G = [hstack((O, s * I)) for s, side in sides if side < np.inf]
    h = [np.full(n, side) for s, side in sides if side < np.inf]
    if weight:  # |x_i| <= s_i
        P, q = np.append(P, np.zeros(n)), np.append(q, np.full(n, weight))
        A = hstack((A, csr_array((rows, n))))
        G = [hstack((O, I, -I)), hstack((O, -I, -I))]
        h = [np.zeros(n)] * 2
    G = vstack(G) if G else None
    h = np.concatenate(h) if h else None
    return make_qp(np.diag(P), q, G, h, A, c), B, c


def upper_triangle_of(kkt):
    """Return the upper triangle of K~ as a matrix."""
    return csc_array((kkt.data, kkt.indices, kkt.indptr), shape=(kkt.size, kkt.size))


def dense_scaled(s):
    """P, A and S of the scaled QP: S x <= c are all its one-sided constraints."""
    n, p = s.n, s.p
    K = upper_triangle_of(s.kkt).toarray()
    K[np.diag_indices(s.kkt.size)] = s.kkt.base[s.kkt.diagonal]
    K += np.triu(K, 1).T
    T = np.vstack((np.eye(n), K[n:, :n]))
    return K[:n, :n], K[n : n + p, :n], s.sign[:, None] * T[s.place]


def opposed(gap=3.0):
    """x_1 <= 0 and x_1 >= gap; x_2 free, its best value 1."""
    return make_qp(np.eye(2), [0.0, -1.0], [[1.0, 0.0], [-1.0, 0.0]], [0.0, -gap])
