"""infeasible="closest" and "elastic": least shifts, then the least cost among them."""

import numpy as np
import pytest
from problems_qp import DATA, dense, infeasible, make_qp, opposed, sparse
from scipy.optimize import linprog, lsq_linear

from namlcp import Relaxation, Solver, Status, qp_residuals, solve_qp
from validation.problems import infeasible_cases

INF = np.inf
FORMS = {"dense": dense, "sparse": sparse}


def relaxed(qp, **choice):
    """Return the result for an infeasible QP and check all that it promises."""
    result = solve_qp(*qp, **choice)
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
        for v in (found.z, found.shift_h, found.shift_ub, -found.shift_lb):
            assert (v >= 0.0).all()
    return found


def test_the_nearest_problem_is_solved_by_pivots_though_its_rows_leave_a_point():
    """Rows that leave a single x seem to contradict each other by rounding."""
    rng, n = np.random.default_rng(200), 100
    B, G, A = (rng.standard_normal((k, n)) for k in (n, 3 * n, n // 10))
    h, b = -1.0 - rng.random(3 * n), rng.standard_normal(n // 10)
    qp = make_qp(B.T @ B, rng.standard_normal(n), G, h, A, b)
    found = relaxed(qp, infeasible="closest")
    assert found.status is Status.SOLVED
    near = qp._replace(h=qp.h + found.shift_h, b=qp.b + found.shift_b)
    result = solve_qp(*near)
    assert (result.status, result.form) == (Status.SOLVED, "dual")
    np.testing.assert_allclose(result.x, found.x, 0.0, 1e-9)


# ---- against other solvers of the two stages


def bounded(seed, n=6, m=9, p=2, rank=4):
    """Return an infeasible QP with bounds on every other variable."""
    qp = infeasible(seed, n, m, p, rank)
    lb = np.where(np.arange(n) % 2 == 0, -1.0, -INF)
    return qp._replace(lb=lb, ub=1.0 - lb)


def in_units(seed):
    """Rows in units from 0.01 to 100, some without a side, some that must stay."""
    rng = np.random.default_rng(seed)
    qp = bounded(seed, n=8, m=30, p=3, rank=8)
    units = 10.0 ** rng.uniform(-2.0, 2.0, 30)
    h = units * (qp.h - rng.random(30))
    h[rng.random(30) < 0.1] = INF
    wh = np.where(rng.random(30) < 0.2, INF, (0.1 + rng.random(30)) / units**2)
    qp = make_qp(qp.P, qp.q, units[:, None] * qp.G.toarray(), h, *qp[4:])
    return qp, Relaxation(h=wh, b=np.array([INF, 1.0, 1.0]), ub=3.0)


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


@pytest.mark.parametrize("seed", range(20))
def test_shifts_of_least_squares(seed):
    qp = bounded(seed) if seed % 2 else infeasible(seed, 6, 9, 2, 6)
    wh, wb = (1.0, 1.0) if seed % 3 else (0.1 + np.arange(9.0), np.array([2.0, 0.5]))
    shift_h, shift_b = least_squares_shifts(qp, wh, wb)
    costs = []
    for form in FORMS.values():
        found = relaxed(form(qp), infeasible=Relaxation(h=wh, b=wb))
        assert found.status is Status.SOLVED
        np.testing.assert_allclose(found.shift_h, shift_h, atol=1e-9)
        np.testing.assert_allclose(found.shift_b, shift_b, atol=1e-9)
        costs.append(found.obj)
    assert costs[0] == pytest.approx(costs[1], rel=1e-8, abs=1e-8)


@pytest.mark.parametrize("seed", range(12))
def test_both_forms_give_the_same_in_other_units(seed):
    qp, choice = in_units(seed)
    one, other = (relaxed(form(qp), infeasible=choice) for form in FORMS.values())
    assert one.status is other.status
    if one.status is Status.SOLVED:
        for name in "x", "shift_h", "shift_b", "shift_lb", "shift_ub":
            v, w = getattr(one, name), getattr(other, name)
            np.testing.assert_allclose(v, w, atol=1e-7)


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
    P, box = np.diag(rng.random(n)), (np.zeros(n), np.full(n, 1e6))
    return make_qp(P, np.zeros(n), None, None, A, b, *box)


@pytest.mark.parametrize("contradiction", [1e-4, 1.0, 1e3])
def test_multipliers_of_the_least_shifts_prove_a_doubt(contradiction):
    """Of small ones too, whose errors are relatively large."""
    qp = summed(contradiction)
    result = solve_qp(*qp, infeasible="closest")
    assert result.status is Status.PRIMAL_INFEASIBLE
    y, z_box = result.y, result.z_box
    np.testing.assert_allclose(qp.A.T @ y + z_box, 0.0, atol=1e-12 * np.abs(y).max())
    np.testing.assert_allclose(qp.b @ y + qp.ub @ np.maximum(z_box, 0.0), -1.0)
    found, size = result.closest, 0.25 * contradiction
    assert found.status is Status.SOLVED
    expected = np.zeros(qp.b.size)
    expected[:3], expected[-1] = size, -size
    np.testing.assert_allclose(found.shift_b, expected, atol=1e-9 * (1.0 + size))


@pytest.mark.skipif(
    not (DATA / "maros_meszaros").is_dir(),
    reason="no Maros-Meszaros data: set NAMLCP_DATA to the data folder",
)
def test_a_solve_that_resists_asks_the_least_shifts():
    """QCAPRI with sums of equations that are off by 1e-4: 402 iterations without."""
    qp = infeasible_cases.changed(DATA, "QCAPRI", "sums").problem
    result = solve_qp(*qp.unpack())
    assert result.status is Status.PRIMAL_INFEASIBLE
    assert result.iterations < 100


# ---- known answers: (QP, choice, what is known of the closest point)

MEANS = make_qp([[0.0]], [0.0], A=[[1.0], [1.0], [1.0]], b=[0.0, 1.0, 5.0])
CORNER = make_qp(np.eye(2), [0, 0], [[-1, -1]], [-3], ub=[1, 1])
CROSSED = make_qp(np.eye(2), [0, 0], lb=[1, 0], ub=[-1, 1])
FALLING = make_qp(np.diag([1.0, 0.0]), [0, -2], opposed().G, opposed().h)
NOISE = make_qp(np.eye(2), [0, -5], np.diag([-1, 1]), [-3.0 - 1e-5, 3], ub=[3, INF])
FIXED = make_qp(np.eye(2), [1, 1], [[1, 1]], [1], lb=[1, 2], ub=[1, 2])
NOWHERE = make_qp(np.eye(2), [0, 0], [[1, 1]], [1], lb=[INF, 0])
ENDLESS = make_qp(np.eye(1), [0], [[1]], [-INF])
# x_k+1 = x_k + u_k with |u| <= 1 from x_0 = 5 cannot have x_1, x_2 <= 2: full braking
BRAKING = make_qp(
    np.diag([1.0, 1.0, 0.1, 0.1]), np.zeros(4), np.eye(2, 4), [2, 2],
    [[1, 0, -1, 0], [-1, 1, 0, -1]], [5, 0], [-INF, -INF, -1, -1], [INF, INF, 1, 1],
)  # fmt: skip
BRAKED = {"x": [4, 3, -1, -1], "shift_h": [2, 1]}
NONE = {"status": Status.PRIMAL_INFEASIBLE}
FALLS = {"status": Status.DUAL_INFEASIBLE, "x": [0.0, 0.5], "obj": -INF}
KNOWN = {
    "rows meet halfway": (opposed(), "closest", {"x": [1.5, 1], "shift_h": [1.5, 1.5]}),
    "by their weights": (opposed(), Relaxation(h=[2.0, 1.0]), {"shift_h": [1, 2]}),
    "one stays": (opposed(), Relaxation(h=[INF, 1.0]), {"shift_h": [0, 3]}),
    # any x_1 in [0, 3] has the sum 3; the cost is least at 0
    "by the cost": (opposed(), "elastic", {"x": [0, 1], "shift_h": [0, 3]}),
    "mean": (MEANS, "closest", {"x": [2], "shift_b": [2, 1, -3]}),
    "median": (MEANS, "elastic", {"x": [1], "shift_b": [1, 0, -4]}),
    "bounds stay": (CORNER, "closest", {"x": [1, 1], "shift_h": [1]}),
    "bounds give way": (
        CORNER, Relaxation(h=INF, ub=[1.0, 3.0]),
        {"shift_ub": [0.75, 0.25], "shift_h": [0]},
    ),
    "the cheapest bound": (
        CORNER, Relaxation(norm=1, h=INF, ub=[2.0, 1.0]), {"shift_ub": [0, 1]},
    ),
    "bounds that cross": (
        CROSSED, "closest", NONE | {"message": "bounds of x[0] contradict each other"},
    ),
    "bounds that meet": (
        CROSSED, Relaxation(lb=1.0, ub=3.0),
        {"shift_lb": [-1.5, 0], "shift_ub": [0.5, 0], "x": [-0.5, 0]},
    ),
    "h = -inf": (ENDLESS, "closest", NONE | {"message": "h = -inf"}),
    "lb = inf": (NOWHERE, "closest", NONE),
    "lb = inf, relaxed": (NOWHERE, Relaxation(lb=1.0), NONE),
    "unbounded": (FALLING, "closest", FALLS),
    "unbounded, elastic": (FALLING, "elastic", FALLS),
    "a controller": (BRAKING, Relaxation(b=INF), BRAKED),
    "a controller, elastic": (BRAKING, Relaxation(norm=1, b=INF), BRAKED),
    # x_2 <= 3 holds by chance, with force 0
    "noise holds no rows": (NOISE, Relaxation(ub=1.0), {"x": [3.0 + 0.5e-5, 3]}),
    "nothing to minimise": (FIXED, "closest", {"x": [1, 2], "shift_h": [2]}),
}  # fmt: skip


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("name", KNOWN)
def test_known_answers(name, form):
    qp, choice, known = KNOWN[name]
    found = relaxed(FORMS[form](qp), infeasible=choice)
    assert found.status is known.get("status", Status.SOLVED)
    assert known.get("message", "") in found.message
    if qp is FALLING:  # the shifts are those of a point, x is the ray
        assert found.shift_h.sum() == pytest.approx(3.0, abs=1e-9)
    sizes = [getattr(found, part).size for part in ("x", "y", "z", "z_box")]
    assert sizes == [qp.q.size, qp.b.size, qp.h.size, qp.q.size]
    if found.status is Status.SOLVED:
        assert found.message == ""
    for part in ("x", "shift_h", "shift_b", "shift_lb", "shift_ub", "obj"):
        if part in known:
            np.testing.assert_allclose(getattr(found, part), known[part], 0.0, 1e-9)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("choice", ["closest", "elastic", Relaxation(h=np.ones(2))])
def test_a_feasible_problem_has_nothing_closer(choice, form):
    result = solve_qp(*FORMS[form](opposed(gap=-1.0)), infeasible=choice)
    assert result.status is Status.SOLVED
    assert result.closest is None
    assert (result.closest or result).x is result.x


@pytest.mark.parametrize("form", FORMS)
def test_a_loop_of_steps_gives_what_fresh_solves_give(form):
    """Some are infeasible; weights for each row."""
    weights = Relaxation(h=0.1 + np.arange(9.0), b=np.array([2.0, 0.5]))
    qp = FORMS[form](infeasible(3, 6, 9, 2, 6))
    solver = Solver(*qp, infeasible=weights)
    for step in (0.0, 0.1, 1e3, 0.2, 0.3):
        h = qp.h + step * (np.cos(np.arange(9.0)) if step < 1.0 else 1.0)
        solver.update(h=h)
        own, fresh = solver.solve(), solve_qp(*qp._replace(h=h), infeasible=weights)
        assert (own.closest is None) == (fresh.closest is None) == (step > 1.0)
        own, fresh = own.closest or own, fresh.closest or fresh
        for name in ("x", "shift_h", "shift_b")[: 1 if step > 1.0 else 3]:
            mine, other = getattr(own, name), getattr(fresh, name)
            np.testing.assert_allclose(mine, other, atol=1e-9)


def test_choices_are_checked():
    qp = opposed()
    for choice, error, said in (
        ("nearest", ValueError, r"infeasible must be one of \['certificate', 'clos"),
        (2, TypeError, "infeasible must be a string or a Relaxation, got 2"),
    ):
        with pytest.raises(error, match=said):
            solve_qp(*qp, infeasible=choice)
    for fields, error, said in (
        ({"norm": 3}, ValueError, "Relaxation.norm must be 1 or 2, got 3"),
        ({"h": [1.0, 0.0]}, ValueError, r"Relaxation.h must be > 0, got 0\.0"),
        ({"ub": "soft"}, TypeError, "Relaxation.ub must be a number, got 'soft'"),
    ):
        with pytest.raises(error, match=said):
            Relaxation(**fields)
    for gap in 3.0, -1.0:  # infeasible or not
        with pytest.raises(ValueError, match=r"Relaxation\.h must have shape"):
            solve_qp(*opposed(gap), infeasible=Relaxation(h=[1.0, 2.0, 3.0]))
