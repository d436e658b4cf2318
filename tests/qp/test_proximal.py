"""Sequences with a singular P: against the definition, and fresh solves."""

import numpy as np
import pytest
import scipy.sparse as sp

from namlcp import Solver, Status, solve_qp
from namlcp.options import DEFAULT_OPTIONS
from namlcp.qp.active.once import answer_of, kept_for
from namlcp.qp.active.solve import solve as solve_kept
from namlcp.qp.judge import Judge
from namlcp.qp.problem import qp_data
from namlcp.residuals import qp_residuals

INF = np.inf
LIMITS = DEFAULT_OPTIONS.limits()


def solve(kept, qp):
    """Return the answer to the QP with the vectors of `qp`, None if left to others."""
    solve_kept(kept, qp.joined(), DEFAULT_OPTIONS.settings, INF)
    return answer_of(kept, Judge(qp, LIMITS))


def lasso_qp(rng, m, n, penalty):
    """min |r|^2 + penalty 1't, r = X w - y, -t <= w <= t, for (r, w, t).

    P is singular where A x = 0: in the directions of t, and of w if m < n.
    """
    X, y = rng.standard_normal((m, n)), rng.standard_normal(m)
    I, zero = sp.eye_array(n), sp.csc_array((m, n))
    P = sp.diags_array(np.append(np.full(m, 2.0), np.zeros(2 * n)))
    A = sp.hstack((sp.eye_array(m), -X, zero))
    empty = sp.csc_array((n, m))
    G = sp.vstack((sp.hstack((empty, I, -I)), sp.hstack((empty, -I, -I))))
    q = np.append(np.zeros(m + n), np.full(n, penalty))
    return qp_data(P, q, G, np.zeros(2 * n), A, -y, None, None)


def store_qp(rng, n):
    """Buy, sell and store: linear costs, sides of rows and bounds, a flat optimum."""
    P = sp.diags_array(np.where(rng.random(3 * n) < 0.3, 1.0, 0.0))
    price = rng.uniform(1.0, 2.0, n)
    flow = sp.eye_array(n) - sp.eye_array(n, k=-1)
    A = sp.hstack((-sp.eye_array(n), sp.eye_array(n), flow))
    G = sp.hstack((sp.eye_array(n), sp.eye_array(n), sp.csc_array((n, n))))
    q = np.concatenate((price, -0.9 * price, np.zeros(n)))
    lb, ub = np.zeros(3 * n), np.repeat([1.0, 1.0, 3.0], n)
    return qp_data(P, q, G, np.full(n, 1.5), A, np.zeros(n), lb, ub)


def forms(qp):
    """Return the QP with what solves its sequences, in both storages."""
    dense = qp.in_dense_form()
    return (dense, kept_for(dense)), (qp, kept_for(qp))


def assert_agrees(answer, qp):
    """The answer is right by the definition, and as good as that of `solve_qp`."""
    assert answer.status is Status.SOLVED
    residuals = qp_residuals(*qp, *answer.point)
    assert residuals.solved(1e-9, 1e-10)
    np.testing.assert_allclose(answer.residuals, residuals, atol=1e-10)
    expected = solve_qp(*qp).obj
    assert residuals.objective == pytest.approx(expected, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize(("m", "n"), [(8, 5), (6, 15)])
def test_a_lasso_path(m, n):
    for qp, kept in forms(lasso_qp(np.random.default_rng(m), m, n, 5.0)):
        for penalty in 5.0 * np.logspace(0.0, -2.0, 30):
            step = qp._replace(q=np.append(np.zeros(m + n), np.full(n, penalty)))
            assert_agrees(solve(kept, step), step)


def test_sides_that_vanish_appear_and_meet():
    rng = np.random.default_rng(3)
    for qp, kept in forms(store_qp(rng, 12)):
        seen = 0
        for _ in range(40):
            lb, ub, h = qp.lb.copy(), qp.ub.copy(), qp.h.copy()
            j, i = rng.integers(36), rng.integers(12)
            ub[j], h[i] = rng.choice([lb[j], 0.95, INF]), rng.choice([1.4, INF])
            q = qp.q + 0.01 * rng.standard_normal(36)
            step = qp._replace(q=q, h=h, lb=lb, ub=ub)
            answer = solve(kept, step)
            if answer is not None:
                seen += 1
                assert_agrees(answer, step)
        assert seen >= 35


def test_the_same_active_rows_need_no_pivot():
    for qp, kept in forms(store_qp(np.random.default_rng(4), 8)):
        first = solve(kept, qp)
        again = solve(kept, qp)
        assert first.iterations > again.iterations == 0
        assert again.residuals.objective == pytest.approx(first.residuals.objective)


def test_another_size_of_the_vectors_chooses_another_weight():
    for qp, kept in forms(store_qp(np.random.default_rng(5), 6)):
        weights = set()
        for size in (1.0, 1e5, 1.0):
            step = qp._replace(q=size * qp.q)
            assert_agrees(solve(kept, step), step)
            weights.add(kept.rho)
        assert len(weights) == 2


def test_steps_without_a_solution():
    """The last solved rows stay the start."""
    for qp, kept in forms(store_qp(np.random.default_rng(6), 8)):
        first = solve(kept, qp)
        assert_agrees(first, qp)
        lost = solve(kept, qp._replace(h=qp.h - 5.0))
        assert lost.status is Status.PRIMAL_INFEASIBLE
        down = np.full(24, -1.0)
        wide = np.full(24, INF), np.full(8, INF)
        free = qp._replace(q=down, ub=wide[0], h=wide[1])
        assert solve(kept, free).status is Status.DUAL_INFEASIBLE
        assert solve(kept, qp._replace(lb=qp.ub, ub=qp.lb)) is None
        assert solve(kept, qp).iterations < first.iterations / 4


@pytest.mark.parametrize("store", [np.asarray, sp.csc_array])
def test_a_solver_gives_the_objective_of_a_fresh_solve(store):
    rng = np.random.default_rng(8)
    qp = lasso_qp(rng, 10, 20, 2.0).in_dense_form()
    matrices = {name: store(getattr(qp, name)) for name in "PGA"}
    solver = Solver(**qp._replace(**matrices)._asdict())
    for k in range(12):
        q = qp.q * rng.uniform(0.5, 1.5)
        solver.update(q=q)
        if k % 4 == 3:
            matrices["P"] = matrices["P"] * 1.1
            solver.update(P=matrices["P"])
        result, fresh = solver.solve(), solve_qp(*qp._replace(q=q, **matrices))
        assert result.status is fresh.status is Status.SOLVED
        assert result.obj == pytest.approx(fresh.obj, rel=1e-9)
