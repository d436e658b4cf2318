"""Sparse QPs with the same matrices by responses: definition and fresh solves."""

import copy
import pickle

import numpy as np
import pytest
import scipy.sparse as sp
from responding import FINAL, solve, walked

import namlcp
from namlcp.qp.problem import qp_data
from namlcp.qp.responses import DenseResponses, SparseResponses
from namlcp.residuals import qp_residuals
from namlcp.status import Status

INF = np.inf


def control_qp(rng, stages, weight=0.1):
    """Return x_0, ..., x_N, u_0, ..., u_{N-1} of a random plant, with rows G.

    The weights of some states are zero: P is singular, but not where A x = 0.
    """
    nx, nu = 3, 2
    F = 0.9 * np.eye(nx) + 0.1 * rng.standard_normal((nx, nx))
    B = rng.standard_normal((nx, nu))
    past = sp.eye_array(stages + 1, k=-1)
    inputs = sp.kron(sp.eye_array(stages + 1, stages, k=-1), B)
    A = sp.hstack((sp.kron(past, F) - sp.eye_array(nx * (stages + 1)), inputs))
    weights = np.where(np.arange(nx * (stages + 1)) % nx == 0, 0.0, 1.0)
    P = sp.diags_array(np.append(weights, np.full(nu * stages, weight)))
    n, m = P.shape[0], 2 * stages
    G = sp.random_array((m, n), density=3.0 / n, rng=rng) + sp.eye_array(m, n)
    b = np.zeros(A.shape[0])
    b[:nx] = -rng.standard_normal(nx)
    lb = np.append(np.full(nx * (stages + 1), -INF), np.full(nu * stages, -0.5))
    return qp_data(P, rng.standard_normal(n), G, np.full(m, 3.0), A, b, lb, -lb)


def heap_qp(rng, n):
    """Return a definite P with few entries, rows G and bounds, no equations."""
    P = sp.diags_array(rng.uniform(0.1, 10.0, n)) + 0.0
    root = sp.random_array((n, n), density=1.0 / n, rng=rng)
    G = sp.random_array((2 * n, n), density=2.0 / n, rng=rng) - sp.eye_array(2 * n, n)
    lb = np.where(rng.random(n) < 0.5, -1.0, -INF)
    return qp_data(
        P + root @ root.T, rng.standard_normal(n), G, rng.random(2 * n), None, None,
        lb, np.full(n, 2.0),
    )  # fmt: skip


def moved(rng, qp, size):
    """Return the QP with other vectors; now and then a side vanishes or appears."""
    n = qp.q.size
    q, b = qp.q + size * rng.standard_normal(n), qp.b.copy()
    b[:3] += 0.3 * size * rng.standard_normal(b[:3].size)
    h, lb, ub = qp.h.copy(), qp.lb.copy(), qp.ub.copy()
    j, i = rng.integers(n), rng.integers(h.size)
    if rng.random() < 0.3:
        lb[j] = -INF if lb[j] > -INF else -1.0
    if rng.random() < 0.2:
        h[i] = INF
    if rng.random() < 0.2:
        lb[j] = ub[j] = 0.1
    if rng.random() < 0.1:
        h = h - 4.0 * rng.random()  # may be infeasible
    return qp._replace(q=q, h=h, b=b, lb=lb, ub=ub)


def assert_agrees(answer, qp):
    """The answer is that of `solve_qp`, and right by the definition."""
    expected = namlcp.solve_qp(*qp)
    assert answer.status is expected.status
    if answer.status is Status.SOLVED:
        residuals = qp_residuals(*qp, *answer.point)
        assert residuals.solved(1e-9, 1e-10)
        np.testing.assert_allclose(answer.point.x, expected.x, atol=1e-8)
        np.testing.assert_allclose(answer.residuals, residuals, atol=1e-10)
    else:
        _, y, z, z_box = answer.point
        most = max(np.abs(v).max(initial=0.0) for v in (y, z, z_box))
        assert abs(qp.A.T @ y + qp.G.T @ z + z_box).max() < 1e-8 * most
        assert z.min(initial=0.0) >= 0.0


@pytest.mark.parametrize("seed", range(10))
def test_sequences_agree_with_fresh_solves(seed):
    rng = np.random.default_rng(seed)
    first = heap_qp(rng, 30) if seed % 2 else control_qp(rng, 5 + seed)
    kept = SparseResponses.of(first)
    size = 10.0 ** rng.uniform(-2, 0.5)
    steps = (moved(rng, first, size) for _ in range(20))
    seen = walked(kept, steps, assert_agrees)
    assert seen.count(Status.SOLVED) >= 10


def test_dense_and_sparse_matrices_give_the_same():
    rng = np.random.default_rng(3)
    qp = heap_qp(rng, 20)
    full = {name: getattr(qp, name).toarray() for name in "PGA"}
    dense = qp_data(*qp._replace(**full))
    one, other = SparseResponses.of(qp), DenseResponses.of(dense)
    for _ in range(10):
        step = moved(rng, qp, 0.5)
        found, expected = solve(one, step), solve(other, step)
        assert found.status is expected.status
        np.testing.assert_allclose(found.point.x, expected.point.x, atol=1e-11)


def test_renewed_matrices_give_the_answer_of_a_fresh_solve():
    rng = np.random.default_rng(5)
    qp = control_qp(rng, 10)
    kept = SparseResponses.of(qp)
    factors = kept.kkt.factors
    pivots = []
    for _ in range(6):
        qp = qp._replace(P=qp.P * 1.01, G=qp.G * 1.01, A=qp.A * 1.01, b=qp.b * 1.02)
        kept.renew(qp)
        answer, fresh = solve(kept, qp), solve(SparseResponses.of(qp), qp)
        assert answer.status is fresh.status is Status.SOLVED
        np.testing.assert_array_equal(answer.point.x, fresh.point.x)
        pivots.append((answer.iterations, fresh.iterations))
    assert kept.kkt.factors is factors  # the order is not looked for again
    assert sum(p[0] for p in pivots[1:]) < sum(p[1] for p in pivots[1:])


def test_a_bound_on_what_the_equations_fix():
    """x_0 = (1, 1, 1) by equations; a bound on it holds or contradicts them."""
    qp = control_qp(np.random.default_rng(6), 8)
    b = qp.b.copy()
    b[:3] = -1.0
    kept = SparseResponses.of(qp)
    for bound, status in ((1.5, Status.SOLVED), (0.5, FINAL[1]), (1.0, Status.SOLVED)):
        ub = qp.ub.copy()
        ub[0] = bound
        answer = solve(kept, qp._replace(b=b, ub=ub))
        assert answer.status is status
        assert_agrees(answer, qp._replace(b=b, ub=ub))


def test_a_cost_that_is_not_convex_is_left_to_others():
    P = sp.diags_array([1.0, 1.0, 1.0])
    A = sp.csc_array([[1.0, 1.0, 0.0]])
    qp = qp_data(P, np.ones(3), None, None, A, np.ones(1), np.zeros(3), None)
    kept = SparseResponses.of(qp)
    assert solve(kept, qp).status is Status.SOLVED
    assert not kept.are_unsuited
    for last in (0.0, -1.0):
        values = np.array([1.0, 1.0, last])
        other = qp._replace(P=sp.csc_array((values, qp.P.indices, qp.P.indptr)))
        kept.renew(other)
        answer = solve(kept, other)
        assert kept.are_unsuited == (answer is None) == (last < 0.0)
    kept.renew(qp)
    assert solve(kept, qp).status is Status.SOLVED


def test_changed_matrices_are_factored_where_a_solve_is_tried():
    qp = control_qp(np.random.default_rng(6), 10)
    kept = SparseResponses.of(qp)
    first = solve(kept, qp)
    kkt, kept.pause = kept.kkt, 1
    for factor in (1.0, 2.0):  # x stays
        kept.renew(qp._replace(P=qp.P * factor, q=qp.q * factor))
    assert solve(kept, qp) is None
    assert kept.kkt is kkt
    answer = solve(kept, qp._replace(P=qp.P * 2.0, q=qp.q * 2.0))
    assert kept.kkt is not kkt
    np.testing.assert_allclose(answer.point.x, first.point.x, atol=1e-10)
    assert answer.iterations == 0  # from the rows of the first solve


def test_dependent_equations():
    """The same equation twice: solved if both agree, else left to others."""
    A = sp.csc_array([[1.0, 1.0, 0.0], [1.0, 1.0, 0.0]])
    qp = qp_data(sp.eye_array(3), np.ones(3), None, None, A, np.ones(2), None, None)
    answer = solve(SparseResponses.of(qp), qp)
    np.testing.assert_allclose(answer.point.x, [0.5, 0.5, -1.0], atol=1e-12)
    assert solve(SparseResponses.of(qp), qp._replace(b=np.array([1.0, 2.0]))) is None


def test_scales_far_apart():
    """Rows and columns in units from 1e-3 to 1e3."""
    rng = np.random.default_rng(8)
    qp = control_qp(rng, 8)
    n = qp.q.size
    unit = 10.0 ** rng.uniform(-3.0, 3.0, n)
    row = 10.0 ** rng.uniform(-3.0, 3.0, qp.b.size)
    D, E = sp.diags_array(unit), sp.diags_array(row)
    scaled = qp_data(
        D @ qp.P @ D, unit * qp.q, qp.G @ D, qp.h, E @ qp.A @ D, row * qp.b,
        qp.lb / unit, qp.ub / unit,
    )  # fmt: skip
    kept = SparseResponses.of(scaled)
    answer, expected = solve(kept, scaled), solve(SparseResponses.of(qp), qp)
    assert answer.status is expected.status is Status.SOLVED
    np.testing.assert_allclose(unit * answer.point.x, expected.point.x, atol=1e-7)


def test_a_copy_begins_anew():
    qp = control_qp(np.random.default_rng(7), 5)
    kept = SparseResponses.of(qp)
    expected = solve(kept, qp)
    for other in (copy.copy(kept), pickle.loads(pickle.dumps(kept))):
        np.testing.assert_array_equal(solve(other, qp).point.x, expected.point.x)


def test_what_is_not_sparse_or_too_large():
    dense = qp_data(np.eye(2), np.ones(2), *6 * [None])
    assert SparseResponses.of(dense) is None
    n = 30_000
    large = qp_data(sp.eye_array(n), np.ones(n), *6 * [None])
    assert SparseResponses.of(large) is None
    kept = SparseResponses.of(qp_data(sp.eye_array(2), [0, 0], *6 * [None]))
    assert solve(kept, dense._replace(q=np.array([np.nan, 0.0]))) is None


def test_too_much_work_is_left_to_others():
    """What takes too many operations is, and then some solves are not tried."""
    qp = control_qp(np.random.default_rng(9), 10)
    kept = SparseResponses.of(qp)
    kept.now.most_operations = 1.0
    assert solve(kept, qp) is None
    assert solve(kept, qp) is None
    kept.now.most_operations = INF
    assert solve(kept, qp) is None  # not tried
    assert solve(kept, qp).status is Status.SOLVED
    kept.pause = 1
    kept.renew(qp)
    assert solve(kept, qp) is None  # other values do not end a pause
    assert solve(kept, qp).status is Status.SOLVED
