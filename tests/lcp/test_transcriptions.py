"""Factors of friction problems beside dense algebra."""

import numpy as np
import pytest
from scipy import sparse

from namlcp.lcp.shifted import system_of
from validation.problems.general.families import FAMILIES


@pytest.fixture
def rng():
    return np.random.default_rng(20261121)


# ---- factors with friction


def friction(family, n=120, seed=0):
    """Return A of a scene, scaled to a unit diagonal where that is positive."""
    A = sparse.csc_array(FAMILIES[family](n, seed)[0])
    slopes = A.diagonal()
    d = sparse.diags_array(1.0 / np.sqrt(np.where(slopes > 0.0, slopes, 1.0)))
    return sparse.csc_array(d @ A @ d)


@pytest.mark.parametrize("family", ["pile", "wall", "chain", "balls", "cubes"])
@pytest.mark.parametrize("digits", [0, 3, 6])
def test_solutions_with_friction_are_those_of_dense_algebra(family, digits):
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
