"""The one definition of the residuals, against the host's and against the formula."""

import math

import numpy as np
import pytest
import scipy.sparse as sp

from namlcp import Residuals, natural_residual, qp_residuals
from namlcp.measure import signed_gap
from namlcp.qp.problem import QP


def one_variable(z=0.0, z_box=0.0, lb=-np.inf, ub=np.inf, x=1.0):
    """Return the residuals of a point of min x^2/2 - x, x <= 1 as a row."""
    return qp_residuals(
        np.eye(1), -np.ones(1), np.ones((1, 1)), np.ones(1), np.empty((0, 1)),
        np.empty(0), np.array([lb]), np.array([ub]), np.array([x]), np.empty(0),
        np.array([z]), np.array([z_box]),
    )  # fmt: skip


def test_signs_count_as_dual_residual():
    assert one_variable().solved(1e-12, 0.0)
    assert one_variable(z=-1.0, z_box=1.0).dual == 1.0
    assert one_variable(z=1.0, z_box=-1.0).dual == 1.0  # lower bound is infinite
    assert one_variable(z=1.0, z_box=-1.0, lb=1.0).solved(1e-12, 0.0)


def test_only_what_stands_in_a_constraint_loosens_the_primal_tolerance():
    """x = (0, 1e12), x_0 = 1 violated by 1: x_1 is in no row and has no bound."""
    row, none, free = np.array([[1.0, 0.0]]), np.empty(0), np.full(2, np.inf)
    residuals = qp_residuals(
        np.zeros((2, 2)), np.zeros(2), np.empty((0, 2)), none, row, np.ones(1), -free,
        free, np.array([0.0, 1e12]), np.zeros(1), none, np.zeros(2),
    )  # fmt: skip
    assert (residuals.primal, residuals.primal_size) == (1.0, 1.0)


def test_nan_is_never_solved():
    assert one_variable(x=math.nan).worst(1.0, 1.0) == math.inf
    assert one_variable(z=math.nan).worst(1.0, 1.0) == math.inf
    assert Residuals(0, 0, 0, 0, 0, 0, 0).solved(1e-9, 0.0)


def test_natural_residual():
    """That of the paper; z - (z - w) far out would be 0, and any point a solution."""
    z, w = np.random.default_rng(0).standard_normal((2, 9))
    lower, upper = np.zeros(9), np.full(9, np.inf)
    expected = np.linalg.norm(np.minimum(z, w))
    assert natural_residual(z, w, lower, upper) == pytest.approx(expected)
    free = np.full(2, np.inf)
    z, w = np.full(2, 1e20), np.array([1.0, 0.0])
    assert natural_residual(z, w, -free, free) == 1.0
    assert natural_residual(z, w, 0.0 * z, free) == 1.0
    z[1] = np.nan
    assert np.isnan(natural_residual(z, w, -free, free))


@pytest.mark.parametrize("sparse", [False, True])
@pytest.mark.parametrize("place", [1, 3, 5, 6, 7, 8, 9, 10, 11])
def test_wrong_sizes_are_refused(sparse, place):
    """Compiled code would read beyond the end."""
    P, G, A = np.eye(3), np.ones((2, 3)), np.ones((1, 3))
    if sparse:
        P, G, A = (sp.csc_array(C) for C in (P, G, A))
    n, m, p = np.ones(3), np.ones(2), np.ones(1)
    data = [P, n, G, m, A, p, -n, n, n, p, m, n]
    assert qp_residuals(*data).dual_size > 0.0
    data[place] = np.zeros(7)
    with pytest.raises(ValueError, match="shape"):
        qp_residuals(*data)
    with pytest.raises(ValueError, match="must have one shape"):
        natural_residual(n, n, p, n)


def test_a_matrix_of_another_shape_is_named():
    n, m, p = np.ones(3), np.ones(2), np.ones(1)
    data = [np.eye(3), n, np.ones((2, 3)), m, np.ones((1, 3)), p, -n, n, n, p, m, n]
    for name, place, rows in (("P", 0, 3), ("G", 2, 2), ("A", 4, 1)):
        for shape in ((rows, 4), (rows + 1, 3)):
            wrong = [*data[:place], np.ones(shape), *data[place + 1 :]]
            with pytest.raises(ValueError, match=rf"^{name} must .* \({rows}, 3\)"):
                qp_residuals(*wrong)


def test_none_stands_for_absent_bounds():
    P, one = np.eye(2), np.ones(2)
    none, free = (np.empty((0, 2)), np.empty(0)), np.full(2, np.inf)
    point = one, np.empty(0), np.empty(0), np.array([1.0, -2.0])
    whole = qp_residuals(P, one, *none, *none, -free, free, *point)
    assert qp_residuals(P, one, *none, *none, None, None, *point) == whole
    half = qp_residuals(P, one, *none, *none, 0.0 * one, None, *point)
    assert half == qp_residuals(P, one, *none, *none, 0.0 * one, free, *point)
    assert half != whole


def terms(sides, multipliers, sign):
    """Return the product of finite sides and their multipliers of this sign."""
    at = np.isfinite(sides)
    kept = multipliers[at]
    if sign != 0.0:
        kept = sign * np.maximum(sign * kept, 0.0)
    return np.dot(sides[at], kept)


@pytest.mark.parametrize("n", [0, 1, 7, 300])
def test_the_gap_is_added_as_the_host_adds_it(n):
    """To the last digit, with infinite sides, whose multipliers may be anything."""
    rng = np.random.default_rng(n)
    m, p = n + 3, n // 2
    x, Px, q, z_box = 1e3 * rng.standard_normal((4, n))
    h, z, b, y = (rng.standard_normal(k) for k in (m, m, p, p))
    h[0], z[0] = np.inf, np.nan
    lb, ub = -rng.random(n), rng.random(n)
    lb[::3], ub[::2] = -np.inf, np.inf
    wanted = x.dot(Px) + q.dot(x) + terms(h, z, 0.0) + b.dot(y)
    wanted += terms(lb, z_box, -1.0)
    wanted += terms(ub, z_box, 1.0)
    qp = QP(None, q, None, h, None, b, lb, ub)
    assert signed_gap(qp, (x, y, z, z_box), Px) == wanted


def test_vectors_need_not_be_contiguous():
    """BLAS reads one number after another."""
    wide = 1e6 * np.random.default_rng(0).standard_normal((3, 8))
    q, x, z_box = wide[:, ::2]
    none, free = (np.zeros((0, 4)), np.zeros(0)), np.full(4, np.inf)
    sides = np.eye(4), q, *none, *none, -free, free
    whole = qp_residuals(*sides, x, none[1], none[1], z_box)
    packed = qp_residuals(*sides, x.copy(), none[1], none[1], z_box.copy())
    assert whole == packed
    assert whole.gap == abs(x.dot(x) + q.dot(x))
