"""Exact arithmetic against fractions, and exact solutions of small QPs."""

from fractions import Fraction

import numpy as np
import pytest
import scipy.sparse as sp
from problems_qp import complementary
from qpsolvers import Problem

from namlcp.qp.problem import qp_data
from validation.harness import csv_files
from validation.oracles import ceilings, exact
from validation.oracles.exact import BITS, Active, ExactMatrix, ExactQP


def fractions(numbers, bits):
    """Return integers times 2^-bits as fractions."""
    return [Fraction(number, 1 << bits) for number in numbers]


def test_doubles_are_integers_times_a_power_of_two():
    values = np.array([0.0, 1.0, -0.1, 3e12, 2.0**-60, -5e-30, 7.25])
    bits = exact.fraction_bits(values)
    assert fractions(exact.integers(values, bits), bits) == list(map(Fraction, values))
    np.testing.assert_array_equal(
        exact.doubles(exact.integers(values, bits), bits), values
    )
    assert exact.fraction_bits(np.array([4.0, -6.0, 0.0])) == 0
    assert exact.fraction_bits(np.array([0.375])) == 3
    assert exact.fraction_bits(np.empty(0)) == 0
    assert exact.integers(np.array([0.75]), 1)[0] == 1  # the floor of 3/2


def test_products_are_exact():
    rng = np.random.default_rng(0)
    M = sp.random_array((9, 7), density=0.4, rng=rng)
    x = rng.standard_normal(7) * 10.0 ** rng.integers(-9, 9, 7)
    bits = exact.fraction_bits(M.data)
    found = fractions(ExactMatrix(M, bits) @ exact.integers(x, BITS), bits + BITS)
    dense = M.toarray()
    for row, value in zip(dense, found, strict=True):
        terms = (Fraction(a) * Fraction(b) for a, b in zip(row, x, strict=True))
        assert value == sum(terms, Fraction(0))


@pytest.mark.parametrize("seed", range(3))
def test_the_face_of_a_solution_is_solved_to_the_last_bit(seed):
    known = complementary(seed, 40, 12, 3, 40)
    P, q, G, h, A, b, lb, ub = known.qp
    P, G, A = (sp.csc_array(M) for M in (P, G, A))
    qp = qp_data(P, q, G, h, A, b, lb, ub)
    problem = Problem(qp.P, q, qp.G, h, qp.A, b, lb, ub)
    row = ceilings.ceiling(problem, 10.0)
    assert row["exact"]
    assert row["face_residual"] <= exact.GOAL
    assert row["rounded_1e-09"]
    assert max(row["primal"], row["dual"], row["gap"]) < 1e-11


def test_a_wrong_active_set_is_corrected():
    """min 1/2 |x|^2 + x_1 - x_2, x >= 0, x_2 <= 1/2: x = (0, 1/2)."""
    eye, none = sp.csc_array(np.eye(2)), np.empty(0)
    G = sp.csc_array(np.array([[0.0, 1.0]]))
    qp = qp_data(eye, [1.0, -1.0], G, [0.5], None, None, np.zeros(2), None)
    start = ceilings.Point(
        np.array([1.0, 0.0]), none, np.zeros(1), np.array([0.0, -2.0])
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
    zero, row = sp.csc_array((2, 2)), sp.csc_array(np.ones((2, 2)))
    qp = qp_data(zero, np.zeros(2), None, None, row, np.ones(2), None, None)
    none = np.zeros(2, dtype=bool)
    start = ceilings.Point(np.ones(2), np.zeros(2), np.empty(0), np.zeros(2))
    face = ExactQP(qp).face(start, Active(np.zeros(0, dtype=bool), none, none))
    assert face.x.sum() == pytest.approx(1.0, abs=1e-15)
    assert face.residual < 1e-20


def test_right_sides_beyond_the_spacing_of_doubles_are_at_the_ceiling():
    """The sum of a thousand thirds of 1e12 is no double within 1e-6."""
    n = 1000
    rng = np.random.default_rng(1)
    A = sp.csc_array(rng.uniform(0.5, 1.5, (1, n)))
    problem = Problem(
        sp.csc_matrix(sp.eye_array(n)), np.zeros(n), A=sp.csc_matrix(A),
        b=np.array([1e15 / 3.0]),
    )  # fmt: skip
    row = ceilings.ceiling(problem, 10.0)
    assert row["exact"]
    assert not row["rounded_1e-09"]
    assert row["primal"] > 1e-3


def test_the_table(tmp_path):
    file = tmp_path / "ceilings.csv"
    row = dict.fromkeys(ceilings.COLUMNS, 1e-7) | {
        "problem": "A", "nam": "stalled", "exact": True, "rounded_1e-06": False,
        "corrected_1e-06": True, "rounded_1e-09": False, "corrected_1e-09": False,
    }  # fmt: skip
    with csv_files.writer(file, ["date"], ceilings.COLUMNS) as write:
        write(row)
        write(row | {"problem": "B", "exact": False, "rounded_1e-06": True})
    assert ceilings.main(["table", "--csv", str(file)]) == 0
    first, second = ceilings.markdown(csv_files.read(file)).splitlines()[2:]
    assert first.startswith("| A | stalled, 1.0e-07 |")
    assert first.endswith("| corrected | no |")
    assert second.endswith("| yes | unknown |")
