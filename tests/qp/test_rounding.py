"""What rounding leaves in a point, moved where it does no harm."""

import numpy as np
import pytest
from problems_qp import complementary, make_qp

from namlcp.limits import Limits
from namlcp.options import Options
from namlcp.qp.answer import Answer
from namlcp.qp.guess import NO_GUESS
from namlcp.qp.judge import Judge
from namlcp.qp.memory import Memory
from namlcp.qp.path.solve import solve_path
from namlcp.qp.problem import Point, qp_data
from namlcp.qp.rounding import (
    correct_dual_residual,
    correct_gap,
    correct_rounding,
)
from namlcp.residuals import UNDEFINED, qp_residuals, signed_gap
from namlcp.status import Status

EPS = 1e-6


def test_a_dual_residual_goes_into_a_bound_or_into_a_curved_variable():
    # x = (at its lower bound, free and curved, free and straight)
    qp = make_qp(np.diag([0.0, 2.0, 0.0]), [1.0, -4.0, 0.0], lb=[0.0, -np.inf, -np.inf])
    none = np.empty(0)
    point = Point(np.array([0.0, 2.1, 0.0]), none, none, np.zeros(3))
    x, _, _, z_box = correct_dual_residual(qp, point, EPS)
    np.testing.assert_allclose(x, [0.0, 2.0, 0.0])
    np.testing.assert_array_equal(z_box, [-1.0, 0.0, 0.0])


def test_no_multiplier_gets_a_sign_its_bounds_do_not_allow():
    rng = np.random.default_rng(4)
    n = 50
    lb = np.where(rng.random(n) < 0.5, 0.0, -np.inf)
    ub = np.where(rng.random(n) < 0.5, 1.0, np.inf)
    qp = make_qp(np.zeros((n, n)), rng.standard_normal(n), lb=lb, ub=ub)
    none = np.empty(0)
    point = Point(np.full(n, 0.5), none, none, np.zeros(n))
    x, _, _, z_box = correct_dual_residual(qp, point, EPS)
    assert (z_box[np.isinf(lb)] >= 0.0).all()
    assert (z_box[np.isinf(ub)] <= 0.0).all()
    np.testing.assert_array_equal(x, point[0])
    allowed = np.where(qp.q > 0.0, np.isfinite(lb), np.isfinite(ub))
    np.testing.assert_array_equal(z_box[allowed], -qp.q[allowed])


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
    found = qp_residuals(
        *qp, *correct_rounding(qp, point, qp_residuals(*qp, *point), EPS, 0.0)
    )
    assert max(found.dual, found.primal) <= EPS


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
    vectors = qp.q, qp.h, qp.b, qp.lb, qp.ub
    gap = signed_gap(vectors, judge.point, qp.P @ judge.point[0])
    assert abs(gap) == judge.residuals.gap
    assert (judge.point[2] >= 0.0).all()


def test_a_gap_goes_into_the_only_multiplier_there_is():
    """The other rows are empty, with sides that are 0 or infinite."""
    one = np.ones((1, 1))
    qp = make_qp(one, [0.0], 0.0 * np.ones((2, 1)), [0.0, np.inf], 1e-6 * one, [1e3])
    point = Point(np.zeros(1), np.array([1e-9]), np.zeros(2), np.zeros(1))
    gap = qp_residuals(*qp, *point).gap
    assert gap > 1e-7
    found = correct_gap(qp, point, gap, 1e-9, 1e-8)
    assert qp_residuals(*qp, *found).gap <= 1e-9
    np.testing.assert_array_equal(np.concatenate((found[2], found[3])), 0.0)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_gap_too_large_for_one_multiplier_is_spread_over_many(sign):
    """All sides are 1; one multiplier has no room, and keeps its sign."""
    n = 40
    none = np.empty(0)
    q = np.r_[0.0, np.full(n - 1, -1.0)]
    qp = make_qp(np.zeros((n, n)), q, ub=np.ones(n))
    z_box = np.r_[1e-12, np.full(n - 1, 1.0 + sign * 5e-7)]
    point = Point(np.ones(n), none, none, z_box)
    gap = qp_residuals(*qp, *point).gap
    assert gap > 1e-5
    found = correct_gap(qp, point, gap, 1e-9, EPS)
    after = qp_residuals(*qp, *found)
    assert after.gap <= 1e-9
    assert after.dual <= EPS
    assert (found[3] > 0.0).all()


@pytest.mark.parametrize("kind", ["inequalities", "equalities"])
def test_changes_that_add_up_in_the_dual_residual_have_one_room(kind):
    """10^4 equal rows: each has room for its part of the gap, all together have not."""
    m, none = 10_000, np.empty(0)
    C, side, one = np.ones((m, 1)), np.ones(m), np.ones(m)
    x = np.array([1.0 - 1e-10])
    rows = {"G": C, "h": side} if kind == "inequalities" else {"A": C, "b": side}
    qp = make_qp(np.zeros((1, 1)), [-1.0 * m], **rows)
    y, z = (none, one) if kind == "inequalities" else (one, none)
    point = Point(x, y, z, np.zeros(1))
    before = qp_residuals(*qp, *point)
    assert before.dual == 0.0
    assert before.gap > 5e-7
    after = qp_residuals(*qp, *correct_gap(qp, point, before.gap, 1e-7, 1e-7))
    assert after.dual <= 1e-7


def test_dense_problems_are_judged_on_their_dense_matrices(monkeypatch):
    """Sparse products round in another order, for which a point may be corrected."""
    qp = qp_data(np.eye(2), np.ones(2), None, None, None, None, None, None)
    point = qp.point()
    found = Answer(Status.SOLVED, point, UNDEFINED, 1, "path")
    monkeypatch.setattr("namlcp.qp.path.solve.follow_path", lambda *arguments: found)
    answer = solve_path(qp, NO_GUESS, Options().limits(), Memory())
    assert answer.status is Status.STALLED
    assert answer.residuals.dual == 1.0
