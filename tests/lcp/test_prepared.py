"""A prepared matrix keeps the last face: other q are solved sooner, not otherwise."""

import numpy as np
import problems_lcp as problems
import pytest
from scipy import sparse

from namlcp import Prepared, Status, solve_lcp
from namlcp.lcp.lazy import kept
from namlcp.scenes import disc_pile


def moving(A, q, steps=20):
    """Yield vectors near q, the free velocities of contacts that are pushed."""
    rng = np.random.default_rng(0)
    for _ in range(steps):
        yield q + 0.02 * np.abs(q).max() * (A @ rng.standard_normal(q.size))


def dense(rng, n):
    B = rng.standard_normal((n, n))
    return B @ B.T / n + 0.1 * np.eye(n), rng.standard_normal(n)


CASES = {
    "dense": dense(np.random.default_rng(0), 40),
    "P-matrix": (
        problems.triangular_p(np.random.default_rng(1), 12, 2.0),
        -np.ones(12),
    ),
    "singular": disc_pile(6),
    "large": (sparse.csr_array(problems.laplacian(12)), -np.ones(144)),
}


@pytest.mark.parametrize("case", CASES)
def test_each_lcp_is_solved_as_a_fresh_one(case):
    A, q = CASES[case]
    matrix = Prepared(A)
    for one in moving(A, q):
        fresh, result = solve_lcp(A, one), solve_lcp(matrix, one)
        assert result.status is fresh.status is Status.SOLVED
        np.testing.assert_allclose(result.w, fresh.w, atol=1e-9 * np.abs(one).max())
        assert result.residual <= 1e-9 * np.abs(one).max()


def test_the_last_face_saves_factorisations():
    A, q = CASES["P-matrix"]
    matrix = Prepared(A)
    cold = sum(solve_lcp(A, one).iterations for one in moving(A, q))
    warm = sum(solve_lcp(matrix, one).iterations for one in moving(A, q))
    assert warm < cold / 2


def test_an_lcp_without_a_solution_is_proved_between_others():
    A = np.array([[1.0, -1.0], [-1.0, 1.0]])
    matrix = Prepared(A)
    for q, status in (
        ([-1.0, 2.0], Status.SOLVED),
        ([-1.0, -1.0], Status.UNSOLVABLE),
        ([-2.0, 2.5], Status.SOLVED),
    ):
        result = solve_lcp(matrix, np.array(q))
        assert result.status is status
        assert (result.ray is not None) == (status is Status.UNSOLVABLE)


def test_a_start_that_is_given_comes_first():
    A, q = CASES["dense"]
    matrix = Prepared(A)
    expected = solve_lcp(matrix, q)
    solve_lcp(matrix, -q)
    result = solve_lcp(matrix, q, z0=expected.z)
    assert result.iterations <= 1
    np.testing.assert_allclose(result.z, expected.z, atol=1e-12)


def test_bounds_may_change_between_solves():
    A, q = CASES["dense"]
    matrix = Prepared(A)
    for upper in (np.inf, 0.3, 1.0):
        expected = solve_lcp(A, q, upper=upper)
        result = solve_lcp(matrix, q, upper=upper)
        np.testing.assert_allclose(result.z, expected.z, atol=1e-10)


class Circle:
    def __init__(self, radius):
        self.radius, self.computed = radius, 0

    @kept
    def area(self):
        """The area."""
        self.computed += 1
        return 3.0 * self.radius**2


def test_a_value_is_computed_when_it_is_first_read_and_kept():
    circle = Circle(2.0)
    assert circle.computed == 0
    assert (circle.area, circle.area, circle.computed) == (12.0, 12.0, 1)
    assert Circle(1.0).area == 3.0


def test_a_value_may_be_given_instead():
    circle = Circle(2.0)
    circle.area = 5.0
    assert (circle.area, circle.computed) == (5.0, 0)


def test_the_class_has_the_property_with_its_docstring():
    assert isinstance(Circle.area, kept)
    assert Circle.area.__doc__ == "The area."
