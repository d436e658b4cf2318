"""Exact arithmetic against fractions, exact solutions of small QPs, derivatives."""

from fractions import Fraction

import numpy as np
import pytest
import scipy.sparse as sp
from problems_qp import complementary, make_qp
from qpsolvers import Problem

from validation.derivatives import cases, differences, packages
from validation.oracles import ceilings, exact
from validation.oracles.exact import BITS, Active, ExactMatrix, ExactQP


def test_products_are_exact():
    rng = np.random.default_rng(0)
    M = sp.random_array((9, 7), density=0.4, rng=rng)
    x = rng.standard_normal(7) * 10.0 ** rng.integers(-9, 9, 7)
    bits = exact.fraction_bits(M.data)
    whole = ExactMatrix(M, bits) @ exact.integers(x, BITS)
    found = [Fraction(number, 1 << (bits + BITS)) for number in whole]
    for row, value in zip(M.toarray(), found, strict=True):
        terms = (Fraction(a) * Fraction(b) for a, b in zip(row, x, strict=True))
        assert value == sum(terms, Fraction(0))


@pytest.mark.parametrize("seed", range(3))
def test_the_face_of_a_solution_is_solved_to_the_last_bit(seed):
    known = complementary(seed, 40, 12, 3, 40)
    row = ceilings.ceiling(Problem(*known.qp), 10.0)
    assert row["exact"]
    assert row["face_residual"] <= exact.GOAL
    assert row["rounded_1e-09"]
    assert max(row["primal"], row["dual"], row["gap"]) < 1e-11


def test_a_wrong_active_set_is_corrected():
    """min 1/2 |x|^2 + x_1 - x_2, x >= 0, x_2 <= 1/2: x = (0, 1/2)."""
    qp = make_qp(np.eye(2), [1.0, -1.0], [[0.0, 1.0]], [0.5], lb=np.zeros(2))
    start = ceilings.Point(
        np.array([1.0, 0.0]), np.empty(0), np.zeros(1), np.array([0.0, -2.0])
    )
    assert not ceilings.guess(qp, start).lower[0]
    point, face, wrong, rounds = ceilings.exact_solution(qp, start)
    np.testing.assert_array_equal(point.x, [0.0, 0.5])
    np.testing.assert_array_equal(point.z, [0.5])
    np.testing.assert_array_equal(point.z_box, [-1.0, 0.0])
    assert (wrong, face.residual <= exact.GOAL) == (0, True)
    assert rounds > 1


def test_a_singular_face_has_one_of_its_solutions():
    """x_1 + x_2 = 1 twice, no cost."""
    qp = make_qp(np.zeros((2, 2)), np.zeros(2), A=np.ones((2, 2)), b=np.ones(2))
    none = np.zeros(2, dtype=bool)
    start = ceilings.Point(np.ones(2), np.zeros(2), np.empty(0), np.zeros(2))
    face = ExactQP(qp).face(start, Active(np.zeros(0, dtype=bool), none, none))
    assert face.x.sum() == pytest.approx(1.0, abs=1e-15)
    assert face.residual < 1e-20


def test_right_sides_beyond_the_spacing_of_doubles_are_at_the_ceiling():
    """The sum of a thousand thirds of 1e12 is no double within 1e-6."""
    A = sp.csc_array(np.random.default_rng(1).uniform(0.5, 1.5, (1, 1000)))
    eye = sp.csc_matrix(sp.eye_array(1000))
    problem = Problem(eye, np.zeros(1000), A=sp.csc_matrix(A), b=np.array([1e15 / 3.0]))
    row = ceilings.ceiling(problem, 10.0)
    assert row["exact"]
    assert not row["rounded_1e-09"]
    assert row["primal"] > 1e-3


def test_derivatives_are_those_of_differences_in_more_digits():
    for row in differences.rows(4, 2):
        assert row["right"] == row["problems"], row
    K = cases.definite(12, np.random.default_rng(0))
    x = np.arange(1.0, 13.0)
    rest = K.astype(np.longdouble) @ differences.extended_solve(K, K @ x) - K @ x
    assert np.abs(rest).max() <= 1e-17 * 1e2


@pytest.mark.parametrize("make", [packages.dense_case, packages.band_case])
def test_our_gradients_are_those_of_the_reference(make):
    data = make(60 if make is packages.band_case else 8)
    solve, backward = packages.nam(data)
    assert packages.error_of(backward(solve()), packages.reference(data)) <= 1e-12
