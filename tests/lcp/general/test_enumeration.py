"""All complementary cones: every answer beside the definition on every face."""

import itertools

import numpy as np
import problems_lcp as problems
import pytest
from scipy.optimize import nnls

from namlcp import Prepared, Status, natural_residual
from namlcp.lcp.data import lcp_data
from namlcp.lcp.general.enumeration import (
    LARGEST_ENUMERATION,
    least_distances,
    solve_by_enumeration,
)
from namlcp.limits import Deadline, Limits

LIMITS = Limits(0.0, 1e-9)


def enumerated(A, q, lower=None, upper=None, limits=LIMITS):
    lcp = lcp_data(Prepared(np.array(A, dtype=float)), q, lower, upper)
    return solve_by_enumeration(lcp, None, limits)


def has_solution(A, q):
    """Solve the system of every face of a generic problem."""
    n = q.size
    for face in itertools.product([False, True], repeat=n):
        F = np.flatnonzero(face)
        z = np.zeros(n)
        z[F] = np.linalg.solve(A[np.ix_(F, F)], -q[F])
        w = A @ z + q
        w[F] = 0.0
        if (z >= 0.0).all() and (w >= 0.0).all():
            return True
    return False


@pytest.mark.parametrize("seed", range(40))
def test_generic(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 7))
    A, q = rng.standard_normal((n, n)), rng.standard_normal(n)
    outcome = enumerated(A, q)
    if has_solution(A, q):
        assert outcome.status is Status.SOLVED
        assert natural_residual(outcome.z, A @ outcome.z + q, 0 * q, q + np.inf) < 1e-8
    else:
        assert outcome.status is Status.UNSOLVABLE
        assert outcome.iterations == 2**n


@pytest.mark.parametrize("name", problems.TEXTBOOK)
def test_textbook(name):
    A, q, _ = problems.textbook(name)
    assert enumerated(A, q).status is Status.SOLVED


@pytest.mark.parametrize("name", problems.UNSOLVABLE)
def test_without_a_solution(name):
    A, q = (np.array(part, dtype=float) for part in problems.UNSOLVABLE[name])
    assert enumerated(A, q).status is Status.UNSOLVABLE


@pytest.mark.parametrize("seed", range(10))
def test_singular_faces_with_a_planted_solution(seed):
    """Friction's structure: [[W, I], [M, 0]] is singular on most faces."""
    rng = np.random.default_rng(seed)
    J = rng.standard_normal((2, 6))
    A = np.zeros((12, 12))
    A[:6, :6], A[:6, 6:], A[6:, :6] = J.T @ J, np.eye(6), -np.eye(6)
    z = rng.exponential(size=12) * (rng.random(12) < 0.5)
    q = rng.exponential(size=12) * (z == 0.0) - A @ z
    assert enumerated(A, q).status is Status.SOLVED


def test_nearly_solvable_is_left_open():
    """w_1 = -1e-13 is rounding or a contradiction: the tolerance decides."""
    A, q = [[1, 0], [0, 0]], [-1.0, -1e-13]
    assert enumerated(A, q).status is Status.SOLVED
    assert enumerated(A, q, limits=Limits(0.0, 1e-15)) is None
    assert enumerated([[1, 0], [0, 0]], [-1.0, -1e-3]).status is Status.UNSOLVABLE


def test_bounds():
    outcome = enumerated([[0, 1], [-1, 0]], [-1.0, 2.0], [-3.0, -np.inf], [4.0, np.inf])
    assert outcome is None  # A is singular where z is free
    outcome = enumerated([[1, 1], [-1, 2]], [-1.0, 2.0], [-3.0, -np.inf], [4.0, np.inf])
    np.testing.assert_allclose(outcome.z, [4.0 / 3.0, -1.0 / 3.0])
    outcome = enumerated([[-1.0]], [0.5], [0.0], [1.0])
    assert outcome.status is Status.SOLVED


def test_what_is_left_out():
    n = LARGEST_ENUMERATION + 1
    assert enumerated(np.eye(n), np.ones(n)) is None
    assert enumerated(np.eye(0), np.ones(0)) is None
    late = LIMITS._replace(deadline=Deadline(0.0))
    assert enumerated([[0, 1], [1, 0]], [0.0, 0.0], limits=late) is None


def test_distances_are_bounds():
    rng = np.random.default_rng(1)
    cones, q = rng.standard_normal((50, 3, 3)), rng.standard_normal(3)
    bounds = least_distances(cones, q)
    for cone, bound in zip(cones, bounds, strict=True):
        assert nnls(cone, q)[1] >= bound - 1e-12
