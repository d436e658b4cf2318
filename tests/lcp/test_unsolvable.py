"""LCPs with singular matrices, without a solution, or outside every class."""

import numpy as np
import problems_lcp as problems
import pytest
from lcp_definition import assert_solves_lcp

from namlcp import Status, solve_lcp
from namlcp.lcp.pivoting.rays import proof


@pytest.fixture
def rng():
    return np.random.default_rng(20261121)


@pytest.mark.parametrize("n", [2, 20, 100])
def test_singular(rng, n):
    B = rng.standard_normal((n // 2, n))
    A = B.T @ B
    A = (A + A.T) / 2
    for q in (
        -B.T @ rng.standard_normal(n // 2),
        problems.with_solution(rng, A)[0],
        problems.with_solution(rng, A, degenerate=0.5)[0],
    ):
        assert_solves_lcp(solve_lcp(A, q), A, q)


def test_zero_matrix():
    result = solve_lcp(np.zeros((2, 2)), [1.0, 0.0])
    np.testing.assert_array_equal(result.z, [0.0, 0.0])
    assert result.status is Status.SOLVED


def assert_proves_unsolvable(ray, A, q):
    """v >= 0, A v = 0, q'v = -1: no z has w >= 0 with z'w = 0, for v'w = q'v < 0."""
    assert ray is not None
    assert np.all(ray >= 0)
    assert q @ ray == pytest.approx(-1)
    size = np.sqrt(A.diagonal())
    assert np.max(np.abs(A @ ray)) <= 1e-8 * max(1e-300, np.max(size * ray)) * np.max(
        size
    )


@pytest.mark.parametrize("name", problems.UNSOLVABLE)
def test_unsolvable(name):
    A, q = (np.array(part, dtype=float) for part in problems.UNSOLVABLE[name])
    result = solve_lcp(A, q)
    assert result.status is Status.UNSOLVABLE
    assert_proves_unsolvable(result.ray, A, q)


@pytest.mark.parametrize("n", [3, 30, 150])
def test_unsolvable_generated(rng, n):
    A, q = problems.unsolvable(rng, n)
    result = solve_lcp(A, q)
    assert result.status is Status.UNSOLVABLE
    assert_proves_unsolvable(result.ray, A, q)


@pytest.mark.parametrize("n", [2, 5, 20, 60])
def test_other_matrices_get_an_honest_answer(rng, n):
    B = rng.standard_normal((n, n))
    for A in (B, B + B.T, -np.eye(n)):
        q = rng.standard_normal(n) - 1.0
        result = solve_lcp(A, q)
        if result.status is Status.SOLVED:
            assert_solves_lcp(result, A, q)
        else:
            assert result.status in (
                Status.UNSOLVABLE, Status.STALLED, Status.MAX_ITER,
            )  # fmt: skip


@pytest.mark.parametrize(
    ("v", "q", "proved"),
    [(1.0, -1e10, True), (1e300, -1e10, True), (np.inf, -1e10, False)],
)
def test_overflow_proves_nothing(v, q, proved):
    lcp = problems.box_lcp(-np.eye(1), np.array([q]), np.zeros(1), np.array([np.inf]))
    ray = proof(lcp, np.ones(1), np.array([v]))
    assert (ray is not None) == proved
    assert ray is None or q * ray[0] == pytest.approx(-1.0)


@pytest.mark.parametrize("size", [1e-120, 1.0, 1e120])
def test_ray_in_any_unit(size):
    q = np.array([-1.0, 2.0]) * size
    ray = solve_lcp(np.zeros((2, 2)), q).ray
    np.testing.assert_allclose(q @ ray, -1.0, rtol=1e-12)


@pytest.mark.parametrize("low", [1e-3, 1e-6, 1e-9, 1e-11])
def test_solution_far_along_a_nearly_singular_direction(low):
    """z = (2 + low, 2) / low, a P-matrix whose condition is 4 / low."""
    A, q = np.array([[1.0, -1.0], [-1.0, 1.0 + low]]), np.array([-1.0, -1.0])
    result = solve_lcp(A, q)
    assert result.status is Status.SOLVED
    np.testing.assert_allclose(result.z, [(2 + low) / low, 2 / low], rtol=1e-4)


@pytest.mark.parametrize("skewness", [0.0, 1.0])
def test_a_narrow_box_does_not_make_any_point_a_solution(skewness):
    """Its width is rounding beside w, so that every z is near a bound."""
    rng = np.random.default_rng(0)
    B, K = rng.standard_normal((2, 6, 6))
    A = 1e18 * (B.T @ B + skewness * (K - K.T))
    q = [1.0, -2.0, 3.0, -1.0, 2.0, -3.0]
    result = solve_lcp(A, q, -1e-18, 1e-18, eps_abs=1e-40)
    assert result.status is not Status.SOLVED or result.residual < 1e-40


@pytest.mark.parametrize("fall", [1.0, 1e-3, 1e-6])
def test_a_proof_beyond_the_range_is_not_returned(fall):
    A = [[0.0, 3.0 * fall, 0.0], [-3.0 * fall, 0.0, 0.0], [0.0, 0.0, 1.0]]
    unit = 1e-305
    lower, upper = [2.0 * unit, 0.0, 0.0], [2.0 * unit, np.inf, np.inf]
    result = solve_lcp(A, np.array([1.0, 0.0, 1.0]) * unit, lower, upper)
    assert result.status is Status.UNSOLVABLE
    assert result.ray is None or np.isfinite(result.ray).all()
