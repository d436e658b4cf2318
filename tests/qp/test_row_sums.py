"""Equalities with huge right sides, met as their sums are computed."""

import numpy as np
import pytest
import scipy.sparse as sp

from namlcp.limits import Limits
from namlcp.qp.judge import Judge
from namlcp.qp.problem import Point, qp_data
from namlcp.qp.row_sums import Row, groups, least_change, meet_equalities
from namlcp.residuals import qp_residuals


def huge_sums(seed, n=4000, short=1500):
    """Return a QP whose rows sum up to 1e12, and its solution as far as doubles go.

    min 1/2 |x - c|^2 over Ax = b, x >= 0; the second row ends at column `short`.
    """
    rng = np.random.default_rng(seed)
    A = rng.uniform(1.0, 9.0, (3, n)) * np.array([[1e8], [1e8], [1e2]])
    A[1, short:] = 0.0
    x = rng.uniform(1.0, 3.0, n)
    x[::10] = 0.0
    y = rng.standard_normal(3) / np.array([1e8, 1e8, 1e2])
    z_box = np.where(x > 0.0, 0.0, -1.0)
    q = -(x + A.T @ y + z_box)
    b = A.astype(np.longdouble) @ x
    qp = qp_data(
        sp.csc_array(sp.eye_array(n)), q, None, None, sp.csc_array(A),
        b.astype(float), np.zeros(n), None,
    )  # fmt: skip
    return qp, Point(x, y, np.empty(0), z_box)


@pytest.mark.parametrize("seed", range(3))
def test_the_sums_come_out_as_the_right_sides(seed):
    qp, point = huge_sums(seed)
    before = np.abs(qp.b - qp.A @ point.x)
    assert before.max() > 1e-4
    x = meet_equalities(qp, point.x, 1e-7)
    assert np.abs(qp.b - qp.A @ x).max() <= 1e-7
    np.testing.assert_array_equal(x[::10], 0.0)  # at their bounds
    assert np.abs(x - point.x).max() < 1e-9


def test_the_judge_takes_such_points():
    qp, point = huge_sums(0)
    assert qp_residuals(*qp, *point).primal > 1e-4
    judge = Judge(qp, Limits(1e-6))
    assert judge.offer(point) <= 1.0
    assert qp_residuals(*qp, *judge.point).solved(1e-6, 0.0)


@pytest.mark.parametrize("dense", [False, True])
def test_the_least_change(dense):
    rng = np.random.default_rng(3)
    A, weight, r = rng.standard_normal((3, 8)), rng.random(8), rng.standard_normal(3)
    weight[5] = 0.0
    dx = least_change(A if dense else sp.csr_array(A), weight, r)
    np.testing.assert_allclose(A @ dx, r)
    assert dx[5] == 0.0
    root = np.sqrt(weight)
    least = np.linalg.lstsq(A * root, r, rcond=None)[0]
    np.testing.assert_allclose(dx, root * least, atol=1e-14)


def test_rows_that_end_together_form_a_group():
    def row(*columns):
        return Row(np.array(columns), np.ones(len(columns)), 0.0, 1.0)

    rows = [row(0, 5, 900), row(2, 90), row(1, 80), row(0, 3, 910)]
    inside = np.ones(1000, dtype=bool)
    assert groups(rows, inside) == [[rows[2], rows[1]], [rows[0], rows[3]]]
    inside[900:] = False
    assert [len(group) for group in groups(rows, inside)] == [2, 2]
    assert groups(rows, inside)[0] == [rows[3], rows[0]]


def test_a_row_is_added_from_its_first_column_to_its_last():
    row = Row(np.array([0, 2, 3]), np.array([1.0, 1.0, 1.0]), 0.0, 2.0)
    x = np.array([1e16, 0.0, 1.0, -1e16])
    assert row.residual(x) == 2.0  # 1e16 + 1 is 1e16
    tail = row.tail(2, x)
    assert (tail.before, tail.columns.tolist()) == (1e16, [2, 3])
    assert tail.residual(x) == 2.0
    assert row.tail(0, x).before == 0.0


def test_without_room_nothing_changes():
    qp, point = huge_sums(1, n=60, short=20)
    pinned = qp._replace(lb=point.x, ub=point.x)
    np.testing.assert_array_equal(meet_equalities(pinned, point.x, 1e-7), point.x)
