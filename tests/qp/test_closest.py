"""infeasible="closest" and "elastic": least shifts, then the least cost among them."""

import numpy as np
import pytest
from problems_qp import infeasible, make_qp, opposed
from scipy.optimize import linprog, lsq_linear
from scipy.sparse import csc_array

import namlcp
from namlcp import Relaxation, Status
from namlcp.qp.problem import QP
from namlcp.residuals import qp_residuals

INF = np.inf


def relaxed(qp, **choice):
    """Return the result for an infeasible QP and check all that it promises."""
    result = namlcp.solve_qp(*qp, **choice)
    assert result.status is Status.PRIMAL_INFEASIBLE
    assert np.isnan(result.x).all()
    found = result.closest
    if found.status is Status.SOLVED:
        shifted = qp._replace(
            h=qp.h + found.shift_h,
            b=qp.b + found.shift_b,
            lb=qp.lb + found.shift_lb,
            ub=qp.ub + found.shift_ub,
        )
        point = found.x, found.y, found.z, found.z_box
        measured = qp_residuals(*shifted, *point)
        assert measured.solved(1e-9, 1e-9), measured
        assert found.residuals.solved(1e-9, 1e-9)
        assert found.obj == pytest.approx(measured.objective, abs=1e-12, rel=1e-12)
        assert (found.z >= 0.0).all()
        assert (found.shift_h >= 0.0).all()
        assert (found.shift_ub >= 0.0).all()
        assert (found.shift_lb <= 0.0).all()
    return found


def least_squares_shifts(qp, wh, wb):
    """Return the shifts of least weighted squares, by bounded least squares.

    G x + slack - h = shift_h and A x - b = shift_b with slack >= 0.
    """
    m = qp.h.size
    root = np.sqrt(np.concatenate((wh * np.ones(m), wb * np.ones(qp.b.size))))
    C = np.vstack((qp.G.toarray(), qp.A.toarray()))
    slack = np.vstack((np.eye(m), np.zeros((qp.b.size, m))))
    d = np.concatenate((qp.h, qp.b))
    sides = np.append(qp.lb, np.zeros(m)), np.append(qp.ub, np.full(m, INF))
    matrix = root[:, None] * np.hstack((C, slack))
    found = lsq_linear(matrix, root * d, sides, method="bvls", tol=1e-15)
    r = np.hstack((C, slack)) @ found.x - d
    return r[:m], r[m:]


def bounded(seed, n=6, m=9, p=2, rank=4):
    """Return an infeasible QP with bounds on every other variable."""
    qp = infeasible(seed, n, m, p, rank)
    lb = np.where(np.arange(n) % 2 == 0, -1.0, -INF)
    return qp._replace(lb=lb, ub=1.0 - lb)


def dense(qp):
    return qp._replace(P=qp.P.toarray(), G=qp.G.toarray(), A=qp.A.toarray())


@pytest.mark.parametrize("seed", range(20))
def test_shifts_of_least_squares(seed):
    qp = bounded(seed) if seed % 2 else infeasible(seed, 6, 9, 2, 6)
    wh, wb = (1.0, 1.0) if seed % 3 else (0.1 + np.arange(9.0), np.array([2.0, 0.5]))
    found = relaxed(qp, infeasible=Relaxation(h=wh, b=wb))
    assert found.status is Status.SOLVED
    shift_h, shift_b = least_squares_shifts(qp, wh, wb)
    np.testing.assert_allclose(found.shift_h, shift_h, atol=1e-9)
    np.testing.assert_allclose(found.shift_b, shift_b, atol=1e-9)
    full = relaxed(dense(qp), infeasible=Relaxation(h=wh, b=wb))
    np.testing.assert_allclose(full.shift_h, shift_h, atol=1e-9)
    np.testing.assert_allclose(full.obj, found.obj, rtol=1e-8, atol=1e-8)


def least_sum(qp, wh, wb):
    """Return the least weighted sum of |shifts|, by HiGHS."""
    (m, n), p = qp.G.shape, qp.b.size
    cost = np.concatenate((np.zeros(n), np.full(m, wh), np.full(2 * p, wb)))
    G = np.hstack((qp.G.toarray(), -np.eye(m), np.zeros((m, 2 * p))))
    A = np.hstack((qp.A.toarray(), np.zeros((p, m)), -np.eye(p), np.eye(p)))
    free = [*zip(qp.lb, qp.ub, strict=True)] + [(0.0, INF)] * (m + 2 * p)
    return linprog(cost, G, qp.h, A, qp.b, free).fun


def least_cost_within(qp, wh, wb, total):
    """Return the least cost among x whose weighted shifts sum up to `total`."""
    cp = pytest.importorskip("cvxpy")
    x = cp.Variable(qp.q.size)
    P = cp.psd_wrap(qp.P.toarray())
    shifts = wh * cp.sum(cp.pos(qp.G @ x - qp.h)) + wb * cp.norm1(qp.A @ x - qp.b)
    inside = np.isfinite(qp.lb)
    rows = [shifts <= total, x[inside] >= qp.lb[inside], x[inside] <= qp.ub[inside]]
    problem = cp.Problem(cp.Minimize(0.5 * cp.quad_form(x, P) + qp.q @ x), rows)
    return problem.solve(solver="CLARABEL")


@pytest.mark.parametrize("seed", range(10))
def test_shifts_of_least_sum_and_the_least_cost_among_them(seed):
    qp = bounded(seed, rank=6) if seed % 2 else infeasible(seed, 6, 9, 2, 6)
    found = relaxed(qp, infeasible=Relaxation(norm=1, h=1.0, b=3.0))
    assert found.status is Status.SOLVED
    total = found.shift_h.sum() + 3.0 * np.abs(found.shift_b).sum()
    assert total == pytest.approx(least_sum(qp, 1.0, 3.0), rel=1e-9)
    assert np.count_nonzero(found.shift_h) < 9
    best = least_cost_within(qp, 1.0, 3.0, total * (1.0 + 1e-9))
    assert found.obj == pytest.approx(best, rel=1e-4, abs=1e-4)


def test_opposed_rows_meet_by_their_weights():
    found = relaxed(opposed(), infeasible="closest")
    np.testing.assert_allclose(found.x, [1.5, 1.0], atol=1e-12)
    np.testing.assert_allclose(found.shift_h, [1.5, 1.5], atol=1e-12)
    found = relaxed(opposed(), infeasible=Relaxation(h=[2.0, 1.0]))
    np.testing.assert_allclose(found.shift_h, [1.0, 2.0], atol=1e-12)
    found = relaxed(opposed(), infeasible=Relaxation(h=[INF, 1.0]))
    np.testing.assert_array_equal(found.shift_h, [0.0, 3.0])


def test_the_cost_chooses_among_shifts_of_equal_sum():
    """Any x_1 in [0, 3] has the sum 3; the cost is least at 0."""
    found = relaxed(opposed(), infeasible="elastic")
    np.testing.assert_allclose(found.x, [0.0, 1.0], atol=1e-12)
    np.testing.assert_allclose(found.shift_h, [0.0, 3.0], atol=1e-12)


@pytest.mark.parametrize("choice", ["closest", "elastic"])
def test_a_feasible_problem_has_nothing_closer(choice):
    qp = opposed(gap=-1.0)
    result = namlcp.solve_qp(*qp, infeasible=choice)
    assert result.status is Status.SOLVED
    assert result.closest is None
    assert (result.closest or result).x is result.x


def test_bounds_stay_unless_they_have_weights():
    qp = make_qp(np.eye(2), [0.0, 0.0], [[-1.0, -1.0]], [-3.0], ub=[1.0, INF])
    qp = qp._replace(lb=np.array([-INF, -INF]), ub=np.array([1.0, 1.0]))
    found = relaxed(qp, infeasible="closest")
    np.testing.assert_allclose(found.x, [1.0, 1.0], atol=1e-12)
    np.testing.assert_allclose(found.shift_h, [1.0], atol=1e-12)
    found = relaxed(qp, infeasible=Relaxation(h=INF, ub=[1.0, 3.0]))
    np.testing.assert_allclose(found.shift_ub, [0.75, 0.25], atol=1e-12)
    np.testing.assert_array_equal(found.shift_h, [0.0])
    found = relaxed(qp, infeasible=Relaxation(norm=1, h=INF, ub=[2.0, 1.0]))
    np.testing.assert_allclose(found.shift_ub, [0.0, 1.0], atol=1e-12)


def test_contradicting_bounds_are_named_or_shifted():
    qp = make_qp(np.eye(2), [0.0, 0.0], lb=[1.0, 0.0], ub=[-1.0, 1.0])
    found = relaxed(qp, infeasible="closest")
    assert found.status is Status.PRIMAL_INFEASIBLE
    assert "bounds of x[0] contradict each other" in found.message
    assert np.isnan(found.x).all()
    found = relaxed(qp, infeasible=Relaxation(lb=1.0, ub=3.0))
    np.testing.assert_allclose(found.shift_lb, [-1.5, 0.0], atol=1e-12)
    np.testing.assert_allclose(found.shift_ub, [0.5, 0.0], atol=1e-12)
    np.testing.assert_allclose(found.x, [-0.5, 0.0], atol=1e-12)


@pytest.mark.parametrize("form", [dense, lambda qp: qp], ids=["dense", "sparse"])
def test_an_infinite_shift_is_none(form):
    qp = form(make_qp(np.eye(1), [0.0], [[1.0]], [-INF]))
    found = relaxed(qp, infeasible="closest")
    assert found.status is Status.PRIMAL_INFEASIBLE
    assert "h = -inf" in found.message


@pytest.mark.parametrize("choice", ["closest", Relaxation(lb=1.0)])
def test_an_infinite_bound_that_excludes_every_x_stays(choice):
    qp = dense(make_qp(np.eye(2), [0.0, 0.0], [[1.0, 1.0]], [1.0], lb=[INF, 0.0]))
    found = relaxed(qp, infeasible=choice)
    assert found.status is Status.PRIMAL_INFEASIBLE


@pytest.mark.parametrize("choice", ["closest", "elastic"])
def test_the_cost_may_fall_without_bound(choice):
    qp = opposed()
    qp = make_qp(np.diag([1.0, 0.0]), [0.0, -2.0], qp.G, qp.h)
    found = relaxed(qp, infeasible=choice)
    assert found.status is Status.DUAL_INFEASIBLE
    np.testing.assert_allclose(found.x, [0.0, 0.5], atol=1e-12)
    assert found.shift_h.sum() == pytest.approx(3.0)
    assert found.obj == -INF


@pytest.mark.parametrize("choice", ["closest", "elastic"])
def test_least_squares_of_contradicting_equations(choice):
    """x = 0, x = 1 and x = 5: their mean, and their median."""
    qp = make_qp([[0.0]], [0.0], A=[[1.0], [1.0], [1.0]], b=[0.0, 1.0, 5.0])
    found = relaxed(qp, infeasible=choice)
    x = 2.0 if choice == "closest" else 1.0
    np.testing.assert_allclose(found.x, [x], atol=1e-12)
    np.testing.assert_allclose(found.shift_b, x - qp.b, atol=1e-12)


def test_a_controller_yields_by_the_least_violation():
    """x_k+1 = x_k + u_k with |u| <= 1 from x_0 = 5 cannot have x_1, x_2 <= 2.

    x_1 >= 4 and x_2 >= 3: the least violations are 2 and 1, by full braking.
    """
    qp = make_qp(
        np.diag([1.0, 1.0, 0.1, 0.1]),  # x_1, x_2, u_0, u_1
        np.zeros(4),
        [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0]],
        [2.0, 2.0],
        [[1.0, 0.0, -1.0, 0.0], [-1.0, 1.0, 0.0, -1.0]],
        [5.0, 0.0],
        [-INF, -INF, -1.0, -1.0],
        [INF, INF, 1.0, 1.0],
    )
    for norm in 1, 2:  # the dynamics hold exactly
        found = relaxed(qp, infeasible=Relaxation(norm=norm, b=INF))
        np.testing.assert_allclose(found.x, [4.0, 3.0, -1.0, -1.0], atol=1e-9)
        np.testing.assert_allclose(found.shift_h, [2.0, 1.0], atol=1e-9)


@pytest.mark.parametrize("choice", ["closest", "elastic", Relaxation(h=np.ones(2))])
def test_a_feasible_step_takes_the_short_way(choice, monkeypatch):
    """A dense QP goes on to the general solve only where it is infeasible."""
    answers = []
    kept = namlcp.qp.solve.solve_checked

    def spy(*arguments):
        answers.append(arguments[-1])
        return kept(*arguments)

    monkeypatch.setattr("namlcp.qp.solve.solve_checked", spy)
    result = namlcp.solve_qp(*dense(opposed(-1.0)), infeasible=choice)
    assert result.status is Status.SOLVED
    assert not answers
    result = namlcp.solve_qp(*dense(opposed(3.0)), infeasible=choice)
    assert [known.status for known in answers] == [result.status]
    assert result.z is answers[0].point.z  # its certificate


def test_choices_are_checked():
    qp = opposed()
    for choice, error, said in (
        ("nearest", ValueError, r"infeasible must be one of \['certificate', 'clos"),
        (2, TypeError, "infeasible must be a string or a Relaxation, got 2"),
    ):
        with pytest.raises(error, match=said):
            namlcp.solve_qp(*qp, infeasible=choice)
    for fields, error, said in (
        ({"norm": 3}, ValueError, "Relaxation.norm must be 1 or 2, got 3"),
        ({"h": [1.0, 0.0]}, ValueError, r"Relaxation.h must be > 0, got 0\.0"),
        ({"ub": "soft"}, TypeError, "Relaxation.ub must be a number, got 'soft'"),
    ):
        with pytest.raises(error, match=said):
            Relaxation(**fields)
    for gap in 3.0, -1.0:  # infeasible or not
        with pytest.raises(ValueError, match=r"Relaxation\.h must have shape"):
            namlcp.solve_qp(*opposed(gap), infeasible=Relaxation(h=[1.0, 2.0, 3.0]))


def test_a_solver_yields_in_the_steps_that_are_infeasible_alone():
    solver = namlcp.Solver(*opposed(gap=-1.0), infeasible="closest")
    for gap in -1.0, 3.0, 1.0, -2.0:
        solver.update(h=np.array([0.0, -gap]))
        result = solver.solve()
        x = (result.closest or result).x
        np.testing.assert_allclose(x, [max(0.5 * gap, 0.0), 1.0], atol=1e-9)
        assert (result.closest is None) == (gap < 0.0)


def test_noise_of_a_small_contradiction_holds_no_rows():
    """x_1 >= 3 + 1e-5 against x_1 <= 3; x_2 <= 3 holds by chance, with force 0."""
    qp = make_qp(np.eye(2), [0.0, -5.0], np.diag([-1.0, 1.0]), [-3.0 - 1e-5, 3.0])
    qp = dense(qp._replace(lb=np.full(2, -INF), ub=np.array([3.0, INF])))
    found = relaxed(qp, infeasible=Relaxation(ub=1.0))
    assert found.status is Status.SOLVED
    assert found.message == ""
    np.testing.assert_allclose(found.x, [3.0 + 0.5e-5, 3.0], atol=1e-12)


def test_all_variables_at_bounds_leave_nothing_to_minimise():
    qp = dense(make_qp(np.eye(2), [1.0, 1.0], [[1.0, 1.0]], [1.0], lb=[1.0, 2.0]))
    found = relaxed(qp._replace(ub=qp.lb), infeasible="closest")
    np.testing.assert_allclose(found.x, [1.0, 2.0], rtol=1e-14)
    np.testing.assert_allclose(found.shift_h, [2.0])


@pytest.mark.parametrize("form", [dense, lambda qp: qp], ids=["dense", "sparse"])
def test_a_loop_of_infeasible_steps_gives_what_fresh_solves_give(form):
    weights = Relaxation(h=0.1 + np.arange(9.0), b=np.array([2.0, 0.5]))
    qp = form(infeasible(3, 6, 9, 2, 6))
    solver = namlcp.Solver(*qp, infeasible=weights)
    for step in range(4):
        h = qp.h + 0.1 * step * np.cos(np.arange(9.0))
        solver.update(h=h)
        here, fresh = (
            solver.solve(),
            namlcp.solve_qp(*qp._replace(h=h), infeasible=weights),
        )
        for name in "x", "shift_h", "shift_b":
            own, other = getattr(here.closest, name), getattr(fresh.closest, name)
            np.testing.assert_allclose(own, other, atol=1e-9)


def summed(contradiction):
    """The last row of A is the sum of three others, its b exceeds theirs.

    x is around 1000 or at a bound; the least shifts are a quarter of the excess each.
    """
    rng = np.random.default_rng(3)
    n, m = 120, 60
    A = np.where(rng.random((m, n)) < 0.05, rng.uniform(0.5, 2.0, (m, n)), 0.0)
    A[np.arange(m), np.arange(m)] = 1.0
    x = 1e3 * np.where(rng.random(n) < 0.5, rng.random(n), 0.0)
    A = np.vstack((A, A[:3].sum(axis=0)))
    b = A @ x
    b[-1] += contradiction
    P = csc_array(np.diag(rng.random(n)))
    rows = csc_array((0, n)), np.empty(0), csc_array(A), b
    return QP(P, np.zeros(n), *rows, np.zeros(n), np.full(n, 1e6))


@pytest.mark.parametrize("contradiction", [1e-4, 1.0, 1e3])
def test_contradictions_of_all_sizes_are_proved_and_shifted(contradiction):
    """Small ones too, whose multipliers have relatively large errors."""
    qp = summed(contradiction)
    result = namlcp.solve_qp(*qp, infeasible="closest")
    assert result.status is Status.PRIMAL_INFEASIBLE
    y, z_box = result.y, result.z_box
    np.testing.assert_allclose(qp.A.T @ y + z_box, 0.0, atol=1e-12 * np.abs(y).max())
    value = qp.b @ y + qp.ub @ np.maximum(z_box, 0.0)
    np.testing.assert_allclose(value, -1.0)
    found = result.closest
    assert found.status is Status.SOLVED
    size = 0.25 * contradiction
    expected = np.zeros(qp.b.size)
    expected[:3], expected[-1] = size, -size
    np.testing.assert_allclose(found.shift_b, expected, atol=1e-9 * (1.0 + size))
