"""QPs with the same matrices by responses: against the definition and fresh solves."""

import copy
import pickle

import numpy as np
import pytest
from numba import njit
from responding import LIMITS, solve, walked

import namlcp
from namlcp.qp.guess import NO_GUESS
from namlcp.qp.problem import QP
from namlcp.qp.responses import matrices as packed
from namlcp.qp.responses.active import DONE
from namlcp.qp.responses.fresh import solve_once
from namlcp.qp.responses.judgement import ROUNDING
from namlcp.qp.responses.solve import DenseResponses, parted
from namlcp.residuals import qp_residuals
from namlcp.status import Status

INF = np.inf


def random_qp(rng, n, m, p):
    """Return a feasible strictly convex QP with bounds, some of them pinned."""
    root = rng.standard_normal((n, n))
    P = root @ root.T / n + np.diag(rng.uniform(0.1, 2.0, n))
    G, A = rng.standard_normal((m, n)), rng.standard_normal((p, n))
    x = rng.standard_normal(n)
    lb = np.where(rng.random(n) < 0.6, x - rng.random(n), -INF)
    ub = np.where(rng.random(n) < 0.6, x + rng.random(n), INF)
    pinned = rng.random(n) < 0.1
    lb[pinned] = ub[pinned] = x[pinned]
    h = G @ x + rng.random(m)
    h[rng.random(m) < 0.1] = INF
    return QP((P + P.T) / 2, 3.0 * rng.standard_normal(n), G, h, A, A @ x, lb, ub)


def problem(responses, q, h, b, lb, ub):
    """Return the QP of matrices at hand with these vectors."""
    P, G, A = responses.matrices
    return QP(P, q, G, h, A, b, lb, ub)


def moved(rng, qp, size):
    """Return the QP with other vectors; now and then a side vanishes or appears."""
    n = qp.q.size
    q = qp.q + size * rng.standard_normal(n)
    h, lb, ub = qp.h.copy(), qp.lb.copy(), qp.ub.copy()
    if rng.random() < 0.3:
        j = rng.integers(n)
        lb[j] = -INF if lb[j] > -INF else ub[j] - 1.0 if ub[j] < INF else -1.0
    if h.size and rng.random() < 0.3:
        i = rng.integers(h.size)
        h[i] = INF if h[i] < INF else 1.0
    if rng.random() < 0.1:
        h = h - 10.0 * rng.random()  # may be infeasible
    return qp._replace(q=q, h=h, lb=lb, ub=ub)


def assert_agrees(answer, qp):
    """The answer is that of `solve_qp`, and right by the definition."""
    expected = namlcp.solve_qp(*qp)
    assert answer.status is expected.status
    if answer.status is Status.SOLVED:
        assert qp_residuals(*qp, *answer.point).solved(1e-9, 1e-10)
        np.testing.assert_allclose(answer.point.x, expected.x, atol=1e-8)
        residuals = qp_residuals(*qp, *answer.point)
        np.testing.assert_allclose(answer.residuals, residuals, atol=1e-10)
    else:
        _, y, z, z_box = answer.point
        assert abs(qp.A.T @ y + qp.G.T @ z + z_box).max() < 1e-9 * abs(z).max()
        assert z.min(initial=0.0) >= 0.0


@pytest.mark.parametrize("seed", range(12))
def test_sequences_agree_with_fresh_solves(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 25))
    m, p = int(rng.integers(0, 2 * n + 1)), int(rng.integers(0, n // 2 + 1))
    first = random_qp(rng, n, m, p)
    kept = DenseResponses.of(first)
    size = 10.0 ** rng.uniform(-2, 1)
    steps = (moved(rng, first, size) for _ in range(25))
    seen = walked(kept, steps, assert_agrees)
    assert Status.SOLVED in seen


@pytest.mark.parametrize("seed", range(6))
def test_a_singular_cost_that_is_definite_where_equations_hold(seed):
    """P has rank n - p / 2 or less, and rows of A differ in length."""
    rng = np.random.default_rng(100 + seed)
    n, p = int(rng.integers(4, 20)), int(rng.integers(2, 4))
    first = random_qp(rng, n, n, p)
    root = rng.standard_normal((n, n - p // 2))
    length = 10.0 ** rng.uniform(-1, 1, p)
    A, b = length[:, None] * first.A, length * first.b
    first = first._replace(P=root @ root.T, A=A, b=b)
    kept = DenseResponses.of(first)
    seen = walked(kept, (moved(rng, first, 0.3) for _ in range(10)), assert_agrees)
    assert Status.SOLVED in seen


def test_hs51_and_hs52():
    """W. Hock and K. Schittkowski, Test Examples for Nonlinear Programming (1981)."""
    rows = np.array(
        [[1.0, -1, 0, 0, 0], [0, 1, 1, 0, 0], [0, 0, 0, 1, 0], [0, 0, 0, 0, 1]]
    )
    A = np.array([[1.0, 3, 0, 0, 0], [0, 0, 1, 1, -2], [0, 1, 0, 0, -1]])
    e, none, free = np.empty(0), np.empty((0, 5)), (np.full(5, -INF), np.full(5, INF))
    for first, b, expected in (
        (1.0, [4.0, 0.0, 0.0], np.ones(5)),
        (4.0, [0.0, 0.0, 0.0], np.array([-33.0, 11, 180, -158, 11]) / 349),
    ):
        C = rows.copy()
        C[0, 0] = first
        q = -2.0 * C.T @ [0.0, 2.0, 1.0, 1.0]
        qp = QP(2.0 * C.T @ C, q, none, e, A, np.array(b), *free)
        answer = solve(DenseResponses.of(qp), qp)
        assert answer.status is Status.SOLVED
        np.testing.assert_allclose(answer.point.x, expected, atol=1e-12)


@pytest.mark.parametrize("p", [0, 3])
def test_large_terms_are_summed_in_the_order_of_numpy(p):
    """Where NumPy and SciPy have the same BLAS, to the last bit."""
    rng = np.random.default_rng(p)
    limits = namlcp.Options(eps_abs=1e-7, eps_rel=0.0).limits()
    seen = 0
    for _ in range(20):
        qp = random_qp(rng, 12, 15, p)
        qp = qp._replace(q=1e7 * qp.q, P=1e7 * qp.P)
        code, numbers = DenseResponses.of(qp).run(qp.joined(), limits)
        if code == DONE:
            point, found = parted(numbers, 12, 15, p)
            expected = qp_residuals(*qp, *point)
            assert found.objective == pytest.approx(expected.objective, rel=1e-12)
            size = max(found.dual_size, found.gap_size)
            if ROUNDING * size > limits.eps_abs:
                np.testing.assert_allclose(found[:6], expected[:6], atol=1e-15 * size)
                seen += 1
    assert seen > 5


def test_equations_do_not_hide_that_a_cost_is_not_convex():
    e, none, free = np.empty(0), np.empty((0, 2)), (np.full(2, -INF), np.full(2, INF))
    A, b = np.array([[0.0, 1.0]]), np.ones(1)
    for corner in (-0.1, -1e-3):
        qp = QP(np.diag([1.0, corner]), np.ones(2), none, e, A, b, *free)
        assert solve(DenseResponses.of(qp), qp) is None
        with pytest.raises(ValueError, match="positive semidefinite"):
            namlcp.solve_qp(*qp)


def test_renewed_matrices_give_the_answer_of_a_fresh_solve():
    rng = np.random.default_rng(5)
    qp = random_qp(rng, 15, 20, 3)
    kept = DenseResponses.of(qp)
    pivots = []
    for _ in range(6):
        qp = qp._replace(
            P=qp.P + 1e-3 * np.eye(15), G=qp.G + 1e-4, A=qp.A * 1.01, b=qp.b * 1.01
        )
        kept.renew(qp)
        answer, fresh = solve(kept, qp), solve(DenseResponses.of(qp), qp)
        assert answer.status is fresh.status is Status.SOLVED
        np.testing.assert_array_equal(answer.point.x, fresh.point.x)
        pivots.append((answer.iterations, fresh.iterations))
    assert sum(p[0] for p in pivots[1:]) < sum(p[1] for p in pivots[1:])


def test_an_infeasible_step_keeps_the_last_solved_rows():
    rng = np.random.default_rng(6)
    qp = random_qp(rng, 20, 40, 0)
    kept = DenseResponses.of(qp)
    assert solve(kept, qp).iterations > 2
    lost = qp._replace(lb=np.full(20, 5.0), ub=np.full(20, 6.0))
    assert solve(kept, lost).status is Status.PRIMAL_INFEASIBLE
    assert solve(kept, qp).iterations == 0


def test_a_suggestion_is_the_start():
    rng = np.random.default_rng(7)
    qp = random_qp(rng, 20, 40, 2)
    answer = solve(DenseResponses.of(qp), qp)
    x, _, z, z_box = answer.point
    active = np.concatenate((z > 0.0, z_box < 0.0, z_box > 0.0)).astype(np.int8)
    other = DenseResponses.of(qp)
    other.suggest(NO_GUESS._replace(active=active))
    again = solve(other, qp)
    assert answer.iterations > again.iterations == 0
    np.testing.assert_array_equal(again.point.x, x)


def test_singular_costs_dependent_equations_and_crossed_bounds():
    eye, none = np.eye(2), np.empty((0, 2))
    free, e = (np.full(2, -INF), np.full(2, INF)), np.empty(0)
    singular = DenseResponses(np.diag([1.0, 0.0]), none, none)
    qp = problem(singular, np.ones(2), e, e, *free)
    assert solve(singular, qp).status is Status.DUAL_INFEASIBLE
    dependent = DenseResponses(eye, none, np.ones((2, 2)))
    qp = problem(dependent, np.ones(2), e, np.ones(2), *free)
    np.testing.assert_allclose(solve(dependent, qp).point.x, [0.5, 0.5], atol=1e-14)
    qp = qp._replace(b=np.array([1.0, 2.0]))
    assert solve(dependent, qp).status is Status.PRIMAL_INFEASIBLE
    crossed = DenseResponses(eye, none, none)
    qp = problem(crossed, np.ones(2), e, e, np.ones(2), -np.ones(2))
    assert solve(crossed, qp) is None


def test_numbers_that_are_not_allowed_are_left_to_others():
    eye, row, none = np.eye(2), np.ones((1, 2)), np.empty((0, 2))
    q, h, b = np.ones(2), np.ones(1), np.empty(0)
    lb, ub = np.full(2, -INF), np.full(2, INF)
    kept = DenseResponses(eye, row, none)
    qp = problem(kept, q, h, b, lb, ub)
    assert solve(kept, qp).point.x.tolist() == [-1.0, -1.0]
    for bad in (np.array([0.0, np.nan]), np.array([0.0, INF])):
        assert solve(kept, qp._replace(q=bad)) is None
    assert solve(kept, qp._replace(h=np.array([np.nan]))) is None
    assert solve(kept, qp._replace(lb=np.full(2, -1e30))) is None
    for P, G in (
        (eye, row * np.nan),
        (np.full((2, 2), INF), row),
        (np.triu(eye + 1.0), row),
    ):
        other = qp._replace(P=P, G=G)
        assert solve(DenseResponses.of(other), other) is None


def test_a_copy_begins_anew():
    rng = np.random.default_rng(8)
    qp = random_qp(rng, 6, 9, 1)
    kept = DenseResponses.of(qp)
    answer = solve(kept, qp)
    for other in (copy.deepcopy(kept), pickle.loads(pickle.dumps(kept))):
        np.testing.assert_array_equal(solve(other, qp).point.x, answer.point.x)
    np.testing.assert_array_equal(solve(kept, qp).point.x, answer.point.x)


def test_the_triangle_is_that_of_the_remaining_rows():
    """After appending k rows and removing one, L L' = S without it."""
    append, remove = packed.append_to_triangle, packed.remove_from_triangle
    solve_lower = packed.triangle_solve
    solve_upper = packed.triangle_solve_transposed

    @njit
    def go(S, leaving, L, b):
        k = S.shape[0]
        row = np.empty(k)
        for i in range(k):
            row[:i] = S[i, :i]
            solve_lower(L, i, row)
            append(L, i, row, np.sqrt(S[i, i] - np.sum(row[:i] ** 2)))
        remove(L, k, leaving, np.empty(k), np.empty(k))
        solve_lower(L, k - 1, b)
        solve_upper(L, k - 1, b)

    rng = np.random.default_rng(9)
    for leaving in range(6):
        root = rng.standard_normal((6, 6))
        S = root @ root.T + np.eye(6)
        L, b = np.empty(21), rng.standard_normal(5)
        left = np.delete(np.delete(S, leaving, 0), leaving, 1)
        expected = np.linalg.solve(left, b)
        go(S, leaving, L, b)
        square = np.zeros((5, 5))
        square[np.tril_indices(5)] = L[:15]
        np.testing.assert_allclose(square @ square.T, left, atol=1e-12)
        np.testing.assert_allclose(b, expected, atol=1e-12)


def test_a_single_solve_gives_the_answer_of_the_first_in_a_sequence():
    """It goes without V where no row enters, and without sorted rows at the end."""
    rng = np.random.default_rng(10)
    for scale in (0.0, 1.0, 1.0, 1.0):
        qp = random_qp(rng, 20, 40, 0)
        wide = np.full(20, 1e3 if scale == 0.0 else INF)
        far = qp.h + 1e3 if scale == 0.0 else qp.h
        qp = qp._replace(h=far, lb=-wide, ub=wide)
        single, first = (
            solve_once(qp, NO_GUESS, LIMITS),
            solve(DenseResponses.of(qp), qp),
        )
        assert single.status is first.status is Status.SOLVED
        assert (single.iterations == 0) == (scale == 0.0)
        np.testing.assert_allclose(single.point.x, first.point.x, atol=1e-12)
        np.testing.assert_allclose(single.point.z, first.point.z, atol=1e-11)
