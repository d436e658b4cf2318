"""L U by dense fronts, beside plain elimination without row exchanges."""

import numpy as np
import pytest
from scipy import sparse

from namlcp.lcp.general.cones.fronts import Fronts


def plain_factors(K):
    """Return L and U of a dense K by Gaussian elimination without row exchanges."""
    L, U = np.eye(len(K)), K.copy()
    for j in range(len(K)):
        L[j + 1 :, j] = U[j + 1 :, j] / U[j, j]
        U[j + 1 :] -= np.outer(L[j + 1 :, j], U[j])
    return L, np.triu(U)


def dense_factors(lu):
    """Return L and U of panels as dense matrices, in the order of elimination."""
    nodes, n = lu.nodes, lu.place.size
    L, U = np.eye(n), np.zeros((n, n))
    for s in range(nodes.parent.size):
        begin, end = nodes.first[s], nodes.first[s + 1]
        rows = nodes.rows[nodes.starts[s] : nodes.starts[s + 1]]
        block = slice(nodes.panels[s], nodes.panels[s + 1])
        lower = lu.L[block].reshape(rows.size, end - begin)
        upper = lu.U[block].reshape(rows.size, end - begin)
        for k in range(end - begin):
            L[rows[k + 1 :], begin + k] = lower[k + 1 :, k]
            U[begin + k, rows[k:]] = upper[k:, k]
    return L, U


def grid(rows, columns):
    """Return the pattern of a grid whose neighbours, diagonal ones too, are joined."""
    line, other = (
        np.abs(np.subtract.outer(np.arange(k), np.arange(k))) <= 1
        for k in (rows, columns)
    )
    return np.kron(line, other)


def arrow(n):
    """Return the pattern of an arrow that points to the first unknown."""
    pattern = np.eye(n, dtype=bool)
    pattern[0] = pattern[:, 0] = True
    return pattern


def scattered(n, seed):
    """Return a random symmetric pattern with its diagonal."""
    some = np.random.default_rng(seed).random((n, n)) < 3.0 / n
    return some | some.T | np.eye(n, dtype=bool)


PATTERNS = {
    "one": np.ones((1, 1), dtype=bool),
    "diagonal": np.eye(4, dtype=bool),
    "dense": np.ones((90, 90), dtype=bool),
    "grid": grid(15, 12),
    "two parts": np.kron(np.eye(2, dtype=bool), grid(4, 5)),
    "arrow": arrow(40),
    "scattered": scattered(80, 1),
}


def matrix(pattern, seed):
    """Return K of a pattern, with a diagonal of both signs that leads."""
    rng, n = np.random.default_rng(seed), len(pattern)
    K = rng.uniform(-1.0, 1.0, (n, n)) * pattern
    signs = rng.choice([-1.0, 1.0], n)
    np.fill_diagonal(K, signs * (1.0 + np.abs(K).sum(axis=1)))
    return K


def values(K, pattern):
    """Return the CSC pattern and the entries of K in it."""
    P = sparse.csc_array(pattern)
    columns = np.repeat(np.arange(len(K)), np.diff(P.indptr))
    return P.indptr, P.indices, K[P.indices, columns]


@pytest.mark.parametrize("name", PATTERNS)
def test_factors_are_those_of_plain_elimination(name):
    pattern = PATTERNS[name]
    fronts = Fronts(*values(matrix(pattern, 0), pattern)[:2])
    for seed in range(3):  # the layout serves all matrices of the pattern
        K = matrix(pattern, seed)
        lu = fronts.factors(values(K, pattern)[2])
        order = np.argsort(lu.place)
        L, U = plain_factors(K[np.ix_(order, order)])
        mine, own = dense_factors(lu)
        assert np.allclose(mine, L, rtol=0.0, atol=1e-13)
        assert np.allclose(own, U, rtol=1e-12, atol=1e-12)
        assert lu.negative == np.count_nonzero(U.diagonal() < 0.0)
        b = np.random.default_rng(seed).standard_normal(len(K))
        assert np.allclose(lu.solve(b), np.linalg.solve(K, b), rtol=0.0, atol=1e-13)


def test_factors_stay_what_they_were_when_others_are_made():
    pattern = PATTERNS["grid"]
    K, other = (matrix(pattern, seed) for seed in (0, 1))
    fronts, b = Fronts(*values(K, pattern)[:2]), np.ones(len(K))
    lu = fronts.factors(values(K, pattern)[2])
    x = lu.solve(b)
    fronts.factors(values(other, pattern)[2])
    assert np.array_equal(lu.solve(b), x)


@pytest.mark.parametrize("value", [0.0, np.nan])
@pytest.mark.parametrize("name", ["one", "diagonal", "grid"])
def test_a_pivot_that_vanishes_is_told(name, value):
    pattern = PATTERNS[name]
    K = matrix(pattern, 0)
    K[-1] = K[:, -1] = 0.0
    K[-1, -1] = value
    indptr, indices, data = values(K, pattern)
    assert Fronts(indptr, indices).factors(data) is None
