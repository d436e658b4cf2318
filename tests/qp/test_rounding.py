"""What rounding leaves in a point, moved where it does no harm."""

import numpy as np
import pytest
import qpsolvers
import scipy.sparse as sp
from problems_qp import DATA, complementary, make_qp, maros_meszaros, unbounded
from qpsolvers import Problem, Solution

from namlcp import Status, qp_residuals, solve_qp
from namlcp.limits import Limits
from namlcp.qp.intake import qp_data
from namlcp.qp.judge import (
    Judge,
    correct_dual_residual,
    correct_gap_by_multipliers,
    correct_gap_by_x,
    is_correctable,
)
from namlcp.qp.problem import Point
from namlcp.residuals import UNDEFINED

EPS = 1e-6
NONE = np.empty(0)


def test_a_dual_residual_goes_into_a_bound_or_into_a_curved_variable():
    # x = (at its lower bound, free and curved, free and straight)
    qp = make_qp(np.diag([0.0, 2.0, 0.0]), [1.0, -4.0, 0.0], lb=[0.0, -np.inf, -np.inf])
    point = Point(np.array([0.0, 2.1, 0.0]), NONE, NONE, np.zeros(3))
    x, _, _, z_box = correct_dual_residual(qp, point, EPS)
    np.testing.assert_allclose(x, [0.0, 2.0, 0.0])
    np.testing.assert_array_equal(z_box, [-1.0, 0.0, 0.0])


@pytest.mark.parametrize("seed", [0, 3, 4, 6])
def test_sums_of_large_multipliers_are_as_good_as_they_can_be(seed):
    """A regression with fourth differences >= 0 in other units (LISWET): |G||z| is 1e9
    where G'z is 1e3, so that the dual residual hovers about its tolerance."""
    rng, n, k = np.random.default_rng(seed), 500, 4
    c = np.sqrt(np.linspace(0.0, 1.0, n + k)) + 0.1 * np.sin(np.arange(n + k))
    differences = sp.diags_array(
        [-1.0, 4.0, -6.0, 4.0, -1.0], offsets=range(k + 1), shape=(n, n + k)
    )
    units = 10.0 ** rng.uniform(-2.0, 2.0, n + k)
    P, G = sp.diags_array(units**2), differences @ sp.diags_array(units)
    result = solve_qp(P, -units * c, G, np.zeros(n), eps_abs=1e-8, eps_rel=0.0)
    assert result.status is Status.SOLVED
    assert result.iterations < 100


def test_no_multiplier_gets_a_sign_its_bounds_do_not_allow():
    rng = np.random.default_rng(4)
    n = 50
    lb = np.where(rng.random(n) < 0.5, 0.0, -np.inf)
    ub = np.where(rng.random(n) < 0.5, 1.0, np.inf)
    qp = make_qp(np.zeros((n, n)), rng.standard_normal(n), lb=lb, ub=ub)
    point = Point(np.full(n, 0.5), NONE, NONE, np.zeros(n))
    x, _, _, z_box = correct_dual_residual(qp, point, EPS)
    assert (z_box[np.isinf(lb)] >= 0.0).all()
    assert (z_box[np.isinf(ub)] <= 0.0).all()
    np.testing.assert_array_equal(x, point[0])
    allowed = np.where(qp.q > 0.0, np.isfinite(lb), np.isfinite(ub))
    np.testing.assert_array_equal(z_box[allowed], -qp.q[allowed])


def test_free_variables_have_no_multiplier():
    """A direction without curvature is tried as a ray first, and is none."""
    P = np.diag([5e-9, 0.0, 4.7e8, 3.3e12, 0.0, 0.0])
    P[2, 3] = P[3, 2] = 3.9e10
    q = np.array([0.15, 0.006, -1e5, -1.5e7, 0.04, 5e8])
    lb = np.array([-np.inf, -np.inf, 2e-4, -np.inf, -np.inf, -6e-8])
    ub = np.array([np.inf, np.inf, 2e-4, -1e-8, np.inf, np.inf])
    result = solve_qp(P, q, lb=lb, ub=ub)
    assert result.status is Status.SOLVED
    assert (result.z_box[[0, 1, 4]] == 0.0).all()


@pytest.mark.parametrize("seed", range(3))
def test_multipliers_without_enough_digits_are_made_up_for(seed):
    known = complementary(seed, 30, 40, 5, 30)
    D = 1e3
    P, q, G, h, A, b, lb, ub = known.qp
    qp = make_qp(D * P * D, D * q, G * D, h, A * D, b, lb / D, ub / D)
    rng = np.random.default_rng(seed)
    z = known.z * (1.0 + 1e-9 * rng.standard_normal(known.z.size))
    point = Point(known.x / D, known.y, z, known.z_box * D)
    assert qp_residuals(*qp, *point).worst(EPS, 0.0) > 1.0
    judge = Judge(qp, Limits(EPS, 0.0))
    judge.offer(point)
    assert max(judge.residuals.dual, judge.residuals.primal) <= EPS


@pytest.mark.parametrize("seed", range(3))
def test_a_gap_goes_into_a_multiplier_with_a_large_side(seed):
    known = complementary(seed, 30, 40, 5, 30)
    far = 1e3  # the origin is far away: the terms of the gap are huge
    P, q, G, h, A, b, lb, ub = known.qp
    qp = make_qp(
        P, q - far * P.sum(1), G, h + far * G.sum(1), A, b + far * A.sum(1),
        lb + far, ub + far,
    )  # fmt: skip
    y = known.y.copy()
    y[0] += 1e-7
    point = Point(known.x + far, y, known.z, known.z_box)
    before = qp_residuals(*qp, *point)
    assert 20.0 * EPS < before.gap < 1e3 * EPS
    judge = Judge(qp, Limits(EPS, 0.0))
    worst = judge.offer(point)
    assert worst < 0.1 * before.worst(EPS, 0.0)
    assert judge.residuals == qp_residuals(*qp, *judge.point)
    assert (judge.point[2] >= 0.0).all()


def test_a_gap_goes_into_the_only_multiplier_there_is():
    """The other rows are empty, with sides that are 0 or infinite."""
    one = np.ones((1, 1))
    qp = make_qp(one, [0.0], 0.0 * np.ones((2, 1)), [0.0, np.inf], 1e-6 * one, [1e3])
    point = Point(np.zeros(1), np.array([1e-9]), np.zeros(2), np.zeros(1))
    assert qp_residuals(*qp, *point).gap > 1e-7
    found = next(correct_gap_by_multipliers(qp, point))
    assert qp_residuals(*qp, *found).gap <= 1e-9
    np.testing.assert_array_equal(np.concatenate((found[2], found[3])), 0.0)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_gap_too_large_for_one_multiplier_is_spread_over_many(sign):
    """All sides are 1; one multiplier has no room, and keeps its sign."""
    n = 40
    q = np.r_[0.0, np.full(n - 1, -1.0)]
    qp = make_qp(np.zeros((n, n)), q, ub=np.ones(n))
    z_box = np.r_[1e-12, np.full(n - 1, 1.0 + sign * 5e-7)]
    point = Point(np.ones(n), NONE, NONE, z_box)
    assert qp_residuals(*qp, *point).gap > 1e-5
    found = next(correct_gap_by_multipliers(qp, point))
    after = qp_residuals(*qp, *found)
    assert after.gap <= 1e-9
    assert after.dual <= EPS
    assert (found[3] > 0.0).all()


# ---- the last verdict: sums in the order of the user's own arrays


def large_terms(seed):
    """Return a QP with dense matrices, and a point, with terms up to 1e20."""
    rng = np.random.default_rng(seed)
    n, m, p = 12, 9, 7
    P, G, A = (rng.standard_normal((k, n)) for k in (n, m, p))
    parts = (rng.standard_normal(k) for k in (n, m, p, n))
    q, h, b, lb = (v * 10.0 ** rng.integers(-3, 12, v.size) for v in parts)
    sizes = (n, p, m, n)
    x, y, z, z_box = (10.0 ** rng.uniform(-2, 12, k) for k in sizes)
    return (P + P.T, q, G, h, A, b, lb, lb + 1.0), Point(x, y, z, -z_box)


def unsorted(M):
    """Return M by columns, the rows of each from the last to the first."""
    found = sp.csc_array(M)
    parts = zip(found.indptr, found.indptr[1:], strict=False)
    order = np.concatenate([np.arange(a, b)[::-1] for a, b in parts])
    arrays = found.data[order], found.indices[order], found.indptr
    return sp.csc_array(arrays, shape=M.shape)


LAYOUTS = {
    "dense": (np.asarray,) * 3,
    "sparse": (sp.csc_array,) * 3,
    "matrices": (sp.csc_matrix,) * 3,
    "by rows": (sp.csr_array, sp.csr_matrix, np.asfortranarray),
    "unsorted": (np.asfortranarray, unsorted, sp.csr_array),
}


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("layout", LAYOUTS)
def test_any_layout_is_summed_as_the_host_does(seed, layout):
    """To the last bit; where arrays are taken as they are nothing else is asked."""
    (P, q, G, h, A, b, lb, ub), point = large_terms(seed)
    P, G, A = (make(M) for make, M in zip(LAYOUTS[layout], (P, G, A), strict=True))
    host = Solution(Problem(P, q, G, h, A, b, lb, ub), found=True)
    host.x, host.y, host.z, host.z_box = point
    theirs = host.primal_residual(), host.dual_residual(), host.duality_gap()
    assert qp_residuals(P, q, G, h, A, b, lb, ub, *point)[:3] == theirs


def cancelling():
    """Return a QP, a user's A in another order, and a point that only seems to solve.

    min 0 subject to x = 0, three times: A'y = 1e16 + 1 - 1e16 is 0 if added in this
    order, and 1 in the order of the user's column (1, 3, 2).
    """
    A = sp.csc_array((np.ones(3), np.array([0, 2, 1]), np.array([0, 3])), shape=(3, 1))
    qp = qp_data(sp.csc_array((1, 1)), [0.0], None, None, A, np.zeros(3), None, None)
    assert qp.A.has_sorted_indices
    y = np.array([1e16, 1.0, -1e16])
    return qp, A, Point(np.zeros(1), y, np.empty(0), np.zeros(1))


def judged(qp, given, point, eps=EPS):
    judge = Judge(qp, Limits(eps), given)
    judge.offer(point)
    return judge.answer(Status.SOLVED, 3, "path")


def test_a_point_that_passes_in_one_order_only_is_not_solved():
    qp, A, point = cancelling()
    assert qp_residuals(*qp, *point).dual == 0.0
    found = judged(qp, (qp.P, None, A), point)
    assert found.status is Status.STALLED
    assert found.residuals.dual == 1.0
    assert "order of summation" in found.message
    wide = sp.csc_array((A.data, *(v.astype(np.int64) for v in (A.indices, A.indptr))))
    assert judged(qp, (qp.P, None, wide), point).residuals.dual == 1.0
    assert judged(qp, (qp.P, None, A), point, 2.0).status is Status.SOLVED
    assert judged(qp, (qp.P, None, qp.A), point).status is Status.SOLVED


def test_a_row_that_came_as_a_sparse_vector_is_summed_in_its_order():
    row = sp.coo_array((np.ones(3), (np.array([0, 2, 1]),)), shape=(3,))
    qp = qp_data(sp.csc_array((3, 3)), np.zeros(3), None, None, row, [0.0], None, None)
    x = np.array([1e16, 1.0, -1e16])
    point = Point(x, np.zeros(1), np.empty(0), np.zeros(3))
    assert qp_residuals(*qp, *point).primal == 0.0
    assert judged(qp, (qp.P, None, row), point).residuals.primal == 1.0


def test_nothing_is_asked_where_rounding_is_within_tolerance(monkeypatch):
    qp, A, point = cancelling()
    point = point._replace(y=np.array([1.0, 1e-16, -1.0]))
    monkeypatch.delattr(Judge, "take_order_of_user")
    assert judged(qp, (qp.P, None, A), point).status is Status.SOLVED


@pytest.mark.skipif(
    not (DATA / "maros_meszaros").is_dir(),
    reason="no Maros-Meszaros data: set NAMLCP_DATA to the data folder",
)
@pytest.mark.parametrize("eps", [1e-6, 1e-8, 1e-9, 1e-10])
@pytest.mark.parametrize(
    "layout", [sp.csc_matrix, sp.csr_matrix, sp.csc_matrix.toarray]
)
def test_qfffff80_is_not_called_solved_by_luck(eps, layout):
    """Its multipliers reach 1e11; toarray() is a Fortran array, which we copy."""
    P, q, G, h, A, b, lb, ub = maros_meszaros("QFFFFF80")
    P, G, A = (layout(sp.csc_matrix(M)) for M in (P, G, A))
    given = Problem(P, q, G, h, A, b, lb, ub)
    answer = qpsolvers.solve_problem(given, solver="nam", eps_abs=eps, eps_rel=0.0)
    if answer.found:
        assert answer.primal_residual() <= eps
        assert answer.dual_residual() <= eps
        assert answer.duality_gap() <= eps
    else:
        assert answer.extras["status"] == "stalled"
    assert answer.found or eps < 1e-6


# ---- the gap by x, the dual residual by a part of a step


@pytest.mark.parametrize("seed", range(4))
def test_a_gap_with_huge_terms_is_removed_by_x(seed):
    """min 1/2 |x - c|^2, sum x = s, x >= 0: terms of 1e12, a gap of units of 1e-4.

    The multiplier is an integer, so that a sum without a gap is among these units.
    """
    rng = np.random.default_rng(seed)
    n, y = 100, 3.0
    c, lb = rng.uniform(0.5e5, 1.5e5, n), np.zeros(n)
    c[0] = -1e5  # x_0 is at its bound
    total = np.floor(c[2:].sum()) + 1e5
    c[1] = total + (n - 1) * y - c[2:].sum()
    A = sp.csc_array(np.ones((1, n)))
    qp = qp_data(sp.csc_array(np.eye(n)), -c, None, None, A, [total], lb, None)
    x, z_box = c - y, np.zeros(n)
    x[0], z_box[0] = lb[0], c[0] - lb[0] - y
    point = Point(x, np.array([y]), np.empty(0), z_box)
    found = qp_residuals(*qp, *point)
    assert found.gap_size > 1e11
    assert max(found.primal, found.dual) < 1e-7
    moved = correct_gap_by_x(qp, point, 1e-7)
    after = qp_residuals(*qp, *moved)
    assert after.gap <= 1e-7
    assert max(after.primal, after.dual) < 1e-7
    assert moved.x[0] == lb[0]
    assert moved.y is point.y


def test_a_gap_that_x_cannot_change_stays():
    qp = make_qp(np.eye(1), [1.0], lb=[2.0])  # x is at its bound
    point = Point(np.array([2.0]), NONE, NONE, np.array([-3.0 - 1e-7]))
    assert correct_gap_by_x(qp, point, 1e-9) is point


def test_x_takes_up_what_exceeds_the_tolerance_alone():
    qp = make_qp(np.array([[2.0]]), [-4.0])
    point = Point(np.array([2.0 + 1e-3]), NONE, NONE, np.zeros(1))
    x = correct_dual_residual(qp, point, 1e-3, 1e-3).x
    assert 2.0 * x[0] - 4.0 == pytest.approx(1e-3, rel=1e-9)


def test_what_is_correctable():
    point = UNDEFINED._replace(
        primal=0.0, dual=0.0, gap=1e-4, primal_size=1.0, dual_size=1.0, gap_size=1e12
    )
    assert is_correctable(point, 1e-9, 0.0)  # a few units in the last place of 1e12
    assert not is_correctable(point._replace(gap_size=1e9), 1e-9, 0.0)
    assert not is_correctable(point._replace(dual=2e-6), 1e-9, 0.0)
    assert is_correctable(point._replace(dual=5e-7), 1e-9, 0.0)
    assert not is_correctable(point, 1e-3, 0.0)  # nothing to correct
    assert not is_correctable(point._replace(primal=np.nan), 1e-9, 0.0)


@pytest.mark.parametrize("seed", [1, 2])
def test_a_refined_point_is_measured_at_its_own_rows(seed):
    """Refinement moves x along a flat direction, and across a row near it."""
    rng, n = np.random.default_rng(seed), 6
    Q, size = np.linalg.qr(rng.normal(size=(n, n)))[0], np.logspace(0.0, -8.0, n)
    P, q = (Q * size) @ Q.T, Q @ np.append(rng.normal(size=n - 1) * size[:-1], -1e-3)
    P, G = 0.5 * (P + P.T), np.ascontiguousarray(Q[:, -1:].T)
    at = G @ np.linalg.solve(P, -q)
    for change in np.linspace(-3e-9, 3e-9, 61):
        h = at + change * abs(at)
        found = solve_qp(P, q, G, h, eps_abs=1e-5, eps_rel=0.0)
        violation = max(0.0, (G @ found.x - h)[0])
        assert found.residuals.primal == pytest.approx(violation, abs=1e-9)


def test_what_is_curved_is_taken_away_from_a_ray():
    """Two centres differ along other directions, too; interior points stall here."""
    result = solve_qp(*unbounded(23, 300, 400, 50, rank=150, has_bounds=True))
    assert result.status is Status.DUAL_INFEASIBLE
