"""Sparse L D L' of one pattern against dense matrices."""

import numpy as np
import pytest
from problems_elimination import laplacian, natural, parts, quasi_definite, upper

from namlcp.linalg.minimum_degree import minimum_degree
from namlcp.linalg.sparse_ldl import analyse, factor_sparse, solve_sparse
from namlcp.linalg.sparse_ldl.pattern import first_dense


def bordered(pairs, border, density):
    """Return K with 2 by 2 blocks or larger ones, coupled by the last rows alone."""
    rng = np.random.default_rng(5)
    inner = np.kron(np.eye(pairs), np.array([[4.0, 1.0], [1.0, 3.0]]))
    B = rng.standard_normal((border, 2 * pairs))
    B *= rng.random(B.shape) < density
    return np.block([[inner, B.T], [B, -3.0 * np.eye(border)]])


CASES = {
    "one": np.array([[-2.0]]),
    "diagonal": np.diag([1.0, -2.0, 3.0]),
    "full": quasi_definite(23, 16, 1.0, 1),
    "sparse": quasi_definite(60, 40, 0.06, 2),
    "denser": quasi_definite(40, 30, 0.3, 3),
    "apart": np.kron(np.eye(3), quasi_definite(7, 6, 0.4, 4)),
    "blocks of three": np.kron(np.eye(4), np.full((3, 3), 0.3)) + np.eye(12),
    "path": laplacian(1, 40).toarray(),
    "grid": laplacian(17, 13).toarray(),
    "no zeros": np.ones((20, 20)) + 5.0 * np.eye(20),
    "data rows": bordered(260, 24, 0.2),
    "full data rows": bordered(200, 17, 1.0),
}


@pytest.fixture(params=CASES)
def K(request):
    return CASES[request.param]


class LDL:
    """The functions under test with the arrays they work on."""

    def __init__(self, K, find=minimum_degree):
        U = upper(K)
        order = find(U) if find is natural else find(*parts(U))
        self.pattern = analyse(*parts(U), order)
        self.values = np.full(self.pattern.below.size, np.nan)
        self.inverse, self.y = np.full((2, K.shape[0]), np.nan)

    def factor(self, K):
        data = upper(K).data
        return factor_sparse(self.pattern, data, self.values, self.inverse, self.y)

    def solve(self, rhs):
        x = np.full(rhs.size, np.nan)
        solve_sparse(self.pattern, self.values, self.inverse, rhs, x, self.y)
        return x

    def dense(self):
        """Return L and D as dense matrices."""
        L = np.eye(self.inverse.size)
        starts = self.pattern.starts
        for j in range(L.shape[0]):
            here = slice(starts[j], starts[j + 1])
            L[self.pattern.below[here], j] = self.values[here]
        return L, np.diag(1.0 / self.inverse)


def dense_ldl(K):
    """Return L and the diagonal of D by elimination of one column after the other."""
    S, L = K.copy(), np.eye(K.shape[0])
    for j in range(K.shape[0]):
        L[j:, j] = S[j:, j] / S[j, j]
        S[j + 1 :, j + 1 :] -= np.outer(L[j + 1 :, j], S[j, j + 1 :])
    return L, np.diag(S).copy()


@pytest.mark.parametrize("find", [natural, minimum_degree])
def test_factors_are_those_of_the_elimination(K, find):
    f = LDL(K, find)
    assert f.factor(K)
    by_place = np.argsort(f.pattern.place)
    L, D = dense_ldl(K[np.ix_(by_place, by_place)])
    found_L, found_D = f.dense()
    scale = max(1.0, abs(L).max())
    np.testing.assert_allclose(found_L, L, rtol=0, atol=1e-12 * scale)
    np.testing.assert_allclose(np.diag(found_D), D, rtol=1e-9)


def test_rows_rise_and_chunks_are_alike(K):
    pattern = LDL(K).pattern
    i = 0
    while i < K.shape[0]:
        width = pattern.width[i]
        assert width in (1, 2, 4)
        assert pattern.width[i + width - 1] == width
        last = slice(*pattern.starts[i + width - 1 : i + width + 1])
        for j in range(i, i + width):
            rows = pattern.below[pattern.starts[j] : pattern.starts[j + 1]]
            expected = [*range(j + 1, i + width), *pattern.below[last]]
            np.testing.assert_array_equal(rows, expected)
            assert (np.diff(rows) > 0).all()
        i += width
    for k in range(K.shape[0]):
        line = pattern.chunks[pattern.lines[k] : pattern.lines[k + 1]]
        assert (np.diff(line) > 0).all()
        columns = {j for i in line for j in range(i, min(k, i + pattern.width[i]))}
        starts, below = pattern.starts, pattern.below
        assert columns == {j for j in range(k) if k in below[starts[j] : starts[j + 1]]}


@pytest.mark.parametrize("case", ["data rows", "full data rows"])
def test_the_dense_block_is_where_no_entry_of_L_vanishes(case):
    f = LDL(CASES[case])
    assert f.factor(CASES[case])
    L, pattern = f.dense()[0] != 0.0, f.pattern
    n = L.shape[0]
    first = getattr(first_dense, "py_func", first_dense)(n, pattern.starts)
    assert 0 < first <= n - 16
    assert L[first:, first:].sum() == (n - first) * (n - first + 1) / 2
    assert not L[first - 1 :, first - 1].all()
    begin = 0
    while begin < n:
        last = begin + pattern.width[begin] - 1
        end = first if begin < first and pattern.width[begin] < 4 else n
        assert pattern.reach[begin] == L[last + 1 : end, last].sum()
        begin = last + 1


@pytest.mark.parametrize("case", ["diagonal", "no zeros", "grid"])
def test_no_dense_block_is_small_or_most_of_L(case):
    pattern = LDL(CASES[case]).pattern
    n = pattern.place.size
    assert getattr(first_dense, "py_func", first_dense)(n, pattern.starts) == n


def test_solve_and_factor_again(K):
    f = LDL(K)
    assert f.factor(K)
    rhs = np.random.default_rng(0).standard_normal(K.shape[0])
    x = f.solve(rhs)
    np.testing.assert_allclose(K @ x, rhs, atol=1e-9)
    other = K + np.diag(np.sign(np.diag(K)))
    assert f.factor(other)
    np.testing.assert_allclose(other @ f.solve(rhs), rhs, atol=1e-9)
    assert f.factor(K)
    np.testing.assert_array_equal(f.solve(rhs), x)


def test_the_solution_may_overwrite_the_right_hand_side():
    K = CASES["sparse"]
    f = LDL(K)
    assert f.factor(K)
    rhs = np.arange(K.shape[0]) * 1.0
    expected = f.solve(rhs)
    solve_sparse(f.pattern, f.values, f.inverse, rhs, rhs, f.y)
    np.testing.assert_array_equal(rhs, expected)


def test_pivots_have_the_signs_of_the_blocks():
    K = CASES["denser"]
    f = LDL(K)
    assert f.factor(K)
    assert (f.inverse < 0.0).sum() == (np.diag(K) < 0.0).sum() == 30


@pytest.mark.parametrize("bad", [0.0, np.nan, np.inf, 1e-310])
def test_a_pivot_without_reciprocal_is_told(bad):
    K = np.diag([1.0, 5.0, 2.0])
    f = LDL(K)
    K[1, 1] = bad
    U = upper(np.eye(3))
    U.data[:] = np.diag(K)
    assert not factor_sparse(f.pattern, U.data, f.values, f.inverse, f.y)
    assert f.factor(np.eye(3))
    np.testing.assert_array_equal(f.solve(np.ones(3)), np.ones(3))


@pytest.mark.parametrize("size", [5, 25])
def test_a_singular_matrix_is_told(size):
    K = np.ones((size, size))
    f = LDL(K)
    assert not f.factor(K)


def test_of_order_zero():
    f = LDL(np.empty((0, 0)))
    assert f.factor(np.empty((0, 0)))
    assert f.solve(np.empty(0)).size == 0
