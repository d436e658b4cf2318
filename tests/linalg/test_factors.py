"""The choice of factors, and the protocol that all of them keep."""

import numpy as np
import pytest
from problems_elimination import (
    factored,
    laplacian,
    natural,
    parts,
    quasi_definite,
    upper,
)
from scipy.sparse import csc_matrix

from namlcp.linalg import factors
from namlcp.linalg.factors import (
    Bordered,
    Diagonal,
    SparseFactors,
    factor_triangle,
    plan_factors,
)
from namlcp.linalg.minimum_degree import minimum_degree
from namlcp.linalg.multifrontal import Multifrontal


def factor(U):
    return factored(plan_factors(*parts(U)), U)


def sparse(U):
    return factored(SparseFactors(*parts(U), minimum_degree(*parts(U))), U)


def fronts(U):
    return factored(Multifrontal(*parts(U), minimum_degree(*parts(U))), U)


def bordered(U):
    return factored(Bordered(*parts(U), np.arange(0, U.shape[0], 3)), U)


def diagonal(U):
    return factored(Diagonal(), U)


KINDS = {"sparse": sparse, "fronts": fronts, "bordered": bordered}


@pytest.mark.parametrize("kind", KINDS)
def test_factors_solve_and_take_other_values(kind):
    K = quasi_definite(40, 25, 0.2, 1)
    f = KINDS[kind](upper(K))
    rhs = np.random.default_rng(0).standard_normal(65)
    x = f.solve(rhs)
    np.testing.assert_allclose(K @ x, rhs, atol=1e-10)
    other = K + np.diag(np.sign(np.diag(K)))
    f.refactor(upper(other).data)
    np.testing.assert_allclose(other @ f.solve(rhs), rhs, atol=1e-10)
    f.refactor(upper(K).data)
    np.testing.assert_array_equal(f.solve(rhs), x)


@pytest.mark.parametrize("bad", [0.0, np.nan, np.inf])
@pytest.mark.parametrize("kind", ["sparse", "diagonal"])
def test_a_pivot_that_vanishes_is_told(kind, bad):
    U = upper(np.diag([1.0, 5.0, 2.0]))
    make = diagonal if kind == "diagonal" else sparse
    f = make(U)
    data = np.array([1.0, bad, 2.0])
    with pytest.raises(ValueError, match="pivot"):
        f.refactor(data)
    f.refactor(np.array([1.0, -2.0, 4.0]))
    np.testing.assert_array_equal(f.solve(np.ones(3)), [1.0, -0.5, 0.25])
    U.data[1] = bad
    with pytest.raises(ValueError, match="pivot"):
        make(U)


def test_a_diagonal_part_beside_a_border_may_fail():
    K = np.diag([1.0, 2.0, 3.0, 9.0, 9.0])
    K[3:, :3] = K[:3, 3:] = 1.0
    U = csc_matrix(upper(K))
    f = factored(Bordered(*parts(U), np.array([3, 4])), U)
    assert isinstance(f.factors, Diagonal)
    np.testing.assert_allclose(K @ f.solve(np.ones(5)), 1.0)
    K[1, 1] = 0.0
    U = upper(np.abs(K) + np.eye(5))
    U.data[U.indptr[1:] - 1] = np.diag(K)
    with pytest.raises(ValueError, match="pivot"):
        f.refactor(U.data)


def test_the_kind_of_factors_is_chosen_by_counts(monkeypatch):
    U = upper(laplacian(90, 90))
    work = minimum_degree(*parts(U)).work
    assert work < factors.HEAVY
    assert isinstance(factor(U), SparseFactors)
    monkeypatch.setattr(factors, "HEAVY", 0.9 * work)
    monkeypatch.setattr(factors, "SOME", 0.9 * work)
    assert isinstance(factor(U), Multifrontal)
    monkeypatch.setattr(factors, "HEAVY", 1.1 * work)
    assert isinstance(factor(U), SparseFactors)


def test_a_dense_border_comes_before_fronts(monkeypatch):
    rng = np.random.default_rng(4)
    B = rng.standard_normal((400, 60))
    U = upper(np.block([[-np.eye(400), B], [B.T, np.eye(60)]]))
    monkeypatch.setattr(factors, "SOME", 1e4)
    assert isinstance(factor(U), Bordered)
    monkeypatch.setattr(factors, "SOME", 1e9)
    assert isinstance(factor(U), SparseFactors)


@pytest.mark.parametrize("worse", ["minimum_degree", "nested_dissection"])
def test_of_two_orders_the_one_with_less_work_is_taken(monkeypatch, worse):
    U = upper(laplacian(20, 20).toarray())
    orders = dict.fromkeys(("minimum_degree", "nested_dissection"), minimum_degree)
    orders[worse] = lambda *parts: natural(U)
    for name, find in orders.items():
        monkeypatch.setattr(factors, name, find)
    monkeypatch.setattr(factors, "DEEP", 0.0)
    monkeypatch.setattr(factors, "SOME", 0.0)
    found = factor(U)
    assert found.order.work == minimum_degree(*parts(U)).work < natural(U).work


def test_a_diagonal_entry_that_is_not_stored_is_told():
    K = quasi_definite(6, 4, 0.5, 2)
    np.testing.assert_allclose(K @ factor_triangle(upper(K)).solve(K[0]), K[0])
    for j in (0, 5, 9):
        U = upper(K - np.diag(np.diag(K) * (np.arange(10) == j)))
        U.eliminate_zeros()
        with pytest.raises(ValueError, match="pivot"):
            factor_triangle(U)
