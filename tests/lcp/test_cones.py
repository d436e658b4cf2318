"""Factors with friction cones eliminated, beside dense algebra."""

import numpy as np
import pytest
from scipy import sparse

from namlcp.lcp.general.cones import system_of
from validation.problems.general.families import FAMILIES


def friction(family, n=120, seed=0):
    """Return A of a scene, scaled to a unit diagonal where that is positive."""
    A = sparse.csc_array(FAMILIES[family](n, seed)[0])
    slopes = A.diagonal()
    d = sparse.diags_array(1.0 / np.sqrt(np.where(slopes > 0.0, slopes, 1.0)))
    return sparse.csc_array(d @ A @ d)


@pytest.mark.parametrize("family", ["pile", "wall", "chain", "balls", "cubes"])
@pytest.mark.parametrize("digits", [0, 3, 6])
def test_solutions_with_cones_are_those_of_dense_algebra(family, digits):
    M, rng = friction(family, 60), np.random.default_rng(digits)
    n = M.shape[0]
    system = system_of(M)
    for _ in range(3):  # the first factors choose an order, later ones keep it
        D = 10.0 ** rng.uniform(-digits, digits, n)
        K = M.toarray() + np.diag(D)
        r = rng.standard_normal((n, 2))
        factors = system.factors(D)
        x = np.linalg.solve(K, r)
        close = 1e-15 * np.linalg.cond(K) * np.abs(x).max()
        assert np.allclose(factors.solve(r), x, rtol=0.0, atol=close)
        assert np.array_equal(factors.solve(r[:, 0]), factors.solve(r)[:, 0])


@pytest.mark.parametrize("value", [0.0, np.inf, np.nan, 1e-320])
@pytest.mark.parametrize("family", ["pile", "balls"])
def test_a_path_that_has_diverged_has_no_factors(family, value):
    M = friction(family)
    D = np.ones(M.shape[0])
    D[[-1, M.shape[0] // 2]] = value
    assert system_of(M).factors(D) is None


def changed(A, *entries):
    A = sparse.lil_array(A)
    for i, j, value in entries:
        A[i, j] = value
    return sparse.csc_array(A)


def test_matrices_that_are_nearly_friction_are_solved_too():
    """Whatever is recognised or not, K x = r."""
    A = sparse.csc_array(FAMILIES["pile"](120, 0)[0])
    k, rng = A.shape[0] // 4, np.random.default_rng(0)
    inertia = sparse.diags_array(np.repeat([1.0, 0.0, 1.0], [k, 2 * k, k]))
    for M in (
        sparse.eye_array(5, format="csc"),  # no speeds
        sparse.csc_array(np.array([[1.0, 1.0], [-1.0, 0.0]])),  # one direction
        changed(A, (k, 0, A[k, 0] + 0.1)),  # a direction turned
        changed(A, (3 * k, 1, 0.5)),  # speed and another impulse
        changed(A, (k + 1, 3 * k, 1.0)),  # a third direction
        changed(A, (3 * k, k, -0.5)),  # a weight lost
        changed(A, (k, 3 * k, -1.0), (3 * k, k, 1.0)),  # directions pull
        sparse.csc_array(inertia @ A @ inertia),  # directions without inertia
    ):
        D, r = rng.uniform(0.5, 2.0, M.shape[0]), rng.standard_normal(M.shape[0])
        K = M.toarray() + np.diag(D)
        x = system_of(M).factors(D).solve(r)
        np.testing.assert_allclose(K @ x, r, atol=1e-9)


@pytest.mark.parametrize("family", ["balls", "cubes"])
@pytest.mark.parametrize("seed", range(6))
def test_small_and_large_entries_of_the_diagonal_lose_no_digits(family, seed):
    # sticking and sliding directions of one contact: d_j from 1e-10 to 1e10
    M, rng = friction(family, 300), np.random.default_rng(seed)
    D = 10.0 ** rng.choice([-10.0, 10.0], M.shape[0])
    K = M + sparse.diags_array(D)
    r = np.sqrt(D) * rng.standard_normal(D.size)
    x = system_of(M).factors(D).solve(r)
    assert np.abs(K @ x - r).max() <= 1e-14 * (abs(K) @ np.abs(x)).max()
