"""QPs by faces: definition, a plain transcription, and fresh solves."""

import copy
import pickle

import numpy as np
import pytest
import scipy.sparse as sp
from responding import LIMITS, solve

from namlcp import Solver, Status, solve_qp
from namlcp.qp.guess import make_guess
from namlcp.qp.problem import qp_data
from namlcp.qp.responses import Faces, SparseResponses
from namlcp.residuals import qp_residuals

INF = np.inf


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


def generic_qp(rng, n):
    """Rows and bounds in general position, and a definite P."""
    root = sp.random_array((n, n), density=2.0 / n, rng=rng)
    P = root @ root.T + 0.1 * sp.eye_array(n)
    G = sp.random_array((n, n), density=3.0 / n, rng=rng)
    A = sp.random_array((2, n), density=0.5, rng=rng)
    q, h = 3.0 * rng.standard_normal(n), 0.5 * rng.random(n)
    return qp_data(P, q, G, h, A, np.zeros(2), -rng.random(n), rng.random(n))


def begun(qp):
    """Return faces that know the solution of `qp`."""
    faces = Faces.of(qp)
    faces.suggest(make_guess(qp, None, solve_qp(*qp)))
    return faces


def transcribed(qp, guess):
    """Solve the QP by faces as their door has it; return x and the faces tried."""
    n, rows, m = qp.q.size, qp.b.size, qp.h.size
    P, A = qp.P.toarray(), qp.A.toarray()
    C = np.vstack((qp.G.toarray(), -np.eye(n), np.eye(n)))
    d = np.concatenate((qp.h, -qp.lb, qp.ub))
    x, active = guess.x, guess.active.astype(bool)
    for count in range(20):
        K = np.zeros(2 * (n + rows + active.sum(),))
        K[:n, :n], K[n : n + rows, :n], K[n + rows :, :n] = P, A, C[active]
        K[:n, n:] = K[n:, :n].T
        goal = np.concatenate((-qp.q, qp.b, d[active]))
        u = np.append(x, np.zeros(goal.size - n))
        shift = np.where(np.arange(goal.size) < n, 1e-9, -1e-9)
        for _ in range(4):
            u = u + np.linalg.solve(K + np.diag(shift), goal - K @ u)
        x = u[:n]
        following = C @ x > d + 1e-12
        following[active] = u[n + rows :] > -1e-12
        if (following == active).all():
            return x, count
        active = following
    raise AssertionError(f"{m} rows: no end")


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
    rng = np.random.default_rng(m)
    qp = lasso_qp(rng, m, n, 5.0)
    assert SparseResponses.of(qp) is None
    faces = begun(qp)
    solved = 0
    for penalty in 5.0 * np.logspace(0.0, -2.0, 30):
        q = np.append(np.zeros(m + n), np.full(n, penalty))
        step = qp._replace(q=q)
        answer = solve(faces, step)
        if answer is None:
            faces.suggest(make_guess(step, None, solve_qp(*step)))
        else:
            solved += 1
            assert answer.form == "face"
            assert_agrees(answer, step)
    assert solved >= 25


def test_the_same_faces_as_in_a_plain_transcription():
    counts = []
    for seed in range(30):
        rng = np.random.default_rng(seed)
        qp = generic_qp(rng, 20)
        guess = make_guess(qp, None, solve_qp(*qp))
        faces = Faces.of(qp)
        faces.suggest(guess)
        step = qp._replace(q=qp.q + 0.2 * rng.standard_normal(20))
        answer = solve(faces, step)
        if answer is not None:
            x, count = transcribed(step, guess)
            assert answer.iterations == count
            np.testing.assert_allclose(answer.point.x, x, atol=1e-9)
            assert_agrees(answer, step)
            counts.append(count)
    assert len(counts) > 20
    assert max(counts) >= 3


def test_sides_that_vanish_appear_and_meet():
    rng = np.random.default_rng(3)
    qp = store_qp(rng, 12)
    faces = begun(qp)
    seen = 0
    for _ in range(40):
        lb, ub, h = qp.lb.copy(), qp.ub.copy(), qp.h.copy()
        j, i = rng.integers(36), rng.integers(12)
        ub[j] = rng.choice([lb[j], 0.95, INF])
        h[i] = rng.choice([1.4, INF])
        step = qp._replace(q=qp.q + 0.01 * rng.standard_normal(36), h=h, lb=lb, ub=ub)
        answer = solve(faces, step)
        if answer is not None:
            seen += 1
            assert_agrees(answer, step)
    assert seen >= 12


def test_other_values_in_the_matrices():
    """They are factored in the same order; the last point stays the start."""
    qp = store_qp(np.random.default_rng(4), 10)
    faces = begun(qp)
    first = solve(faces, qp)
    factors = faces.kkt.factors
    for factor in (1.0, 2.0, 1e3):  # x stays
        step = qp._replace(P=qp.P * factor, q=qp.q * factor)
        faces.renew(step)
        answer = solve(faces, step)
        assert answer.iterations == 0
        np.testing.assert_allclose(answer.point.x, first.point.x, atol=1e-9)
        assert_agrees(answer, step)
    assert faces.kkt.factors is factors


def test_nothing_is_begun_without_a_solution():
    qp = store_qp(np.random.default_rng(5), 6)
    faces = Faces.of(qp)
    assert solve(faces, qp) is None
    assert faces.kkt is None  # nor is anything laid out
    assert not faces.are_unsuited
    assert Faces.of(qp_data(np.eye(200), np.ones(200), *6 * [None])) is None


def test_what_faces_do_not_solve():
    """The last solved point stays the start."""
    qp = store_qp(np.random.default_rng(6), 8)
    faces = begun(qp)
    first = solve(faces, qp)
    wrong = [
        qp._replace(h=qp.h - 5.0),  # infeasible
        qp._replace(lb=qp.ub, ub=qp.lb),
        qp._replace(q=np.full(24, np.nan)),
        qp._replace(q=np.full(24, -1.0), ub=np.full(24, INF), h=np.full(8, INF)),
    ]
    for step in wrong:
        assert solve(faces, step) is None
        faces.pause = 0
    answer = solve(faces, qp)
    assert answer.iterations == 0
    np.testing.assert_allclose(answer.point.x, first.point.x, atol=1e-12)
    assert solve(faces, qp, LIMITS._replace(eps_abs=0.0, eps_rel=0.0)) is None


def test_active_rows_that_depend_on_each_other():
    """The same row three times, and x_1 = 1 by two bounds and two rows."""
    G = sp.csc_array([[1.0, 1.0], [1.0, 1.0], [1.0, 1.0], [1.0, 0.0], [-1.0, 0.0]])
    h, P = np.array([1.5, 1.5, 1.5, 1.0, -1.0]), sp.csc_array(np.diag([1.0, 0.0]))
    qp = qp_data(P, [-3.0, -1.0], G, h, None, None, [1.0, 0.0], [1.0, 2.0])
    faces = begun(qp)
    for top in (1.5, 1.2, 2.0, 1.0):
        h = np.append(np.full(3, top), h[3:])
        answer = solve(faces, qp._replace(h=h))
        assert_agrees(answer, qp._replace(h=h))
        np.testing.assert_allclose(answer.point.x, [1.0, top - 1.0], atol=1e-9)


def test_units_far_apart():
    """Rows and columns in units from 1e-3 to 1e3."""
    rng = np.random.default_rng(7)
    qp = store_qp(rng, 8)
    unit, row = 10.0 ** rng.uniform(-3, 3, 24), 10.0 ** rng.uniform(-3, 3, 8)
    D, E = sp.diags_array(unit), sp.diags_array(row)
    scaled = qp_data(
        D @ qp.P @ D, unit * qp.q, qp.G @ D, qp.h, E @ qp.A @ D, row * qp.b,
        qp.lb / unit, qp.ub / unit,
    )  # fmt: skip
    faces = begun(scaled)
    for factor in (1.0, 1.001):
        step = scaled._replace(q=scaled.q * factor)
        assert_agrees(solve(faces, step), step)


def test_a_copy_begins_without_a_point():
    qp = store_qp(np.random.default_rng(8), 6)
    faces = begun(qp)
    for other in (copy.copy(faces), pickle.loads(pickle.dumps(faces))):
        assert solve(other, qp) is None
        other.suggest(make_guess(qp, None, solve_qp(*qp)))
        assert_agrees(solve(other, qp), qp)


def test_a_solver_takes_faces_first_for_new_matrices():
    """Responses would have to be made anew; they come back where matrices stay."""
    rng = np.random.default_rng(10)
    n = 20
    P, G = sp.diags_array(rng.uniform(1.0, 2.0, n)).tocsc(), sp.eye_array(n)
    q, A = rng.standard_normal(n), sp.csc_array(np.ones((1, n)))
    solver = Solver(P, q, G, np.full(n, 0.2), A, np.ones(1))
    assert solver.solve().form == "dual"
    for factor, form in ((1.1, "face"), (1.2, "face"), (1.2, "dual"), (1.2, "dual")):
        solver.update(P=factor * P, q=q)
        result = solver.solve()
        assert result.form == form
        expected = solve_qp(factor * P, q, G, np.full(n, 0.2), A, np.ones(1))
        np.testing.assert_allclose(result.x, expected.x, atol=1e-10)


def test_a_solver_with_many_active_rows():
    """A long portfolio: responses to nearly all bounds would take longer than faces."""
    rng = np.random.default_rng(11)
    n, factors = 300, 5
    loads = sp.random_array((factors, n), density=0.3, rng=rng)
    budget = sp.hstack((sp.csc_array(np.ones((1, n))), sp.csc_array((1, factors))))
    A = sp.vstack((sp.hstack((loads, -sp.eye_array(factors))), budget), format="csc")
    P = sp.diags_array(np.append(rng.uniform(0.05, 0.3, n), np.ones(factors))).tocsc()
    q, b = -0.1 * rng.standard_normal(n + factors), np.append(np.zeros(factors), 1.0)
    lb = np.append(np.zeros(n), np.full(factors, -INF))
    solver, forms = Solver(P, q, A=A, b=b, lb=lb), []
    for _ in range(6):
        result = solver.solve()
        forms.append(result.form)
        expected = solve_qp(P, q, A=A, b=b, lb=lb)
        np.testing.assert_allclose(result.x, expected.x, atol=1e-10)
        q = q + 0.002 * rng.standard_normal(n + factors)
        solver.update(q=q)
    assert forms[2:] == 4 * ["face"]
