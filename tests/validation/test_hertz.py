"""Hertz contact by the FFT, without a matrix, against Hertz' own formulas."""

import numpy as np
import pytest

from namlcp import solve_lcp
from namlcp.status import Status
from validation.problems import hertz


def test_toeplitz_operator_is_the_dense_matrix():
    problem = hertz.hertz(5)
    K = problem.A @ np.eye(25)
    np.testing.assert_allclose(K, K.T, atol=1e-15)
    np.testing.assert_allclose(K.diagonal(), problem.diagonal)
    h = problem.side
    x = np.arange(5) * h
    far = h * h / (np.pi * np.hypot(4 * h, 3 * h))  # a point force, far away
    assert K[0, 5 * 4 + 3] == pytest.approx(far, rel=5e-3)
    assert K[0, 0] == pytest.approx(4 * h * np.log(1 + np.sqrt(2)) / np.pi)
    assert hertz.love(x, h)[4, 3] == pytest.approx(K[0, 23], rel=1e-12)


def test_hertz():
    problem = hertz.hertz(64)
    found = solve_lcp(problem.A, problem.q, diagonal=problem.diagonal)
    assert found.status is Status.SOLVED
    assert found.iterations < 60
    errors = hertz.measured(problem, found.z)
    assert abs(errors["radius_error"]) < 5e-3
    assert abs(errors["force_error"]) < 5e-4
    assert abs(errors["pressure_error"]) < 1e-3
    assert problem.radius**3 == pytest.approx(0.75 * problem.force)


def test_hertz_agrees_with_pivoting():
    problem = hertz.hertz(16)
    found = solve_lcp(problem.A, problem.q, diagonal=problem.diagonal, eps_rel=1e-12)
    exact = solve_lcp(problem.A @ np.eye(256), problem.q)
    np.testing.assert_allclose(found.z, exact.z, atol=1e-10 * exact.z.max())
    np.testing.assert_array_equal(found.z > 0.0, exact.z > 0.0)
