"""The dense form against the definition, a brute force and known answers."""

from itertools import combinations

import numpy as np
import pytest

from namlcp.qp import dense
from namlcp.residuals import Residuals

INF = np.inf


def solve(P, q, G=None, h=None, A=None, b=None, lb=None, ub=None, hint=None):
    """Call the kernel with absent parts filled in."""
    n = len(q)
    return dense.solve(
        np.asarray(P, dtype=float),
        np.asarray(q, dtype=float),
        np.empty((0, n)) if G is None else np.asarray(G, dtype=float),
        np.empty(0) if h is None else np.asarray(h, dtype=float),
        np.empty((0, n)) if A is None else np.asarray(A, dtype=float),
        np.empty(0) if b is None else np.asarray(b, dtype=float),
        np.full(n, -INF) if lb is None else np.asarray(lb, dtype=float),
        np.full(n, INF) if ub is None else np.asarray(ub, dtype=float),
        np.empty(0, dtype=np.int8) if hint is None else hint,
        10_000,
    )


def random_qp(rng, n, m, p, condition):
    """Return a feasible strictly convex QP, often degenerate or with repeated rows."""
    Q, _ = np.linalg.qr(rng.standard_normal((n, n)))
    P = (Q * np.logspace(0, -np.log10(condition), n)) @ Q.T
    P = (P + P.T) / 2
    G, A = rng.standard_normal((m, n)), rng.standard_normal((p, n))
    if m > 4 and rng.random() < 0.4:
        G = np.round(G)
        G[m // 2 :] = G[: m - m // 2] * rng.uniform(0.1, 10.0, (m - m // 2, 1))
    x = rng.standard_normal(n)
    h = G @ x + np.where(rng.random(m) < 0.5, 0.0, rng.random(m))
    lb = np.where(rng.random(n) < 0.5, x - rng.integers(0, 2, n), -INF)
    ub = np.where(rng.random(n) < 0.5, x + rng.random(n), INF)
    return P, rng.standard_normal(n), G, h, A, A @ x, lb, ub


@pytest.mark.parametrize("seed", range(60))
def test_random_problems_are_exact(seed):
    rng = np.random.default_rng(seed)
    n, m = int(rng.integers(1, 30)), int(rng.integers(0, 60))
    qp = random_qp(rng, n, m, int(rng.integers(0, 1 + n // 4)), 10.0 ** (seed % 8))
    code, _, x, _y, z, z_box, numbers = solve(*qp)
    assert code == dense.SOLVED
    assert Residuals(*numbers).solved(1e-10, 1e-10)
    assert (z >= 0.0).all()
    hint = np.concatenate((z > 0.0, z_box < 0.0, z_box > 0.0)).astype(np.int8)
    restart = solve(*qp, hint=hint)
    assert restart[0] == dense.SOLVED
    np.testing.assert_allclose(restart[2], x, atol=1e-7)


def brute_force(P, q, G, h):
    """Minimise 1/2 x'Px + q'x, Gx <= h by trying every active set."""
    best, point = INF, None
    m, n = G.shape
    for k in range(min(m, n) + 1):
        for F in combinations(range(m), k):
            rows = G[list(F)]
            K = np.block([[P, rows.T], [rows, np.zeros((k, k))]])
            if np.linalg.matrix_rank(K) < n + k:
                continue
            x = np.linalg.solve(K, np.concatenate((-q, h[list(F)])))[:n]
            value = 0.5 * x @ P @ x + q @ x
            if (G @ x <= h + 1e-9).all() and value < best:
                best, point = value, x
    return point


@pytest.mark.parametrize("seed", range(15))
def test_same_as_trying_every_active_set(seed):
    rng = np.random.default_rng(100 + seed)
    P, q, G, h, *_ = random_qp(rng, 3, 7, 0, 10.0)
    np.testing.assert_allclose(solve(P, q, G, h)[2], brute_force(P, q, G, h), atol=1e-9)


def test_goldfarb_idnani_example():
    """Goldfarb and Idnani (1983), section 5: x = (1, 0) after two constraints."""
    P, q = [[4.0, -2.0], [-2.0, 4.0]], [6.0, 0.0]
    code, _, x, _, z, z_box, _ = solve(P, q, [[-1.0, -1.0]], [-2.0], lb=[0.0, 0.0])
    assert code == dense.SOLVED
    np.testing.assert_allclose(x, [0.5, 1.5], atol=1e-14)
    np.testing.assert_allclose(z, [5.0], atol=1e-13)
    np.testing.assert_array_equal(z_box, [0.0, 0.0])


def test_unconstrained_and_empty():
    assert solve([[2.0]], [-4.0])[2] == [2.0]
    code, pivots, x, *_ = solve(np.empty((0, 0)), [])
    assert (code, pivots, x.size) == (dense.SOLVED, 0, 0)


def test_equal_bounds_pin_a_variable():
    _, _, x, _, _, z_box, _ = solve(np.eye(2), [1.0, 1.0], lb=[3.0, -9], ub=[3.0, 9])
    np.testing.assert_array_equal(x, [3.0, -1.0])
    np.testing.assert_allclose(z_box, [-4.0, 0.0], atol=1e-15)


def test_more_active_rows_than_variables():
    """All of 40 planes pass through the solution of a problem with two variables."""
    angle = np.linspace(0.0, np.pi / 2, 40)
    G = np.column_stack((np.cos(angle), np.sin(angle)))
    code, _, x, *_ = solve(np.eye(2), [-3.0, -3.0], G, G @ [1.0, 1.0])
    assert code == dense.SOLVED
    np.testing.assert_allclose(x, [1.0, 1.0], atol=1e-12)


def test_redundant_equalities_are_taken():
    A = [[1.0, 1.0, 0.0], [2.0, 2.0, 0.0], [0.0, 0.0, 1.0]]
    code, _, x, *_ = solve(np.eye(3), np.zeros(3), A=A, b=[2.0, 4.0, 1.0])
    assert code == dense.SOLVED
    np.testing.assert_allclose(x, [1.0, 1.0, 1.0], atol=1e-14)


@pytest.mark.parametrize("seed", range(20))
def test_infeasible_rows_give_a_farkas_candidate(seed):
    rng = np.random.default_rng(seed)
    n, m = 6, 9
    G, h = rng.standard_normal((m, n)), rng.standard_normal(m)
    weights = rng.random(m)
    G = np.vstack((G, -weights @ G))
    h = np.append(h, -weights @ h - 0.1)
    code, _, _, _y, z, z_box, _ = solve(np.eye(n), rng.standard_normal(n), G, h)
    assert code == dense.INFEASIBLE
    assert (z >= 0.0).all()
    np.testing.assert_allclose(G.T @ z + z_box, 0.0, atol=1e-9 * z.max())
    assert h @ z < 0.0


@pytest.mark.parametrize(
    "P", [np.diag([1.0, 0.0]), np.diag([1.0, -1.0]), np.ones((2, 2))]
)
def test_indefinite_and_singular_are_handed_over(P):
    assert solve(P, [1.0, 1.0])[0] == dense.NOT_DEFINITE


def test_scales_do_not_matter():
    rng = np.random.default_rng(7)
    P, q, G, h, A, b, lb, ub = random_qp(rng, 12, 20, 2, 100.0)
    x = solve(P, q, G, h, A, b, lb, ub)[2]
    r = 10.0 ** rng.integers(-4, 5, 20)
    scaled = solve(1e6 * P, 1e6 * q, r[:, None] * G, r * h, 1e-4 * A, 1e-4 * b, lb, ub)
    np.testing.assert_allclose(scaled[2], x, atol=1e-9)
    far = solve(P, 1e8 * q, G, 1e8 * h, A, 1e8 * b, 1e8 * lb, 1e8 * ub)
    np.testing.assert_allclose(far[2] * 1e-8, x, atol=1e-9)
