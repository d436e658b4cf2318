"""QPs with most variables at bounds, one after another: against the other form."""

from collections import Counter
from functools import partial

import numpy as np
import pytest
import responding

from namlcp import Solver, solve_qp
from namlcp.limits import Limits
from namlcp.qp.guess import NO_GUESS
from namlcp.qp.problem import QP
from namlcp.qp.responses.active import MOST_SORTED
from namlcp.qp.responses.solve import DenseResponses
from namlcp.residuals import qp_residuals
from namlcp.status import Status

INF = np.inf
LIMITS = Limits(1e-9, 1e-10, 10_000)


def narrow_qp(rng, n, m, p):
    """Return a feasible QP whose gradient is large: most variables end at bounds.

    A tenth of the variables has no bounds, and a tenth is pinned.
    """
    root = rng.standard_normal((n, max(n // 4, 1)))
    P = root @ root.T / n + np.diag(rng.uniform(0.5, 2.0, n))
    G, A = rng.standard_normal((m, n)), rng.standard_normal((p, n))
    x = rng.standard_normal(n)
    lb, ub = x - 0.3 * rng.random(n), x + 0.3 * rng.random(n)
    kind = rng.random(n)
    lb[kind < 0.1], ub[kind < 0.15] = -INF, INF
    pinned = kind > 0.9
    lb[pinned] = ub[pinned] = x[pinned]
    h = G @ x + rng.random(m)
    return QP((P + P.T) / 2, 3.0 * rng.standard_normal(n), G, h, A, A @ x, lb, ub)


solve = partial(responding.solve, limits=LIMITS)


def assert_same(answer, fresh, qp):
    """Both answers are one, and right by the definition."""
    assert answer.status is fresh.status
    if answer.status is Status.SOLVED:
        assert qp_residuals(*qp, *answer.point).solved(1e-9, 1e-10)
        size = max(1.0, *(abs(part).max(initial=0.0) for part in fresh.point))
        for mine, other in zip(answer.point, fresh.point, strict=True):
            np.testing.assert_allclose(mine, other, rtol=0.0, atol=1e-12 * size)
    else:
        _, y, z, z_box = answer.point
        assert abs(qp.A.T @ y + qp.G.T @ z + z_box).max() < 1e-9 * abs(z_box).max()


def changed(rng, first, size):
    """Return the QP with other vectors; sides vanish, bounds move, rows are too low."""
    n = first.q.size
    q = first.q + size * rng.standard_normal(n)
    b = first.b + 0.01 * size * rng.standard_normal(first.b.size)
    h, lb, ub = first.h.copy(), first.lb.copy(), first.ub.copy()
    j = rng.integers(n)
    case = rng.integers(5)
    if case == 0:
        lb[j] = -INF
    elif case == 1:
        ub[j] = INF
    elif case == 2 and lb[j] > -INF:
        ub[j] = lb[j]
    elif case == 3:
        h = h - 20.0 * rng.random()
    return first._replace(q=q, b=b, h=h, lb=lb, ub=ub)


@pytest.mark.parametrize("seed", range(8))
def test_sequences_agree_with_fresh_solves_by_responses(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(32, 90))
    m, p = int(rng.integers(0, n // 2)), int(rng.integers(0, n // 10))
    first = narrow_qp(rng, n, m, p)
    kept, size = DenseResponses.of(first), 10.0 ** rng.uniform(-2.0, 0.5)
    seen: Counter[tuple[bool, Status]] = Counter()
    for _ in range(25):
        qp = changed(rng, first, size)
        was_free = bool(kept.now.is_free)
        answer, fresh = solve(kept, qp), solve(DenseResponses.of(qp), qp)
        if answer is None or fresh is None:
            assert answer is fresh
            continue
        seen[was_free and bool(kept.now.is_free), answer.status] += 1
        assert_same(answer, fresh, qp)
    assert seen[True, Status.SOLVED] > 10


def first_solved(rng, n, m, p):
    """Return a narrow QP and responses that have solved it, now in the free form."""
    qp = narrow_qp(rng, n, m, p)
    kept = DenseResponses.of(qp)
    assert solve(kept, qp).status is Status.SOLVED
    assert kept.now.is_free
    return qp, kept


def test_the_point_solves_the_system_of_its_face():
    rng = np.random.default_rng(20)
    first, kept = first_solved(rng, 60, 10, 3)
    for _ in range(5):
        qp = first._replace(q=first.q + 0.3 * rng.standard_normal(60))
        x, y, z, z_box = solve(kept, qp).point
        assert kept.now.is_free
        free, held = z_box == 0.0, z > 0.0
        C, d = np.vstack((qp.A, qp.G[held])), np.append(qp.b, qp.h[held])
        F, rhs = C[:, free], -qp.q - qp.P[:, ~free] @ x[~free]
        K = np.block([[qp.P[np.ix_(free, free)], F.T], [F, np.zeros(2 * d.shape)]])
        found = np.linalg.solve(K, np.append(rhs[free], d - C[:, ~free] @ x[~free]))
        expected = np.concatenate((x[free], y, z[held]))
        np.testing.assert_allclose(found, expected, atol=1e-11)


def test_the_way_to_the_active_rows_leaves_no_trace():
    rng = np.random.default_rng(21)
    first, kept = first_solved(rng, 80, 12, 2)
    expected = None
    for _ in range(6):
        solve(kept, first._replace(q=first.q + rng.standard_normal(80)))
        point = solve(kept, first).point
        expected = expected or point
        for mine, other in zip(point, expected, strict=True):
            np.testing.assert_array_equal(mine, other)


def test_an_infeasible_step_keeps_the_last_solved_rows():
    rng = np.random.default_rng(22)
    qp, kept = first_solved(rng, 50, 8, 1)
    lost = qp._replace(h=np.full(8, -1e4), lb=np.full(50, 5.0), ub=np.full(50, 6.0))
    for _ in range(2):
        assert solve(kept, lost).status is Status.PRIMAL_INFEASIBLE
        answer = solve(kept, qp)
        assert answer.status is Status.SOLVED
        assert answer.iterations == 0


def test_more_free_variables_are_left_to_responses_and_fewer_come_back():
    rng = np.random.default_rng(23)
    narrow, kept = first_solved(rng, 60, 5, 1)
    wide = narrow._replace(lb=narrow.lb - 50.0, ub=narrow.ub + 50.0)
    box = {"lb": np.full(60, -50.0), "ub": np.full(60, 50.0)}
    nowhere = narrow._replace(h=np.full(5, -1e5), **box)
    for qp, is_free in ((wide, 0), (narrow, 1), (nowhere, 0), (narrow, 1), (wide, 0)):
        answer, fresh = solve(kept, qp), solve(DenseResponses.of(qp), qp)
        assert_same(answer, fresh, qp)
        if answer.status is Status.SOLVED:
            assert kept.now.is_free == is_free


def test_renewed_matrices_and_suggestions():
    rng = np.random.default_rng(24)
    qp, kept = first_solved(rng, 50, 4, 2)
    for _ in range(3):
        qp = qp._replace(P=qp.P + 1e-3 * np.eye(50), G=qp.G + 1e-4)
        kept.renew(qp)
        for _ in range(2):  # by responses, then in the free form
            assert_same(solve(kept, qp), solve(DenseResponses.of(qp), qp), qp)
    for _ in range(3):
        qp = qp._replace(q=qp.q + rng.standard_normal(50))
        kept.suggest(NO_GUESS._replace(active=np.zeros(104, dtype=np.int8)))
        for is_kept in (0, 1):  # the face: not by responses, in the free form
            assert_same(solve(kept, qp), solve(DenseResponses.of(qp), qp), qp)
            assert kept.now.face_is_kept == is_kept


def test_many_free_variables_are_factored_anew_now_and_then():
    """Above MOST_SORTED free variables the factor goes from solve to solve."""
    rng = np.random.default_rng(25)
    qp, kept = first_solved(rng, 400, 0, 1)
    q, ages = 0.3 * qp.q, []
    for k in range(20):
        step = qp._replace(q=q + 0.1 * rng.standard_normal(400))
        answer = solve(kept, step)
        assert kept.now.is_free
        ages.append(kept.now.face_age)
        if k % 5 == 4:
            assert_same(answer, solve(DenseResponses.of(qp), step), step)
    assert kept.now.free_count > MOST_SORTED
    assert max(ages) > min(ages[5:])


def test_numbers_that_are_not_allowed_are_left_to_others():
    qp, kept = first_solved(np.random.default_rng(26), 40, 2, 1)
    for name in ("q", "h", "b", "lb", "ub"):
        vector = getattr(qp, name).copy()
        vector[0] = np.nan
        assert solve(kept, qp._replace(**{name: vector})) is None
    assert solve(kept, qp).iterations == 0


def test_a_portfolio_by_solver():
    """Long only, fully invested, at most a tenth in each: as `solve_qp` has it."""
    rng = np.random.default_rng(27)
    n = 100
    loads = rng.standard_normal((n, 5))
    problem = {
        "P": loads @ loads.T / 10 + np.diag(rng.uniform(0.05, 0.3, n)),
        "A": np.ones((1, n)), "b": np.ones(1),
        "lb": np.zeros(n), "ub": np.full(n, 0.1),
    }  # fmt: skip
    q = rng.standard_normal(n)
    solver = Solver(q=q, **problem)
    for _ in range(20):
        q = q + 0.1 * rng.standard_normal(n)
        solver.update(q=q)
        x, expected = solver.solve().x, solve_qp(q=q, **problem).x
        np.testing.assert_allclose(x, expected, rtol=0.0, atol=1e-12)
    assert solver.method.now.is_free
