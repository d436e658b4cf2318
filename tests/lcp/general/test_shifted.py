"""Factors of M + diag(x): beside NumPy's."""

import numpy as np
import pytest
from scipy import sparse

from namlcp.lcp.shifted import Shifted, transpositions


@pytest.mark.parametrize("layout", [np.asarray, sparse.csc_array])
@pytest.mark.parametrize("n", [1, 2, 7, 40])
def test_solutions_and_signs_of_determinants(n, layout):
    rng = np.random.default_rng(n)
    M = rng.standard_normal((n, n)) * (rng.random((n, n)) < 3.0 / n)
    np.fill_diagonal(M, M.diagonal() * (rng.random(n) < 0.5))
    system, signs = Shifted(layout(M)), set()
    for _ in range(6):
        x, b = rng.standard_normal(n), rng.standard_normal((n, 2))
        K = M + np.diag(x)
        factors = system.factors(x)
        np.testing.assert_allclose(factors.solve(b), np.linalg.solve(K, b), rtol=1e-8)
        np.testing.assert_allclose(
            factors.solve(b[:, 0]), np.linalg.solve(K, b[:, 0]), rtol=1e-8
        )
        assert factors.positive == (np.linalg.slogdet(K)[0] > 0.0)
        signs.add(factors.positive)
    assert n == 1 or len(signs) == 2


@pytest.mark.parametrize("layout", [np.asarray, sparse.csc_array])
def test_a_singular_matrix_has_no_factors(layout):
    system = Shifted(layout(np.array([[0.0, 1.0], [0.0, 1.0]])))
    assert system.factors(np.zeros(2)) is None
    assert system.factors(np.ones(2)) is not None


def test_the_parity_of_permutations():
    rng = np.random.default_rng(0)
    for n in (1, 2, 5, 9):
        order = rng.permutation(n).astype(np.int32)
        sign = np.linalg.det(np.eye(n)[order])
        assert (-1) ** transpositions(order) == pytest.approx(sign)
