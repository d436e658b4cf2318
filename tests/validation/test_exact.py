"""Exact arithmetic against fractions, exact solutions of small QPs, derivatives."""

from fractions import Fraction

import numpy as np
import pytest
import scipy.sparse as sp
from problems_qp import complementary
from qpsolvers import Problem

from validation.derivatives import cases, differences, packages
from validation.oracles import ceilings, exact
from validation.oracles.exact import BITS, ExactMatrix


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
